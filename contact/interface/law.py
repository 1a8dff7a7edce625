"""The interface law: layer and current, beside the unilateral constraint and friction.

The compliant layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2, and the
conductive foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30). Both act
node by node. Newton's method takes `force` and its full derivative.

The fixed point of Algorithms 6 and 8 freezes h_nu and psi. It treats the layer with the
unilateral constraint, as the one monotone graph `NormalLaw` of Figure 1.6, and the current
through `current_block` in the operator. A linearised layer would not do there: a column that
is stiff enough cycles for ever between the slopes of an open and of a saturated layer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.active_set import touching
from contact.interface.layer import NormalLaw
from contact.interface.nodes import ContactNodes
from contact.model.electric import Conductor
from contact.model.layer import Layer
from contact.typing import Array

#: A pressure above zero.
TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class InterfaceLaw:
    """Layer and conductor at the contact nodes; potentials come divided by `phi_scale`.

    `contact_scale` (stress/length) weighs penetrations against pressures.
    """

    jump: ContactNodes
    layer: Layer | None
    conductor: Conductor | None
    phi_scale: float
    contact_scale: float

    @property
    def active(self) -> bool:
        """Whether there is a layer or a conductor."""
        return self.layer is not None or self.conductor is not None

    @property
    def follows_gap(self) -> bool:
        """Whether the charge is implicit and depends smoothly on the gap."""
        conductor = self.conductor
        if conductor is None or conductor.lagged:
            return False
        return conductor.psi.follows_gap

    @property
    def constrained(self) -> ContactNodes:
        """The contact nodes with the gap of the unilateral constraint: infinite without one."""
        rigid = self.layer is None or np.isfinite(self.layer.thickness)
        if np.all(rigid):
            return self.jump
        return replace(self.jump, gap=np.where(rigid, self.jump.gap, np.inf))

    @property
    def touch(self) -> Array:
        """The gap rho_0 of the layer's first touch, shape (n,)."""
        assert self.layer is not None
        depth = self.layer.thickness
        return self.jump.gap - np.where(np.isfinite(depth), depth, 0.0)

    def at(self, time: float) -> InterfaceLaw:
        """Return the foundation at a time."""
        if self.conductor is None:
            return self
        return replace(self, conductor=self.conductor.at(time))

    def conducting(self, share: float) -> InterfaceLaw:
        """Return the foundation with a part of its conductivity."""
        assert self.conductor is not None
        return replace(self, conductor=replace(self.conductor, share=share))

    def normal_law(self, x: Array) -> NormalLaw | None:
        """Return the layer and the constraint as one graph, h_nu frozen at the nodal unknowns.

        None where there is no layer, or where it is lagged and thus a given force.
        """
        if self.layer is None or self.layer.lagged:
            return None
        stiffness = np.broadcast_to(self.layer.h_nu(self._difference(x)), x.shape[:1])
        gap = self.constrained.gap
        return NormalLaw(self.layer.p_nu, stiffness, self.touch, gap)

    def _difference(self, x: Array) -> Array:
        """Return phi - phi_F at the nodes; 0 for a body without potential."""
        if self.jump.block_size == self.jump.dim:
            return np.zeros(x.shape[0])
        phi_f = self.conductor.phi_f if self.conductor is not None else 0.0
        return self.phi_scale * x[:, -1] - phi_f

    def _penetration(self, x: Array) -> Array:
        """Return u_nu - rho at the nodes."""
        return self.jump.normal_component(x) - self.jump.gap

    def layer_pressure(self, x: Array) -> Array:
        """Return the pressure of the layer at nodal unknowns of shape (n, block size)."""
        if self.layer is None:
            return np.zeros(x.shape[0])
        stiffness = self.layer.h_nu(self._difference(x))
        return np.asarray(stiffness * self.layer.p_nu(self._depth(x)), dtype=float)

    def _depth(self, x: Array) -> Array:
        """Return how deep the layer is pressed in: not deeper than to the rigid part.

        An iterate may go beyond; the excess pressure belongs to the multiplier alone.
        """
        return np.minimum(self.jump.normal_component(x), self.constrained.gap) - self.touch

    def charge(self, x: Array, pressure: Array) -> Array:
        """Return D.nu = psi phi_L(phi - phi_F) at the nodes; `pressure` tells the contact."""
        if self.conductor is None:
            return np.zeros(x.shape[0])
        return self._conductivity(x, pressure) * self.conductor.phi_l(self._difference(x))

    def _conductivity(self, x: Array, pressure: Array) -> Array:
        """Return psi at the nodes."""
        assert self.conductor is not None
        pressed = self._pressed(x, pressure)
        # A multiplier of the size of rounding on an open node is no pressure.
        loaded = pressed | (self.layer_pressure(x) > 0)
        psi = self.conductor.psi.at(self._penetration(x), pressed, loaded)
        return np.asarray(self.conductor.share * psi)

    def resting(self, x: Array) -> Array:
        """Return pressures by which nodes conduct whose displacements are prescribed, shape (n,).

        They are closed up to the rounding of these; there is no tolerance of a solver.
        """
        reach = np.abs(self.jump.gap) + np.linalg.norm(x[:, : self.jump.dim], axis=1)
        return np.maximum(1e-12 * self.contact_scale * reach, TINY)

    def _pressed(self, x: Array, pressure: Array) -> NDArray[np.bool_]:
        """Tell where the rigid part presses, and u_nu = rho.

        An iterate misses that by the tolerance of the inner loop, which the steep ramp would
        make a thousand times larger; an open node may carry a multiplier of that size.
        """
        opening = self.constrained.gap - self.jump.normal_component(x)
        return touching(pressure - self.layer_pressure(x), opening, self.contact_scale)

    def force(self, x: Array, pressure: Array) -> Array:
        """Return the nodal residual density, shape (n, block size), in scaled unknowns."""
        total = np.zeros((x.shape[0], self.jump.block_size))
        total[:, : self.jump.dim] = self.layer_pressure(x)[:, None] * self.jump.normal
        if self.conductor is not None:
            total[:, -1] -= self.phi_scale * self.charge(x, pressure)
        return total

    def layer_gradient(self, x: Array) -> Array:
        """Return the derivative of `layer_pressure` by the nodal unknowns, (n, block size)."""
        total = np.zeros((x.shape[0], self.jump.block_size))
        if self.layer is None:
            return total
        depth, difference = self._depth(x), self._difference(x)
        inside = self.jump.normal_component(x) < self.constrained.gap
        slope = self.layer.h_nu(difference) * self.layer.p_nu.derivative(depth) * inside
        total[:, : self.jump.dim] = slope[:, None] * self.jump.normal
        if self.jump.block_size > self.jump.dim:
            growth = self.layer.h_nu.derivative(difference) * self.layer.p_nu(depth)
            total[:, -1] = self.phi_scale * growth
        return total

    def layer_block(self, x: Array, full: bool) -> Array:
        """Return the derivative of the layer's force, shape (n, block size, block size).

        Without that of h_nu, which is not symmetric, unless `full`.
        """
        gradient = self.layer_gradient(x)
        if not full:
            gradient[:, self.jump.dim :] = 0.0
        total = np.zeros((*gradient.shape, self.jump.block_size))
        total[:, : self.jump.dim] = self.jump.normal[:, :, None] * gradient[:, None, :]
        return total

    def current_block(self, x: Array, pressure: Array, full: bool = False) -> Array:
        """Return the derivative of the charge in `force`, shape (n, block size, block size).

        Parameters
        ----------
        x, pressure
            Nodal unknowns, and pressures that tell the contact.
        full
            With the derivative of psi by the gap, not symmetric. Else psi is frozen, and a lagged
            current has no derivative, as the fixed point takes it.
        """
        d, bs = self.jump.dim, self.jump.block_size
        total = np.zeros((x.shape[0], bs, bs))
        if self.conductor is None or (self.conductor.lagged and not full):
            return total
        conductor, difference = self.conductor, self._difference(x)
        slope = self._conductivity(x, pressure) * conductor.phi_l.derivative(difference)
        total[:, -1, -1] = -(self.phi_scale**2) * slope
        if full:
            # The contact flag of the perfect conductor is kept; at kinks a one-sided derivative.
            closing = conductor.psi.gap_slope(self._penetration(x), self._pressed(x, pressure))
            closing = self.phi_scale * conductor.share * closing * conductor.phi_l(difference)
            total[:, -1, :d] = -np.asarray(closing)[:, None] * self.jump.normal
        return total

    def block(self, x: Array, pressure: Array, full: bool = False) -> Array:
        """Return the derivative of `force`, shape (n, block size, block size).

        Without the derivatives of h_nu and psi, and thus symmetric, unless `full`; then that of a
        lagged layer and current too.
        """
        total = self.current_block(x, pressure, full)
        if self.layer is not None and (full or not self.layer.lagged):
            total += self.layer_block(x, full)
        return total
