"""Cuts through a body with a jump of the displacement across them: pretension sections of bolts.

Across a cut the displacement jumps by a shortening s, as a nut is turned. Nodal unknowns are those
of the continuous part u; the displacement is u - s psi n with psi = 1 at the nodes of the cut, seen
from the side to which n points, and 0 at all others. That is a mesh with double nodes at the cut
and u+ - u- = -s n. s is a global unknown, dual to the section force N = int sigma : eps(-psi n):
given, or free under a given force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem, la
from dolfinx.la import InsertMode
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.description import Body
from contact.body.global_unknowns import GlobalUnknowns
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cell_facets, distributed_components
from contact.mesh.parts import members
from contact.model.body import Bolt
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array


@dataclass(frozen=True)
class Pieces:
    """The connected components between cuts of free shortenings, and the nodes at these cuts.

    Attributes
    ----------
    places
        Columns of these shortenings in q, shape (k,).
    component, count
        The component of each owned node, at a cut that below it, and the number of components.
    points
        Nodes of this rank at the cuts, once for each component above, shape (n, d).
    below, above
        The components on both sides there, shape (n,).
    normals
        Displacement of the one below relative to that above, by unit shortenings, shape (n, d, k).
    """

    places: list[int]
    component: Indices
    count: int
    points: Array
    below: Indices
    above: Indices
    normals: Array


class Cuts:
    """The jumps of a body's displacement.

    Parameters
    ----------
    domain, space
        Mesh, and space of the unknowns.
    places
        Columns of the shortenings in q, shape (k,).
    body
        Description of the body, whose bolts are the cuts.

    Attributes
    ----------
    places, parts
        Columns of q, and names of the cuts.
    directions
        The functions -psi n, discontinuous, of unit shortenings.
    jump, secant_jump
        The jumps of the unknowns `at` and `secant_at` of `contact.body.assembly`.
    """

    def __init__(
        self,
        domain: Domain,
        space: fem.FunctionSpace,
        places: Sequence[int],
        body: Body,
    ) -> None:
        degree = space.ufl_element().embedded_superdegree
        whole = fem.functionspace(domain.mesh, ("DG", degree, (domain.dim,)))
        self.places, self._comm = list(places), domain.comm
        self.parts = [bolt.on for bolt in body.bolts]
        found = [_direction(domain, space, whole, part) for part in self.parts]
        self.directions = [direction for direction, _, _, _ in found]
        self._ends = [(nodes, normal) for _, nodes, normal, _ in found]
        self._space, self._moved = space, [moved for _, _, _, moved in found]
        self._free = [k for k, bolt in enumerate(body.bolts) if bolt.shortening is None]
        self.jump, self.secant_jump = fem.Function(whole), fem.Function(whole)

    @staticmethod
    def of(
        domain: Domain, space: fem.FunctionSpace, unknowns: GlobalUnknowns, body: Body
    ) -> Cuts | None:
        """Return the cuts of a body; None without any. Collective."""
        places = [m.begin for m in unknowns.members if isinstance(m.description, Bolt)]
        return Cuts(domain, space, places, body) if places else None

    @cached_property
    def pieces(self) -> Pieces | None:
        """The components between cuts under given forces; None without any. Collective.

        A node at a cut stands for two, of which one moves with the cells above.
        """
        if not self._free:
            return None
        space, index_map = self._space, self._space.dofmap.index_map
        size = index_map.size_local + index_map.num_ghosts
        by = np.stack([self._moved[k].ravel() for k in self._free], axis=1)
        cells, at = space.dofmap.list.copy(), np.flatnonzero(by.any(axis=1))
        rows = np.column_stack([cells.ravel()[at], by[at]])
        doubles, of = np.unique(rows, axis=0, return_inverse=True)
        cells.ravel()[at] = size + of.ravel()
        nodes, moved = doubles[:, 0].astype(np.int32), doubles[:, 1:]
        keys = np.column_stack([index_map.local_to_global(nodes), moved])
        labels, count = distributed_components(space, cells, keys)
        normals = np.stack([self._ends[k][1] for k in self._free], axis=1)
        return Pieces(
            [self.places[k] for k in self._free],
            labels[: index_map.size_local],
            count,
            space.tabulate_dof_coordinates()[nodes, : len(normals)],
            labels[nodes],
            labels[size:],
            moved[:, None, :] * normals,
        )

    def check(self, nodes: NDArray[np.int32], along: Array, text: str) -> None:
        """Refuse a constraint across a cut, where the displacement is that of one side. Collective.

        Parameters
        ----------
        nodes, along, text
            Owned nodes, shape (n,), constrained directions there, shape (n, d, k), and words for
            the message.
        """
        for part, (ends, normal) in zip(self.parts, self._ends, strict=True):
            here = np.einsum("nik,i->nk", along[np.isin(nodes, ends)], normal)
            if self._comm.allreduce(float(np.abs(here).max(initial=0.0)), op=MPI.MAX) > NEGLIGIBLE:
                raise InputError(
                    f"bolt on {part!r}: {text} nodes of the cut along its normal; accepted: parts "
                    "that end a row of cells before the cut, or act along it",
                    "bolt-held",
                )

    def set(self, into: fem.Function, q: Array) -> None:
        """Put the jumps of global unknowns into a function."""
        into.x.array[:] = 0.0
        for place, direction in zip(self.places, self.directions, strict=True):
            into.x.array[:] += q[place] * direction.x.array


def _direction(
    domain: Domain, space: fem.FunctionSpace, whole: fem.FunctionSpace, part: str
) -> tuple[fem.Function, NDArray[np.int32], Array, NDArray[np.bool_]]:
    """Return -psi n of a cut, its owned nodes, n, and moved nodes by cell (mask). Collective."""
    mesh, d, comm = domain.mesh, domain.dim, domain.comm
    facets = domain.facets_anywhere(part)
    if not all(name in domain.inside for name in members(part)):
        raise InputError(
            f"bolt on {part!r}: it is on the boundary; accepted: a part inside", "bolt"
        )
    corners = np.zeros((0, d, d))
    if facets.size:  # which dolfinx divides by
        corners = mesh.geometry.x[entities_to_geometry(mesh, d - 1, facets)][:, :d, :d]
    every = np.concatenate(comm.allgather(corners))
    points = every.reshape(-1, d)
    middle = points.mean(axis=0)
    spread, axes = np.linalg.eigh((points - middle).T @ (points - middle))
    normal = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    if spread[0] > (1e-6 * domain.size) ** 2 * len(points):
        raise InputError(
            f"bolt on {part!r}: the cut is not plane; accepted: facets in one plane", "bolt"
        )
    nodes = fem.locate_dofs_topological(space, d - 1, facets)
    flags = la.vector(space.dofmap.index_map)
    flags.array[nodes] = 1.0
    flags.scatter_reverse(InsertMode.add)
    flags.scatter_forward()
    cells = space.dofmap.list
    touches = flags.array[cells] > 0
    count = np.arange(len(cells), dtype=np.int32)
    midpoints = compute_midpoints(mesh, d, count)[:, :d] if count.size else np.zeros((0, d))
    above = (midpoints - middle) @ normal > 0
    _check_through(domain, part, facets, touches.any(axis=1), above)
    made, moved = fem.Function(whole), touches & above[:, None]
    made.x.array.reshape(-1, d)[whole.dofmap.list[moved]] = -normal
    own = np.flatnonzero(flags.array[: space.dofmap.index_map.size_local] > 0)
    return made, own.astype(np.int32), normal, moved


def _check_through(
    domain: Domain,
    part: str,
    facets: NDArray[np.int32],
    touches: NDArray[np.bool_],
    above: NDArray[np.bool_],
) -> None:
    """Refuse a cut that ends within the body: its sides are joined beside it. Collective."""
    mesh, d = domain.mesh, domain.dim
    of_cells = cell_facets(mesh)
    sides = la.vector(mesh.topology.index_map(d - 1), 2)
    met = sides.array.reshape(-1, 2)
    for side, those in enumerate((touches & above, touches & ~above)):
        np.add.at(met[:, side], of_cells[those], 1.0)
    sides.scatter_reverse(InsertMode.add)
    joined = np.flatnonzero((met[: mesh.topology.index_map(d - 1).size_local] > 0).all(axis=1))
    if domain.comm.allreduce(bool(np.setdiff1d(joined, facets).size), op=MPI.LOR):
        raise InputError(
            f"bolt on {part!r}: the cut ends within the body; accepted: all facets of a section",
            "bolt",
        )
