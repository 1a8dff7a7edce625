"""Families of fresh random problems of two and more bodies, with meshes that numpy writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from scripts.studies.robustness.check import Array, Mesh
from scripts.studies.robustness.one_body import Families, Rng, Tables, coulomb, one, plane


class Bodies:
    """Bodies as they are put together to a mesh."""

    def __init__(self, rng: Rng) -> None:
        self.rng = rng
        self._points: list[Array] = []
        self._triangles: list[NDArray[np.intp]] = []
        self._names: list[str] = []
        self._parts: dict[str, NDArray[np.intp]] = {}
        self._count = 0

    def add(self, name: str, points: Array, triangles: Any, sides: dict[str, Any]) -> None:
        """Add a body with its sides, whose edges are pairs of nodes."""
        self._points.append(points)
        self._triangles.append(np.asarray(triangles) + self._count)
        for side, edges in sides.items():
            self._parts[f"{name}_{side}"] = np.asarray(edges) + self._count
        self._names.append(name)
        self._count += len(points)

    def grid(self, name: str, place: Array, sides: Sequence[str], closed: bool = False) -> None:
        """Add a grid of nodes, shape (rows, columns, 2), with diagonals at random.

        Its sides are the first and the last row, and the first and the last column.
        """
        rows, columns = place.shape[:2]
        number = np.arange(rows * columns).reshape(rows, columns)
        if closed:
            number = np.concatenate([number, number[:, :1]], axis=1)
        quads = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
        a, b, c, d = (part.ravel() for part in quads)
        turned = self.rng.random(a.size) < one(self.rng, 0.0, 0.5, 1.0)
        first = np.where(turned[:, None], np.stack([a, b, c], 1), np.stack([a, b, d], 1))
        other = np.where(turned[:, None], np.stack([b, d, c], 1), np.stack([a, d, c], 1))
        lines = [number[0], number[-1], number[:, 0], number[:, -1]]
        pairs = zip(sides, lines, strict=False)
        edges = {side: np.stack([line[:-1], line[1:]], 1) for side, line in pairs}
        self.add(name, place.reshape(-1, 2), np.concatenate([first, other]), edges)

    def block(self, name: str, corners: Any, h: float) -> None:
        """Add a convex quadrilateral, its corners from below on the left counter-clockwise."""
        p = np.asarray(corners, dtype=float)
        if self.rng.random() < 0.4:
            self.cloud(name, p, h, ["bottom", "right", "top", "left"])
            return
        wide = max(2, round(np.linalg.norm(p[1] - p[0]) / h))
        high = max(1, round(np.linalg.norm(p[3] - p[0]) / h))
        s, t = np.linspace(0, 1, wide + 1), np.linspace(0, 1, high + 1)[:, None]
        s, t = s[None, :, None], t[:, :, None]
        place = (1 - t) * ((1 - s) * p[0] + s * p[1]) + t * ((1 - s) * p[3] + s * p[2])
        self.grid(name, place, ["bottom", "top", "left", "right"])

    def cloud(self, name: str, polygon: Any, h: float, sides: Sequence[str]) -> None:
        """Add a convex polygon with nodes at random, by Delaunay's triangulation."""
        p, rng = np.asarray(polygon, dtype=float), self.rng
        ring, places, which = [], [], []
        for k, (begin, end) in enumerate(zip(p, np.roll(p, -1, axis=0), strict=True)):
            n = max(1, round(np.linalg.norm(end - begin) / h))
            s = (np.arange(n) + np.where(np.arange(n) > 0, rng.uniform(-0.2, 0.2, n), 0.0)) / n
            ring.append(begin + s[:, None] * (end - begin))
            which += [k] * n
        places = np.concatenate(ring)
        low, high = p.min(axis=0), p.max(axis=0)
        x, y = np.meshgrid(np.arange(low[0], high[0], h), np.arange(low[1], high[1], 0.87 * h))
        x[::2] += h / 2
        inner = np.stack([x.ravel(), y.ravel()], 1) + rng.uniform(-0.2, 0.2, (x.size, 2)) * h
        edge = np.roll(p, -1, axis=0) - p
        off = inner[:, None] - p
        depth = edge[:, 0] * off[..., 1] - edge[:, 1] * off[..., 0]
        inner = inner[(depth / np.linalg.norm(edge, axis=1)).min(axis=1) > 0.5 * h]
        points = np.concatenate([places, inner])
        triangles = Delaunay(points).simplices
        a, b, c = (points[triangles[:, k]] for k in range(3))
        b, c = b - a, c - a
        area = np.abs(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
        triangles = triangles[area > 1e-6 * h**2]
        number = np.arange(len(places))
        pairs = np.stack([number, np.roll(number, -1)], 1)
        names = np.array(sides)[which]
        edges = {side: pairs[names == side] for side in dict.fromkeys(sides)}
        self.add(name, points, triangles, edges)

    def ring(self, name: str, centre: Any, radii: tuple[float, float], h: float) -> None:
        """Add a ring, its nodes turned by some angle."""
        n = max(8, round(2 * np.pi * radii[1] / h))
        angle = 2 * np.pi * (np.arange(n) + self.rng.random()) / n
        r = np.linspace(*radii, max(2, round((radii[1] - radii[0]) / h)) + 1)
        place = np.asarray(centre) + r[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        self.grid(name, place, ["inside", "outside"], closed=True)

    def disc(self, name: str, centre: Any, radius: float, n: int) -> None:
        """Add a polygon of n equal sides, which all are its rim."""
        angle = 2 * np.pi * (np.arange(n) + self.rng.random()) / n
        rim = np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], 1)
        self.cloud(name, rim, 2.2 * np.pi * radius / n, ["rim"] * n)

    def mesh(self) -> Mesh:
        """Return the mesh."""
        region = np.repeat(np.arange(len(self._names)), [len(t) for t in self._triangles])
        points, triangles = np.concatenate(self._points), np.concatenate(self._triangles)
        return Mesh(points, triangles, region, self._names, self._parts)

    def materials(self, spread: float = 1.0) -> list[Tables]:
        """Draw a material for each body."""
        rng, found = self.rng, []
        for name in self._names:
            young = float(10 ** rng.uniform(-spread, spread))
            found.append({"on": name, "young": young, "poisson": float(rng.uniform(0.0, 0.45))})
            if rng.random() < 0.35:
                found[-1] |= {"law": "log", "yield_strain": float(10 ** rng.uniform(-3, -1))}
        return found


def friction(rng: Rng) -> Tables:
    """Draw mu from 0 to 1."""
    return {"friction": coulomb(rng, 0.0, 0.1, 0.2, 0.3, 0.5, 0.8, 1.0, rng.random())}


def _pair(rng: Rng, first: str, other: str, once: bool = False) -> Tables:
    """Draw which side is the slave; the first is where the other one has several contacts."""
    on, against = (first, other) if once or rng.random() < 0.5 else (other, first)
    return {"on": on, "against": against, **friction(rng)}


def _box(x: float, y: float, wide: float, high: float, turn: float = 0.0) -> Array:
    """Return the corners of a rectangle whose lower side has the middle (x, y)."""
    corners = np.array([[-wide / 2, 0], [wide / 2, 0], [wide / 2, high], [-wide / 2, high]])
    c, s = np.cos(turn), np.sin(turn)
    return corners @ np.array([[c, s], [-s, c]]) + [x, y]


def _clamp(on: str, x: Any = 0.0, y: Any = 0.0) -> Tables:
    return {"on": on, "displacement": [x, y]}


def rings(rng: Rng, b: Bodies) -> Tables:
    """Draw a ring between a plate and a lid."""
    h = rng.uniform(0.2, 0.35)
    b.ring("ring", (0.0, 1.0), (rng.uniform(0.4, 0.8), 1.0), h)
    low, high = (float(end(b._points[0][:, 1])) for end in (np.min, np.max))
    gap = one(rng, 0.0, 0.0, 0.002)
    below = _box(rng.uniform(-0.1, 0.1), low - 0.5 - gap, 2.0, 0.5)
    b.block("plate", below, rng.uniform(0.15, 0.4))
    b.block("lid", _box(rng.uniform(-0.1, 0.1), high, 2.0, 0.5), rng.uniform(0.15, 0.4))
    way = -float(10 ** rng.uniform(-3, -1.5))
    push = one(rng, 0.0, 0.3, -1.0) * way
    contacts = [_pair(rng, side, "ring_outside", True) for side in ("plate_top", "lid_bottom")]
    return {"fixed": [_clamp("plate_bottom"), _clamp("lid_top", push, way)], "contact": contacts}


def stacks(rng: Rng, b: Bodies) -> Tables:
    """Draw two to four blocks on each other, pressed and pushed aside."""
    count, y = int(rng.integers(2, 5)), 0.0
    for k in range(count):
        wide, high = rng.uniform(0.8, 2.0), rng.uniform(0.2, 0.8)
        b.block(f"b{k}", _box(rng.uniform(-0.2, 0.2), y, wide, high), rng.uniform(0.15, 0.3))
        y += high + one(rng, 0.0, 0.0, 0.001)
    way = float(10 ** rng.uniform(-3, -1.5))
    pairs = [_pair(rng, f"b{k}_top", f"b{k + 1}_bottom") for k in range(count - 1)]
    lid = _clamp(f"b{count - 1}_top", one(rng, 0, 1, -2) * way, -way)
    return {"fixed": [_clamp("b0_bottom"), lid], "contact": pairs}


def wedges(rng: Rng, b: Bodies) -> Tables:
    """Draw a wedge that is pressed or pushed between two rigid planes: two contacts on a body."""
    half, narrow = np.deg2rad(rng.uniform(3, 50)), rng.uniform(0.2, 0.6)
    spread = narrow + np.tan(half)
    b.block("wedge", [[-narrow, 0], [narrow, 0], [spread, 1], [-spread, 1]], rng.uniform(0.12, 0.3))
    gap = one(rng, 0.0, 0.003)
    contacts = []
    for side, x in (("right", narrow), ("left", -narrow)):
        angle = half + np.deg2rad(one(rng, 0.0, 1.0, -1.0) * (gap > 0))
        sign = np.sign(x)
        normal = [float(-sign * np.cos(angle)), float(np.sin(angle))]
        point = [float(x + sign * (gap + 0.03 * (gap > 0))), 0.0]
        ground = plane(point, normal)
        contacts.append({"on": f"wedge_{side}", "foundation": ground, **friction(rng)})
    way = float(10 ** rng.uniform(-2.5, -1.2))
    aside = one(rng, 0.0, 0.4) * way
    return {"fixed": [_clamp("wedge_top", aside, -way - gap)], "contact": contacts}


def driven_wedges(rng: Rng, b: Bodies) -> Tables:
    """Draw an elastic wedge between two elastic cheeks."""
    half, narrow, h = np.deg2rad(rng.uniform(5, 40)), 0.3, rng.uniform(0.15, 0.3)
    spread, gap = narrow + np.tan(half), one(rng, 0.0, 0.002)
    b.block("wedge", [[-narrow, 0], [narrow, 0], [spread, 1], [-spread, 1]], h)
    far = spread + 0.7
    b.block("l", [[-far, 0], [-narrow - gap, 0], [-spread - gap, 1], [-far, 1]], 0.8 * h)
    b.block("r", [[narrow + gap, 0], [far, 0], [far, 1], [spread + gap, 1]], 1.2 * h)
    way = float(10 ** rng.uniform(-2.5, -1.2))
    top = _clamp("wedge_top", one(rng, 0.0, 0.5) * way, -way)
    contacts = [_pair(rng, "wedge_left", "l_right"), _pair(rng, "wedge_right", "r_left")]
    return {"fixed": [_clamp("l_left"), _clamp("r_right"), top], "contact": contacts}


def snap_fits(rng: Rng, b: Bodies) -> Tables:
    """Draw a beam whose tip a rigid pin bends aside and lets go."""
    long = rng.uniform(2.0, 5.0)
    b.block("beam", [[0, 0], [long, 0], [long, 0.4], [0, 0.4]], rng.uniform(0.1, 0.2))
    radius, depth = rng.uniform(0.2, 0.5), rng.uniform(0.01, 0.06)
    x, away = long - rng.uniform(0.1, 0.6), rng.uniform(0.0, 0.02)
    motion = [f"{float(rng.uniform(-0.1, 0.1))!r}*t", f"{depth + away!r}*min(t, 2 - t)"]
    pin = {"shape": "sphere", "centre": [x, -radius - away], "radius": radius}
    contact = {"on": "beam_bottom", "foundation": pin, "rigid": {"displacement": motion}}
    evolution = {"times": [0.0, 1.0, 2.0], "steps": [int(rng.integers(3, 6))] * 2}
    contacts = [contact | friction(rng)]
    return {"fixed": [_clamp("beam_left")], "contact": contacts, "evolution": evolution}


def lifted_off(rng: Rng, b: Bodies) -> Tables:
    """Draw two bodies that are pressed, sheared, lifted off and pressed again, in steps."""
    b.block("a", _box(0, -0.6, 1.8, 0.6), rng.uniform(0.15, 0.35))
    kind = one(rng, "block", "disc", "tilted")
    gap = one(rng, 0.0, 0.02)
    if kind == "disc":
        n = int(rng.integers(12, 24))
        angle = np.pi * (1 + np.arange(n + 1) / n)
        half = np.stack([np.cos(angle), 1.0 + gap + np.sin(angle)], 1)
        b.cloud("b", half, 0.2, ["bottom"] * n + ["top"])
    else:
        turn = 0.0 if kind == "block" else np.deg2rad(rng.uniform(0.2, 4))
        corners = _box(0, gap + 0.5 * np.sin(turn), 1.0, 0.6, turn)
        b.block("b", corners, rng.uniform(0.15, 0.35))
    down, aside = gap + float(10 ** rng.uniform(-2.5, -1.7)), float(10 ** rng.uniform(-3, -2))
    up = one(rng, -0.01, 0.01, 0.1)
    lift = "max(0, min(t - 2, 4 - t))"
    way = f"{-down!r}*min(t, 1) + {down + up!r}*{lift}"
    push = f"{aside!r}*max(0, min(1, t - 1))"
    evolution = {"times": [0.0, 1.0, 2.0, 3.0, 4.0], "steps": [2, 2, 2, 2]}
    fixed, contacts = (
        [_clamp("a_bottom"), _clamp("b_top", push, way)],
        [_pair(rng, "a_top", "b_bottom")],
    )
    return {"fixed": fixed, "contact": contacts, "evolution": evolution}


def indenters(rng: Rng, b: Bodies) -> Tables:
    """Draw a rigid indenter, tilted, that moves or is pressed into a block."""
    b.block("block", _box(0, -1, 2.4, 1), rng.uniform(0.12, 0.25))
    way = -float(10 ** rng.uniform(-3, -1.5))
    tilt = np.deg2rad(rng.uniform(-6, 6))
    kind = one(rng, "plane", "sphere", "punch", "cone", "formula")
    axis = [float(np.sin(tilt)), float(np.cos(tilt))]
    shape: Tables = {"shape": kind}
    more: Tables = {"direction": "axis", "axis": [0.0, 1.0]} if kind in ("punch", "cone") else {}
    if kind == "plane":
        shape |= {"point": [0.0, abs(1.2 * np.tan(tilt))], "normal": [axis[0], -axis[1]]}
    elif kind == "sphere":
        radius = rng.uniform(0.5, 4.0)
        shape |= {"centre": [rng.uniform(-0.3, 0.3), radius], "radius": radius}
    elif kind == "punch":
        size = rng.uniform(0.3, 0.8)
        shape |= {"centre": [0.0, size * abs(axis[0])], "axis": axis, "radius": size}
        shape["edge_radius"] = one(rng, 0.05, 0.15)
    elif kind == "cone":
        shape |= {"apex": [0.05, 0.0], "axis": axis, "half_angle": rng.uniform(60, 82)}
    else:
        shape = {"shape": "distance", "distance": f"{rng.uniform(0.3, 2)!r}*(x - 0.1)**2 - y"}
    rigid: Tables = {"displacement": [one(rng, 0.0, 0.5) * way, way]}
    if rng.random() < 0.3:
        rigid = {"displacement": [0.0, "free"], "force": [0.0, way]}
    elif rng.random() < 0.5:
        rigid |= {"rotation": float(rng.uniform(-0.3, 0.3)), "centre": [0.0, 0.0]}
    contact = {"on": "block_top", "foundation": shape, "rigid": rigid, **more, **friction(rng)}
    return {"fixed": [_clamp("block_bottom")], "contact": [contact]}


def tilted_blocks(rng: Rng, b: Bodies) -> Tables:
    """Draw an elastic block that meets another one with its corner, or its flat side."""
    turn = np.deg2rad(one(rng, 0.3, 2.0, 10.0, 45.0) * one(rng, -1, 1))
    b.block("a", _box(0, -0.8, 2.4, 0.8), rng.uniform(0.12, 0.25))
    corners = _box(0, 0, 0.9, 0.9, turn)
    corners[:, 1] -= corners[:, 1].min()
    b.block("b", corners, rng.uniform(0.12, 0.25))
    on = "b_bottom" if abs(turn) < 0.6 else ["b_bottom", "b_left" if turn > 0 else "b_right"]
    way = float(10 ** rng.uniform(-3, -1.7))
    fixed = [_clamp("a_bottom"), _clamp("b_top", one(rng, 0.0, 1.0, -0.3) * way, -way)]
    return {"fixed": fixed, "contact": [{"on": on, "against": "a_top", **friction(rng)}]}


def clouds(rng: Rng, b: Bodies) -> Tables:
    """Draw a polygon at random in front of a plane or an uneven foundation, under loads."""
    high, wide = rng.uniform(0.5, 1.5), rng.uniform(1.0, 2.5)
    lean = rng.uniform(-0.3, 0.3, 2)
    polygon = [[0, 0], [wide, 0], [wide + lean[0], high], [lean[1], high]]
    b.cloud("body", polygon, rng.uniform(0.12, 0.25), ["bottom", "right", "top", "left"])
    gap = one(rng, "0", "0.002", "0.004*x**2", "0.003*(1+sin(9*x))", "0.01*abs(x-0.6)")
    size = float(10 ** rng.uniform(-3, -1.5))
    loads: list[Tables] = [
        {"on": "body_top", "traction": [float(rng.uniform(-1, 1)) * size, -size]},
        {"on": "body_right", "traction": [float(rng.uniform(-1, 0.5)) * size, 0.0]},
    ]
    if rng.random() < 0.3:
        loads.append({"everywhere": True, "body_force": [0.0, -size]})
    contact = {"on": "body_bottom", "gap": gap, **friction(rng)}
    return {"fixed": [_clamp("body_left")], "load": loads, "contact": [contact]}


def layers(rng: Rng, b: Bodies) -> Tables:
    """Draw a body on a compliant layer, in front of a rigid part or not."""
    b.block("body", _box(0, 0, rng.uniform(1, 3), 1.0), rng.uniform(0.12, 0.25))
    deep = one(rng, 0.01, 0.05)
    layer = {
        "law": "compliance", "gap": deep + one(rng, 0.0, 0.002), "layer": deep,
        "stiffness": float(10 ** rng.uniform(-2, 4)), "potential_factor": 1.0,
        "limit": one(rng, 0.002, 1.0),
    }  # fmt: skip
    way = float(10 ** rng.uniform(-2.5, -1.2))
    fixed = [_clamp("body_top", one(rng, 0, 1) * way, -way)]
    return {"fixed": fixed, "contact": [{"on": "body_bottom", **layer, **friction(rng)}]}


def small_bodies(rng: Rng, b: Bodies) -> Tables:
    """Draw a small disc or block between two cheeks that are not parallel: two contacts on it."""
    radius, tilt = rng.uniform(0.15, 0.4), np.deg2rad(rng.uniform(-8, 8))
    under, over = "small_rim", "small_rim"
    disc = rng.random() < 0.7
    if disc:
        b.disc("small", (0.0, radius), radius, int(rng.integers(8, 24)))
    else:
        b.block("small", _box(0, 0, 2 * radius, 2 * radius), rng.uniform(0.4, 0.9) * radius)
        under, over = "small_bottom", "small_top"
    points = b._points[0]
    low, direction = points[:, 1].min(), np.array([-np.sin(tilt), np.cos(tilt)])
    high = (points @ direction).max()
    b.block("below", _box(0, low - 0.6, 1.6, 0.6), rng.uniform(0.1, 0.3))
    b.block("above", _box(*(high * direction), 1.6, 0.6, tilt), rng.uniform(0.1, 0.3))
    way = float(10 ** rng.uniform(-3, -1.7))
    move = -way * direction + one(rng, 0.0, 0.3) * way * np.array([1.0, 0.0])
    contacts = [_pair(rng, "below_top", under, disc), _pair(rng, "above_bottom", over, disc)]
    fixed = [_clamp("below_bottom"), _clamp("above_top", *move.tolist())]
    return {"fixed": fixed, "contact": contacts}


BODIES: Families = {draw.__name__: (draw, range(count)) for draw, count in (
    (rings, 50), (stacks, 50), (wedges, 45), (driven_wedges, 35), (snap_fits, 40), (lifted_off, 50),
    (indenters, 55), (tilted_blocks, 40), (clouds, 50), (layers, 35), (small_bodies, 50),
)}  # fmt: skip
