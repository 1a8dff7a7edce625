"""Half planes of half spaces for indentation: a cylinder y < 0 about the axis x = 0."""


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

    from contact.errors import InputError
    from meshes.grading import finish, grade

    if radius >= extent:
        raise InputError(f"radius must be below the extent, {extent:g}; given: {radius:g}")
    geo = gmsh.model.geo
    low, corner, rim, edge, origin = (
        geo.addPoint(*p, 0)
        for p in ((0, -extent), (extent, -extent), (extent, 0), (radius, 0), (0, 0))
    )
    bottom, side = geo.addLine(low, corner), geo.addLine(corner, rim)
    free, contact = geo.addLine(rim, edge), geo.addLine(edge, origin)
    axis = geo.addLine(origin, low)
    body = geo.addPlaneSurface([geo.addCurveLoop([bottom, side, free, contact, axis])])
    geo.synchronize()
    grade(
        gmsh,
        size=size,
        contact_size=contact_size,
        width=0.5 * radius,
        growth=growth,
        curves=[contact],
        edges=[edge],
        edge_size=edge_size,
    )
    finish(
        gmsh,
        2,
        [body],
        {"axis": [axis], "contact": [contact], "free": [free], "side": [side], "bottom": [bottom]},
    )
