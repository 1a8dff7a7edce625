"""Measured rigid surfaces: heights over a line or a plane, and triangles of an STL file."""

from __future__ import annotations

import math
from dataclasses import field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from contact.arguments import expect, naming, one_of
from contact.errors import InputError
from contact.model.data import read_data
from contact.model.obstacle.shapes import NAME, Shape
from contact.model.section import File, as_given, as_tuple, described
from contact.settings import MISSING, Accepted, Internal, Number, Positive, Switch, fault
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array


@described(eq=False)
class Heights(Shape):
    """A body below, or above, heights along the last axis, smooth between them (cubic splines).

    Beyond the outermost points the surface goes on level; a warning tells of contact there.
    Distances are those along the last axis times the cosine of the slope: exact on the surface, and
    nearly so close to it; along an axis or the body's normals gaps are exact.
    """

    places: Internal[Annotated[tuple[Array, ...], as_tuple]] = ()
    """Coordinates of the points along the other axes, ascending: shape (n,) in the plane, and
    (n,), (m,) in 3-D."""
    heights: Internal[Array | None] = None
    """Shape (n,), or (n, m). Instead of both a file:"""
    above: Switch = False
    """Whether the rigid body lies above the heights, and the elastic one below."""
    file: Annotated[
        File | None, Accepted("a CSV file, or a .npy file with an array of heights")
    ] = None
    """CSV file with a row of names and the columns x, y (3-D: x, y, z, at all points of a
    grid); or a NumPy array of heights, an image for instance. Relative to the case file. A
    warning tells the share of the contact that lies beyond them."""
    spacing: Annotated[
        Annotated[tuple[Positive, ...], as_tuple] | None,
        Accepted("distances > 0, one per direction of the array"),
    ] = None
    """Distances of the points of an array: along its first axis, which is x, and in 3-D along
    its second, y. Required for an array."""
    origin: Annotated[
        Annotated[tuple[Number, ...], as_tuple] | None,
        Accepted("numbers, one per direction of the array"),
    ] = None
    """Place of the first point of an array. Default: zeros."""
    shape: Annotated[Literal["heights"], NAME] = field(default="heights", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse heights that are given in no way, or in two; and those that are no grid."""
        if one_of("Heights", heights=self.heights, file=self.file) is None:
            raise fault("file", MISSING, "a file, or in Python places and heights")
        for key in ("spacing", "origin"):
            accepted = "that of a .npy file alone: the rows of a CSV file have their places"
            fits = getattr(self, key) is None or (self.file or "").endswith(".npy")
            if not fits:
                raise fault(key, as_given(getattr(self, key)), accepted)
        if self.heights is not None:
            self._check(self.places, self.heights)

    @staticmethod
    def _check(places: tuple[Array, ...], heights: Array) -> None:
        sizes, words = tuple(map(np.size, places)), "two places or more a direction"
        expect("Heights: places", sizes, words, len(sizes) in (1, 2) and min(sizes) > 1)
        rising = all(np.all(np.diff(axis) > 0) for axis in places)
        expect("Heights: places", "others", "ascending numbers", rising)
        shape = np.shape(heights)
        expect("Heights: heights", f"the shape {shape}", f"{sizes}", shape == sizes)
        known = bool(np.isfinite(heights).all())
        expect("Heights: heights", "some that are no numbers", "a number at each place", known)

    def check(self, dim: int) -> None:
        """Refuse heights in another dimension, too."""
        super().check(dim)
        expect("Heights: dimension", dim, f"{len(self.grid[0]) + 1}", len(self.grid[0]) == dim - 1)

    @cached_property
    def grid(self) -> tuple[tuple[Array, ...], Array]:
        """The places and the heights; those of a file are read."""
        if self.heights is not None:
            return self.places, self.heights
        assert self.file is not None
        given = self._array(self.file) if self.file.endswith(".npy") else _columns(self.file)
        with naming(self.file):
            self._check(*given)
        return given

    def _array(self, file: str) -> tuple[tuple[Array, ...], Array]:
        """Return places and heights of an array."""
        try:
            heights = np.asarray(np.load(file), dtype=float)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(
                f"{file}: {error}; accepted: a NumPy array of heights", "heights"
            ) from None
        spacing, origin = self.spacing or (), self.origin or (0.0,) * heights.ndim
        one = f"{heights.ndim} numbers, one per direction of the array"
        for key, given in (("spacing", spacing), ("origin", origin)):
            expect(f"Heights: {key}", given, one, len(given) == heights.ndim)
        steps = zip(origin, spacing, heights.shape, strict=True)
        return tuple(first + step * np.arange(n) for first, step, n in steps), heights

    @cached_property
    def _spline(self) -> Any:
        from scipy import interpolate

        places, heights = self.grid
        degrees = [min(3, axis.size - 1) for axis in places]  # cubic, of few points less
        if len(places) == 1:
            return interpolate.make_interp_spline(*places, heights, degrees[0])
        kx, ky = degrees
        return interpolate.RectBivariateSpline(*places, heights, kx=kx, ky=ky)

    def _surface(self, points: Array) -> tuple[Array, Array]:
        """Return heights, (n,), and their slopes, (n, d - 1), below points."""
        across = points[:, :-1].T
        places = self.grid[0]
        least, most = (np.array([axis[end] for axis in places]) for end in (0, -1))
        inside = np.clip(across, least[:, None], most[:, None])
        beyond = inside != across
        if len(places) == 1:
            height = self._spline(inside[0])
            slopes = [self._spline(inside[0], 1)]
        else:
            height = self._spline.ev(*inside)
            slopes = [self._spline.ev(*inside, dx=1), self._spline.ev(*inside, dy=1)]
        return height, np.where(beyond, 0.0, slopes).T

    def beyond(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points lie beyond the last places, more than half a spacing, shape (n,)."""
        half = 0.5 + NEGLIGIBLE  # an image has its places in the middle of its pixels
        least = [axis[0] - half * (axis[1] - axis[0]) for axis in self.grid[0]]
        most = [axis[-1] + half * (axis[-1] - axis[-2]) for axis in self.grid[0]]
        across = points[:, :-1]
        return np.asarray(np.any((across < least) | (across > most), axis=1))

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        height, slope = self._surface(points)
        normal = np.column_stack([-slope, np.ones(len(points))])
        length = np.linalg.norm(normal, axis=1)
        side = -1.0 if self.above else 1.0
        return side * (points[:, -1] - height) / length, side * normal / length[:, None]


def _columns(file: str) -> tuple[tuple[Array, ...], Array]:
    """Return places and heights of a file with columns."""
    columns = read_data(file)
    names = [name for name in "xyz" if name in columns]
    accepted = "columns x, y in the plane, x, y, z in 3-D"
    expect(file, f"columns {', '.join(columns)}", accepted, len(names) > 1)
    *across, heights = (columns[name] for name in names)
    places, at = zip(*(np.unique(x, return_inverse=True) for x in across), strict=True)
    shape = tuple(axis.size for axis in places)
    made = f"the grid of {' by '.join(map(str, shape))} points that their coordinates make"
    said = f"{len(heights)} points" if math.prod(shape) > 4 * len(heights) else ""  # scattered
    if not said:
        grid, count = np.zeros(shape), np.zeros(shape, dtype=int)
        grid[at] = heights
        np.add.at(count, at, 1)
        wrong = [*np.argwhere(count > 1), *np.argwhere(count == 0)]
        if not wrong:
            return places, grid
        where = ", ".join(f"{axis[k]:g}" for axis, k in zip(places, wrong[0], strict=True))
        twice = count[tuple(wrong[0])] > 1
        said = f"({where}) stands twice," if twice else f"no height at ({where}),"
    raise InputError(f"{file}: {said} of {made}; accepted: each point of a grid once", "heights")


@described(eq=False)
class Triangles(Shape):
    """A surface of triangles whose normals point towards the body; closed or not.

    The sign of the distance is that of the side of an angle-weighted pseudonormal (Baerentzen and
    Aanaes, IEEE Trans. Vis. Comput. Graph. 11 (2005) 243).
    """

    only = 3

    corners: Internal[Array | None] = None
    """Shape (m, 3, 3), none degenerate. Or a file:"""
    file: Annotated[File | None, Accepted("an STL file")] = None
    """STL file, binary or text, its normals towards the body. Relative to the case file."""
    shape: Annotated[Literal["surface"], NAME] = field(default="surface", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse a surface that is given in no way, or in two."""
        if one_of("Triangles", corners=self.corners, file=self.file) is None:
            raise fault("file", MISSING, "an STL file, or in Python corners")

    @cached_property
    def _polydata(self) -> Any:
        """The surface as a pyvista.PolyData of triangles, each vertex once."""
        import pyvista

        if self.corners is None:
            assert self.file is not None  # one of both
            made = read_stl(self.file)
        else:
            corners = self.corners.reshape(-1, 3).astype(np.float64)
            vertex = np.arange(len(corners)).reshape(-1, 3)
            made = pyvista.PolyData.from_regular_faces(corners, vertex)
        # STL has single precision.
        made = made.clean(tolerance=np.abs(made.points).max() / 2**20, absolute=True)
        a, b, c = made.points[made.regular_faces].swapaxes(0, 1)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        longest = np.linalg.norm([b - a, c - b, a - c], axis=2).max(axis=0)
        faces = made.regular_faces[area > 1e-10 * longest**2]
        return pyvista.PolyData.from_regular_faces(made.points, faces)

    @property
    def triangles(self) -> Array:
        """The corners, shape (m, 3, 3)."""
        return np.asarray(self._polydata.points[self._polydata.regular_faces])

    def check(self, dim: int) -> None:
        """Refuse neighbours whose normals point to different sides, too.

        Each of their edges is then run along twice in one direction, and never in the other.
        """
        super().check(dim)
        vertex = self._polydata.regular_faces
        ends = np.stack([vertex, np.roll(vertex, -1, axis=1)], axis=2).reshape(-1, 2)
        _, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
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
        from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

        implicit = vtkImplicitPolyDataDistance()
        implicit.SetInput(self._polydata)
        return implicit

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals: towards the nearest point, on it the pseudonormal."""
        distance, normal = self._signed(points)
        size = np.abs(self._polydata.points).max()
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


def read_stl(path: str | Path) -> Any:
    """Return the triangles of an STL file as pyvista.PolyData in double precision."""
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    if not Path(path).is_file():
        raise InputError(f"{path}: no such file; accepted: an STL file", "stl")
    reader = pyvista.STLReader(path)
    verbosity = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # the messages below say it in a line
    with pyvista.VtkErrorCatcher(send_to_logging=False):
        surface = reader.read()
    vtkLogger.SetStderrVerbosity(verbosity)
    if surface.n_cells == 0 or np.ptp(surface.points) == 0:
        raise InputError(f"{path}: no triangles; accepted: an STL file, binary or text", "stl")
    surface.points = surface.points.astype(np.float64)
    if not np.isfinite(surface.points).all():
        raise InputError(f"{path}: coordinates that are no numbers; accepted: an STL file", "stl")
    return surface
