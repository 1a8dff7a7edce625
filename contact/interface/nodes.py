"""The contact nodes and their geometry, of one contact and of all.

Multipliers and auxiliary variables live at these nodes; products of L2(Gamma_3) are lumped there.
Each rank has the contact nodes that it owns; sums and norms are global. The nodes of one contact
follow each other in the arrays of all: the interface knows no number of contacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.equilibrium import BodyEquilibrium
from contact.errors import InputError
from contact.interface.mortar.lumping import JumpRows
from contact.interface.mortar.operator import CouplingOperator, coupling_operator
from contact.linear.layout import Inclined, projectors
from contact.ranks import largest, summed
from contact.typing import Array


def unit_vectors(vectors: Array) -> Array:
    """Return the rows divided by their lengths, shape (n, d); zero rows stay zero."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def make_read_only(value: object) -> None:
    """Mark the arrays among the attributes of a value as read-only."""
    for array in vars(value).values():
        if isinstance(array, np.ndarray):
            array.flags.writeable = False


def contact_directions(
    normal: Array, movable: Array, prescribed: NDArray[np.bool_] | bool = True
) -> tuple[Array, Array]:
    """Return `admissible_normal` (n, d) and `tangential_projector` (n, d, d) of `ContactNodes`.

    The contact directions, (n, d), have an unconstrained part each; `movable` are the projectors
    onto the unconstrained directions, (n, d, d). `prescribed` says whether supports alone prescribe
    the jumps along constrained directions, (n,): in front of a foundation they do.
    """
    admissible = np.einsum("nij,nj->ni", movable, normal)
    length = np.linalg.norm(admissible, axis=1)[:, None]
    unit = admissible / length
    all_act = (length[:, 0] >= 1 - 1e-12) & prescribed
    acting = np.where(all_act[:, None, None], np.eye(normal.shape[1]), movable)
    return unit / length, acting - unit[:, :, None] * unit[:, None, :]


@dataclass(frozen=True)
class ContactNodes:
    """The contact nodes that this rank owns: gaps, directions, areas, and their jumps T x.

    Which nodes these are is decided once, in the reference configuration. Arrays marked with (R)
    belong to it, all others to the current place of the bodies (`Geometry`). With the projector P
    onto the free directions of a node, and its contact direction nu,

        P     = I - sum_k e_k (x) e_k,                   e_k the directions that supports hold,
        nu_a  = P nu/|P nu|^2,
        P_tau = I - nu (x) nu,   or   P - P nu (x) P nu/|P nu|^2.

    Attributes
    ----------
    comm
        Communicator of the mesh.
    nodes
        Local node (block) numbers (R), shape (n,).
    points
        Coordinates (R), shape (n, d) (length): coefficients such as mu(x), and output, use them.
    weight
        Lumped surface mass, the tributary area of each node: integrals of the nodal basis
        functions over Gamma_3, shape (n,). They reproduce the nodal forces of a constant pressure
        (vertex rule for P1, Simpson's for P2 edges; on P2 triangles of the functions of
        `contact.interface.mortar.lumping`).
    normal
        Contact direction, a unit vector out of the body, shape (n, d).
    admissible_normal
        nu_a, the least free displacement with nu_a . nu = 1, shape (n, d); nu unless supports hold
        the node aslant to it.
    tangential_projector
        P_tau, the projector onto the directions of slip and friction, shape (n, d, d): the second
        formula where supports hold the node aslant to nu, or while the other side moves along
        them. The other jumps are no unknowns there, as on a plane of symmetry, and the supports
        bear the friction.
    gap
        The gap rho: the distance along the contact direction, shape (n,); infinite at nodes that
        face nothing. Methods change that of the constraint alone (`Interface.gap`).
    deviation
        Of a curved surface from its facets, without the part in the gaps, shape (n,) (length).
    block_size
        Unknowns a node: d, or d + 1 with the potential.
    motion
        Motion N_q of the foundation by the m global unknowns (`contact.body.global_unknowns`),
        shape (n, block_size, m); None without these.
    revolved
        Whether nodes are rings about the axis x = 0.
    coupling
        Operator of the jumps that are sums over nodes (`JumpRows`), or None: between bodies, on
        quadratic triangles, and beside the axis of revolution.
    """

    comm: MPI.Comm
    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array
    admissible_normal: Array
    tangential_projector: Array
    gap: Array
    deviation: Array
    block_size: int
    revolved: bool = False
    motion: Array | None = None
    coupling: CouplingOperator | None = None

    def __post_init__(self) -> None:
        """Mark the arrays as read-only."""
        make_read_only(self)

    @property
    def dim(self) -> int:
        """Dimension d of the displacement."""
        return self.normal.shape[1]

    def jump(self, x: Array) -> Array:
        """Return the jumps T x, shape (n, block_size), of a local dof array. Collective.

        In front of a foundation these are the nodal unknowns, or D u on quadratic triangles and
        beside the axis, relative to it if it moves.
        """
        values = self._nodal(x)
        jump = values[self.nodes]
        if self.coupling is not None:
            jump[self.coupling.places] = self.coupling.apply(values)
        if self.motion is None:
            return jump
        return jump - self.motion @ x[x.size - self.motion.shape[2] :]

    def _nodal(self, values: Array) -> Array:
        """Return a view of the nodal values, without the global unknowns behind them."""
        count = values.size // self.block_size
        return values[: count * self.block_size].reshape(count, self.block_size)

    def add_jump_transposed(self, vectors: Array, into: Array) -> None:
        """Add T^T times vectors, (n, d) or (n, block_size), to a local dof array. Collective."""
        size = vectors.shape[1]
        values = self._nodal(into)[:, :size]
        uncoupled = np.ones(self.nodes.size, dtype=bool)
        if self.coupling is not None:
            uncoupled[self.coupling.places] = False
            self.coupling.transpose(vectors[self.coupling.places], values)
        values[self.nodes[uncoupled]] += vectors[uncoupled]
        if self.motion is not None:
            total = np.einsum("ni,nim->m", vectors, self.motion[:, :size])
            into[into.size - total.size :] -= summed(self.comm, total)

    def normal_component(self, u: Array) -> Array:
        """Return u . nu, shape (n,), of vectors of shape (n, >= d)."""
        return np.einsum("ni,ni->n", u[:, : self.dim], self.normal)

    def tangential_component(self, u: Array) -> Array:
        """Return u_tau in the free tangential directions, shape (n, d)."""
        # Twice: once would leave rounding of u along the normal, beside which u_tau may be small.
        once = np.einsum("nij,nj->ni", self.tangential_projector, u[:, : self.dim])
        return np.einsum("nij,nj->ni", self.tangential_projector, once)

    def sum(self, values: Array) -> float:
        """Return the lumped integral of nodal values over Gamma_3."""
        return float(summed(self.comm, np.dot(self.weight, values)))

    def norm(self, values: Array) -> float:
        """Return the lumped L2(Gamma_3) norm of scalars (n,) or vectors (n, d)."""
        squares = values**2 if values.ndim == 1 else np.einsum("ni,ni->n", values, values)
        return float(np.sqrt(self.sum(squares)))

    def maximum(self, values: Array, default: float = 0.0) -> float:
        """Return the largest nodal value over all ranks."""
        return largest(self.comm, np.max(values, initial=default))

    @cached_property
    def size(self) -> int:
        """Number of contact nodes over all ranks."""
        return int(self.comm.allreduce(self.nodes.size, op=MPI.SUM))

    def gather(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the values of all ranks, in rank order, on every rank."""
        return np.concatenate(self.comm.allgather(values))


@dataclass(frozen=True)
class Geometry:
    """Gaps, normals, areas, D and M of one contact in one configuration x_0 of the bodies.

    Unknowns are increments from x_0. `nodes` also has the directions that supports leave free, and
    the motion of the foundation.

    Attributes
    ----------
    nodes
        The contact nodes, without the operator of all contacts: normals, gaps, areas.
    jumps
        D and M of their jumps; None where jumps are nodal values.
    covered
        Share of each node's area that faces the other body, shape (n,); None before a foundation.
    fixed_conducting
        Nodes that cannot move, but carry charge; None without.
    cut
        Largest overlap whose gap is taken as 0: of facets of curves, or of rounded positions
        (length).
    """

    nodes: ContactNodes
    jumps: JumpRows | None
    covered: Array | None = None
    fixed_conducting: ContactNodes | None = None
    cut: float = 0.0


def joined_nodes(
    geometries: Sequence[Geometry], parts: Sequence[str], body: BodyEquilibrium
) -> ContactNodes:
    """Return the nodes of all contacts, one contact after the other. Collective.

    `parts` are the names of the parts that the nodes are of. Refuses contacts that share nodes,
    nodes on both sides of pairs of bodies, and nodes on a roller if their jump is a sum over nodes.
    """
    _refuse_shared(geometries, parts)
    groups = [geometry.nodes for geometry in geometries]
    jumps = [geometry.jumps for geometry in geometries if geometry.jumps is not None]
    at_nodes = (
        np.concatenate([group.nodes for group in groups]),
        np.concatenate([_unknowns_by_jumps(group, body) for group in groups]),
    )
    coupling = coupling_operator(body.comm, body.layout.index_map, jumps, at_nodes, body.free)
    nodes = side_by_side(groups, coupling)
    if coupling is not None and body.layout.inclined is not None:
        _refuse_rollers(nodes, coupling, body.layout.inclined)
    return nodes


def _unknowns_by_jumps(nodes: ContactNodes, body: BodyEquilibrium) -> Array:
    """Return the nodal unknowns by their jumps, shape (n, block size, block size)."""
    # U = P + nu_a (x) (nu - P nu): u = U j moves in free directions P alone, and u . nu = j . nu.
    inclined, d = body.layout.inclined, nodes.dim
    directions = None if inclined is None else inclined.at(nodes.nodes)
    unknowns = projectors(body.free[nodes.nodes], directions)
    fixed = nodes.normal - np.einsum("nij,nj->ni", unknowns[:, :d, :d], nodes.normal)
    unknowns[:, :d, :d] += nodes.admissible_normal[:, :, None] * fixed[:, None, :]
    return unknowns


def motion_at_constant_jump(nodes: ContactNodes, body: BodyEquilibrium) -> Array:
    """Return N_q at the contact nodes for zero jump, as `ContactNodes.motion`. Collective.

    Along constrained directions the `admissible_normal` takes it up.
    """
    assert nodes.motion is not None
    moved, coupling = nodes.motion.copy(), nodes.coupling
    if coupling is not None:
        for k, column in enumerate(body.global_unknowns.tied_motion.toarray().T):
            moved[coupling.places, :, k] -= coupling.apply(column.reshape(-1, nodes.block_size))
    return np.asarray(_unknowns_by_jumps(nodes, body) @ moved)


def _refuse_shared(geometries: Sequence[Geometry], parts: Sequence[str]) -> None:
    """Refuse contacts that share nodes. Collective."""
    numbers = np.concatenate([geometry.nodes.nodes for geometry in geometries])
    shared = numbers.size - np.unique(numbers).size
    if geometries[0].nodes.comm.allreduce(shared, op=MPI.SUM) > 0:
        raise InputError(
            f"contact: the parts {', '.join(parts)} share nodes, which one obstacle alone can "
            "hold; accepted: parts without common nodes, such as pieces of a side with a gap "
            "between",
            "contacts-meet",
        )


def _refuse_rollers(nodes: ContactNodes, coupling: CouplingOperator, inclined: Inclined) -> None:
    """Refuse jumps of several nodes, which have no common direction, on rollers. Collective."""
    shared = bool(np.isin(coupling.local, inclined.nodes).any())
    if not nodes.comm.allreduce(shared, op=MPI.LOR):
        return
    contact = "contact of degree 2 in 3-D"
    if coupling.between:
        contact = "contact of two bodies"
    elif nodes.revolved:
        contact = "contact of a body of revolution that reaches its axis"
    raise InputError(
        f"fixed.normal: its part shares nodes with a {contact}, where jumps are sums over nodes; "
        "accepted: there a displacement across an axis instead, or parts apart",
        "roller-contact",
    )


def side_by_side(
    groups: Sequence[ContactNodes], coupling: CouplingOperator | None = None
) -> ContactNodes:
    """Return the nodes of several contacts as one array, with the operator of their jumps."""
    first = groups[0]
    names = [
        "nodes",
        "points",
        "weight",
        "normal",
        "admissible_normal",
        "tangential_projector",
        "gap",
    ]
    names += ["deviation"] if first.motion is None else ["deviation", "motion"]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(group, name) for group in groups]) for name in names
    }
    return replace(first, coupling=coupling, **arrays)
