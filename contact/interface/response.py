"""What the foundation answers besides the unilateral constraint: a layer and a current.

The compliant layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2, and the
conductive foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30). Both act
node by node. Newton's method takes `force` and its full derivative `jacobian`.

The fixed point of Algorithms 6 and 8 freezes h_nu and psi. It treats the layer with the
unilateral constraint, as the one monotone graph `NormalLaw` of Figure 1.6, and the current
through `current_block` in the operator. A linearised layer would not do there: a column that
is stiff enough cycles for ever between the slopes of an open and of a saturated layer.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.errors import InputError
from contact.interface.nodes import ContactTrace
from contact.typing import Array
from forms.laws import (
    PenetrationLaw,
    PerfectConductivity,
    RampConductivity,
    ShiftedConductivity,
    StiffnessLaw,
    Truncation,
)

EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Layer:
    """A compliant layer in front of the rigid part.

    Attributes
    ----------
    thickness
        rho - rho_0 >= 0: the layer is touched before the rigid part (length). Infinity: there
        is no rigid part, law (1.27), and the contact's gap is that of the first touch.
    p_nu, h_nu
        Penetration law and stiffness of section 8.1.2, or any others with their derivative.
        They are vectorised functions; p_nu must vanish for negative arguments.
    lagged
        Whether the force is taken from the previous outer iterate, as in the thesis.
    """

    thickness: float
    p_nu: PenetrationLaw
    h_nu: StiffnessLaw
    lagged: bool = False

    def check(self, size: float) -> None:
        """Refuse laws that are none of a layer, (h6) and (h7).

        Parameters
        ----------
        size
            Of the body: p_nu is looked at for penetrations up to it, or to the rigid part.

        Raises
        ------
        InputError
            If the thickness, p_nu or h_nu is negative or no number, a law has no derivative, or
            p_nu does not vanish before the layer is touched.
        """
        if not self.thickness >= 0:
            raise InputError(f"layer: the thickness is {self.thickness:g}; accepted: >= 0, or inf")
        depths = self.depths(size)
        differences = np.concatenate([[0.0], np.logspace(-6, 3, 37)])
        for name, law, samples in (
            ("p_nu", self.p_nu, np.concatenate([-size * np.logspace(-9, 0, 37), depths])),
            ("h_nu", self.h_nu, np.concatenate([-differences, differences])),
        ):
            if not callable(getattr(law, "derivative", None)):
                raise InputError(f"layer: {name} has no method `derivative`")
            with np.errstate(all="ignore"):
                values = np.broadcast_to(law(samples), samples.shape)
                slopes = np.broadcast_to(law.derivative(samples), samples.shape)
            if not (np.isfinite(values).all() and np.isfinite(slopes).all()):
                bad = samples[~(np.isfinite(values) & np.isfinite(slopes))][0]
                raise InputError(f"layer: {name} or its derivative is no number at {bad:g}")
            if values.min() < 0:
                bad = samples[np.argmin(values)]
                raise InputError(f"layer: {name} is negative at {bad:g}; accepted: values >= 0")
            if name == "p_nu" and np.any(values[samples < 0] > 0):
                raise InputError(
                    "layer: p_nu presses before the layer is touched; accepted: 0 at negative "
                    "penetrations"
                )

    def depths(self, size: float) -> Array:
        """Return penetrations from 0 to the rigid part, or to the size of the body if it is less.

        Parameters
        ----------
        size
            Of the body.
        """
        return min(self.thickness, size) * np.concatenate([[0.0], np.logspace(-6, 0, 73)])

    def falls(self, size: float) -> bool:
        """Tell whether p_nu falls somewhere: several solutions may then exist.

        Parameters
        ----------
        size
            Of the body.
        """
        values = np.broadcast_to(self.p_nu(self.depths(size)), (74,))
        return bool(np.any(np.diff(values) < -1e-12 * values.max()))


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
        Whether the charge is taken from the previous outer iterate, as Algorithm 4 of the
        thesis does: it then converges for small k_e only (Theorem 5.2). Else the block
        relaxation of Algorithm 5 has phi implicit, as a Robin term, and only psi is lagged.
    """

    psi: ShiftedConductivity | RampConductivity | PerfectConductivity
    phi_f: float
    phi_l: Truncation = field(default_factory=lambda: Truncation(np.inf))
    lagged: bool = False


@dataclass(frozen=True)
class NormalLaw:
    """-sigma_nu as a graph of u_nu (Figure 1.6): free, compliant layer, rigid part.

    Attributes
    ----------
    p_nu
        Penetration law.
    stiffness
        h_nu, frozen, shape (n,).
    touch, gap
        rho_0 and rho: where the layer and the rigid part are touched, shape (n,).
    """

    p_nu: PenetrationLaw
    stiffness: Array
    touch: Array
    gap: Array

    def layer(self, u_n: Array) -> Array:
        """Return the pressure of the layer at normal displacements."""
        return self.stiffness * self.p_nu(u_n - self.touch)

    def layer_slope(self, u_n: Array) -> Array:
        """Return the derivative of `layer`."""
        return self.stiffness * self.p_nu.derivative(u_n - self.touch)

    def pressure(self, z: Array, r: float) -> Array:
        """Return the total pressure P for which (phi, P) is on the graph and P + r phi = z.

        This is what (3.43) becomes with a layer. The graph rises, so that P is unique for any
        r > 0; where p_nu falls, r must exceed its slope.
        """
        low, high = self.touch, np.minimum(self.gap, z / r)
        free, rigid = z <= r * low, z - r * self.gap >= self.layer(high)
        phi, done = high, free | rigid
        # Newton's method in a bracket; every third sweep halves it, should Newton not.
        for sweep in range(90):
            excess = r * phi + self.layer(phi) - z
            slope = r + self.layer_slope(phi)
            # Below this the excess is rounding in phi.
            rounding = 4 * EPS * (np.abs(z) + np.abs(slope) * (np.abs(phi) + np.abs(self.touch)))
            done |= np.abs(excess) <= rounding
            if np.all(done):
                break
            low, high = np.where(excess < 0, phi, low), np.where(excess > 0, phi, high)
            newton = phi - excess / np.where(slope > 0, slope, r)
            inside = (newton > low) & (newton < high) & (sweep % 3 < 2)
            phi = np.where(done, phi, np.where(inside, newton, 0.5 * (low + high)))
        # The layer's pressure is exact where it is small, the remainder where it is stiff.
        soft = self.layer_slope(phi) < r
        pressed = np.where(soft, self.layer(phi), z - r * phi)
        return np.where(free, 0.0, np.where(rigid, z - r * self.gap, pressed))

    def displacement(self, z: Array, r: float) -> Array:
        """Return the u_nu that goes with `pressure`."""
        return np.asarray((z - self.pressure(z, r)) / r, dtype=float)

    def pressure_slope(self, z: Array, r: float) -> Array:
        """Return the derivative of `pressure` by z: 0 free, 1 rigid, between them in the layer."""
        high = np.minimum(self.gap, z / r)
        free, rigid = z <= r * self.touch, z - r * self.gap >= self.layer(high)
        slope = self.layer_slope(self.displacement(z, r))
        return np.where(free, 0.0, np.where(rigid, 1.0, slope / (slope + r)))


@dataclass(frozen=True)
class FoundationResponse:
    """Layer and conductor at the contact nodes; potentials come divided by `phi_scale`.

    `contact_scale` (stress/length) weighs penetrations against pressures.
    """

    trace: ContactTrace
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
        return not isinstance(conductor.psi, PerfectConductivity) and conductor.psi.k_e > 0

    @property
    def constrained_trace(self) -> ContactTrace:
        """The contact nodes with the gap of the unilateral constraint: infinite without one."""
        if self.layer is None or np.isfinite(self.layer.thickness):
            return self.trace
        return replace(self.trace, gap=np.full_like(self.trace.gap, np.inf))

    @property
    def touch(self) -> Array:
        """The gap rho_0 of the layer's first touch, shape (n,)."""
        assert self.layer is not None
        depth = self.layer.thickness
        return self.trace.gap - (depth if np.isfinite(depth) else 0.0)

    def normal_law(self, x: Array) -> NormalLaw | None:
        """Return the layer and the constraint as one graph, h_nu frozen at the nodal unknowns.

        None where there is no layer, or where it is lagged and thus a given force.
        """
        if self.layer is None or self.layer.lagged:
            return None
        stiffness = np.broadcast_to(self.layer.h_nu(self._difference(x)), x.shape[:1])
        gap = self.constrained_trace.gap
        return NormalLaw(self.layer.p_nu, stiffness, self.touch, gap)

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
        return self.layer.h_nu(self._difference(x)) * self.layer.p_nu(self._depth(x))

    def _depth(self, x: Array) -> Array:
        """Return how deep the layer is pressed in: not deeper than to the rigid part.

        An iterate may go beyond; what it then takes belongs to the multiplier alone.
        """
        return np.minimum(self.trace.normal_component(x), self.constrained_trace.gap) - self.touch

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
        return psi(np.where(self._pressed(x, pressure), 0.0, self._penetration(x)))

    def _pressed(self, x: Array, pressure: Array) -> NDArray[np.bool_]:
        """Tell where the rigid part presses, and u_nu = rho.

        An iterate misses that by the tolerance of the inner loop, which the steep ramp would
        make a thousand times larger; an open node may carry a multiplier of that size.
        """
        opening = self.trace.normal_component(x) - self.constrained_trace.gap
        return np.greater(pressure - self.layer_pressure(x) + self.contact_scale * opening, 0.0)

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
        depth, difference = self._depth(x), self._difference(x)
        inside = self.trace.normal_component(x) < self.constrained_trace.gap
        slope = self.layer.h_nu(difference) * self.layer.p_nu.derivative(depth) * inside
        total[:, : self.trace.dim] = slope[:, None] * self.trace.normal
        if self.trace.block_size > self.trace.dim:
            growth = self.layer.h_nu.derivative(difference) * self.layer.p_nu(depth)
            total[:, -1] = self.phi_scale * growth
        return total

    def layer_block(self, x: Array, full: bool) -> Array:
        """Return the derivative of the layer's force, shape (n, block size, block size).

        Without that of h_nu, which is not symmetric, unless `full`.
        """
        gradient = self.layer_gradient(x)
        if not full:
            gradient[:, self.trace.dim :] = 0.0
        total = np.zeros((*gradient.shape, self.trace.block_size))
        total[:, : self.trace.dim] = self.trace.normal[:, :, None] * gradient[:, None, :]
        return total

    def jacobian(self, x: Array, pressure: Array) -> Array:
        """Return the full derivative of `force`, shape (n, block size, block size).

        Not symmetric where h_nu depends on the potential or psi on the gap. The contact flag
        of the perfect conductor is kept; at kinks a one-sided derivative is taken.
        """
        return self.layer_block(x, True) + self.current_jacobian(x, pressure)

    def current_jacobian(self, x: Array, pressure: Array) -> Array:
        """Return the full derivative of the charge, shape (n, block size, block size)."""
        d, bs = self.trace.dim, self.trace.block_size
        total = np.zeros((x.shape[0], bs, bs))
        if self.conductor is not None:
            psi, difference = self.conductor.psi, self._difference(x)
            slope = self._conductivity(x, pressure) * self.conductor.phi_l.derivative(difference)
            total[:, -1, -1] -= self.phi_scale**2 * slope
            if not isinstance(psi, PerfectConductivity):
                open_slope = psi.derivative(self._penetration(x))
                closing = np.where(self._pressed(x, pressure), 0.0, open_slope)
                closing = self.phi_scale * closing * self.conductor.phi_l(difference)
                total[:, -1, :d] -= closing[:, None] * self.trace.normal
        return total

    def current_block(self, x: Array, pressure: Array) -> Array:
        """Return the current's derivative by the potential alone, psi frozen, (n, bs, bs).

        Zero for a lagged current. It keeps the operator of the fixed point symmetric.
        """
        bs = self.trace.block_size
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
