"""A rigid surface of triangles, for instance of an STL file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.errors import InputError
from contact.interface.obstacle.protocol import Shape
from contact.typing import Array

#: Pairs of a point and a triangle that are looked at together: bounds the memory.
PAIRS = 2_000_000


@dataclass(frozen=True, eq=False)
class Triangles(Shape):
    """A surface of triangles whose normals point towards the body; closed or not.

    The sign of the distance is that of the side of an angle-weighted pseudonormal (Baerentzen and
    Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243).

    Parameters
    ----------
    corners
        Shape (m, 3, 3). None is degenerate.
    """

    only = 3

    corners: Array

    def check(self, dim: int) -> None:
        """Refuse neighbours whose normals point to different sides, too.

        Each of their edges is then run along twice in one direction, and never in the other.
        """
        super().check(dim)
        vertex = _numbered(_vertices(self.corners))
        ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2)
        edge = _numbered(ends.min(axis=1) * (vertex.max() + 1) + ends.max(axis=1))
        turns = np.bincount(edge, np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0))
        wrong = np.flatnonzero(np.abs(turns)[edge] > 1)
        if wrong.size:
            x, y, z = self.corners.reshape(-1, 3)[wrong[0]]
            raise InputError(
                f"normals point to both sides of the surface, at ({x:g}, {y:g}, {z:g}) for "
                "instance; accepted: triangles that all have their corners counter-clockwise, "
                "seen from the body"
            )

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.corners.mean(axis=1))

    @cached_property
    def _radius(self) -> Array:
        """Distances of the farthest corners from the middles, shape (m,)."""
        middle = self.corners.mean(axis=1, keepdims=True)
        return np.asarray(np.linalg.norm(self.corners - middle, axis=2).max(axis=1))

    @cached_property
    def _normals(self) -> Array:
        """Pseudonormals of face, edges 01, 12, 20 and corners 0, 1, 2, shape (m, 7, 3)."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        face = np.cross(b - a, c - a)
        face /= np.linalg.norm(face, axis=1)[:, None]
        vertex = _numbered(_vertices(self.corners))
        ends = np.sort(np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2), axis=2)
        edge = _numbered(ends[..., 0] * (vertex.max() + 1) + ends[..., 1])
        along = np.roll(self.corners, -1, axis=1) - self.corners
        along /= np.linalg.norm(along, axis=2)[:, :, None]
        cosine = -np.einsum("mki,mki->mk", along, np.roll(along, 1, axis=1))
        angle = np.arccos(np.clip(cosine, -1, 1))
        shared = _summed(edge, np.repeat(face[:, None], 3, axis=1))
        corner = _summed(vertex, angle[:, :, None] * face[:, None])
        return np.concatenate([face[:, None], shared, corner], axis=1)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals: towards the nearest point, on it the pseudonormal."""
        triangle, nearest, feature = self._closest(points)
        pseudo = self._normals[triangle, feature]
        pseudo = pseudo / np.linalg.norm(pseudo, axis=1)[:, None]
        offset = points - nearest
        size = np.linalg.norm(offset, axis=1)
        sign = np.where(np.einsum("ni,ni->n", offset, pseudo) >= 0, 1.0, -1.0)
        rounding = 1e-9 * np.abs(self.corners).max()
        away = sign[:, None] * offset / np.where(size > rounding, size, 1.0)[:, None]
        return sign * size, np.where((size > rounding)[:, None], away, pseudo)

    def _closest(self, points: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
        """Return the nearest triangle, point on it, and which of its features that is.

        Twice as many middles of triangles are looked at until the next one is too far for its
        triangle to be nearer.
        """
        count, radius = len(self.corners), self._radius
        best = np.full(len(points), np.inf)
        triangle = np.zeros(len(points), dtype=np.intp)
        nearest = np.zeros_like(points)
        feature = np.zeros(len(points), dtype=np.intp)
        left: NDArray[np.intp] = np.arange(len(points))
        seen, k = 0, min(8, count)
        while left.size:
            beyond = np.zeros(left.size)
            for chunk in np.array_split(np.arange(left.size), 1 + left.size * k // PAIRS):
                chosen = left[chunk]
                far, near = self._tree.query(points[chosen], k=range(seen + 1, k + 1))
                beyond[chunk] = far[:, -1]
                row, column = np.nonzero(far - radius[near] < best[chosen, None])
                at, tried = chosen[row], near[row, column]
                where, kind = _nearest_points(points[at], self.corners[tried])
                length = np.linalg.norm(points[at] - where, axis=1)
                # The nearest of each point comes first; a later one has to be nearer still.
                order = np.lexsort((length, at))
                order = order[np.unique(at[order], return_index=True)[1]]
                order = order[length[order] < best[at[order]]]
                to = at[order]
                best[to], triangle[to] = length[order], tried[order]
                nearest[to], feature[to] = where[order], kind[order]
            left = left[beyond < best[left] + radius.max()] if k < count else left[:0]
            seen, k = k, min(2 * k, count)
        return triangle, nearest, feature


def _vertices(corners: Array) -> NDArray[np.int64]:
    """Return a number for the place of each corner, (m, 3): STL has single precision."""
    size = np.abs(corners).max()
    places = np.round((corners / size + 1) * (2**20 - 1)).astype(np.int64)
    return np.asarray(places @ np.array([2**42, 2**21, 1]))


def _numbered(names: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return names as numbers from 0 on."""
    return np.unique(names, return_inverse=True)[1].reshape(names.shape).astype(np.int64)


def _summed(index: NDArray[np.int64], vectors: Array) -> Array:
    """Return for each entry the sum of the vectors of all entries of its index, (m, 3, 3)."""
    total = np.stack(
        [np.bincount(index.ravel(), vectors[..., i].ravel()) for i in range(3)], axis=1
    )
    return np.asarray(total[index])


def _nearest_points(p: Array, corners: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the nearest points of triangles, (n, 3), and the features they lie on, (n,).

    Features are numbered as in `Triangles._normals`. After Ericson, Real-Time Collision Detection
    (2005), section 5.1.5, with all cases at once.
    """
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    ab, ac = b - a, c - a
    d1, d2 = _dot(ab, p - a), _dot(ac, p - a)
    d3, d4 = _dot(ab, p - b), _dot(ac, p - b)
    d5, d6 = _dot(ab, p - c), _dot(ac, p - c)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    bc = d4 - d3, d5 - d6
    cases = [
        (d1 <= 0) & (d2 <= 0),
        (d3 >= 0) & (d4 <= d3),
        (d6 >= 0) & (d5 <= d6),
        (vc <= 0) & (d1 >= 0) & (d3 <= 0),
        (vb <= 0) & (d2 >= 0) & (d6 <= 0),
        (va <= 0) & (bc[0] >= 0) & (bc[1] >= 0),
    ]
    with np.errstate(invalid="ignore", divide="ignore"):
        t, s, r = d1 / (d1 - d3), d2 / (d2 - d6), bc[0] / (bc[0] + bc[1])
        total = va + vb + vc
        zero, one = np.zeros_like(t), np.ones_like(t)
        v = np.select(cases, [zero, one, zero, t, zero, 1 - r], vb / total)
        w = np.select(cases, [zero, zero, one, zero, s, r], vc / total)
    feature = np.select(cases, [4, 5, 6, 1, 3, 2], 0)
    return a + v[..., None] * ab + w[..., None] * ac, feature


def _dot(x: Array, y: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", x, y))


#: Bytes of a binary file before its triangles, and of each triangle.
HEADER, EACH = 84, 50

_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path: str | Path) -> Array:
    """Return the corners of the triangles of an STL file, shape (m, 3, 3), none degenerate.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no triangles.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: an STL file") from None
    corners = _binary(data) if _is_binary(data) else _text(path, data)
    if corners.size and not np.all(np.isfinite(corners)):
        raise InputError(f"{path}: coordinates that are no numbers; accepted: an STL file")
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    corners = corners[area > 1e-10 * longest**2]
    if len(corners) == 0:
        raise InputError(f"{path}: no triangles; accepted: an STL file, binary or text")
    return corners


def _is_binary(data: bytes) -> bool:
    count = int.from_bytes(data[80:84], "little") if len(data) >= HEADER else -1
    return len(data) == HEADER + EACH * count


def _binary(data: bytes) -> Array:
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(data, kind, offset=HEADER)["corners"].astype(np.float64)


def _text(path: Path, data: bytes) -> Array:
    found = _VERTEX.findall(data)
    try:
        numbers = np.array(found, dtype=np.float64)
    except ValueError:
        raise InputError(
            f"{path}: coordinates that are no numbers; accepted: an STL file"
        ) from None
    if len(found) % 3:
        raise InputError(f"{path}: triangles without three corners; accepted: an STL file")
    return numbers.reshape(-1, 3, 3)
