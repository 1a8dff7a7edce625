"""A rigid surface of triangles, for instance of an STL file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from contact.arguments import expect, one_of
from contact.errors import InputError
from contact.model.obstacle.protocol import Shape
from contact.model.values import File
from contact.settings import Accepted, Internal, Required
from contact.typing import Array


@dataclass(frozen=True, eq=False)
class Triangles(Shape):
    """A surface of triangles whose normals point towards the body; closed or not.

    The sign of the distance is that of the side of an angle-weighted pseudonormal (Baerentzen and
    Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243).

    Attributes
    ----------
    corners
        Shape (m, 3, 3), none degenerate. Or a file:
    file
        STL file, binary or text, its normals towards the body. Relative to the case file.
    """

    only = 3

    corners: Annotated[Array | None, Internal()] = None
    file: Annotated[File | None, Accepted("an STL file"), Required()] = None
    shape: Literal["surface"] = field(default="surface", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse a surface that is given in no way, or in two."""
        super().__post_init__()
        given = one_of("Triangles", corners=self.corners, file=self.file)
        expect("Triangles: file", None, "an STL file, or corners", given is not None)

    @cached_property
    def triangles(self) -> Array:
        """The corners, shape (m, 3, 3)."""
        if self.corners is not None:
            return self.corners
        assert self.file is not None  # one of both
        return read_stl(self.file)

    def check(self, dim: int) -> None:
        """Refuse neighbours whose normals point to different sides, too.

        Each of their edges is then run along twice in one direction, and never in the other.
        """
        super().check(dim)
        vertex = _numbered(_vertices(self.triangles))
        ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2)
        edge = _numbered(ends.min(axis=1) * (vertex.max() + 1) + ends.max(axis=1))
        turns = np.bincount(edge, np.where(ends[:, 0] < ends[:, 1], 1.0, -1.0))
        wrong = np.flatnonzero(np.abs(turns)[edge] > 1)
        if wrong.size:
            x, y, z = self.triangles.reshape(-1, 3)[wrong[0]]
            raise InputError(
                f"normals point to both sides of the surface, at ({x:g}, {y:g}, {z:g}) for "
                "instance; accepted: triangles that all have their corners counter-clockwise, "
                "seen from the body",
                "stl-normals",
            )

    @cached_property
    def _implicit(self) -> Any:
        """VTK's signed distance, with angle-weighted pseudonormals at edges and corners."""
        from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
        from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

        corners = self.triangles
        _, first, number = np.unique(
            _vertices(corners).ravel(), return_index=True, return_inverse=True
        )
        points, cells, surface = vtkPoints(), vtkCellArray(), vtkPolyData()
        points.SetData(numpy_to_vtk(corners.reshape(-1, 3)[first], deep=True))
        offsets = 3 * np.arange(len(corners) + 1, dtype=np.int64)
        cells.SetData(*(numpy_to_vtkIdTypeArray(a, deep=True) for a in (offsets, number.ravel())))
        surface.SetPoints(points)
        surface.SetPolys(cells)
        implicit = vtkImplicitPolyDataDistance()
        implicit.SetInput(surface)
        return implicit

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals: towards the nearest point, on it the pseudonormal."""
        distance, normal = self._signed(points)
        size = np.abs(self.triangles).max()
        on = np.flatnonzero(np.abs(distance) <= 1e-9 * size)
        # On the surface the nearest point tells no direction, but the slope of the distance does.
        h = 1e-4 * size * np.eye(3)
        beside = [(points[on, None] + x).reshape(-1, 3) for x in (h, -h)]
        ahead, behind = (self._signed(x)[0] for x in beside)
        slope = (ahead - behind).reshape(-1, 3)
        normal[on] = slope / np.linalg.norm(slope, axis=1)[:, None]
        return distance, normal

    def _signed(self, points: Array) -> tuple[Array, Array]:
        """Return distances, and the directions from the nearest points to the side outside."""
        nearest, distance = np.zeros_like(points), np.zeros(len(points))
        place = [0.0, 0.0, 0.0]
        for i, x in enumerate(points):
            distance[i] = self._implicit.EvaluateFunctionAndGetClosestPoint(x, place)
            nearest[i] = place
        return distance, (points - nearest) / np.where(distance == 0, 1.0, distance)[:, None]


def _vertices(corners: Array) -> NDArray[np.int64]:
    """Return a number for the place of each corner, (m, 3): STL has single precision."""
    size = np.abs(corners).max()
    places = np.round((corners / size + 1) * (2**20 - 1)).astype(np.int64)
    return np.asarray(places @ np.array([2**42, 2**21, 1]))


def _numbered(names: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return names as numbers from 0 on."""
    return np.unique(names, return_inverse=True)[1].reshape(names.shape).astype(np.int64)


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
        raise InputError(f"{path}: {error.strerror}; accepted: an STL file", "stl") from None
    count = int.from_bytes(data[80:84], "little") if len(data) >= HEADER else -1
    if len(data) == HEADER + EACH * count:
        kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
        corners = np.frombuffer(data, kind, offset=HEADER)["corners"].astype(np.float64)
    else:
        corners = _text(path, data)
    if corners.size and not np.all(np.isfinite(corners)):
        raise InputError(f"{path}: coordinates that are no numbers; accepted: an STL file", "stl")
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    corners = corners[area > 1e-10 * longest**2]
    if len(corners) == 0:
        raise InputError(f"{path}: no triangles; accepted: an STL file, binary or text", "stl")
    return corners


def _text(path: Path, data: bytes) -> Array:
    found = _VERTEX.findall(data)
    try:
        numbers = np.array(found, dtype=np.float64)
    except ValueError:
        raise InputError(
            f"{path}: coordinates that are no numbers; accepted: an STL file", "stl"
        ) from None
    if len(found) % 3:
        raise InputError(f"{path}: triangles without three corners; accepted: an STL file", "stl")
    return numbers.reshape(-1, 3, 3)
