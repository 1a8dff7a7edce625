"""A mesh with names: parts of its boundary and regions of its cells, and measures over them.

Each name stands for one set of indices, so that parts, and regions, may overlap (the side
``top`` and a piece ``loaded`` of it). Of a body of revolution the mesh is the half plane, x the
radius and y the axis.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact import _compat
from contact.errors import InputError, nearest
from contact.mesh.cells import SHAPES, shape_of
from contact.mesh.entities import Indices, combinations, extent, exterior_facets
from contact.typing import Array
from forms.kinematics import CARTESIAN, Axisymmetric, Kinematics

PART_ACCEPTED = "the name of a part, or a list of names"


class Together(str):
    """The name of several parts together: their names with + between, one word in tables."""

    __slots__ = ("members",)

    members: tuple[str, ...]  #: the parts

    def __new__(cls, members: Iterable[str]) -> Together:
        """Join names."""
        names = tuple(members)
        made = super().__new__(cls, "+".join(names))
        made.members = names
        return made

    def __getnewargs__(self) -> tuple[tuple[str, ...]]:  # type: ignore[override]
        """Return the names, of which copies are made: a text alone does not say where one ends."""
        return (self.members,)


def part_name(given: str | Sequence[str]) -> str:
    """Return the name of a part, or of several together, of a name or a list of names."""
    names = [given] if isinstance(given, str) else given
    named = isinstance(names, list | tuple) and all(isinstance(n, str) and n for n in names)
    if not named or not names:
        raise InputError(f"given {given!r}; accepted: {PART_ACCEPTED}", "value")
    different = list(dict.fromkeys(names))
    return different[0] if len(different) == 1 else Together(different)


def members(name: str) -> tuple[str, ...]:
    """Return the parts that a name stands for."""
    return name.members if isinstance(name, Together) else (name,)


def meet(one: str, other: str) -> bool:
    """Tell whether two names have a part in common."""
    return not set(members(one)).isdisjoint(members(other))


def disjoint_pieces(
    comm: MPI.Intracomm, count: int, parts: Iterable[Indices]
) -> list[tuple[tuple[int, ...], Indices]]:
    """Divide facets 0, ..., count - 1 into pieces: positions of parts, facets in exactly these."""
    # Collective: all ranks have the same pieces in the same order, some without facets.
    numbers, combined = combinations(count, parts)
    own = {combined[k]: np.flatnonzero(numbers == k).astype(np.int32) for k in np.unique(numbers)}
    there = sorted(set().union(*comm.allgather(tuple(own))) - {()})
    return [(found, own.get(found, np.empty(0, dtype=np.int32))) for found in there]


def known_name(kind: str, name: str, names: Mapping[str, Indices]) -> str:
    """Return a name, or raise an InputError with the nearest one and all names."""
    if name in names:
        return name
    hint = nearest(str(name), names, "; did you mean '{}'?")
    raise InputError(
        f"the mesh has no {kind} {name!r}{hint} (its {kind}s: {', '.join(sorted(names))})",
        "part-name",
    )


@dataclass(frozen=True)
class ExtendedMeasure:
    """A measure of UFL over a half plane, times the extent of the body there."""

    ufl_measure: ufl.Measure  #: dx or ds of the mesh
    extent: Expr  #: 2 pi r, the length of the ring through a point

    def __call__(self, *arguments: Any, **settings: Any) -> ExtendedMeasure:
        """Return the measure with a subdomain or metadata of its own."""
        return ExtendedMeasure(self.ufl_measure(*arguments, **settings), self.extent)

    def __rmul__(self, integrand: Any) -> ufl.Form:
        """Return the integral over the whole body."""
        return (self.extent * integrand) * self.ufl_measure


#: Measure of a body or of a part of its boundary.
Measure: TypeAlias = ufl.Measure | ExtendedMeasure


def compiled(form: ufl.Form) -> fem.Form:
    """Compile a form of one domain's measures, its subdomains renumbered from 0. Collective."""
    # UFL's signature of a form, by which FFCx finds compiled code, contains the numbers of
    # subdomains: an integrand on another part would be compiled again.
    everywhere, subdomains = [], defaultdict(list)
    for integral in form.integrals():
        numbers = integral.subdomain_id()
        if numbers == "everywhere":
            everywhere.append(integral)
            continue
        for number in numbers if isinstance(numbers, tuple) else (numbers,):
            subdomains[integral.integral_type(), number].append(integral)
    groups: dict[Any, tuple[list[ufl.Integral], list[Indices]]] = {}
    for (kind, number), own in sorted(subdomains.items(), key=lambda item: item[0]):
        same = kind, *((one.integrand(), repr(one.metadata())) for one in own)
        entities = dict(own[0].subdomain_data())[number]
        groups.setdefault(same, (own, []))[1].append(entities)
    # One object a kind of integrals, as dolfinx demands.
    data: dict[str, list[tuple[int, Indices]]] = defaultdict(list)
    made = [one.reconstruct(subdomain_data=data[one.integral_type()]) for one in everywhere]
    for (kind, *_), (own, entities) in groups.items():
        number = len(data[kind])
        made += [one.reconstruct(subdomain_id=number, subdomain_data=data[kind]) for one in own]
        data[kind].append((number, np.concatenate(entities)))
    return fem.form(ufl.Form(made))


#: The region of a mesh without named regions.
BODY = "body"

#: Uses of facets inside of the body.
UNLESS = (
    ", unless components of its displacement or its potential are given, it is an electrode, or a "
    "bolt is cut there"
)


#: Function of x, shape (3, n), that is true at places, shape (n,).
Marker: TypeAlias = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class Domain:
    """A mesh with named parts and regions, made by the functions of `contact.mesh`.

    Attributes
    ----------
    mesh
        Mesh of cells of one of `contact.mesh.cells.SHAPES`, straight or of second order; a
        `dolfinx.mesh.Mesh`.
    parts
        Name of a part of the boundary -> its facets that this rank owns. The same names in the
        same order on all ranks.
    regions
        Name of a region -> its cells that this rank owns, likewise. Each mesh has one at least.
    size
        Largest extent of the bounding box of the whole mesh (of a generated one: before its
        rotation, so that lengths derived from it do not depend on the rotation).
    levels
        Number of uniform refinements: 2**levels edges of the boundary are one straight edge of the
        first mesh, whose vertices alone lie on a curved boundary.
    unusable
        Name of a group of facets that cannot be a part -> the reason.
    notes
        Notes on the source of the mesh, one sentence each.
    revolved
        Whether the mesh is the half plane of a body of revolution, x the radius and y the axis.
        Measures are then those of the whole body.
    inside
        Name of a group of facets inside of the body -> those that this rank owns. They may be
        fixed, or electrodes, and are unusable otherwise.
    space
        Keys of ``[space]`` of a new case by the elements of a mesh file: degree, kinematics.
    """

    mesh: dmesh.Mesh
    parts: Mapping[str, Indices]
    regions: Mapping[str, Indices]
    size: float
    levels: int = 0
    unusable: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    revolved: bool = False
    inside: Mapping[str, Indices] = field(default_factory=dict)
    space: Mapping[str, int | str] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Return the names, not the facets of each part."""
        names = f"parts {', '.join(self.parts) or 'none'}; regions {', '.join(self.regions)}"
        return f"<Domain: {self.mesh.topology.index_map(self.dim).size_global} cells; {names}>"

    @staticmethod
    def from_mesh(
        mesh: dmesh.Mesh,
        facet_tags: dmesh.MeshTags,
        names: Mapping[str, int | Sequence[int]],
        cell_tags: dmesh.MeshTags | None = None,
        regions: Mapping[str, int | Sequence[int]] | None = None,
        inside: Mapping[str, int | Sequence[int]] | None = None,
    ) -> Domain:
        """Name parts of a dolfinx mesh by its tags. Collective.

        Parameters
        ----------
        mesh
            Triangles, quadrilaterals, tetrahedra or hexahedra, straight or of second order.
        facet_tags
            Tags of facets, for instance those that dolfinx reads from Gmsh.
        names
            Name of a part -> its tag, or several.
        cell_tags, regions
            Likewise of the regions; by default there is one, ``body``.
        inside
            As `names`, of facets inside of the body: cuts of bolts, electrodes, supports.

        Returns
        -------
        The domain; the mesh is not copied.

        Raises
        ------
        InputError
            As `contact.mesh.domain.from_mesh`, which takes functions of position instead.
        """
        cells = {} if cell_tags is None else regions
        parts, within, chosen = (
            {name: _tagged(tags, tag) for name, tag in (given or {}).items()}
            for tags, given in ((facet_tags, names), (facet_tags, inside), (cell_tags, cells))
        )
        return from_mesh(mesh, parts, regions=chosen, inside=within)

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the ranks of the mesh."""
        return _compat.lasting(self.mesh.comm)

    @property
    def dim(self) -> int:
        """Space dimension, 2 or 3."""
        return self.mesh.geometry.dim

    @property
    def order(self) -> int:
        """Degree of the geometry of the cells, 1 or 2: 1 for straight edges."""
        return _compat.geometry_degree(self.mesh)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of parts and unusable groups."""
        return (*self.parts, *self.unusable)

    def facets(self, name: str) -> Indices:
        """Local indices of the facets of a part that this rank owns, ascending.

        Parameters
        ----------
        name
            Name of the part; several may stand `parts.Together`.

        Returns
        -------
        The indices, shape (n,), of type int32.

        Raises
        ------
        InputError
            If there is no such part; the message names the nearest one and lists all.
        """
        for one in members(name):
            if one in self.unusable:
                raise InputError(self.unusable[one], "part-facets")
        return self.facets_anywhere(name)

    def facets_anywhere(self, name: str) -> Indices:
        """Return the facets of a part, on the boundary or inside of the body; as `facets`."""
        names = {**self.parts, **self.inside}
        for one in members(name):
            if one in self.unusable and one not in self.inside:
                raise InputError(self.unusable[one], "part-facets")
        found = [names[known_name("part", one, names)] for one in members(name)]
        return found[0] if len(found) == 1 else np.unique(np.concatenate(found))

    def cells(self, name: str) -> Indices:
        """Local indices of the cells of a region that this rank owns, ascending.

        Parameters
        ----------
        name
            Name of the region.

        Returns
        -------
        The indices, shape (n,), of type int32.

        Raises
        ------
        InputError
            If there is no such region, likewise.
        """
        return self.regions[known_name("region", name, self.regions)]

    @property
    def kinematics(self) -> Kinematics:
        """Gradient of displacements, in a plane, in 3-D or of a body of revolution."""
        return Axisymmetric() if self.revolved else CARTESIAN

    def ds(self, name: str) -> Measure:
        """Measure over the facets of a part. Collective.

        Parameters
        ----------
        name
            Name of the part.

        Returns
        -------
        The `ufl.Measure`; of a body of revolution one over the full turn.

        Raises
        ------
        InputError
            If there is no such part, as `facets`.
        """
        self.facets(name)
        every = list(self.parts)
        wanted = {every.index(one) for one in members(name)}
        found = tuple(i for i, (within, _) in enumerate(self._pieces) if wanted & {*within})
        ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=self._facet_data)
        return self._extended(ds(found))

    @property
    def dx(self) -> Measure:
        """Measure over all cells."""
        return self._extended(ufl.Measure("dx", domain=self.mesh, subdomain_data=self._cell_data))

    def _extended(self, ufl_measure: ufl.Measure) -> Measure:
        extent = self.kinematics.extent(ufl.SpatialCoordinate(self.mesh))
        return ufl_measure if extent is None else ExtendedMeasure(ufl_measure, extent)

    def resultant(self, vector: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return a resultant force, shape (..., d), without the radial one of a full turn: 0."""
        return np.where([self.revolved, *[False] * (self.dim - 1)], 0.0, vector)

    def dx_in(self, name: str) -> Measure:
        """Measure over the cells of region ``name``; raises as `cells`."""
        self.cells(name)
        return self.dx(list(self.regions).index(name))

    def dx_over(self, cells: Indices) -> Measure:
        """Measure over some owned cells, for forms with no other cell integrals."""
        data = [(0, cells)]
        return self._extended(ufl.Measure("dx", domain=self.mesh, subdomain_data=data)(0))

    # The integrals of a form must share one object of subdomain data for each kind of integral;
    # parts may overlap, their disjoint pieces do not.

    @cached_property
    def _pieces(self) -> list[tuple[tuple[int, ...], Indices]]:
        count = self.mesh.topology.index_map(self.dim - 1).size_local
        return disjoint_pieces(self.comm, count, self.parts.values())

    @cached_property
    def _facet_data(self) -> list[tuple[int, Indices]]:
        facets = (facets for _, facets in self._pieces)
        return [(i, _compat.facet_entities(self.mesh, piece)) for i, piece in enumerate(facets)]

    @cached_property
    def _cell_data(self) -> list[tuple[int, Indices]]:
        return list(enumerate(self.regions.values()))


def from_mesh(
    mesh: dmesh.Mesh,
    parts: Mapping[str, Marker | npt.NDArray[np.integer[Any]]],
    size: float | None = None,
    regions: Mapping[str, Marker | npt.NDArray[np.integer[Any]]] | None = None,
    inside: Mapping[str, Marker | npt.NDArray[np.integer[Any]]] | None = None,
) -> Domain:
    """Name parts of the boundary, and regions, of a dolfinx mesh. Collective.

    Parameters
    ----------
    mesh
        Triangles, quadrilaterals, tetrahedra or hexahedra, straight or of second order.
    parts
        Name -> function of x, shape (3, n), that is true at all vertices of the part's facets;
        or the local indices of the facets. The same names on all ranks.
    size
        Largest extent of the body; by default that of its bounding box.
    regions
        Name -> the like for cells; by default one region, ``body``.
    inside
        Name -> the like for facets inside of the body, which may be fixed, or electrodes.

    Raises
    ------
    InputError
        For other meshes, an empty part or region, or an interior facet in a part.
    """
    tdim = mesh.topology.dim
    flat = tdim == mesh.geometry.dim and _compat.geometry_degree(mesh) in (1, 2)
    if shape_of(mesh) not in SHAPES or not flat:
        raise InputError(
            "the mesh must consist of triangles or quadrilaterals in the plane, or of tetrahedra "
            "or hexahedra, with a geometry of degree 1 or 2",
            "cell-kinds",
        )
    boundary = exterior_facets(mesh)
    chosen = {name: _owned(mesh, tdim - 1, given) for name, given in parts.items()}
    for name, facets in chosen.items():
        wrong = int(np.count_nonzero(~np.isin(facets, boundary)))
        if _compat.lasting(mesh.comm).allreduce(wrong) > 0:
            raise InputError(
                f"the part {name!r} contains interior facets of the mesh; accepted: facets of the "
                "boundary, or the name among inside={...}",
                "part-facets",
            )
    cells = {name: _owned(mesh, tdim, given) for name, given in (regions or {}).items()}
    within = {name: facets_inside(mesh, given) for name, given in (inside or {}).items()}
    return with_further_names(with_names(mesh, chosen, cells, size), within, {})


def facets_inside(mesh: dmesh.Mesh, given: Marker | npt.NDArray[np.integer[Any]]) -> Indices:
    """Return the owned facets inside of the body among given ones, ascending."""
    dim = mesh.topology.dim - 1
    found = dmesh.locate_entities(mesh, dim, given) if callable(given) else given
    return np.setdiff1d(_owned(mesh, dim, found), exterior_facets(mesh)).astype(np.int32)


def cells_in(mesh: dmesh.Mesh, marker: Marker) -> Indices:
    """Return the owned cells in whose middles a function of x is true, ascending."""
    dim = mesh.topology.dim
    cells = np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)
    if not cells.size:  # dolfinx divides by their number
        return cells
    return cells[marker(dmesh.compute_midpoints(mesh, dim, cells).T)]


def with_further_names(
    domain: Domain, inside: Mapping[str, Indices], regions: Mapping[str, Indices]
) -> Domain:
    """Add names of owned facets inside of the body, and of cells, none empty. Collective."""
    for name, own in (*inside.items(), *regions.items()):
        if domain.comm.allreduce(own.size, op=MPI.SUM) == 0:
            entity = "facet inside of the body" if name in inside else "cell"
            raise InputError(f"{name!r} contains no {entity}", "part-facets")
    reason = "the part {!r} lies inside of the body; a part must lie on its boundary" + UNLESS
    return replace(
        domain,
        inside={**domain.inside, **inside},
        unusable={**domain.unusable, **{name: reason.format(name) for name in inside}},
        regions={**domain.regions, **regions},
    )


def _tagged(tags: dmesh.MeshTags, wanted: int | Sequence[int]) -> Indices:
    """Return the entities with one of some tags, ascending."""
    return np.asarray(tags.indices[np.isin(tags.values, wanted)], dtype=np.int32)


def _owned(mesh: dmesh.Mesh, dim: int, given: Marker | npt.NDArray[np.integer[Any]]) -> Indices:
    """Return the owned entities among given ones, ascending."""
    if not callable(given):
        entities = np.asarray(given, dtype=np.int32)
    elif dim == mesh.topology.dim:
        entities = dmesh.locate_entities(mesh, dim, given)
    else:
        entities = dmesh.locate_entities_boundary(mesh, dim, given)
    return np.unique(entities[entities < mesh.topology.index_map(dim).size_local])


def with_names(
    mesh: dmesh.Mesh,
    parts: Mapping[str, Indices],
    regions: Mapping[str, Indices],
    size: float | None = None,
) -> Domain:
    """Make a domain of owned exterior facets and cells by name, none empty. Collective."""
    exterior_facets(mesh)
    if not regions:
        count = mesh.topology.index_map(mesh.topology.dim).size_local
        regions = {BODY: np.arange(count, dtype=np.int32)}
    wholes = ("part", "facet of the mesh's boundary", parts), ("region", "cell", regions)
    comm = _compat.lasting(mesh.comm)
    for kind, of_it, sets in wholes:
        counts = comm.allreduce(np.array([s.size for s in sets.values()], dtype=np.int64))
        empty = [name for name, count in zip(sets, counts, strict=True) if count == 0]
        if empty:
            raise InputError(f"the {kind} {empty[0]!r} contains no {of_it}", "part-facets")
    return Domain(mesh, parts, regions, extent(mesh) if size is None else size)


#: Largest distance from the axis, over the size of the body, of nodes on it.
ON_AXIS = 1e-9


def on_axis(domain: Domain, points: Array) -> NDArray[np.bool_]:
    """Return which points, shape (n, 2), lie on the axis of a body of revolution."""
    return np.asarray(np.abs(points[:, 0]) <= ON_AXIS * domain.size)


def revolved(domain: Domain) -> Domain:
    """Return the body of revolution of a half plane, nodes near the axis on it. Collective."""
    if domain.dim != 2:
        raise InputError(
            'space.kinematics: "axisymmetric" with a mesh in 3-D; accepted: a mesh in 2-D, '
            "x the radius and y the axis",
            "axisymmetric",
        )
    radius = domain.mesh.geometry.x[:, 0]
    least = domain.comm.allreduce(float(radius.min(initial=np.inf)), op=MPI.MIN)
    if least < -ON_AXIS * domain.size:
        raise InputError(
            f'space.kinematics: "axisymmetric", and the mesh goes to x = {least:.4g}; accepted: '
            "a mesh with x >= 0, the half plane of the body",
            "axisymmetric",
        )
    radius[on_axis(domain, domain.mesh.geometry.x)] = 0.0
    return replace(domain, revolved=True)
