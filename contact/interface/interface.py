"""Gamma_3 with all its laws, node by node.

It knows of the body only constants: moduli over lengths, size, elongation of the cells, connected
components; no mesh, no space, no stiffness matrix.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.foundation import FoundationLaw
from contact.interface.friction import NodalFriction
from contact.interface.multipliers import ActiveSet, Multipliers, SlipHistory, constraint_active
from contact.interface.nodes import ContactNodes, make_read_only
from contact.mesh.entities import component_sums
from contact.ranks import summed
from contact.tolerances import EPS, NEGLIGIBLE, ROUNDING
from contact.typing import Array


@dataclass(frozen=True)
class Proximal:
    """An elastic bed along the tangents: k (u_tau - u_tau of an iterate).

    Attributes
    ----------
    stiffness
        k (stress/length).
    about
        u_tau of the iterate, shape (n, d).
    """

    stiffness: float
    about: Array


@dataclass(frozen=True)
class Interface:
    """Unilateral contact, friction, layer and surface charge at the owned contact nodes.

    Its methods take jumps T x of shape (n, block size): of displacements, then of the scaled
    potential (`ContactNodes.jump`). In front of a fixed foundation these are the nodal unknowns,
    or D u (`ContactNodes.coupling`).

    Attributes
    ----------
    nodes
        The contact nodes.
    gap
        Of the unilateral constraint, shape (n,), which methods change: rho of the nodes
        (`ContactNodes.gap`), or infinite without one, as behind a layer without a rigid part, and
        at nodes outside of a working set.
    foundation
        Layer and surface charge D.nu of the foundation.
    friction
        Friction.
    fixed_conducting
        The charge at nodes without a free displacement, but with a free potential, or None.
    c_b
        E/size, E behind Gamma_3: the complementarity parameter with which the active set of a
        solution is told (stress/length).
    c_0
        E/L of docs/residuals.md, L the extent of the smaller body of the contact, shape (n,)
        (stress/length).
    size
        Largest extent of the body (length).
    elongation
        Largest diameter of the cells behind Gamma_3 over twice the shortest edge of their facets,
        >= 1 (`contact.mesh.entities.elongation`).
    connected_component, connected_components
        Connected component of each contact node, shape (n,), and their number
        (`contact.body.equilibrium`).
    proximal
        The term of a proximal-point method, or None.
    """

    nodes: ContactNodes
    gap: Array
    foundation: FoundationLaw
    friction: NodalFriction
    fixed_conducting: FoundationLaw | None
    c_b: float
    c_0: Array
    size: float
    elongation: float
    connected_component: NDArray[np.intp]
    connected_components: int
    proximal: Proximal | None = None

    def __post_init__(self) -> None:
        """Mark the arrays as read-only."""
        make_read_only(self)

    @property
    def c_r(self) -> Array:
        """Complementarity parameter c_r of the residuals (16), shape (n,) (stress/length).

        It is elongation times `c_0`: behind facets that are short beside the depth of their
        cells a gap takes a stress far above that, and errors of the pressure would be hidden.
        """
        return self.elongation * self.c_0

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""
        return self.nodes.comm

    @property
    def dim(self) -> int:
        """Number of displacement components."""
        return self.nodes.dim

    def at(self, time: float, history: SlipHistory) -> Interface:
        """Return the interface at the end of a step, with the slip history before it."""
        return replace(
            self,
            foundation=self.foundation.at(time),
            friction=replace(self.friction, history=history),
            fixed_conducting=None
            if self.fixed_conducting is None
            else self.fixed_conducting.at(time),
        )

    def norms(self, values: Array) -> Array:
        """Return the norms in L2(Gamma_3) of values on each component, shape (k,). Collective."""
        if self.connected_components == 1:
            return np.array([self.nodes.norm(values)])
        squares = values**2 if values.ndim == 1 else np.einsum("ni,ni->n", values, values)
        return np.sqrt(
            component_sums(
                self.comm,
                self.connected_component,
                self.nodes.weight * squares,
                self.connected_components,
            )
        )

    def component_norms(self, values: Array) -> Array:
        """Return the norms on the components of the nodes, 1 for a single one. Collective."""
        norms = self.norms(values)
        if self.connected_components == 1 or not norms.max() > 0:
            return np.ones_like(self.nodes.weight)
        return np.maximum(norms, EPS * norms.max())[self.connected_component]

    @property
    def extents(self) -> tuple[Array, Array]:
        """The number of contact nodes of each component, and their area, shape (k,). Collective."""
        of, weight = (self.comm, self.connected_component), self.nodes.weight
        count = component_sums(*of, np.ones_like(weight), self.connected_components)
        return count, component_sums(*of, weight, self.connected_components)

    def normal_gap(self, jump: Array) -> Array:
        """Return g_N = gap - u_nu, shape (n,)."""
        return self.gap - self.nodes.normal_component(jump)

    def slip(self, jump: Array) -> Array:
        """Return the slip of the step, u_tau less that at its beginning, shape (n, d)."""
        return self.nodes.tangential_component(jump[:, : self.dim] - self.friction.history.jump)

    def commit(self, jump: Array) -> SlipHistory:
        """Return the slip history of the next step, where this one ends at a jump."""
        accumulated = self.friction.history.accumulated + self.slip_length(jump)
        return SlipHistory(self.nodes.tangential_component(jump), accumulated)

    def slip_length(self, jump: Array) -> Array:
        """Return the lengths of `slip`, shape (n,)."""
        return np.linalg.norm(self.slip(jump), axis=1)

    def pressure(self, jump: Array, multipliers: Multipliers) -> Array:
        """Return the contact pressure p = -sigma_nu = lambda_c + p_l, shape (n,)."""
        return multipliers.contact + self.foundation.layer_pressure(jump)

    @property
    def largest_pressure(self) -> Array:
        """Bounds of the contact pressure, shape (n,); finite on saturating layers alone."""
        return self.foundation.largest_pressure(self.size)

    @property
    def saturation(self) -> float:
        """The largest pressure of layers that saturate; 0 without such. Collective."""
        bound = self.largest_pressure
        return self.nodes.maximum(np.where(np.isfinite(bound), bound, 0.0))

    def bound(self, jump: Array, multipliers: Multipliers) -> Array:
        """Return the friction bound s, shape (n,). Collective."""
        return self.friction.bound(self.slip_length(jump), self.pressure(jump, multipliers))

    def traction(self, jump: Array, multipliers: Multipliers) -> Array:
        """Return -sigma nu, exerted on the foundation, layer included, shape (n, d)."""
        nodes, pressure = self.nodes, self.pressure(jump, multipliers)
        tangential = nodes.tangential_component(multipliers.friction)
        return pressure[:, None] * nodes.normal + tangential

    def active_set(
        self,
        jump: Array,
        multipliers: Multipliers,
        bound: Array,
        c: float | None = None,
        rounding_stress: float = 0.0,
    ) -> ActiveSet:
        """Return the active set: open, stick, slip.

        `c` and `rounding_stress` are those of `constraint_active`; c is `c_b` by
        default.
        """
        c = self.c_b if c is None else c
        closed = constraint_active(multipliers.contact, self.normal_gap(jump), c, rounding_stress)
        if not self.friction.acts:
            return ActiveSet.without_slip(closed, False)
        return ActiveSet.of(
            closed, multipliers.friction, self.slip(jump), bound, c, rounding_stress
        )

    def node_counts(self, jump: Array, active: ActiveSet) -> tuple[int, int, int]:
        """Return the numbers of open, stick and slip nodes; layer contact is closed. Collective."""
        closed = active.closed | (self.foundation.layer_pressure(jump) > 0)
        sticks = closed & active.sticks
        local = [np.count_nonzero(nodes) for nodes in (~closed, sticks, closed & ~sticks)]
        opened, stick, slip = (int(count) for count in summed(self.comm, local))
        return opened, stick, slip

    def rounding_stress(self, jump: Array) -> float:
        """Return the pressure of a rounding of the displacements (stress). Collective."""
        displacement = np.abs(jump[:, : self.nodes.dim]).max(axis=1, initial=0.0)
        return 2 * ROUNDING * self.c_b * self.nodes.maximum(displacement)

    def negligible(self, jump: Array, pressure: Array) -> float:
        """Return the rounding of pressures, by displacements or the largest one. Collective."""
        return max(NEGLIGIBLE * self.nodes.maximum(pressure), self.rounding_stress(jump))

    def acting(
        self, x: Array, multipliers: Multipliers
    ) -> Iterator[tuple[FoundationLaw, Array, Array]]:
        """Yield law, jumps and pressures of contact, then fixed conducting nodes. Collective."""
        jump = self.nodes.jump(x)
        yield self.foundation, jump, self.pressure(jump, multipliers)
        if self.fixed_conducting is not None:
            jump = self.fixed_conducting.nodes.jump(x)
            yield self.fixed_conducting, jump, self.fixed_conducting.resting(jump)

    def add_forces(self, residual: Array, x: Array, multipliers: Multipliers) -> None:
        """Add the forces T^T W (lambda + p_l nu, -D.nu) at local unknowns to owned values.

        lambda is that of the multipliers, without the pressure p_l of the layer; D.nu is the
        charge, 0 of an insulator.
        """
        nodes = self.nodes
        nodes.add_jump_transposed(nodes.weight[:, None] * multipliers.vectors(nodes), residual)
        for law, jump, pressure in self.acting(x, multipliers):
            density = law.force(jump, pressure)
            law.nodes.add_jump_transposed(law.nodes.weight[:, None] * density, residual)
        if self.proximal is not None:
            away = nodes.tangential_component(nodes.jump(x)) - self.proximal.about
            nodes.add_jump_transposed(
                self.proximal.stiffness * nodes.weight[:, None] * away, residual
            )

    def add_charge(
        self, residual: Array, x: Array, change: Array, multipliers: Multipliers
    ) -> None:
        """Add the change of the charge with local unknowns, psi frozen, to owned values."""
        for law, jump, pressure in self.acting(x, multipliers):
            block = law.charge_block(jump, pressure)
            density = np.einsum("nij,nj->ni", block, law.nodes.jump(change))
            law.nodes.add_jump_transposed(law.nodes.weight[:, None] * density, residual)

    @property
    def operator_nodes(self) -> NDArray[np.int32]:
        """Nodes at which the operator has blocks: contact nodes, then fixed conducting ones."""
        if self.fixed_conducting is None:
            return self.nodes.nodes
        return np.concatenate([self.nodes.nodes, self.fixed_conducting.nodes.nodes])

    def weighted(self, blocks: Array, x: Array) -> Array:
        """Return blocks at `operator_nodes`: those of the contact nodes, times their areas.

        The given `blocks` are derivatives of nodal forces at the contact nodes, without weights,
        shape (n, block size, block size).
        """
        if self.proximal is not None:
            blocks = blocks.copy()
            blocks[:, : self.dim, : self.dim] += (
                self.proximal.stiffness * self.nodes.tangential_projector
            )
        weighted = self.nodes.weight[:, None, None] * blocks
        if self.fixed_conducting is None:
            return weighted
        conducting = self.fixed_conducting.nodes
        jump = conducting.jump(x)
        block = self.fixed_conducting.charge_block(jump, self.fixed_conducting.resting(jump))
        return np.concatenate([weighted, conducting.weight[:, None, None] * block])
