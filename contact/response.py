"""What the foundation answers besides the unilateral constraint: a layer and a current.

The compliant layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2, and the
conductive foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30). Both act
node by node. `force` gives them at an iterate and `block` their linearisation, which an outer
loop puts into the operator; what is lagged has no block.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from contact.projections import Array
from contact.trace import ContactTrace
from forms.laws import (
    Compliance,
    PerfectConductivity,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)


@dataclass(frozen=True)
class Layer:
    """A compliant layer in front of the rigid part.

    Attributes
    ----------
    thickness
        rho - rho_0 >= 0: the layer is touched before the rigid part (length).
    p_nu, h_nu
        Penetration law and stiffness of section 8.1.2.
    lagged
        Whether the force is taken from the previous outer iterate, as in the thesis.
    """

    thickness: float
    p_nu: Compliance
    h_nu: PotentialFactor
    lagged: bool = False


@dataclass(frozen=True)
class Conductor:
    """A conductive foundation at the potential phi_f.

    Attributes
    ----------
    psi
        Conductivity law.
    phi_f
        Potential of the foundation.
    phi_l
        Truncation of the potential difference.
    lagged
        Whether the charge is taken from the previous outer iterate, as in the thesis; else
        only psi is.
    """

    psi: ShiftedConductivity | RampConductivity | PerfectConductivity
    phi_f: float
    phi_l: Truncation = field(default_factory=lambda: Truncation(np.inf))
    lagged: bool = False


@dataclass(frozen=True)
class FoundationResponse:
    """Layer and conductor at the contact nodes; potentials come divided by `phi_scale`."""

    trace: ContactTrace
    layer: Layer | None
    conductor: Conductor | None
    phi_scale: float

    @property
    def active(self) -> bool:
        """Whether there is a layer or a conductor."""
        return self.layer is not None or self.conductor is not None

    def _difference(self, x: Array) -> Array:
        """Return phi - phi_F at the nodes; 0 for a body without potential."""
        if self.trace.block_size == self.trace.dim:
            return np.zeros(x.shape[0])
        phi_f = self.conductor.phi_f if self.conductor is not None else 0.0
        return self.phi_scale * x[:, -1] - phi_f

    def _penetration(self, x: Array) -> Array:
        """Return u_nu - rho at the nodes."""
        return self.trace.normal_component(x) - self.trace.gap

    def layer_pressure(self, x: Array) -> Array:
        """Return the pressure of the layer at nodal unknowns of shape (n, block size)."""
        if self.layer is None:
            return np.zeros(x.shape[0])
        depth = self._penetration(x) + self.layer.thickness
        return self.layer.h_nu(self._difference(x)) * self.layer.p_nu(depth)

    def charge(self, x: Array, pressure: Array) -> Array:
        """Return D.nu = psi phi_L(phi - phi_F) at the nodes; `pressure` tells the contact."""
        if self.conductor is None:
            return np.zeros(x.shape[0])
        return self._conductivity(x, pressure) * self.conductor.phi_l(self._difference(x))

    def _conductivity(self, x: Array, pressure: Array) -> Array:
        assert self.conductor is not None
        psi = self.conductor.psi
        if isinstance(psi, PerfectConductivity):
            return psi(pressure > 0)
        # Where the rigid part presses, u_nu = rho. An iterate misses that by the tolerance of
        # the inner loop, which the steep ramp would make a thousand times larger.
        pressed = pressure - self.layer_pressure(x) > 1e-12 * np.abs(pressure)
        return psi(np.where(pressed, 0.0, self._penetration(x)))

    def force(self, x: Array, pressure: Array) -> Array:
        """Return the nodal residual density, shape (n, block size), in scaled unknowns."""
        total = np.zeros((x.shape[0], self.trace.block_size))
        total[:, : self.trace.dim] = self.layer_pressure(x)[:, None] * self.trace.normal
        if self.conductor is not None:
            total[:, -1] -= self.phi_scale * self.charge(x, pressure)
        return total

    def layer_gradient(self, x: Array) -> Array:
        """Return the derivative of `layer_pressure` by the nodal unknowns, (n, block size)."""
        total = np.zeros((x.shape[0], self.trace.block_size))
        if self.layer is None:
            return total
        depth, difference = self._penetration(x) + self.layer.thickness, self._difference(x)
        slope = self.layer.h_nu(difference) * self.layer.p_nu.derivative(depth)
        total[:, : self.trace.dim] = slope[:, None] * self.trace.normal
        if self.trace.block_size > self.trace.dim:
            growth = self.layer.h_nu.derivative(difference) * self.layer.p_nu(depth)
            total[:, -1] = self.phi_scale * growth
        return total

    def jacobian(self, x: Array, pressure: Array) -> Array:
        """Return the full derivative of `force`, shape (n, block size, block size).

        Not symmetric where h_nu depends on the potential or psi on the gap. The contact flag
        of the perfect conductor is kept; at kinks a one-sided derivative is taken.
        """
        d, bs = self.trace.dim, self.trace.block_size
        total = np.zeros((x.shape[0], bs, bs))
        total[:, :d, :] = self.trace.normal[:, :, None] * self.layer_gradient(x)[:, None, :]
        if self.conductor is not None:
            psi, difference = self.conductor.psi, self._difference(x)
            slope = self._conductivity(x, pressure) * self.conductor.phi_l.derivative(difference)
            total[:, -1, -1] -= self.phi_scale**2 * slope
            if not isinstance(psi, PerfectConductivity):
                closing = psi.derivative(self._penetration(x)) * self.conductor.phi_l(difference)
                total[:, -1, :d] -= self.phi_scale * closing[:, None] * self.trace.normal
        return total

    def block(self, x: Array, pressure: Array) -> Array:
        """Return the symmetric linearisation, shape (n, block size, block size).

        h_nu and psi are frozen: what they add is not symmetric, and is left to the outer loop.
        """
        d, bs = self.trace.dim, self.trace.block_size
        total = np.zeros((x.shape[0], bs, bs))
        if self.layer is not None and not self.layer.lagged:
            depth = self._penetration(x) + self.layer.thickness
            slope = self.layer.h_nu(self._difference(x)) * self.layer.p_nu.derivative(depth)
            normal = self.trace.normal
            total[:, :d, :d] += slope[:, None, None] * normal[:, :, None] * normal[:, None, :]
        if self.conductor is not None and not self.conductor.lagged:
            slope = self._conductivity(x, pressure)
            slope = slope * self.conductor.phi_l.derivative(self._difference(x))
            total[:, -1, -1] -= self.phi_scale**2 * slope
        return total
