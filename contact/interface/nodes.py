"""The contact nodes: where the foundation acts on the body.

Multipliers and auxiliary variables live at these nodes, and the products of L2(Gamma_3) are
lumped there. Each rank holds the contact nodes that it owns; sums and norms are global.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.mortar.operator import CouplingOperator
from contact.ranks import largest, summed
from contact.typing import Array


def unit_vectors(vectors: Array) -> Array:
    """Return the directions of rows, shape (n, d); zero where there is none."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1.0))


def contact_directions(
    normal: Array, movable: Array, given: NDArray[np.bool_] | bool = True
) -> tuple[Array, Array]:
    """Return the lifts of unit normals, and the projectors onto the directions of friction.

    Parameters
    ----------
    normal
        Contact directions, of which some part is free, shape (n, d).
    movable
        The projectors onto the directions that no support holds, shape (n, d, d).
    given
        Whether the jumps along the directions that supports hold are given by supports alone,
        shape (n,): in front of a foundation they are.

    Returns
    -------
    See `ContactNodes.lift` and `ContactNodes.tangent`, shapes (n, d) and (n, d, d).
    """
    admissible = np.einsum("nij,nj->ni", movable, normal)
    length = np.linalg.norm(admissible, axis=1)[:, None]
    unit = admissible / length
    every = (length[:, 0] >= 1 - 1e-12) & given
    acting = np.where(every[:, None, None], np.eye(normal.shape[1]), movable)
    return unit / length, acting - unit[:, :, None] * unit[:, None, :]


@dataclass(frozen=True)
class ContactNodes:
    """The contact nodes that this rank owns: the jump in front of a rigid foundation.

    Attributes
    ----------
    comm
        Communicator of the mesh.
    nodes
        Local node (block) numbers, shape (n,).
    points
        Coordinates, shape (n, d) (length).
    weight
        Lumped surface mass, the tributary area of each node: integrals of the nodal basis
        functions over Gamma_3, shape (n,). They reproduce the nodal forces of a constant pressure
        (vertex rule for P1, Simpson's for P2 edges; on P2 triangles of the functions of
        `contact.interface.mortar.lumping`).
    normal
        Contact direction, a unit vector out of the body, shape (n, d).
    lift
        The least displacement along directions that no support holds whose normal component is 1,
        shape (n, d): the normal, but where a support holds nodes aslant to it.
    tangent
        Projector onto the directions in which nodes slip and friction acts, shape (n, d, d): all
        tangential ones, as a node that supports move slips too; but they bear the friction along
        directions they hold where these are aslant to the contact direction, or where the other
        side moves along them: no unknown is the jump there, as of nodes on a plane of symmetry.
    gap
        Distance to the foundation along the contact direction, shape (n,).
    deviation
        Of a curved surface from its facets, as far as the gaps do not have it, shape (n,) (length).
    block_size
        Unknowns a node: d, or d + 1 with the potential.
    motion
        How the foundation moves here with the m global unknowns behind those of the nodes
        (`contact.body.global_unknowns`), shape (n, block_size, m); None where nothing moves.
    cut
        Largest depth in the foundation, undeformed, of a node on a straight facet of a curved
        part; the gap of these nodes is 0 (length).
    revolved
        Whether the nodes stand for the rings through them, about the axis x = 0.
    carried
        How the nodes move with these unknowns where no jump changes, likewise: as the foundation
        does, and against nodes beside them that follow a rigid part. Along directions that supports
        hold they do not; the `lift` then closes the gap as much.
    coupling
        The operator of jumps that are no nodal values, between bodies and on quadratic triangles;
        None for none.
    """

    comm: MPI.Comm
    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array
    lift: Array
    tangent: Array
    gap: Array
    deviation: Array
    block_size: int
    cut: float = 0.0
    revolved: bool = False
    motion: Array | None = None
    carried: Array | None = None
    coupling: CouplingOperator | None = None

    @property
    def dim(self) -> int:
        """Dimension d of the displacement."""
        return self.normal.shape[1]

    def apply(self, x: Array) -> Array:
        """Return the jumps, shape (n, block_size), of a local dof array. Collective.

        In front of a foundation that stays these are the nodal unknowns; they are relative to one
        that moves.
        """
        values = self._nodal(x)
        nodal = values[self.nodes]
        if self.coupling is not None:
            nodal[self.coupling.places] = self.coupling.apply(values)
        if self.motion is None:
            return nodal
        return nodal - self.motion @ x[x.size - self.motion.shape[2] :]

    def _nodal(self, values: Array) -> Array:
        """Return a view of the nodal values; the global unknowns are behind them."""
        count = values.size // self.block_size
        return values[: count * self.block_size].reshape(count, self.block_size)

    def transpose(self, nodal: Array, into: Array) -> None:
        """Add nodal vectors of shape (n, d) or (n, block_size) to a local dof array.

        The opposite ones act on the foundation where that moves, or on the other body. Collective.
        """
        size = nodal.shape[1]
        values = self._nodal(into)[:, :size]
        own = np.ones(self.nodes.size, dtype=bool)
        if self.coupling is not None:
            own[self.coupling.places] = False
            self.coupling.transpose(nodal[self.coupling.places], values)
        values[self.nodes[own]] += nodal[own]
        if self.motion is not None:
            total = np.einsum("ni,nim->m", nodal, self.motion[:, :size])
            into[into.size - total.size :] -= summed(self.comm, total)

    def normal_component(self, u: Array) -> Array:
        """Return u . nu, shape (n,), of vectors of shape (n, >= d)."""
        return np.einsum("ni,ni->n", u[:, : self.dim], self.normal)

    def tangential_component(self, u: Array) -> Array:
        """Return u_tau in the free tangential directions, shape (n, d).

        Its part along the normal is rounding of u_tau: the projector is applied twice, since
        once leaves that of u, beside which u_tau may be small.
        """
        once = np.einsum("nij,nj->ni", self.tangent, u[:, : self.dim])
        return np.einsum("nij,nj->ni", self.tangent, once)

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
