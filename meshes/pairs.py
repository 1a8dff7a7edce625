"""Two bodies, or three, that touch each other: each a region of its own, with its own nodes."""

import math

from contact.errors import InputError
from meshes.grading import Sizes, check_cells, finish
from meshes.pieces import half, half_ball, polygon, quarter


def two_blocks(
    *,
    lower_width: float = 4.0,
    lower_height: float = 1.0,
    upper_width: float = 2.0,
    upper_height: float = 1.0,
    lower_size: float = 0.2,
    upper_size: float = 0.25,
) -> None:
    """Block on the middle of another one, whose top is y = 0.

    Regions: ``upper``, ``lower``. Parts: ``upper_bottom`` on ``lower_top``; ``upper_top``,
    ``upper_left``, ``upper_right``, ``lower_bottom``, ``lower_left``, ``lower_right``.
    """
    import gmsh

    bodies: dict[str, list[int]] = {}
    parts: dict[str, list[int]] = {}
    for name, width, low, high, size in (
        ("lower", lower_width, -lower_height, 0.0, lower_size),
        ("upper", upper_width, 0.0, upper_height, upper_size),
    ):
        check_cells(math.log10(width / size) + math.log10((high - low) / size), 2)
        half = width / 2
        corners = [(-half, low), (half, low), (half, high), (-half, high)]
        bodies[name], sides = polygon(gmsh.model.geo, corners, size)
        places = ("bottom", "right", "top", "left")
        parts |= {f"{name}_{p}": [s] for p, s in zip(places, sides, strict=True)}
    gmsh.model.geo.synchronize()
    finish(gmsh, 2, bodies, parts)


def two_boxes(
    *,
    lower_width: float = 2.0,
    lower_height: float = 1.0,
    upper_width: float = 1.0,
    upper_height: float = 1.0,
    lower_size: float = 0.35,
    upper_size: float = 0.25,
) -> None:
    """Box on the middle of another one, in 3-D, both with square bases; z = 0 is between them.

    Regions: ``upper``, ``lower``. Parts: ``upper_bottom`` on ``lower_top``; of both, as
    ``upper_top``, ``lower_bottom``, the other sides: ``left``, ``right`` (x), ``front``, ``back``
    (y), ``bottom``, ``top``.
    """
    import gmsh

    model, bodies = gmsh.model, {}
    parts: dict[str, list[int]] = {}
    for name, width, low, height, size in (
        ("lower", lower_width, -lower_height, lower_height, lower_size),
        ("upper", upper_width, 0.0, upper_height, upper_size),
    ):
        check_cells(2 * math.log10(width / size) + math.log10(height / size), 3)
        body = model.occ.addBox(-width / 2, -width / 2, low, width, width, height)
        model.occ.synchronize()
        model.mesh.setSize(model.getBoundary([(3, body)], recursive=True), size)
        bodies[name] = [body]
        sides = ("left", "right", "front", "back", "bottom", "top")
        faces = model.getBoundary([(3, body)], oriented=False)
        parts |= {f"{name}_{side}": [face] for side, (_, face) in zip(sides, faces, strict=True)}
    finish(gmsh, 3, bodies, parts)


def cylinder_on_block(
    *,
    radius: float = 50.0,
    width: float = 100.0,
    height: float = 200.0,
    size: float = 10.0,
    contact_size: float = 0.6,
    contact_width: float = 8.0,
    growth: float = 0.2,
) -> None:
    """Right half of the lower half of a cylinder on the right half of a block, whose top is y = 0.

    Regions: ``cylinder``, ``block``. Parts: ``arc`` on ``block_top``; ``symmetry`` (x = 0 of
    both), ``top`` (the cut y = radius), ``block_bottom``, ``block_right``. Sizes as in
    `quarter_disc`; in the plane, or about the axis x = 0 a ball on a disc.
    """
    import gmsh

    geo = gmsh.model.geo
    cylinder = quarter(geo, radius, radius)
    corners = [(0.0, -height), (width, -height), (width, 0.0), (0.0, 0.0)]
    block, (bottom, right, upper, left) = polygon(geo, corners)
    parts = {
        "arc": cylinder.round,
        "block_top": [upper],
        "symmetry": [*cylinder.sides, left],
        "top": cylinder.cut,
        "block_bottom": [bottom],
        "block_right": [right],
    }
    finish(
        gmsh,
        2,
        {"cylinder": cylinder.body, "block": block},
        parts,
        Sizes(size, contact_size, contact_width, growth),
        points=[cylinder.low],
    )


def two_half_cylinders(
    *,
    radius: float = 10.0,
    size: float = 1.5,
    contact_size: float = 0.05,
    contact_width: float = 0.8,
    growth: float = 0.2,
) -> None:
    """Lower half of one cylinder on the upper half of another; they touch at the origin.

    Regions: ``upper``, ``lower``. Parts: ``upper_arc`` on ``lower_arc``; the cuts ``upper_cut``
    (y = radius) and ``lower_cut`` (y = -radius). Sizes as in `quarter_disc`.
    """
    import gmsh

    geo, bodies, touching = gmsh.model.geo, {}, []
    parts: dict[str, list[int]] = {}
    for name, y in (("upper", radius), ("lower", -radius)):
        cap = half(geo, radius, y)
        bodies[name] = cap.body
        parts |= {f"{name}_arc": cap.round, f"{name}_cut": cap.cut}
        touching.append(cap.low)
    finish(
        gmsh, 2, bodies, parts, Sizes(size, contact_size, contact_width, growth), points=touching
    )


def two_balls(
    *,
    radius: float = 50.0,
    size: float = 6.0,
    contact_size: float = 1.0,
    contact_width: float = 13.0,
    growth: float = 0.2,
) -> None:
    """Right half of the lower half of a ball on that of the upper half of another one.

    They touch at the origin. Regions: ``upper``, ``lower``. Parts: ``upper_arc`` on
    ``lower_arc``; the cuts ``upper_cut`` (y = radius) and ``lower_cut`` (y = -radius);
    ``symmetry`` (x = 0 of both). About the axis x = 0 these are balls, in the plane cylinders.
    Sizes as in `quarter_disc`.
    """
    import gmsh

    geo, bodies, touching = gmsh.model.geo, {}, []
    parts: dict[str, list[int]] = {"symmetry": []}
    for name, y in (("upper", radius), ("lower", -radius)):
        cap = quarter(geo, radius, y)
        bodies[name] = cap.body
        parts |= {f"{name}_arc": cap.round, f"{name}_cut": cap.cut}
        parts["symmetry"] += cap.sides
        touching.append(cap.low)
    finish(
        gmsh, 2, bodies, parts, Sizes(size, contact_size, contact_width, growth), points=touching
    )


def two_spheres(
    *,
    radius: float = 50.0,
    size: float = 12.0,
    contact_size: float = 2.0,
    contact_width: float = 12.0,
    growth: float = 0.4,
    quarters: float = 1,
) -> None:
    """One quarter, x, y >= 0, of the lower half of a ball on that of the upper half of another.

    They touch at the origin. Regions: ``upper``, ``lower``. Parts: ``upper_round`` on
    ``lower_round``; the cuts ``upper_cut`` (z = radius) and ``lower_cut`` (z = -radius);
    ``symmetry_x`` (x = 0), ``symmetry_y`` (y = 0) of both. Sizes as in `quarter_disc`. Of two
    quarters, the half y >= 0, there is no ``symmetry_x``.
    """
    import gmsh

    if quarters not in (1, 2):
        raise InputError(
            f"quarters of the mesh generator must be 1 or 2; given: {quarters:g}", "generator"
        )
    bodies: dict[str, list[int]] = {}
    parts: dict[str, list[int]] = {}
    touching = []
    for name, z in (("upper", radius), ("lower", -radius)):
        cap = half_ball(gmsh.model.geo, radius, z, int(quarters))
        bodies[name] = cap.body
        parts |= {f"{name}_round": cap.round, f"{name}_cut": cap.cut}
        first, *_, last = cap.sides
        parts.setdefault("symmetry_y", []).append(first)
        parts.setdefault("symmetry_x" if quarters == 1 else "symmetry_y", []).append(last)
        touching.append(cap.low)
    finish(
        gmsh, 3, bodies, parts, Sizes(size, contact_size, contact_width, growth), points=touching
    )


def ball_between_plates(
    *,
    radius: float = 1.0,
    width: float = 1.5,
    height: float = 0.5,
    size: float = 0.15,
    contact_size: float = 0.02,
    contact_width: float = 0.25,
    growth: float = 0.3,
) -> None:
    """Right half of a ball with the centre (0, radius) between the right halves of two plates.

    Regions: ``ball``, ``upper``, ``lower``. Parts: ``ball_bottom`` on ``lower_top``, and
    ``ball_top`` below ``upper_bottom``; ``upper_top``, ``lower_bottom``, ``symmetry`` (x = 0 of
    all). About the axis x = 0 it is a ball, in the plane a cylinder. Sizes as in `quarter_disc`.
    """
    import gmsh

    geo = gmsh.model.geo
    low, side, high, centre = (
        geo.addPoint(*p, 0) for p in ((0, 0), (radius, radius), (0, 2 * radius), (0, radius))
    )
    arcs = [geo.addCircleArc(low, centre, side), geo.addCircleArc(side, centre, high)]
    axis = [geo.addLine(high, centre), geo.addLine(centre, low)]
    ball = geo.addPlaneSurface([geo.addCurveLoop([*arcs, *axis])])
    bodies, parts = {"ball": [ball]}, {"ball_bottom": arcs[:1], "ball_top": arcs[1:]}
    for name, y in (("lower", -height), ("upper", 2 * radius)):
        corners = [(0.0, y), (width, y), (width, y + height), (0.0, y + height)]
        bodies[name], (bottom, _, top, left) = polygon(geo, corners)
        parts |= {f"{name}_bottom": [bottom], f"{name}_top": [top]}
        axis.append(left)
    finish(
        gmsh,
        2,
        bodies,
        {**parts, "symmetry": axis},
        Sizes(size, contact_size, contact_width, growth),
        points=[low, high],
    )


def bimorph_on_stop(
    *,
    length: float = 6.0,
    thickness: float = 1.0,
    gap: float = 0.003,
    stop_width: float = 0.2,
    stop_height: float = 0.3,
    size: float = 0.25,
    contact_size: float = 0.02,
) -> None:
    """Beam of two layers from x = 0 on, y = 0 its lower side, over a stop below its tip.

    Regions: ``upper``, ``lower`` (the layers, each half of ``thickness``), ``stop``. Parts:
    ``clamped`` (x = 0), ``upper_top``, ``lower_bottom`` (the electrodes), ``tip``; ``stop_top``
    lies ``gap`` below, its middle 1.5 ``stop_width`` from the tip; ``stop_bottom``. The elements
    have ``contact_size`` at the stop's top, ``size`` far away.
    """
    import gmsh

    geo = gmsh.model.geo
    heights = (0.0, thickness / 2, thickness)
    left, right = ([geo.addPoint(x, y, 0) for y in heights] for x in (0.0, length))
    along = [geo.addLine(a, b) for a, b in zip(left, right, strict=True)]
    bodies: dict[str, list[int]] = {}
    ends: list[list[int]] = [[], []]
    for k, name in enumerate(("lower", "upper")):
        for column, points in zip(ends, (left, right), strict=True):
            column.append(geo.addLine(points[k], points[k + 1]))
        loop = [along[k], ends[1][k], -along[k + 1], -ends[0][k]]
        bodies[name] = [geo.addPlaneSurface([geo.addCurveLoop(loop)])]
    at, top = length - 2 * stop_width, -gap
    corners = [(at, top - stop_height), (at + stop_width, top - stop_height)]
    corners += [(at + stop_width, top), (at, top)]
    bodies["stop"], (bottom, _, touched, _) = polygon(geo, corners)
    parts = {"clamped": ends[0], "tip": ends[1], "lower_bottom": along[:1], "upper_top": along[2:]}
    parts |= {"stop_top": [touched], "stop_bottom": [bottom]}
    sizes = Sizes(size, contact_size, 0.0, 0.3)
    finish(gmsh, 2, bodies, parts, sizes, curves=[touched])
