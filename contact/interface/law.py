"""The interface law: layer and current, beside the unilateral constraint and friction.

The compliant layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2, and the
conductive foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30). Both act
node by node. Newton's method takes `force` and its full derivative `jacobian`.

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
from contact.interface.current import Conductor
from contact.interface.layer import Layer, NormalLaw
from contact.interface.nodes import ContactNodes
from contact.typing import Array


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

    def conducting(self, part: float) -> InterfaceLaw:
        """Return the foundation with a part of its conductivity."""
        assert self.conductor is not None
        return replace(self, conductor=self.conductor.part(part))

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
        return self.layer.h_nu(self._difference(x)) * self.layer.p_nu(self._depth(x))

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
        assert self.conductor is not None
        pressed = self._pressed(x, pressure)
        # A multiplier of the size of rounding on an open node is no pressure.
        loaded = pressed | (self.layer_pressure(x) > 0)
        return self.conductor.psi.at(self._penetration(x), pressed, loaded)

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

    def jacobian(self, x: Array, pressure: Array) -> Array:
        """Return the full derivative of `force`, shape (n, block size, block size).

        Not symmetric where h_nu depends on the potential or psi on the gap. The contact flag
        of the perfect conductor is kept; at kinks a one-sided derivative is taken.
        """
        return self.layer_block(x, True) + self.current_jacobian(x, pressure)

    def current_jacobian(self, x: Array, pressure: Array) -> Array:
        """Return the full derivative of the charge, shape (n, block size, block size)."""
        d, bs = self.jump.dim, self.jump.block_size
        total = np.zeros((x.shape[0], bs, bs))
        if self.conductor is not None:
            psi, difference = self.conductor.psi, self._difference(x)
            slope = self._conductivity(x, pressure) * self.conductor.phi_l.derivative(difference)
            total[:, -1, -1] -= self.phi_scale**2 * slope
            closing = psi.gap_slope(self._penetration(x), self._pressed(x, pressure))
            closing = self.phi_scale * closing * self.conductor.phi_l(difference)
            total[:, -1, :d] -= closing[:, None] * self.jump.normal
        return total

    def current_block(self, x: Array, pressure: Array) -> Array:
        """Return the current's derivative by the potential alone, psi frozen, (n, bs, bs).

        Zero for a lagged current. It keeps the operator of the fixed point symmetric.
        """
        bs = self.jump.block_size
        total = np.zeros((x.shape[0], bs, bs))
        if self.conductor is not None and not self.conductor.lagged:
            slope = self._conductivity(x, pressure)
            slope = slope * self.conductor.phi_l.derivative(self._difference(x))
            total[:, -1, -1] = -(self.phi_scale**2) * slope
        return total

    def block(self, x: Array, pressure: Array) -> Array:
        """Return `jacobian` without the derivatives of h_nu and psi: symmetric.

        A lagged layer or current has none.
        """
        total = self.current_block(x, pressure)
        if self.layer is not None and not self.layer.lagged:
            total += self.layer_block(x, False)
        return total
