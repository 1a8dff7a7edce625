"""Global unknowns q: rigid motions, potentials of electrodes, shortenings of bolts.

A rigid body moves by u = N_q q, N_q = [I, -(x - x_c) x]; an electrode has one potential. Each
component of q is given, or free under a given force, moment or charge. Nodes of a rigid part or of
an electrode are tied to q. A moving foundation ties no nodes: it changes gaps alone
(`contact.interface.nodes`).

q is behind the unknowns of the ghosts in a state, its duals at the end of forces, with the same
values on all ranks. Rotations are multiplied by the diameter of the body, and potentials are scaled
as those of the nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.errors import InputError
from contact.mesh.domain import Domain, members
from contact.mesh.entities import Indices, cell_facets, distributed_components, sums_at
from contact.model.body import Body, Bolt, Electrode
from contact.model.rigid import Motion, Rigid, numbers_at, rigid_motions
from contact.ranks import summed
from contact.settings import Fault
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array


@dataclass(frozen=True)
class UnknownGroup:
    """The unknowns of a rigid body, an electrode or a bolt: columns of q from `begin` on.

    The description of a foundation is the motion alone; it is in front of its `part`. `scale` is
    the length of a rotation of 1, or the unit of the potential.
    """

    description: Motion | Electrode | Bolt
    part: str
    begin: int
    scale: float

    @property
    def is_foundation(self) -> bool:
        """True for a foundation, without tied nodes."""
        return isinstance(self.description, Motion) and not self.has_tied_nodes

    @property
    def has_tied_nodes(self) -> bool:
        """True for a rigid part or an electrode, whose nodes are tied to it."""
        return isinstance(self.description, Rigid | Electrode)

    @property
    def columns(self) -> slice:
        """Its columns of q."""
        return slice(self.begin, self.begin + len(self.description.values))

    @property
    def units(self) -> Array:
        """Translation, rotation, potential or shortening of each unknown of 1."""
        motion = self.description
        if not isinstance(motion, Motion):
            return np.full(1, self.scale)
        turns = np.full(len(motion.turns), 1 / self.scale)
        return np.concatenate([np.ones(len(motion.displacement or ())), turns])

    @property
    def free(self) -> NDArray[np.bool_]:
        """Mask of its unknowns without given values."""
        return np.array([value is None for value in self.description.values])

    def prescribed(self, time: float) -> Array:
        """Return the given values at a time, 0 for free unknowns."""
        one = self.description
        return numbers_at(one.values, one.amplitude, time, one.forces) / self.units

    def forces(self, time: float) -> Array:
        """Return the forces and moments, or the charge, on its free unknowns at a time."""
        one = self.description
        forces = numbers_at(one.forces, one.amplitude, time, one.values)
        return np.where(self.free, forces * self.units, 0.0)

    def motion(self, points: Array, block_size: int) -> Array:
        """Return N_q at points of shape (n, d): shape (n, block size, its unknowns)."""
        n, d = points.shape
        columns = np.zeros((n, block_size, self.units.size))
        if isinstance(self.description, Electrode):
            columns[:, -1, 0] = 1.0
        elif isinstance(self.description, Motion):
            offset = points - np.asarray(self.description.centre)
            columns[:, :d] = rigid_motions(offset) * self.units
        return columns


@dataclass(frozen=True)
class GlobalUnknowns:
    """The global unknowns of a body and its foundations.

    Attributes
    ----------
    comm
        Communicator.
    groups
        The unknowns of each rigid body, electrode and bolt, foundations first.
    free
        Mask of the unknowns without given values, shape (m,).
    tied_motion
        N_q at the tied owned unknowns, shape (owned, m).
    tied
        Mask of the tied unknowns of owned nodes, shape (nodes, block size).
    """

    comm: MPI.Intracomm
    groups: tuple[UnknownGroup, ...]
    free: NDArray[np.bool_]
    tied_motion: sparse.csr_array
    tied: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """Number m of global unknowns."""
        return self.free.size

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Mask of the motions, shape (m,)."""
        flags = [
            np.full(group.free.size, not isinstance(group.description, Electrode))
            for group in self.groups
        ]
        return np.concatenate([np.zeros(0, dtype=bool), *flags])

    @property
    def has_tied_nodes(self) -> bool:
        """True if there are tied nodes."""
        return any(group.has_tied_nodes for group in self.groups)

    def foundation(self, part: str) -> UnknownGroup | None:
        """Return the moving foundation in front of a part; None where it is fixed."""
        return next((one for one in self.groups if one.is_foundation and one.part == part), None)

    def of_foundation(
        self, points: Array, block_size: int, part: str | None = None
    ) -> Array | None:
        """Return N_q of the foundation in front of a part at points, (n, block size, m).

        Zero where it is fixed, and without a part; None without any q.
        """
        if self.size == 0:
            return None
        motion = np.zeros((len(points), block_size, self.size))
        group = None if part is None else self.foundation(part)
        if group is not None:
            motion[:, :, group.columns] = group.motion(points, block_size)
        return motion

    def prescribe(self, q: Array, time: float) -> Array:
        """Return q with the given values at a time."""
        values = [group.prescribed(time) for group in self.groups]
        return np.where(self.free, q, np.concatenate([np.zeros(0), *values]))

    def forces(self, time: float) -> Array:
        """Return the forces and charges on the free ones at a time, shape (m,)."""
        return np.concatenate([np.zeros(0), *(group.forces(time) for group in self.groups)])

    def gathered(self, forces: Array) -> Array:
        """Return the forces on q of those on owned unknowns: N_q^T f, shape (m,). Collective."""
        if not self.has_tied_nodes:
            return np.zeros(self.size)
        return summed(self.comm, self.tied_motion.T @ forces)

    def with_foundations(self, nodes: NDArray[np.int32], motion: Array) -> sparse.csr_array:
        """Return N_q at tied nodes, and as given, (n, b, m), at contact nodes, shape (owned, m)."""
        contact_rows = _rows(nodes, motion, slice(0, self.size), self.tied_motion.shape)
        return (self.tied_motion + contact_rows).tocsr()


def make_global_unknowns(
    domain: Domain,
    space: fem.FunctionSpace,
    body: Body,
    foundations: Mapping[str, Motion],
    free: NDArray[np.bool_],
) -> GlobalUnknowns:
    """Return the global unknowns of a body and of the moving foundations in front of parts.

    Given the mask of free nodal unknowns. Collective.

    Refuses rigid parts or electrodes that share nodes, and free ones that share nodes with a
    support.
    """
    groups: list[UnknownGroup] = []
    size = 0
    described: list[Rigid | Electrode | Bolt] = [*body.rigid, *body.electrodes, *body.bolts]
    for part, given in (*foundations.items(), *((one.on, one) for one in described)):
        description = _moving(given, part, domain) if isinstance(given, Motion) else given
        scale = body.phi_scale if isinstance(description, Electrode) else domain.size
        scale = 1.0 if isinstance(description, Bolt) else scale
        groups.append(UnknownGroup(description, part, size, scale))
        size = groups[-1].columns.stop
    unknown = np.concatenate([np.zeros(0, dtype=bool), *(group.free for group in groups)])
    tied = np.zeros(free.shape, dtype=bool)
    tied_motion = sparse.csr_array((free.size, size))
    for group in groups:
        if group.has_tied_nodes:
            tied_motion = tied_motion + _tie(domain, space, group, free, tied, size)
    return GlobalUnknowns(domain.comm, tuple(groups), unknown, tied_motion, tied)


def _moving(motion: Motion, part: str, domain: Domain) -> Motion:
    """Return a motion with all its components, checked for the dimension."""
    place = f"rigid on {part!r}: "
    for key in ("displacement", "force", "centre"):
        vector = getattr(motion, key)
        if vector is not None and len(vector) != domain.dim:
            raise InputError(
                f"{place}{key} has {len(vector)} components, the body has {domain.dim}",
                "components",
            )
    try:
        motion.check_dimension(domain.dim)
    except Fault as error:
        raise error.within(place) from None
    if domain.revolved and motion.off_axis is not None:
        raise InputError(
            f"{place}a rigid part moves along the axis alone where space is "
            "axisymmetric; accepted: 0 for the first component of the displacement, no rotation",
            "rigid-part",
        )
    return motion.filled(domain.dim)


def _tie(
    domain: Domain,
    space: fem.FunctionSpace,
    group: UnknownGroup,
    free: NDArray[np.bool_],
    tied: NDArray[np.bool_],
    size: int,
) -> sparse.csr_array:
    """Return the rows of N_q of a rigid part or an electrode, and mark them as tied. Collective."""
    d, electric = domain.dim, isinstance(group.description, Electrode)
    key = f"{'electrode' if electric else 'rigid'} on {group.part!r}"
    domain.mesh.topology.create_connectivity(d - 1, d)
    nodes = fem.locate_dofs_topological(space, d - 1, domain.facets_anywhere(group.part))
    nodes = nodes[nodes < free.shape[0]]
    points = space.tabulate_dof_coordinates()[nodes, :d]
    motion = group.motion(points, free.shape[1])
    follows = np.zeros((nodes.size, free.shape[1]), dtype=bool)
    follows[:, slice(d, None) if electric else slice(0, d)] = True
    if _anywhere(domain, tied[nodes] & follows):
        raise InputError(
            f"{key}: it shares nodes with another rigid part or electrode; accepted: parts apart",
            "rigid-part",
        )
    # A supported node cannot be tied.
    moves = np.abs(motion[:, :, group.free]).max(axis=2, initial=0.0) > NEGLIGIBLE
    if _anywhere(domain, moves & follows & ~free[nodes]):
        if electric:
            raise InputError(
                f"{key}: it shares nodes with a part whose potential is fixed; accepted: parts "
                "that share no nodes",
                "rigid-part",
            )
        raise InputError(
            f"{key}: a support fixes a component of one of its nodes that is free to move with it; "
            "accepted: that component given there, or parts that share no nodes",
            "rigid-part",
        )
    follows &= free[nodes]
    tied[nodes] |= follows
    motion[~follows] = 0.0
    return _rows(nodes, motion, group.columns, (free.size, size))


def _rows(
    nodes: NDArray[np.int32], motion: Array, columns: slice, shape: tuple[int, int]
) -> sparse.csr_array:
    """Return N_q at nodes, (n, block size, columns), as rows of a matrix of all unknowns."""
    dofs = nodes[:, None] * motion.shape[1] + np.arange(motion.shape[1])
    every = np.broadcast_arrays(dofs[:, :, None], np.arange(columns.start, columns.stop))
    places = tuple(numbers.ravel() for numbers in every)
    return sparse.coo_array((motion.ravel(), places), shape=shape).tocsr()


def _anywhere(domain: Domain, flags: NDArray[np.bool_]) -> bool:
    return bool(domain.comm.allreduce(bool(flags.any()), op=MPI.LOR))


@dataclass(frozen=True)
class CutComponents:
    """The connected components between cuts of free shortenings, and the nodes at these cuts.

    Attributes
    ----------
    places
        Columns of these shortenings in q, shape (k,).
    connected_component, count
        The component of each owned node, at a cut that below it, and the number of components.
    points
        Nodes of this rank at the cuts, once for each component above, shape (n, d).
    below, above
        The components on both sides there, shape (n,).
    normals
        Displacement of the one below relative to that above, by unit shortenings, shape (n, d, k).
    """

    places: list[int]
    connected_component: Indices
    count: int
    points: Array
    below: Indices
    above: Indices
    normals: Array


class Cuts:
    """Cuts through a body: pretension sections of bolts.

    Across a cut the displacement jumps by a shortening s, as a nut is turned. Nodal unknowns are
    those of the continuous part u; the displacement is u - s psi n with psi = 1 at the nodes of the
    cut, seen from the side to which n points, and 0 at all others. That is a mesh with double nodes
    at the cut and u+ - u- = -s n. s is a global unknown, dual to the section force
    N = int sigma : eps(-psi n): given, or free under a given force.

    `places` are the columns of the shortenings in q, shape (k,), and `parts` the names of the cuts;
    `directions` are the functions -psi n, discontinuous, of unit shortenings; `jump` and
    `secant_jump` are the jumps of the unknowns `at` and `secant_at` of `contact.body.assembly`.
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
        cuts = [_direction(domain, space, whole, part) for part in self.parts]
        self.directions = [direction for direction, _, _, _ in cuts]
        self._ends = [(nodes, normal) for _, nodes, normal, _ in cuts]
        self._space, self._moved = space, [moved for _, _, _, moved in cuts]
        self._free = [k for k, bolt in enumerate(body.bolts) if bolt.shortening is None]
        self.jump, self.secant_jump = fem.Function(whole), fem.Function(whole)

    @staticmethod
    def of(
        domain: Domain, space: fem.FunctionSpace, unknowns: GlobalUnknowns, body: Body
    ) -> Cuts | None:
        """Return the cuts of a body; None without any. Collective."""
        places = [one.begin for one in unknowns.groups if isinstance(one.description, Bolt)]
        return Cuts(domain, space, places, body) if places else None

    @cached_property
    def connected_components(self) -> CutComponents | None:
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
        return CutComponents(
            places=[self.places[k] for k in self._free],
            connected_component=labels[: index_map.size_local],
            count=count,
            points=space.tabulate_dof_coordinates()[nodes, : len(normals)],
            below=labels[nodes],
            above=labels[size:],
            normals=moved[:, None, :] * normals,
        )

    def check(self, nodes: NDArray[np.int32], along: Array, text: str) -> None:
        """Refuse a constraint across a cut, where the displacement is that of one side. Collective.

        The constraint acts at owned nodes, shape (n,), in k directions, shape (n, d, k); `text` has
        words on it for the message.
        """
        for part, (ends, normal) in zip(self.parts, self._ends, strict=True):
            across = np.einsum("nik,i->nk", along[np.isin(nodes, ends)], normal)
            largest = float(np.abs(across).max(initial=0.0))
            if self._comm.allreduce(largest, op=MPI.MAX) > NEGLIGIBLE:
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
    on_cut = sums_at(space.dofmap.index_map, nodes, 1.0) > 0
    cells = space.dofmap.list
    touches = on_cut[cells]
    count = np.arange(len(cells), dtype=np.int32)
    midpoints = compute_midpoints(mesh, d, count)[:, :d] if count.size else np.zeros((0, d))
    above = (midpoints - middle) @ normal > 0
    _check_through(domain, part, facets, touches.any(axis=1), above)
    direction, moved = fem.Function(whole), touches & above[:, None]
    direction.x.array.reshape(-1, d)[whole.dofmap.list[moved]] = -normal
    owned_nodes = np.flatnonzero(on_cut[: space.dofmap.index_map.size_local])
    return direction, owned_nodes.astype(np.int32), normal, moved


def _check_through(
    domain: Domain,
    part: str,
    facets: NDArray[np.int32],
    touches: NDArray[np.bool_],
    above: NDArray[np.bool_],
) -> None:
    """Refuse a cut that ends within the body: its sides are joined beside it. Collective."""
    mesh, d = domain.mesh, domain.dim
    of_cells, index_map = cell_facets(mesh), mesh.topology.index_map(d - 1)
    one, other = (
        sums_at(index_map, of_cells[those], 1.0)[: index_map.size_local] > 0
        for those in (touches & above, touches & ~above)
    )
    joined = np.flatnonzero(one & other)
    if domain.comm.allreduce(bool(np.setdiff1d(joined, facets).size), op=MPI.LOR):
        raise InputError(
            f"bolt on {part!r}: the cut ends within the body; accepted: all facets of a section",
            "bolt",
        )
