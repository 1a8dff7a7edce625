"""Normal compliance and electrical contact, beside the unilateral constraint and friction.

The compliant layer presses with h_nu(phi - phi_F) p_nu(u_nu - rho_0), section 8.1.2, and the
conductive foundation draws the charge psi(u_nu - rho) phi_L(phi - phi_F), (1.30), (5.11). Both act
node by node. Newton's method takes the whole of `layer_block` and `charge_block` once the active
set no longer changes.

Algorithms 4 and 6 of the thesis freeze the charge l, Algorithms 6 and 8 the layer's force j_1: all
of each is on the right-hand side; so it is here where they are `lagged`. The variants of the code
freeze psi (4, 6) and h_nu (6, 8) alone. They treat the layer with the unilateral constraint, as the
one monotone graph `NormalGraph` of Figure 1.6, and phi_L through `charge_block` in the operator. A
linearised layer would not do there: a column that is stiff enough cycles for ever between the
slopes of an open and of a saturated layer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.multipliers import constraint_active
from contact.interface.nodes import ContactNodes
from contact.model.foundation import Conductor, Layer
from contact.tolerances import EPS
from contact.typing import Array
from forms.laws import PenetrationLaw
from forms.ops import Value

#: Change of a stiffness within a small penetration, over the larger one, that is a kink of the law;
#: least one over `c_b`.
KINK, SOFTEST = 0.01, 1e-5

#: A pressure, or a penetration, above zero.
TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class NormalGraph:
    """The contact law (1.29), -sigma_nu as a graph of u_nu: free, compliant layer, rigid part.

    That of Figure 1.6, but that the layer presses from rho_0 < rho on, in (1.29) from rho.

    Attributes
    ----------
    p_nu
        Penetration law.
    stiffness
        h_nu, frozen, shape (n,).
    rho_0, gap
        rho_0 and rho, gaps at which layer and rigid part are touched, shape (n,).
    """

    p_nu: PenetrationLaw
    stiffness: Array
    rho_0: Array
    gap: Array

    def layer_pressure(self, u_n: Array) -> Array:
        """Return p_l at u_nu, by its law also where an iterate exceeds rho."""
        return self.stiffness * self.p_nu(u_n - self.rho_0)

    def layer_slope(self, u_n: Array) -> Array:
        """Return the derivative of p_l by u_nu; at the first touch that of the pressed layer."""
        s = u_n - self.rho_0
        return self.stiffness * self.p_nu.derivative(np.where(s == 0, TINY, s))

    def pressure(self, q: Array, r: float) -> Array:
        """Return the resolvent of the maximal monotone graph: p = -sigma_nu with p + r u_nu = q.

        It is (3.43) with a layer, and unique for any r > 0 above the slope of a falling p_nu.
        """
        low, high = self.rho_0, np.minimum(self.gap, q / r)
        u_n, layer, steep = high, self.layer_pressure(high), self.layer_slope(high)
        free, rigid = q <= r * low, q - r * self.gap >= layer
        done = free | rigid
        # Newton's method in a bracket; every third sweep halves it, should Newton not.
        for sweep in range(90):
            excess, slope = r * u_n + layer - q, r + steep
            # Below this the excess is rounding in u_n.
            rounding_stress = (
                4 * EPS * (np.abs(q) + np.abs(slope) * (np.abs(u_n) + np.abs(self.rho_0)))
            )
            done |= np.abs(excess) <= rounding_stress
            if np.all(done):
                break
            low, high = np.where(excess < 0, u_n, low), np.where(excess > 0, u_n, high)
            newton = u_n - excess / np.where(slope > 0, slope, r)
            inside = (newton > low) & (newton < high) & (sweep % 3 < 2)
            u_n = np.where(done, u_n, np.where(inside, newton, 0.5 * (low + high)))
            layer, steep = self.layer_pressure(u_n), self.layer_slope(u_n)
        # The layer's pressure is exact where it is small, the remainder where it is stiff.
        pressed = np.where(steep < r, layer, q - r * u_n)
        return np.where(free, 0.0, np.where(rigid, q - r * self.gap, pressed))

    def displacement(self, q: Array, r: float) -> Array:
        """Return u_nu = (q - `pressure`)/r."""
        return np.asarray((q - self.pressure(q, r)) / r, dtype=float)

    def pressure_slope(self, q: Array, r: float) -> Array:
        """Return the derivative of `pressure` by q: 0 free, 1 rigid, between them in the layer."""
        high = np.minimum(self.gap, q / r)
        free, rigid = q <= r * self.rho_0, q - r * self.gap >= self.layer_pressure(high)
        slope = self.layer_slope(self.displacement(q, r))
        return np.where(free, 0.0, np.where(rigid, 1.0, slope / (slope + r)))


@dataclass(frozen=True)
class ElasticBed:
    """k s in place of p_nu(s), in tension too; see `PenetrationLaw`."""

    stiffness: Array

    def __call__(self, s: Value) -> Value:
        """Return the pressure over h_nu."""
        return self.stiffness * s

    def derivative(self, s: Value) -> Value:
        """Return its derivative."""
        return self.stiffness + 0.0 * s


@dataclass(frozen=True)
class FoundationLaw:
    """Layer and conductor at the contact nodes; potentials come divided by `phi_scale`.

    `c_b` (stress/length) weighs penetrations against pressures.
    """

    nodes: ContactNodes
    layer: Layer | None
    conductor: Conductor | None
    phi_scale: float
    c_b: float

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
    def signorini_gap(self) -> Array:
        """Gap of the unilateral constraint, (n,): infinite where there is no rigid part."""
        rigid = self.layer is None or np.isfinite(self.layer.thickness)
        return np.where(rigid, self.nodes.gap, np.inf)

    @property
    def rho_0(self) -> Array:
        """Gap at which the layer is touched first, rho less its thickness, shape (n,)."""
        assert self.layer is not None
        depth = self.layer.thickness
        return self.nodes.gap - np.where(np.isfinite(depth), depth, 0.0)

    def at(self, time: float) -> FoundationLaw:
        """Return the foundation at a time."""
        if self.conductor is None:
            return self
        return replace(self, conductor=self.conductor.at(time))

    def conducting(self, share: float) -> FoundationLaw:
        """Return the foundation with a part of its psi."""
        assert self.conductor is not None
        return replace(self, conductor=replace(self.conductor, share=share))

    def elastic_bed(self, secant: Array) -> FoundationLaw:
        """Return the foundation with an elastic bed in place of its layer, in tension too."""
        assert self.layer is not None
        return replace(self, layer=replace(self.layer, p_nu=ElasticBed(secant)))

    def secant(self, jump: Array) -> Array:
        """Return p_nu(s)/s at jumps, shape (n,); 0 where the layer is not touched."""
        assert self.layer is not None
        s = self._layer_penetration(jump)
        return np.asarray(self.layer.p_nu(s) / np.where(s > 0, s, 1.0), dtype=float)

    def regimes(self, jump: Array) -> NDArray[np.int8]:
        """Return 0 where the layer is open, 1 below saturation, 2 beyond, shape (n,).

        Saturated is a tangent of less than half of the secant.
        """
        return self._regimes(self._layer_penetration(jump))

    def _regimes(self, s: Array) -> NDArray[np.int8]:
        assert self.layer is not None
        pressure, slope = self.layer.p_nu(s), self.layer.p_nu.derivative(s)
        return np.where(pressure > 0, np.where(slope * s < pressure / 2, 2, 1), 0).astype(np.int8)

    def _depths(self, size: float) -> list[Array]:
        """Return penetrations up to a thousand times the size of the bodies, shape (n,) each."""
        return [np.full(self.nodes.weight.size, s) for s in size * np.logspace(-9, 3, 49)]

    def saturates(self, size: float) -> NDArray[np.bool_]:
        """Return where the layer saturates at any penetration, shape (n,)."""
        if self.layer is None or self.layer.lagged:
            return np.zeros(self.nodes.weight.size, dtype=bool)
        return np.max([self._regimes(s) == 2 for s in self._depths(size)], axis=0)

    def largest_secant(self, size: float) -> Array:
        """Return the largest p_nu(s)/s of all penetrations, shape (n,)."""
        assert self.layer is not None
        return np.max([self.layer.p_nu(s) / s for s in self._depths(size)], axis=0)

    def normal_graph(self, jump: Array) -> NormalGraph | None:
        """Return the layer and the constraint as one graph, h_nu frozen at the jumps.

        None where there is no layer, or where it is lagged and thus a given force.
        """
        if self.layer is None or self.layer.lagged:
            return None
        stiffness = np.broadcast_to(self.layer.h_nu(self._difference(jump)), jump.shape[:1])
        gap = self.signorini_gap
        return NormalGraph(self.layer.p_nu, stiffness, self.rho_0, gap)

    def _difference(self, jump: Array) -> Array:
        """Return phi - phi_F at the nodes; 0 for a body without potential."""
        if self.nodes.block_size == self.nodes.dim:
            return np.zeros(jump.shape[0])
        phi_f = self.conductor.phi_f if self.conductor is not None else 0.0
        return self.phi_scale * jump[:, -1] - phi_f

    def _past_rigid_part(self, jump: Array) -> Array:
        """Return u_nu - rho, rho the geometric gap: that of the constraint may be infinite."""
        return self.nodes.normal_component(jump) - self.nodes.gap

    def layer_pressure(self, jump: Array) -> Array:
        """Return p_l at jumps of shape (n, block size), shape (n,)."""
        if self.layer is None:
            return np.zeros(jump.shape[0])
        stiffness = self.layer.h_nu(self._difference(jump))
        return np.asarray(stiffness * self.layer.p_nu(self._layer_penetration(jump)), dtype=float)

    def largest_pressure(self, size: float) -> Array:
        """Return bounds of the contact pressure p, shape (n,): finite on saturating layers.

        Infinite with a rigid part, and where p_nu falls anywhere, or still grows at a thousand
        times the size of the bodies (length). h_nu is the largest of any potential.
        """
        unbounded = np.full(self.nodes.weight.size, np.inf)
        if self.layer is None:
            return unbounded
        p_nu = np.array([self.layer.p_nu(s) for s in self._depths(size)])
        steps = np.diff(p_nu, axis=0)
        saturates = np.isinf(self.layer.thickness) & (steps >= 0).all(axis=0) & (steps[-1] == 0)
        differences = np.array([0.0])
        if self.nodes.block_size > self.nodes.dim:
            differences = np.outer([-1.0, 1.0], np.logspace(-6, 9, 46)).ravel()
        h_nu = [np.asarray(self.layer.h_nu(np.full(unbounded.size, s))) for s in differences]
        return np.where(saturates, np.max(h_nu, axis=0) * p_nu[-1], np.inf)

    def _layer_penetration(self, jump: Array) -> Array:
        """Return the penetration of the layer, min(u_nu, gap) - rho_0, shape (n,)."""
        # An iterate may go beyond the rigid part; the excess pressure belongs to the multiplier.
        return np.minimum(self.nodes.normal_component(jump), self.signorini_gap) - self.rho_0

    def charge(self, jump: Array, pressure: Array) -> Array:
        """Return D.nu = psi phi_L(phi - phi_F) of (5.11); nodes with `pressure` are closed."""
        if self.conductor is None:
            return np.zeros(jump.shape[0])
        return self._psi(jump, pressure) * self.conductor.phi_l(self._difference(jump))

    def _psi(self, jump: Array, pressure: Array) -> Array:
        """Return psi at the nodes."""
        assert self.conductor is not None
        pressed = self._pressed(jump, pressure)
        # A multiplier of the size of rounding on an open node is no pressure.
        loaded = pressed | (self.layer_pressure(jump) > 0)
        psi = self.conductor.psi.at(self._past_rigid_part(jump), pressed, loaded)
        return np.asarray(self.conductor.share * psi)

    def resting(self, jump: Array) -> Array:
        """Return pressures just above rounding, shape (n,), which mark fixed nodes as closed."""
        reach = np.abs(self.nodes.gap) + np.linalg.norm(jump[:, : self.nodes.dim], axis=1)
        return np.maximum(1e-12 * self.c_b * reach, TINY)

    def _pressed(self, jump: Array, pressure: Array) -> NDArray[np.bool_]:
        """Return where the rigid part presses, shape (n,)."""
        # u_nu = rho holds to the tolerance of the inner loop, which a steep ramp makes a thousand
        # times larger; so large a multiplier at an open node is no pressure.
        normal_gap = self.signorini_gap - self.nodes.normal_component(jump)
        return constraint_active(pressure - self.layer_pressure(jump), normal_gap, self.c_b)

    def force(self, jump: Array, pressure: Array) -> Array:
        """Return the residual density on Gamma_3, shape (n, block size), in scaled unknowns."""
        total = np.zeros((jump.shape[0], self.nodes.block_size))
        total[:, : self.nodes.dim] = self.layer_pressure(jump)[:, None] * self.nodes.normal
        if self.conductor is not None:
            total[:, -1] -= self.phi_scale * self.charge(jump, pressure)
        return total

    def kinks(self, jump: Array, reach: Array | float) -> NDArray[np.bool_]:
        """Return where the layer's stiffness jumps within a penetration `reach`, shape (n,)."""
        if self.layer is None:
            return np.zeros(jump.shape[0], dtype=bool)
        s, stiffness = self._layer_penetration(jump), self.layer.h_nu(self._difference(jump))
        before, after = (
            np.abs(stiffness * self.layer.p_nu.derivative(s + way)) for way in (-reach, reach)
        )
        least = np.maximum(KINK * np.maximum(before, after), SOFTEST * self.c_b)
        return np.asarray(np.abs(after - before) > least)

    def layer_gradient(self, jump: Array) -> Array:
        """Return the derivative of `layer_pressure` by the jumps, shape (n, block size)."""
        total = np.zeros((jump.shape[0], self.nodes.block_size))
        if self.layer is None:
            return total
        depth, difference = self._layer_penetration(jump), self._difference(jump)
        inside = self.nodes.normal_component(jump) < self.signorini_gap
        slope = self.layer.h_nu(difference) * self.layer.p_nu.derivative(depth) * inside
        total[:, : self.nodes.dim] = slope[:, None] * self.nodes.normal
        if self.nodes.block_size > self.nodes.dim:
            growth = self.layer.h_nu.derivative(difference) * self.layer.p_nu(depth)
            total[:, -1] = self.phi_scale * growth
        return total

    def layer_block(self, jump: Array, full: bool) -> Array:
        """Return the derivative of the layer's force, shape (n, block size, block size).

        Without that of h_nu, which is not symmetric, unless `full`.
        """
        gradient = self.layer_gradient(jump)
        if not full:
            gradient[:, self.nodes.dim :] = 0.0
        total = np.zeros((*gradient.shape, self.nodes.block_size))
        total[:, : self.nodes.dim] = self.nodes.normal[:, :, None] * gradient[:, None, :]
        return total

    def charge_block(self, jump: Array, pressure: Array, full: bool = False) -> Array:
        """Return the derivative of the charge in `force`, shape (n, block size, block size).

        With that of psi by the gap, not symmetric, if `full`. Else psi is frozen, and a lagged
        charge has no derivative, as in the fixed point.
        """
        d, bs = self.nodes.dim, self.nodes.block_size
        total = np.zeros((jump.shape[0], bs, bs))
        if self.conductor is None or (self.conductor.lagged and not full):
            return total
        conductor, difference = self.conductor, self._difference(jump)
        slope = self._psi(jump, pressure) * conductor.phi_l.derivative(difference)
        total[:, -1, -1] = -(self.phi_scale**2) * slope
        if full:
            # The contact flag of the perfect conductor is kept; at kinks a one-sided derivative.
            closing = conductor.psi.gap_slope(
                self._past_rigid_part(jump), self._pressed(jump, pressure)
            )
            closing = self.phi_scale * conductor.share * closing * conductor.phi_l(difference)
            total[:, -1, :d] = -np.asarray(closing)[:, None] * self.nodes.normal
        return total

    def block(self, jump: Array, pressure: Array, full: bool = False) -> Array:
        """Return the derivative of `force`, shape (n, block size, block size).

        Without the derivatives of h_nu and psi, and thus symmetric, unless `full`; then that of a
        lagged layer and charge too.
        """
        total = self.charge_block(jump, pressure, full)
        if self.layer is not None and (full or not self.layer.lagged):
            total += self.layer_block(jump, full)
        return total
