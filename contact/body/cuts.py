"""Cuts through a body with a jump of the displacement across them: pretension sections of bolts.

Across a cut the displacement jumps by a shortening s: one side is moved towards the other, as a nut
is that is turned. All unknowns of nodes are those of the continuous part u, the displacement is
u - s psi n with psi = 1 at the nodes of the cut, seen from the side to which n points, and 0 at all
others. That is the body of a mesh whose nodes at the cut are doubled, with u+ - u- = -s n, and
needs no other mesh. s is a global unknown, dual to the section force N = int sigma : eps(-psi n):
it is given, or free under a force that is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem, la
from dolfinx.la import InsertMode
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.global_unknowns import GlobalUnknowns
from contact.body.rigid import Bolt
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.entities import cell_facets
from contact.mesh.together import members
from contact.typing import Array


class Cuts:
    """The jumps of a body's displacement.

    Parameters
    ----------
    domain, space
        Mesh, and space of the unknowns.
    places
        Where the shortenings are among the global unknowns, shape (k,).
    parts
        Names of the cuts.

    Attributes
    ----------
    places
        As given.
    directions
        The functions -psi n, discontinuous, of unit shortenings.
    jump, secant_jump
        The jumps of the unknowns `at` and `secant_at` of the weak forms.
    """

    def __init__(
        self,
        domain: Domain,
        space: fem.FunctionSpace,
        places: Sequence[int],
        parts: Sequence[str],
    ) -> None:
        degree = space.ufl_element().embedded_superdegree
        whole = fem.functionspace(domain.mesh, ("DG", degree, (domain.dim,)))
        self.places = list(places)
        self.directions = [_direction(domain, space, whole, part) for part in parts]
        self.jump, self.secant_jump = fem.Function(whole), fem.Function(whole)

    @staticmethod
    def of(domain: Domain, space: fem.FunctionSpace, unknowns: GlobalUnknowns) -> Cuts | None:
        """Return those of a body; None without any. Collective."""
        bolts = [m for m in unknowns.members if isinstance(m.description, Bolt)]
        if not bolts:
            return None
        return Cuts(domain, space, [m.begin for m in bolts], [m.description.on for m in bolts])

    def set(self, into: fem.Function, q: Array) -> None:
        """Put the jumps of global unknowns into a function."""
        into.x.array[:] = 0.0
        for place, direction in zip(self.places, self.directions, strict=True):
            into.x.array[:] += q[place] * direction.x.array


def _direction(
    domain: Domain, space: fem.FunctionSpace, whole: fem.FunctionSpace, part: str
) -> fem.Function:
    """Return -psi n of a cut. Collective.

    Raises
    ------
    InputError
        If the cut is not plane, or ends within the body.
    """
    mesh, d, comm = domain.mesh, domain.dim, domain.comm
    facets = domain.facets_anywhere(part)
    if not all(name in domain.inside for name in members(part)):
        raise InputError(f"bolt on {part!r}: it is on the boundary; accepted: a part inside")
    corners = np.zeros((0, d, d))
    if facets.size:  # which dolfinx divides by
        corners = mesh.geometry.x[entities_to_geometry(mesh, d - 1, facets)][:, :d, :d]
    every = np.concatenate(comm.allgather(corners))
    points = every.reshape(-1, d)
    middle = points.mean(axis=0)
    spread, axes = np.linalg.eigh((points - middle).T @ (points - middle))
    normal = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    if spread[0] > (1e-6 * domain.size) ** 2 * len(points):
        raise InputError(f"bolt on {part!r}: the cut is not plane; accepted: facets in one plane")
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
    return made


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
            f"bolt on {part!r}: the cut ends within the body; accepted: all facets of a section"
        )
