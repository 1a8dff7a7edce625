"""Pieces of bodies for the generators: polygons, and round bodies that touch the origin."""

from collections.abc import Sequence
from typing import Any, NamedTuple

Points = Sequence[tuple[float, float]]


def polygon(geo: Any, corners: Points, size: float = 0.0) -> tuple[list[int], list[int]]:
    """Return the surface of a polygon, and its sides, the first from the first corner on."""
    points = [geo.addPoint(x, y, 0, size) for x, y in corners]
    ends = [*points[1:], points[0]]
    sides = [geo.addLine(a, b) for a, b in zip(points, ends, strict=True)]
    return [geo.addPlaneSurface([geo.addCurveLoop(sides)])], sides


class Cap(NamedTuple):
    """Half of a round body, or a part of that, by its entities.

    Attributes
    ----------
    body, round, cut
        Its entity, its round boundary, and the plane through the centre.
    sides
        Its planes or lines of symmetry.
    low
        The point at the origin.
    """

    body: list[int]
    round: list[int]
    cut: list[int]
    sides: list[int]
    low: int


def quarter(geo: Any, radius: float, y: float) -> Cap:
    """Return the right half x > 0 of half a disc with the centre (0, y), y = +-radius."""
    low, side, centre = (geo.addPoint(*p, 0) for p in ((0, 0), (radius, y), (0, y)))
    arc, cut = geo.addCircleArc(low, centre, side), geo.addLine(side, centre)
    axis = geo.addLine(centre, low)
    return Cap(_surface(geo, [arc, cut, axis]), [arc], [cut], [axis], low)


def half(geo: Any, radius: float, y: float) -> Cap:
    """Return half a disc with the centre (0, y), y = +-radius."""
    low, right, left, centre = (
        geo.addPoint(*p, 0) for p in ((0, 0), (radius, y), (-radius, y), (0, y))
    )
    arcs = [geo.addCircleArc(left, centre, low), geo.addCircleArc(low, centre, right)]
    cut = [geo.addLine(right, centre), geo.addLine(centre, left)]
    return Cap(_surface(geo, [*arcs, *cut]), arcs, cut, [], low)


def half_ball(geo: Any, radius: float, z: float, quarters: int) -> Cap:
    """Return quarters of half a ball with the centre (0, 0, z), z = +-radius, from y = 0 on.

    The sides are those between the quarters too.
    """
    low, centre = geo.addPoint(0, 0, 0), geo.addPoint(0, 0, z)
    axis = geo.addLine(centre, low)
    places = [(radius, 0), (0, radius), (-radius, 0)][: quarters + 1]
    rims = [geo.addPoint(x, y, z) for x, y in places]
    arcs = [geo.addCircleArc(low, centre, rim) for rim in rims]
    spokes = [geo.addLine(centre, rim) for rim in rims]
    made = Cap([], [], [], [], low)
    for arc, spoke in zip(arcs, spokes, strict=True):
        made.sides.append(geo.addPlaneSurface([geo.addCurveLoop([axis, arc, -spoke])]))
    for k in range(quarters):
        rim = geo.addCircleArc(rims[k], centre, rims[k + 1])
        loop = geo.addCurveLoop([arcs[k], rim, -arcs[k + 1]])
        made.round.append(geo.addSurfaceFilling([loop]))
        cut = geo.addCurveLoop([spokes[k], rim, -spokes[k + 1]])
        made.cut.append(geo.addPlaneSurface([cut]))
        around = [made.round[k], made.cut[k], *made.sides[k : k + 2]]
        made.body.append(geo.addVolume([geo.addSurfaceLoop(around)]))
    return made


def _surface(geo: Any, curves: Sequence[int]) -> list[int]:
    return [geo.addPlaneSurface([geo.addCurveLoop(curves)])]
