"""Bars and blocks on a foundation along their lower side."""

from itertools import pairwise
from typing import Any

from contact.errors import InputError
from meshes.grading import Sizes, finish
from meshes.pieces import Points, polygon


def _sizes(size: float, contact_size: float) -> Sizes:
    """Return the sizes of a bar, whose contact part is a side of it."""
    return Sizes(size, contact_size, 2.0 * contact_size, 0.25)


def _polygon(corners: Points) -> tuple[Any, list[int], list[list[int]]]:
    """Make a polygon: Gmsh, the body, the edges."""
    import gmsh

    body, edges = polygon(gmsh.model.geo, corners)
    return gmsh, body, [[edge] for edge in edges]


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
    if loaded_from >= length:
        raise InputError(
            f"loaded_from must be less than the length {length}; given: {loaded_from}", "generator"
        )
    gmsh, body, (bottom, right, loaded, rest, left) = _polygon(
        [(0, 0), (length, 0), (length, height), (loaded_from, height), (0, height)]
    )
    parts = {"left": left, "right": right, "bottom": bottom, "top": loaded + rest}
    sizes = _sizes(size, contact_size)
    finish(gmsh, 2, body, {**parts, "loaded": loaded}, sizes, curves=bottom)


def piezo_bar(
    *, length: float = 8.0, height: float = 4.0, size: float = 0.4, contact_size: float = 0.2
) -> None:
    """Bar of Example 8.1, unstructured; parts ``left``, ``right``, ``bottom``, ``top``."""
    gmsh, body, (bottom, right, top, left) = _polygon(
        [(0, 0), (length, 0), (length, height), (0, height)]
    )
    parts = {"left": left, "right": right, "bottom": bottom, "top": top}
    finish(gmsh, 2, body, parts, _sizes(size, contact_size), curves=bottom)


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
    if 2.0 * end >= length:
        raise InputError(
            f"end must be less than half the length {length}; given: {end}", "generator"
        )
    gmsh, body, (first, contact, last, right, top, left) = _polygon(
        [(0, 0), (end, 0), (length - end, 0), (length, 0), (length, height), (0, height)]
    )
    bottom = first + contact + last
    parts = {"left": left, "right": right, "top": top, "bottom_ends": first + last}
    sizes = _sizes(size, contact_size)
    finish(gmsh, 2, body, {**parts, "contact": contact}, sizes, curves=bottom)


def block(
    *,
    width: float = 1.0,
    depth: float = 1.0,
    height: float = 1.0,
    size: float = 0.25,
    contact_size: float = 0.25,
) -> None:
    """Block in 3-D, unstructured, with one corner at the origin.

    Parts: ``left``, ``right`` (x), ``front``, ``back`` (y), ``bottom``, ``top`` (z). The
    elements have ``contact_size`` at the bottom, ``size`` far away.
    """
    import gmsh

    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (width, 0), (width, depth), (0, depth))]
    edges = [geo.addLine(a, b) for a, b in pairwise([*points, points[0]])]
    bottom = geo.addPlaneSurface([geo.addCurveLoop(edges)])
    # The extrusion lists the upper face, the body, and the side faces in the edges' order.
    top, body, front, right, back, left = (
        tag for _, tag in geo.extrude([(2, bottom)], 0, 0, height)
    )
    sides = {"left": left, "right": right, "front": front, "back": back}
    parts = {name: [face] for name, face in {**sides, "bottom": bottom, "top": top}.items()}
    finish(gmsh, 3, [body], parts, _sizes(size, contact_size), surfaces=[bottom])


def column(
    *,
    width: float = 1.0,
    height: float = 4.0,
    size: float = 0.4,
    contact_size: float = 0.4,
) -> None:
    """Column of square section in 3-D; parts as in `block`."""
    block(width=width, depth=width, height=height, size=size, contact_size=contact_size)
