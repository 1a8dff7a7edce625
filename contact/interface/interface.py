"""Gamma_3 with all its laws, node by node: nothing here knows the body behind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.active_set import ActiveSet, touching
from contact.interface.friction import NodalFriction
from contact.interface.law import InterfaceLaw
from contact.interface.multipliers import Multipliers, SlipHistory
from contact.interface.nodes import ContactNodes
from contact.mesh.entities import component_sums
from contact.ranks import summed
from contact.tolerances import EPS, NEGLIGIBLE, ROUNDING
from contact.typing import Array


@dataclass(frozen=True)
class Proximal:
    """An elastic bed along the tangents, about an earlier iterate.

    Attributes
    ----------
    stiffness
        Of the bed (stress/length).
    about
        Tangential displacement of the iterate, shape (n, d).
    """

    stiffness: float
    about: Array


@dataclass(frozen=True)
class Interface:
    """Unilateral contact, friction, layer and current at the owned contact nodes.

    Nodal unknowns are arrays of shape (n, block size): displacement, then scaled potential.

    Attributes
    ----------
    jump
        The contact nodes; their gap is that of the unilateral constraint.
    law
        Layer and current.
    friction
        Friction.
    held
        The current through nodes that cannot move, but whose potential is free; None without.
    stiffness
        c = E/diameter, which weighs displacements against stresses (stress/length); E of the
        regions that touch.
    diameter
        Largest extent of the body (length).
    elongation
        How many times longer than usual the cells behind Gamma_3 are, across it
        (`contact.mesh.entities.elongation`); residuals take c so many times as large.
    component, components
        The connected component of the mesh that each contact node belongs to, shape (n,), and how
        many there are (`contact.body.component_norms`).
    proximal
        The term of a proximal-point method; None for the problem itself.
    """

    jump: ContactNodes
    law: InterfaceLaw
    friction: NodalFriction
    held: InterfaceLaw | None
    stiffness: float
    diameter: float
    elongation: float
    component: NDArray[np.intp]
    components: int
    proximal: Proximal | None = None

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""
        return self.jump.comm

    @property
    def dim(self) -> int:
        """Number of displacement components."""
        return self.jump.dim

    def at(self, time: float, history: SlipHistory) -> Interface:
        """Return the interface of a step that ends at a time with the slip history before it."""
        return replace(
            self,
            law=self.law.at(time),
            friction=replace(self.friction, history=history),
            held=None if self.held is None else self.held.at(time),
        )

    def norms(self, values: Array) -> Array:
        """Return the norms in L2(Gamma_3) of values on each component, shape (k,). Collective."""
        if self.components == 1:
            return np.array([self.jump.norm(values)])
        squares = values**2 if values.ndim == 1 else np.einsum("ni,ni->n", values, values)
        return np.sqrt(
            component_sums(self.comm, self.component, self.jump.weight * squares, self.components)
        )

    def component_norms(self, values: Array) -> Array:
        """Return the norms on the components of the nodes, 1 for a single one. Collective."""
        norms = self.norms(values)
        if self.components == 1 or not norms.max() > 0:
            return np.ones_like(self.jump.weight)
        return np.maximum(norms, EPS * norms.max())[self.component]

    @property
    def extents(self) -> tuple[Array, Array]:
        """The number of contact nodes of each component, and their area, shape (k,). Collective."""
        of, weight = (self.comm, self.component), self.jump.weight
        count = component_sums(*of, np.ones_like(weight), self.components)
        return count, component_sums(*of, weight, self.components)

    def opening(self, nodal: Array) -> Array:
        """Return gap - u_nu, shape (n,): the distance that is left."""
        return self.jump.gap - self.jump.normal_component(nodal)

    def slip(self, nodal: Array) -> Array:
        """Return the slip of the step, u_tau less that at its beginning, shape (n, d).

        Friction depends on this alone. For a static problem, one step from zero, it is u_tau.
        """
        return self.jump.tangential_component(nodal[:, : self.dim] - self.friction.history.jump)

    def commit(self, nodal: Array) -> SlipHistory:
        """Return the slip history of the next step, where this one ends at nodal unknowns."""
        accumulated = self.friction.history.accumulated + self.slip_length(nodal)
        return SlipHistory(self.jump.tangential_component(nodal), accumulated)

    def slip_length(self, nodal: Array) -> Array:
        """Return the lengths of `slip`, shape (n,)."""
        return np.linalg.norm(self.slip(nodal), axis=1)

    def pressure(self, nodal: Array, forces: Multipliers) -> Array:
        """Return -sigma_nu, the multiplier and the layer's pressure, shape (n,)."""
        return forces.pressure + self.law.layer_pressure(nodal)

    def bound(self, nodal: Array, forces: Multipliers) -> Array:
        """Return the friction bound s, shape (n,). Collective."""
        return self.friction.bound(self.pressure(nodal, forces), self.slip_length(nodal))

    def stress(self, nodal: Array, forces: Multipliers) -> Array:
        """Return -sigma nu, layer included, shape (n, d)."""
        return Multipliers(self.pressure(nodal, forces), forces.friction).vectors(self.jump)

    def active_set(
        self,
        nodal: Array,
        forces: Multipliers,
        bound: Array,
        c: float | None = None,
        rounding: float = 0.0,
    ) -> ActiveSet:
        """Return which nodes are open, stick or slip.

        Parameters
        ----------
        nodal, forces, bound
            Unknowns, contact forces and friction bound.
        c, rounding
            Weight of displacements against stresses, `stiffness` by default, and a stress that
            counts as none.
        """
        c = self.stiffness if c is None else c
        closed = touching(forces.pressure, self.opening(nodal), c, rounding)
        if not self.friction.acts:
            return ActiveSet.without_slip(closed, False)
        return ActiveSet.of(closed, forces.friction, self.slip(nodal), bound, c, rounding)

    def node_counts(self, nodal: Array, active: ActiveSet) -> tuple[int, int, int]:
        """Return the numbers of nodes that are open, stick and slip. Collective.

        Parameters
        ----------
        nodal
            Unknowns: a node that presses the layer alone is not open.
        active
            The active set.
        """
        closed = active.closed | (self.law.layer_pressure(nodal) > 0)
        sticks = closed & active.sticks
        local = [np.count_nonzero(nodes) for nodes in (~closed, sticks, closed & ~sticks)]
        opened, stick, slip = (int(count) for count in summed(self.comm, local))
        return opened, stick, slip

    def rounding(self, nodal: Array) -> float:
        """Return a pressure that rounding of the displacements makes (stress). Collective."""
        displacement = np.abs(nodal[:, : self.jump.dim]).max(axis=1, initial=0.0)
        return 2 * ROUNDING * self.stiffness * self.jump.maximum(displacement)

    def negligible(self, nodal: Array, pressure: Array) -> float:
        """Return a pressure that counts as none beside all others. Collective.

        That is rounding of the displacements, or of the largest pressure.
        """
        return max(NEGLIGIBLE * self.jump.maximum(pressure), self.rounding(nodal))

    def acting(self, x: Array, forces: Multipliers) -> Iterator[tuple[InterfaceLaw, Array, Array]]:
        """Yield the law, unknowns and pressures of contact nodes, then of held ones. Collective."""
        nodal = self.jump.apply(x)
        yield self.law, nodal, self.pressure(nodal, forces)
        if self.held is not None:
            nodal = self.held.jump.apply(x)
            yield self.held, nodal, self.held.resting(nodal)

    def add_forces(self, residual: Array, x: Array, forces: Multipliers) -> None:
        """Add the contact forces and the current at local unknowns to owned values."""
        jump = self.jump
        jump.transpose(jump.weight[:, None] * forces.vectors(jump), residual)
        for law, nodal, pressure in self.acting(x, forces):
            law.jump.transpose(law.jump.weight[:, None] * law.force(nodal, pressure), residual)
        if self.proximal is not None:
            away = jump.tangential_component(jump.apply(x)) - self.proximal.about
            jump.transpose(self.proximal.stiffness * jump.weight[:, None] * away, residual)

    def add_current(self, residual: Array, x: Array, change: Array, forces: Multipliers) -> None:
        """Add the change of the current with local unknowns, psi frozen, to owned values."""
        for law, nodal, pressure in self.acting(x, forces):
            block = law.current_block(nodal, pressure)
            density = np.einsum("nij,nj->ni", block, law.jump.apply(change))
            law.jump.transpose(law.jump.weight[:, None] * density, residual)

    @property
    def coupled(self) -> NDArray[np.int32]:
        """Nodes at which the operator has blocks: contact nodes, then held ones."""
        if self.held is None:
            return self.jump.nodes
        return np.concatenate([self.jump.nodes, self.held.jump.nodes])

    def weighted(self, blocks: Array, x: Array) -> Array:
        """Return the operator's blocks at `coupled`: those of the contact nodes, times weight.

        Parameters
        ----------
        blocks
            Derivatives of nodal forces, without weights, shape (n, block size, block size).
        x
            Local unknowns.
        """
        if self.proximal is not None:
            blocks = blocks.copy()
            blocks[:, : self.dim, : self.dim] += self.proximal.stiffness * self.jump.tangent
        weighted = self.jump.weight[:, None, None] * blocks
        if self.held is None:
            return weighted
        held = self.held.jump
        nodal = held.apply(x)
        block = self.held.current_block(nodal, self.held.resting(nodal))
        return np.concatenate([weighted, held.weight[:, None, None] * block])
