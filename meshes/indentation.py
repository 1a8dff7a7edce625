"""Half spaces for indentation: cylinders, their half planes and halves of them in 3-D."""

import math

from contact.errors import InputError
from meshes.grading import Sizes, finish
from meshes.turning import turn


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
    edge_size: float = 0.05,
    arc_size: float = 0.25,
    growth: float = 0.4,
) -> None:
    """Half y > 0 of a cylinder -extent < z < 0 about the axis z, indented at the origin.

    Parts: ``contact`` (the top up to ``radius``), ``free`` (the rest of the top), ``symmetry``
    (y = 0), ``side``, ``bottom``. Sizes as in `half_space`, whose mesh is turned about the axis;
    along the edge of the contact part the elements have the size ``arc_size``, at most ``radius``.
    """
    import gmsh

    if arc_size > radius:  # a few chords make no circle
        raise InputError(
            f"arc_size must be at most the radius, {radius:g}; given: {arc_size:g}", "generator"
        )
    half_space(
        radius=radius,
        extent=extent,
        size=size,
        contact_size=contact_size,
        edge_size=edge_size,
        growth=growth,
    )
    turn(gmsh, math.ceil(math.pi * radius / arc_size))


def _check(radius: float, extent: float) -> None:
    if radius >= extent:
        raise InputError(
            f"radius must be below the extent, {extent:g}; given: {radius:g}", "generator"
        )
