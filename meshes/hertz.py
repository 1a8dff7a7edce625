"""Round bodies that touch the plane y = 0 (z = 0 in 3-D) at the origin (Example 7.1)."""

import math

from contact.errors import InputError
from meshes.grading import Sizes, finish
from meshes.pieces import half, half_ball, quarter


def quarter_disc(
    *,
    radius: float = 8.0,
    size: float = 1.0,
    contact_size: float = 0.2,
    contact_width: float = 4.0,
    growth: float = 0.3,
) -> None:
    """Right half of the lower half of a disc with the centre (0, radius).

    Parts: ``symmetry`` (x = 0), ``top`` (the cut y = radius), ``contact`` (the arc). The
    elements have the size ``contact_size`` up to ``contact_width`` from the origin and grow
    by ``growth`` a unit length, up to ``size``.
    """
    import gmsh

    made = quarter(gmsh.model.geo, radius, radius)
    parts = {"symmetry": made.sides, "top": made.cut, "contact": made.round}
    sizes = Sizes(size, contact_size, contact_width, growth)
    finish(gmsh, 2, made.body, parts, sizes, points=[made.low])


def half_disc(
    *,
    radius: float = 8.0,
    size: float = 1.0,
    contact_size: float = 0.2,
    contact_width: float = 4.0,
    growth: float = 0.3,
) -> None:
    """Lower half of a disc with the centre (0, radius).

    Parts: ``top`` (the cut y = radius), ``contact`` (the arc). Sizes as in `quarter_disc`.
    """
    import gmsh

    made = half(gmsh.model.geo, radius, radius)
    sizes = Sizes(size, contact_size, contact_width, growth)
    finish(gmsh, 2, made.body, {"top": made.cut, "contact": made.round}, sizes, points=[made.low])


def disc(
    *,
    radius: float = 8.0,
    size: float = 1.0,
    contact_size: float = 0.2,
    contact_width: float = 4.0,
    growth: float = 0.3,
    top_angle: float = 30.0,
) -> None:
    """Full disc with the centre (0, radius).

    Parts: ``contact`` (the lower half of the circle), ``top`` (the arc within ``top_angle``
    degrees, at most 90, of the highest point). Sizes as in `quarter_disc`.
    """
    import gmsh

    if top_angle > 90.0:
        raise InputError(f"top_angle must be at most 90 degrees; given: {top_angle}", "generator")
    geo = gmsh.model.geo
    centre = geo.addPoint(0, radius, 0)
    # Angles from the lowest point, counter-clockwise; every arc is shorter than 180 degrees.
    angles = [-90.0, 0.0, 90.0, 180.0 - top_angle, 180.0, 180.0 + top_angle]
    if top_angle == 90.0:
        angles = [-90.0, 0.0, 90.0, 180.0]
    points = [
        geo.addPoint(
            radius * math.sin(math.radians(a)), radius * (1.0 - math.cos(math.radians(a))), 0
        )
        for a in angles
    ]
    arcs = [
        geo.addCircleArc(a, centre, b) for a, b in zip(points, points[1:] + points[:1], strict=True)
    ]
    body = geo.addPlaneSurface([geo.addCurveLoop(arcs)])
    top = arcs[2:] if top_angle == 90.0 else arcs[3:5]
    finish(
        gmsh,
        2,
        [body],
        {"contact": arcs[:2], "top": top},
        Sizes(size, contact_size, contact_width, growth),
        points=[points[1]],
    )


def sphere(
    *,
    radius: float = 10.0,
    size: float = 2.0,
    contact_size: float = 0.1,
    contact_width: float = 1.3,
    growth: float = 0.25,
) -> None:
    """Quarter x, y >= 0 of the lower half of a ball with the centre (0, 0, radius).

    Parts: ``symmetry_x`` (x = 0), ``symmetry_y`` (y = 0), ``top`` (the cut z = radius),
    ``contact`` (the round surface). Sizes as in `quarter_disc`.
    """
    import gmsh

    made = half_ball(gmsh.model.geo, radius, radius, 1)
    symmetry_y, symmetry_x = made.sides
    parts = {
        "symmetry_x": [symmetry_x],
        "symmetry_y": [symmetry_y],
        "top": made.cut,
        "contact": made.round,
    }
    sizes = Sizes(size, contact_size, contact_width, growth)
    finish(gmsh, 3, made.body, parts, sizes, points=[made.low])
