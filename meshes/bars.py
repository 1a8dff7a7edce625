"""Bars and blocks on a foundation along their lower side."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any


def _polygon(
    corners: Sequence[tuple[float, float]], size: float, contact_size: float, bottom: Sequence[int]
) -> tuple[Any, int, list[int]]:
    """Make a polygon graded towards the edges ``bottom``: Gmsh, the body, the edges."""
    import gmsh

    from meshes.grading import grade

    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0) for x, y in corners]
    edges = [geo.addLine(a, b) for a, b in pairwise([*points, points[0]])]
    body = geo.addPlaneSurface([geo.addCurveLoop(edges)])
    geo.synchronize()
    grade(
        gmsh,
        size=size,
        contact_size=contact_size,
        width=2.0 * contact_size,
        growth=0.25,
        curves=[edges[i] for i in bottom],
    )
    return gmsh, body, edges


def bar(
    *,
    length: float = 4.0,
    height: float = 1.0,
    loaded_from: float = 2.0,
    size: float = 0.1,
    contact_size: float = 0.05,
) -> None:
    """Bar of Example 7.2, unstructured.

    Parts: ``left``, ``right``, ``bottom``, ``top``, ``loaded`` (the top from x =
    ``loaded_from`` on). The elements have ``contact_size`` at the bottom, ``size`` far away.
    """
    from contact.errors import InputError
    from meshes.grading import finish

    if loaded_from >= length:
        raise InputError(f"loaded_from must be less than the length {length}; given: {loaded_from}")
    gmsh, body, edges = _polygon(
        [(0, 0), (length, 0), (length, height), (loaded_from, height), (0, height)],
        size,
        contact_size,
        [0],
    )
    bottom, right, loaded, rest, left = ([edge] for edge in edges)
    parts = {"left": left, "right": right, "bottom": bottom, "top": loaded + rest}
    finish(gmsh, 2, [body], {**parts, "loaded": loaded})


def piezo_bar(
    *, length: float = 8.0, height: float = 4.0, size: float = 0.4, contact_size: float = 0.2
) -> None:
    """Bar of Example 8.1, unstructured; parts ``left``, ``right``, ``bottom``, ``top``."""
    from meshes.grading import finish

    gmsh, body, edges = _polygon(
        [(0, 0), (length, 0), (length, height), (0, height)], size, contact_size, [0]
    )
    bottom, right, top, left = ([edge] for edge in edges)
    finish(gmsh, 2, [body], {"left": left, "right": right, "bottom": bottom, "top": top})


def bar_on_ends(
    *,
    length: float = 12.0,
    height: float = 2.0,
    end: float = 2.0,
    size: float = 0.3,
    contact_size: float = 0.15,
) -> None:
    """Bar of Example 8.3, unstructured.

    Parts: ``left``, ``right``, ``top``, ``bottom_ends`` (the bottom up to ``end`` from either
    side), ``contact`` (the bottom between them).
    """
    from contact.errors import InputError
    from meshes.grading import finish

    if 2.0 * end >= length:
        raise InputError(f"end must be less than half the length {length}; given: {end}")
    gmsh, body, edges = _polygon(
        [(0, 0), (end, 0), (length - end, 0), (length, 0), (length, height), (0, height)],
        size,
        contact_size,
        [0, 1, 2],
    )
    first, contact, last, right, top, left = ([edge] for edge in edges)
    parts = {"left": left, "right": right, "top": top, "bottom_ends": first + last}
    finish(gmsh, 2, [body], {**parts, "contact": contact})


def block(
    *,
    width: float = 1.0,
    depth: float = 1.0,
    height: float = 1.0,
    size: float = 0.25,
    contact_size: float = 0.25,
) -> None:
    """Block in space, unstructured, with one corner at the origin.

    Parts: ``left``, ``right`` (x), ``front``, ``back`` (y), ``bottom``, ``top`` (z). The
    elements have ``contact_size`` at the bottom, ``size`` far away.
    """
    import gmsh

    from meshes.grading import finish, grade

    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (width, 0), (width, depth), (0, depth))]
    edges = [geo.addLine(a, b) for a, b in pairwise([*points, points[0]])]
    bottom = geo.addPlaneSurface([geo.addCurveLoop(edges)])
    # The extrusion lists the upper face, the body, and the side faces in the edges' order.
    top, body, front, right, back, left = (
        tag for _, tag in geo.extrude([(2, bottom)], 0, 0, height)
    )
    geo.synchronize()
    grade(
        gmsh,
        size=size,
        contact_size=contact_size,
        width=2.0 * contact_size,
        growth=0.25,
        surfaces=[bottom],
    )
    sides = {"left": left, "right": right, "front": front, "back": back}
    parts = {name: [face] for name, face in {**sides, "bottom": bottom, "top": top}.items()}
    finish(gmsh, 3, [body], parts)


def column(
    *,
    width: float = 1.0,
    height: float = 4.0,
    size: float = 0.4,
    contact_size: float = 0.4,
) -> None:
    """Column of square section in space; parts as in `block`."""
    block(width=width, depth=width, height=height, size=size, contact_size=contact_size)
