"""Half spaces for indentation: cylinders, their half planes and halves of them in space."""

from itertools import pairwise

from contact.errors import InputError
from meshes.grading import Sizes, finish


def half_space(
    *,
    radius: float = 1.0,
    extent: float = 30.0,
    size: float = 4.0,
    contact_size: float = 0.02,
    edge_size: float = 0.02,
    growth: float = 0.15,
) -> None:
    """Half plane x < extent, -extent < y < 0 of a cylinder whose top is indented at the origin.

    Parts: ``axis`` (x = 0), ``contact`` (the top up to ``radius``), ``free`` (the rest of the
    top), ``side``, ``bottom``. The elements have the size ``contact_size`` up to half of ``radius``
    from the contact part, ``edge_size`` at its edge, and grow by ``growth`` a unit length, up to
    ``size``.
    """
    import gmsh

    _check(radius, extent)
    geo = gmsh.model.geo
    low, corner, rim, edge, origin = (
        geo.addPoint(*p, 0)
        for p in ((0, -extent), (extent, -extent), (extent, 0), (radius, 0), (0, 0))
    )
    bottom, side = geo.addLine(low, corner), geo.addLine(corner, rim)
    free, contact = geo.addLine(rim, edge), geo.addLine(edge, origin)
    axis = geo.addLine(origin, low)
    body = geo.addPlaneSurface([geo.addCurveLoop([bottom, side, free, contact, axis])])
    finish(
        gmsh,
        2,
        [body],
        {"axis": [axis], "contact": [contact], "free": [free], "side": [side], "bottom": [bottom]},
        Sizes(size, contact_size, 0.5 * radius, growth),
        curves=[contact],
        edges=[edge],
        edge_size=edge_size,
    )


def half_cylinder(
    *,
    radius: float = 1.0,
    extent: float = 6.0,
    size: float = 1.5,
    contact_size: float = 0.25,
    edge_size: float = 0.15,
    growth: float = 0.4,
) -> None:
    """Half y > 0 of a cylinder -extent < z < 0 about the axis z, indented at the origin.

    Parts: ``contact`` (the top up to ``radius``), ``free`` (the rest of the top), ``symmetry``
    (y = 0), ``side``, ``bottom``. Sizes as in `half_space`.
    """
    import gmsh

    _check(radius, extent)
    geo = gmsh.model.geo
    low, top = geo.addPoint(0, 0, -extent), geo.addPoint(0, 0, 0)

    def half_circle(centre: int, r: float, z: float) -> tuple[list[int], list[int]]:
        """Return the points and the arcs from x = r by y = r to x = -r."""
        points = [geo.addPoint(*p, z) for p in ((r, 0), (0, r), (-r, 0))]
        return points, [geo.addCircleArc(a, centre, b) for a, b in pairwise(points)]

    (right, _, left), edge = half_circle(top, radius, 0.0)
    rim_points, rim = half_circle(top, extent, 0.0)
    floor_points, floor = half_circle(low, extent, -extent)
    across = geo.addLine(left, right)
    ledges = geo.addLine(right, rim_points[0]), geo.addLine(rim_points[2], left)
    walls = [geo.addLine(a, b) for a, b in zip(rim_points, floor_points, strict=True)]
    base = geo.addLine(floor_points[2], floor_points[0])
    contact = geo.addPlaneSurface([geo.addCurveLoop([*edge, across])])
    free = geo.addPlaneSurface(
        [geo.addCurveLoop([ledges[0], *rim, ledges[1], *(-e for e in edge[::-1])])]
    )
    bottom = geo.addPlaneSurface([geo.addCurveLoop([*floor, base])])
    outline = [across, ledges[0], walls[0], -base, -walls[2], ledges[1]]
    symmetry = geo.addPlaneSurface([geo.addCurveLoop(outline)])
    side = [
        geo.addSurfaceFilling([geo.addCurveLoop([walls[k], floor[k], -walls[k + 1], -rim[k]])])
        for k in range(2)
    ]
    body = geo.addVolume([geo.addSurfaceLoop([contact, free, bottom, symmetry, *side])])
    finish(
        gmsh,
        3,
        [body],
        {
            "contact": [contact],
            "free": [free],
            "symmetry": [symmetry],
            "side": side,
            "bottom": [bottom],
        },
        Sizes(size, contact_size, 0.5 * radius, growth),
        surfaces=[contact],
        edges=edge,
        edge_size=edge_size,
    )


def _check(radius: float, extent: float) -> None:
    if radius >= extent:
        raise InputError(f"radius must be below the extent, {extent:g}; given: {radius:g}")
