"""Global unknowns q: rigid motions, potentials of electrodes, shortenings of bolts.

A rigid body moves by u = R q, R = [I, -(x - x_c) x]; an electrode has one potential. Each
component of q is given, or free under a given force, moment or charge. Nodes of a rigid part or of
an electrode are tied to q. A moving foundation ties no nodes: it changes gaps alone
(`contact.interface.nodes`).

q is behind the unknowns of the ghosts in a state, its duals at the end of forces, with the same
values on all ranks. Rotations are multiplied by the diameter of the body, and potentials are scaled
as those of the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from pydantic_core import PydanticCustomError
from scipy import sparse

from contact.body.description import Body
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.model.body import Bolt, Electrode
from contact.model.messages import describe_fault
from contact.model.rigid import Rigid, numbers_at, rigid_motions
from contact.ranks import summed
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array


@dataclass(frozen=True)
class Member:
    """A rigid body, an electrode or a bolt with its columns of q, from `begin` on.

    `scale` is the length of a rotation of 1, or the unit of the potential.
    """

    description: Rigid | Electrode | Bolt
    begin: int
    scale: float

    @property
    def foundation(self) -> bool:
        """True for a foundation, without tied nodes."""
        return isinstance(self.description, Rigid) and self.description.foundation

    @property
    def tying(self) -> bool:
        """True for a rigid part or an electrode, whose nodes are tied to it."""
        return not (self.foundation or isinstance(self.description, Bolt))

    @property
    def columns(self) -> slice:
        """Its columns of q."""
        return slice(self.begin, self.begin + len(self.description.values))

    @property
    def units(self) -> Array:
        """Translation, rotation, potential or shortening of each unknown of 1."""
        if not isinstance(self.description, Rigid):
            return np.full(1, self.scale)
        rigid = self.description
        turns = np.full(len(rigid.turns), 1 / self.scale)
        return np.concatenate([np.ones(len(rigid.displacement or ())), turns])

    @property
    def free(self) -> NDArray[np.bool_]:
        """Mask of its unknowns without given values."""
        return np.array([value is None for value in self.description.values])

    def given(self, time: float) -> Array:
        """Return the given values at a time, 0 for free unknowns."""
        given = self.description
        return numbers_at(given.values, given.amplitude, time) / self.units

    def forces(self, time: float) -> Array:
        """Return the forces and moments, or the charge, on its free unknowns at a time."""
        given = self.description
        forces = numbers_at(given.forces, given.amplitude, time)
        return np.where(self.free, forces * self.units, 0.0)

    def motion(self, points: Array, block_size: int) -> Array:
        """Return R at points of shape (n, d): shape (n, block size, its unknowns)."""
        n, d = points.shape
        columns = np.zeros((n, block_size, self.units.size))
        if isinstance(self.description, Electrode):
            columns[:, -1, 0] = 1.0
        elif isinstance(self.description, Rigid):
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
    members
        Rigid bodies and electrodes.
    free
        Mask of the unknowns without given values, shape (m,).
    ties
        R at the tied owned unknowns, shape (owned, m).
    tied
        Mask of the tied unknowns of owned nodes, shape (nodes, block size).
    """

    comm: MPI.Intracomm
    members: tuple[Member, ...]
    free: NDArray[np.bool_]
    ties: sparse.csr_array
    tied: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """Number m of global unknowns."""
        return self.free.size

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Mask of the motions, shape (m,)."""
        moves = [not isinstance(m.description, Electrode) for m in self.members]
        flags = [np.full(m.free.size, own) for m, own in zip(self.members, moves, strict=True)]
        return np.concatenate([np.zeros(0, dtype=bool), *flags])

    @property
    def tying(self) -> bool:
        """True if there are tied nodes."""
        return any(member.tying for member in self.members)

    def member(self, part: str) -> Member | None:
        """Return the moving foundation in front of a part; None where it is fixed."""
        found = (m for m in self.members if m.foundation and m.description.on == part)
        return next(found, None)

    def of_foundation(
        self, points: Array, block_size: int, part: str | None = None
    ) -> Array | None:
        """Return R of the foundation in front of a part at points, (n, block size, m).

        Zero where it is fixed, and without a part; None without any q.
        """
        if self.size == 0:
            return None
        found = np.zeros((len(points), block_size, self.size))
        member = None if part is None else self.member(part)
        if member is not None:
            found[:, :, member.columns] = member.motion(points, block_size)
        return found

    def prescribe(self, q: Array, time: float) -> Array:
        """Return q with the given values at a time."""
        given = [member.given(time) for member in self.members]
        return np.where(self.free, q, np.concatenate([np.zeros(0), *given]))

    def forces(self, time: float) -> Array:
        """Return the forces and charges on the free ones at a time, shape (m,)."""
        return np.concatenate([np.zeros(0), *(member.forces(time) for member in self.members)])

    def gathered(self, forces: Array) -> Array:
        """Return the forces on q of those on owned unknowns: R^T f, shape (m,). Collective."""
        if not self.tying:
            return np.zeros(self.size)
        return summed(self.comm, self.ties.T @ forces)

    def with_foundations(self, nodes: NDArray[np.int32], motion: Array) -> sparse.csr_array:
        """Return R at tied nodes, and as given, (n, b, m), at contact nodes, shape (owned, m)."""
        there = _rows(nodes, motion, slice(0, self.size), self.ties.shape)
        return (self.ties + there).tocsr()


def make_global_unknowns(
    domain: Domain, space: fem.FunctionSpace, body: Body, free: NDArray[np.bool_]
) -> GlobalUnknowns:
    """Return the global unknowns of a body, given the mask of free nodal unknowns. Collective.

    Raises
    ------
    InputError
        If rigid parts or electrodes share nodes, or a free one shares nodes with a support.
    """
    members: list[Member] = []
    described: list[Rigid | Electrode | Bolt] = [*body.rigid, *body.electrodes, *body.bolts]
    for given in described:
        if isinstance(given, Rigid):
            given = _moving(given, domain)
        begin = members[-1].columns.stop if members else 0
        scale = body.phi_scale if isinstance(given, Electrode) else domain.size
        scale = 1.0 if isinstance(given, Bolt) else scale
        members.append(Member(given, begin, scale))
    size = members[-1].columns.stop if members else 0
    unknown = np.concatenate([np.zeros(0, dtype=bool), *(member.free for member in members)])
    tied = np.zeros(free.shape, dtype=bool)
    ties = sparse.csr_array((free.size, size))
    for member in members:
        if member.tying:
            ties = ties + _tie(domain, space, member, free, tied, size)
    return GlobalUnknowns(domain.comm, tuple(members), unknown, ties, tied)


def _moving(rigid: Rigid, domain: Domain) -> Rigid:
    """Return a rigid part with all components of its motion, checked for the dimension."""
    place = f"{rigid.name} on {rigid.on!r}: "
    for key in ("displacement", "force", "centre"):
        given = getattr(rigid, key)
        if given is not None and len(given) != domain.dim:
            raise InputError(
                f"{place}{key} has {len(given)} components, the body has {domain.dim}",
                "components",
            )
    try:
        rigid.check_dimension(domain.dim)
    except PydanticCustomError as error:
        raise describe_fault(error).within(place) from None
    if domain.revolved and rigid.off_axis is not None:
        raise InputError(
            f"{rigid.name} on {rigid.on!r}: a rigid part moves along the axis alone where space is "
            "axisymmetric; accepted: 0 for the first component of the displacement, no rotation",
            "rigid-part",
        )
    return rigid.filled(domain.dim)


def _tie(
    domain: Domain,
    space: fem.FunctionSpace,
    member: Member,
    free: NDArray[np.bool_],
    tied: NDArray[np.bool_],
    size: int,
) -> sparse.csr_array:
    """Return the rows of R of a rigid part or an electrode, and mark them as tied. Collective."""
    d, key = domain.dim, f"{member.description.name} on {member.description.on!r}"
    domain.mesh.topology.create_connectivity(d - 1, d)
    nodes = fem.locate_dofs_topological(space, d - 1, domain.facets_anywhere(member.description.on))
    nodes = nodes[nodes < free.shape[0]]
    points = space.tabulate_dof_coordinates()[nodes, :d]
    motion = member.motion(points, free.shape[1])
    follows = np.zeros((nodes.size, free.shape[1]), dtype=bool)
    follows[:, slice(d, None) if isinstance(member.description, Electrode) else slice(0, d)] = True
    if _anywhere(domain, tied[nodes] & follows):
        raise InputError(
            f"{key}: it shares nodes with another rigid part or electrode; accepted: parts apart",
            "rigid-part",
        )
    # A supported node cannot be tied.
    moves = np.abs(motion[:, :, member.free]).max(axis=2, initial=0.0) > NEGLIGIBLE
    if _anywhere(domain, moves & follows & ~free[nodes]):
        if isinstance(member.description, Electrode):
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
    return _rows(nodes, motion, member.columns, (free.size, size))


def _rows(
    nodes: NDArray[np.int32], motion: Array, columns: slice, shape: tuple[int, int]
) -> sparse.csr_array:
    """Return R at nodes, (n, block size, columns), as rows of a matrix of all unknowns."""
    dofs = nodes[:, None] * motion.shape[1] + np.arange(motion.shape[1])
    every = np.broadcast_arrays(dofs[:, :, None], np.arange(columns.start, columns.stop))
    places = tuple(numbers.ravel() for numbers in every)
    return sparse.coo_array((motion.ravel(), places), shape=shape).tocsr()


def _anywhere(domain: Domain, flags: NDArray[np.bool_]) -> bool:
    return bool(domain.comm.allreduce(bool(flags.any()), op=MPI.LOR))
