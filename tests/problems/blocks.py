"""Two blocks, one on the other, whose meshes do not match."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact.mesh.cells import Shape
from contact.mesh.contents import Contents
from contact.mesh.domain import Domain, from_mesh
from tests.problems import files
from tests.problems.meshes import assembled, midpoints


@dataclass(frozen=True)
class Blocks:
    """An upper block on a lower one, in the plane or in space."""

    #: 2 or 3.
    dim: int = 2
    #: Cells along each edge, as along x and y and z.
    upper: int = 3
    lower: int = 4
    #: How far inner nodes are moved, in lengths of cells.
    jitter: float = 0.15
    #: The exponent of the spacing along x.
    grading: float = 1.0
    #: Angle by which both are turned (degrees).
    turn: float = 0.0
    #: Between them.
    gap: float = 0.0
    #: Shape of the cells; by default triangles or tetrahedra.
    cell: str = ""
    #: How far nodes move along the faces, and those within also across: cells are then of second
    #: order, and facets curved in their planes; 0 for straight cells.
    bow: float = 0.0

    @property
    def shape(self) -> Shape:
        """The shape of the cells."""
        return Shape(self.cell or {2: "triangle", 3: "tetrahedron"}[self.dim])

    def domain(self, comm: MPI.Intracomm) -> Domain:
        """Return the mesh with the parts `top`, `under`, `over`, `bottom` and sides."""
        points, cells = self._cells()
        if self.bow > 0:
            points, cells = self._bowed(points, cells)
        order, d = self.shape.degree_of(cells.shape[1]), self.dim
        mesh = assembled(comm, points, cells, self.shape.name, order)
        facets, middle, inside, centre = midpoints(mesh)
        height, up = middle[:, -1], inside[:, -1] > 1 + self.gap / 2

        def near(value):
            return np.abs(height - value) < 1e-9

        parts = {
            "top": near(2 + self.gap),
            "bottom": near(0.0),
            "under": near(1 + self.gap) & up,
            "over": near(1.0) & ~up,
            "left": np.abs(middle[:, 0]) < 1e-9,
            "right": np.abs(middle[:, 0] - 1) < 1e-9,
            "upper_left": (np.abs(middle[:, 0]) < 1e-9) & up,
            "lower_left": (np.abs(middle[:, 0]) < 1e-9) & ~up,
        }
        if d == 3:
            parts["front"] = np.abs(middle[:, 1]) < 1e-9
            parts["back"] = np.abs(middle[:, 1] - 1) < 1e-9
        above = centre[:, -1] > 1
        regions = {"upper": np.flatnonzero(above), "lower": np.flatnonzero(~above)}
        domain = from_mesh(mesh, {n: facets[m] for n, m in parts.items()}, 2.0, regions)
        angle = np.deg2rad(self.turn)
        turned = mesh.geometry.x.copy()
        mesh.geometry.x[:, 0] = np.cos(angle) * turned[:, 0] - np.sin(angle) * turned[:, d - 1]
        mesh.geometry.x[:, d - 1] = np.sin(angle) * turned[:, 0] + np.cos(angle) * turned[:, d - 1]
        return domain

    def joined(self, comm: MPI.Intracomm) -> Domain:
        """Return both as one body, where their meshes match."""
        points, cells = self._cells()
        _, first, number = np.unique(
            np.round(points, 9), axis=0, return_index=True, return_inverse=True
        )
        mesh = assembled(comm, points[first], number.reshape(-1)[cells], self.shape.name)
        d = self.dim
        parts = {
            "top": lambda x: np.abs(x[d - 1] - 2) < 1e-9,
            "bottom": lambda x: np.abs(x[d - 1]) < 1e-9,
        }
        return from_mesh(mesh, parts, 2.0)

    @property
    def axes(self) -> np.ndarray:
        """The turned axes, a column each, shape (d, d)."""
        angle, axes = np.deg2rad(self.turn), np.eye(self.dim)
        c, s = np.cos(angle), np.sin(angle)
        axes[np.ix_([0, -1], [0, -1])] = [[c, -s], [s, c]]
        return axes

    def _bowed(self, points, cells):
        """Return nodes of second order, moved by waves, and the cells of these."""
        every = self.shape.lagrange(1, self.shape.nodes(2)) @ points[cells]
        up = (every[..., -1].mean(axis=1) > 1 + self.gap / 2)[:, None] * np.ones(every.shape[1])
        known = np.column_stack([every.reshape(-1, self.dim), up.ravel()]).round(9)
        _, first, number = np.unique(known, axis=0, return_index=True, return_inverse=True)
        x, up = every.reshape(-1, self.dim)[first], up.ravel()[first]
        height = x[:, -1] - up * (1 + self.gap)
        inside = [*x[:, :-1].T, height]
        moves = [
            np.sin(np.pi * along) * np.cos(3.0 * other + k + 2.0 * up)
            for k, (along, other) in enumerate(zip(inside, np.roll(x, 1, axis=1).T, strict=True))
        ]
        return x + self.bow * np.stack(moves, axis=1), number.reshape(every.shape[:2])

    def _cells(self):
        parts, cells, count = [], [], 0
        for k, (n, low) in enumerate(((self.lower, 0.0), (self.upper, 1.0 + self.gap))):
            x, c = self._block(n, np.random.default_rng(k))
            x[:, -1] += low
            parts.append(x)
            cells.append(c + count)
            count += len(x)
        return np.concatenate(parts), np.concatenate(cells).astype(np.int64)

    def _block(self, n, rng):
        d = self.dim
        grid = np.linspace(0, 1, n + 1)
        axes = [grid**self.grading, *([grid] * (d - 1))]
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
        # Along the faces too, but not off them.
        moves = rng.uniform(-self.jitter, self.jitter, x.shape) / n
        x = x + np.where((x > 1e-9) & (x < 1 - 1e-9), moves, 0.0)
        i = np.arange((n + 1) ** d).reshape((n + 1,) * d)
        if d == 2:
            a, b, c, e = (p.ravel() for p in (i[:-1, :-1], i[1:, :-1], i[:-1, 1:], i[1:, 1:]))
            if not self.shape.simplex:
                return x, np.stack([a, b, c, e], 1)
            return x, np.concatenate([np.stack([a, b, e], 1), np.stack([a, e, c], 1)])
        corner = {
            (p, q, r): i[p : n + p, q : n + q, r : n + r].ravel()
            for p in (0, 1)
            for q in (0, 1)
            for r in (0, 1)
        }
        if not self.shape.simplex:
            order = [(k & 1, k >> 1 & 1, k >> 2) for k in range(8)]
            return x, np.stack([corner[place] for place in order], 1)
        paths = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
        cells = []
        for path in paths:
            at = [0, 0, 0]
            vertices = [corner[tuple(at)]]
            for axis in path:
                at[axis] = 1
                vertices.append(corner[tuple(at)])
            cells.append(np.stack(vertices, 1))
        return x, np.concatenate(cells)


def write_unlike(path: Path, upper: Blocks, lower: Blocks) -> None:
    """Write the upper block of one pair on the lower one of another, of other cells, for Abaqus."""
    d, points, blocks, sets, count = upper.dim, [], [], {}, 0
    for low, name, given, n, ends in (
        (0, "lower", lower, lower.lower, ("bottom", "over")),
        (1, "upper", upper, upper.upper, ("under", "top")),
    ):
        x, cells = given._block(n, np.random.default_rng(n))
        x[:, -1] += low
        order = np.argsort(given.shape.vtk(1)[1])
        blocks.append((given.shape.name, cells[:, order] + count))
        sides = {ends[0]: (d - 1, low), ends[1]: (d - 1, low + 1), f"{name}_left": (0, 0)}
        sides |= {f"{name}_front": (1, 0)} if d == 3 else {}
        for part, (axis, value) in sides.items():
            sets[part] = np.flatnonzero(np.abs(x[:, axis] - value) < 1e-12) + count
        points.append(x)
        count += len(x)
    groups = {name: {k: np.arange(len(blocks[k][1]))} for k, name in enumerate(("lower", "upper"))}
    files.write(path, Contents(np.concatenate(points), blocks, groups, sets))


def squares(comm: MPI.Intracomm, corners, cells) -> Domain:
    """Return unit squares by their lower left corners: regions `body0`, ..., parts `left0`, ..."""
    parts, blocks, count = [], [], 0
    for k, (corner, n) in enumerate(zip(corners, cells, strict=True)):
        x, own = Blocks(2)._block(n, np.random.default_rng(k))
        parts.append(x + np.array(corner))
        blocks.append(own + count)
        count += len(x)
    mesh = assembled(comm, np.concatenate(parts), np.concatenate(blocks))
    facets, middle, inside, centre = midpoints(mesh)
    named, regions = {}, {}
    for k, corner in enumerate(np.array(corners, dtype=float)):
        own = (np.abs(inside - corner - 0.5) < 0.5).all(axis=1)
        regions[f"body{k}"] = np.flatnonzero((np.abs(centre - corner - 0.5) < 0.5).all(axis=1))
        for side, axis, value in (("left", 0, 0), ("right", 0, 1), ("bottom", 1, 0), ("top", 1, 1)):
            there = np.abs(middle[:, axis] - corner[axis] - value) < 1e-9
            named[f"{side}{k}"] = facets[own & there]
    return from_mesh(mesh, named, 2.0, regions)
