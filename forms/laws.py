"""Laws on the contact boundary: mu, psi, phi_L, p_nu, h_nu, one definition each.

Each law is a frozen dataclass that is called with UFL expressions or NumPy arrays, and
knows the bounds that the theorems ask for. `derivative` is the derivative with respect to
the argument, used by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from forms.ops import Value, absolute, clip, less, less_equal, minimum, positive_part, where


class FrictionCoefficient(Protocol):
    """A coefficient mu(|u_tau|), assumption (h2)."""

    @property
    def maximum(self) -> float:
        """Upper bound mu*."""

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant L_mu (1/length)."""

    def __call__(self, slip: Value) -> Value:
        """Return mu at the slip |u_tau| >= 0."""

    def derivative(self, slip: Value) -> Value:
        """Return d mu / d|u_tau|."""


@dataclass(frozen=True)
class ConstantCoefficient:
    """A coefficient that does not depend on the slip: a number, or one value a node."""

    value: Value

    @property
    def maximum(self) -> float:
        """Upper bound mu*."""
        # A rank may hold no node.
        return float(np.max(self.value, initial=0.0))

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant: 0."""
        return 0.0

    def __call__(self, slip: Value) -> Value:
        """Return the constant, shaped like the slip."""
        return self.value + 0 * slip

    def derivative(self, slip: Value) -> Value:
        """Return 0."""
        return 0 * slip


@dataclass(frozen=True)
class SlipCoefficient:
    """mu(s) = a + b / (rho s + 2), equation (7.16): a = 0.5, b = 0.2.

    Parameters
    ----------
    a, b
        Limit for large slip, and twice the excess at rest (no unit).
    rho
        Decay rate (1/length), rho >= 0.
    """

    a: float
    b: float
    rho: float

    @property
    def maximum(self) -> float:
        """Upper bound mu* = mu(0) = a + b/2."""
        return self.a + max(self.b, 0.0) / 2

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant |b| rho / 4, reached at s = 0."""
        return abs(self.b) * self.rho / 4

    def __call__(self, slip: Value) -> Value:
        """Return mu at the slip."""
        return self.a + self.b / (self.rho * slip + 2)

    def derivative(self, slip: Value) -> Value:
        """Return d mu / ds."""
        return -self.b * self.rho / (self.rho * slip + 2) ** 2


class FrictionLaw(Protocol):
    """A friction bound s that depends on the slip |u_tau| >= 0 and the pressure p >= 0.

    Coulomb's is `Coulomb`. One whose coefficient depends on the pressure is a class with these.
    """

    @property
    def maximum(self) -> float:
        """Upper bound of s/p, infinity if there is none."""

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant of s/p in the slip (1/length)."""

    def __call__(self, slip: Value, pressure: Value) -> Value:
        """Return the bound s >= 0."""

    def by_slip(self, slip: Value, pressure: Value) -> Value:
        """Return ds/d|u_tau|."""

    def by_pressure(self, slip: Value, pressure: Value) -> Value:
        """Return ds/dp."""


@dataclass(frozen=True)
class Coulomb:
    """Coulomb's law s = mu(|u_tau|) p, (1.36)."""

    coefficient: FrictionCoefficient

    @property
    def maximum(self) -> float:
        """Upper bound mu*."""
        return self.coefficient.maximum

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant L_mu (1/length)."""
        return self.coefficient.lipschitz

    def __call__(self, slip: Value, pressure: Value) -> Value:
        """Return mu p."""
        return self.coefficient(slip) * pressure

    def by_slip(self, slip: Value, pressure: Value) -> Value:
        """Return mu' p."""
        return self.coefficient.derivative(slip) * pressure

    def by_pressure(self, slip: Value, pressure: Value) -> Value:
        """Return mu."""
        return self.coefficient(slip)


@dataclass(frozen=True)
class Tresca:
    """Tresca's law: a bound S that depends on nothing, a number or one value a node."""

    bound: Value

    maximum = np.inf
    lipschitz = 0.0

    def __call__(self, slip: Value, pressure: Value) -> Value:
        """Return S, shaped like the slip."""
        return self.bound + 0 * slip

    def by_slip(self, slip: Value, pressure: Value) -> Value:
        """Return 0."""
        return 0 * slip

    def by_pressure(self, slip: Value, pressure: Value) -> Value:
        """Return 0."""
        return 0 * slip


def _unlimited(limit: Value) -> bool:
    """Tell whether a limit is infinite: compiled forms know no infinity."""
    return isinstance(limit, float) and limit == np.inf


class PotentialLaw(Protocol):
    """phi_L: what drives the current at the potential difference s = phi - phi_F."""

    def __call__(self, s: Value) -> Value:
        """Return phi_L at the potential difference."""

    def derivative(self, s: Value) -> Value:
        """Return d phi_L / ds, one-sided at kinks."""


@dataclass(frozen=True)
class Truncation:
    """phi_L(s) = s limited to [-L, L], equation (1.34); L = infinity for none."""

    limit: float

    def __call__(self, s: Value) -> Value:
        """Return the truncated potential difference."""
        return s if _unlimited(self.limit) else clip(s, -self.limit, self.limit)

    def derivative(self, s: Value) -> Value:
        """Return 1 inside the limits, 0 outside."""
        if _unlimited(self.limit):
            return 1.0 + 0 * s
        return where(less_equal(absolute(s), self.limit), 1.0, 0.0)


def _ramp_slope(position: Value, slope: Value) -> Value:
    """Return the slope where a ramp between positions 0 and 1 rises, 0 elsewhere."""
    return where(less(0.0, position), where(less(position, 1.0), slope, 0.0), 0.0)


class Conductivity(Protocol):
    """psi: how well a foundation conducts, assumption (h5). A new law is a class with these."""

    @property
    def k_e(self) -> float:
        """The largest conductivity."""

    @property
    def delta(self) -> float:
        """Slope of psi over k_e (1/length); infinity where it jumps."""

    @property
    def follows_gap(self) -> bool:
        """Whether it is a function of the gap that Newton's method can follow."""

    def at(self, s: Value, pressed: Value, loaded: Value | None = None) -> Value:
        """Return the conductivity at nodes, k_e at most.

        Parameters
        ----------
        s
            u_nu - rho.
        pressed
            Whether the rigid part presses, and s = 0 but for the tolerance of a solver.
        loaded
            Whether any pressure acts, the layer's included; `pressed` by default.
        """

    def gap_slope(self, s: Value, pressed: Value) -> Value:
        """Return the derivative by s, 0 where the rigid part presses."""


@dataclass(frozen=True)
class RampConductivity:
    """psi(s) = k_e clip(delta s, 0, 1), equation (1.34) as printed, s = u_nu - rho.

    With a unilateral constraint s never exceeds 0 and the ramp never conducts.
    """

    k_e: float
    delta: float

    #: Value of the ramp at the closing gap, over k_e.
    at_closing: ClassVar[float] = 0.0

    @property
    def follows_gap(self) -> bool:
        """True, unless nothing is conducted, or the same at any gap."""
        return self.k_e > 0 and self.delta > 0

    def __call__(self, s: Value) -> Value:
        """Return the conductivity at s = u_nu - rho."""
        return self.k_e * clip(self.at_closing + self.delta * s, 0.0, 1.0)

    def derivative(self, s: Value) -> Value:
        """Return the generalised derivative, 0 at the kinks."""
        return _ramp_slope(self.at_closing + self.delta * s, self.k_e * self.delta)

    def at(self, s: Value, pressed: Value, loaded: Value | None = None) -> Value:
        """Return the conductivity: that of s = 0 where the rigid part presses."""
        return self(where(pressed, 0.0, s))

    def gap_slope(self, s: Value, pressed: Value) -> Value:
        """Return the generalised derivative by s, 0 where the rigid part presses."""
        return where(pressed, 0.0, self.derivative(s))


class ShiftedConductivity(RampConductivity):
    """psi(s) = k_e clip(1 + delta s, 0, 1): the ramp moved to the closing gap.

    Full conductivity in contact, none beyond the distance 1/delta. Bounded and Lipschitz, as
    (h~5)(b) and (e) of the thesis ask; but (h~5)(d), psi = 0 for s <= 0, is given up: with it no
    contact conducts, for s never exceeds 0.
    """

    at_closing = 1.0


@dataclass(frozen=True)
class PerfectConductivity:
    """psi = k_e where the node is in contact, 0 elsewhere, equation (1.33)."""

    k_e: float

    follows_gap = False
    delta = np.inf

    def __call__(self, in_contact: Value) -> Value:
        """Return the conductivity; the argument tells whether the node is in contact."""
        return where(in_contact, self.k_e, 0.0)

    def at(self, s: Value, pressed: Value, loaded: Value | None = None) -> Value:
        """Return k_e where any pressure acts."""
        return self(pressed if loaded is None else loaded)

    def gap_slope(self, s: Value, pressed: Value) -> Value:
        """Return 0: the contact flag is kept."""
        return 0.0 * s


class PenetrationLaw(Protocol):
    """p_nu: what a layer answers to its penetration s = u_nu - rho_0, assumption (h6).

    It vanishes for s <= 0 and should not fall: else several solutions may coexist.
    """

    def __call__(self, s: Value) -> Value:
        """Return p_nu at the penetration."""

    def derivative(self, s: Value) -> Value:
        """Return d p_nu / ds, one-sided at kinks."""


class StiffnessLaw(Protocol):
    """h_nu: the stiffness of a layer at s = phi - phi_F, assumption (h7)."""

    def __call__(self, s: Value) -> Value:
        """Return h_nu >= 0 at the potential difference."""

    def derivative(self, s: Value) -> Value:
        """Return d h_nu / ds, one-sided at kinks."""


@dataclass(frozen=True)
class Compliance:
    """p_nu(s) = [s]^+ limited to n_nu, section 8.1.2, s = penetration of the layer.

    Parameters
    ----------
    limit
        n_nu > 0 (length); infinity gives the law (1.28).
    """

    limit: float

    def __call__(self, s: Value) -> Value:
        """Return p_nu at the penetration s = u_nu - rho_0."""
        depth = positive_part(s)
        return depth if _unlimited(self.limit) else minimum(depth, self.limit)

    def derivative(self, s: Value) -> Value:
        """Return the generalised derivative: 1 for 0 < s < n_nu, else 0."""
        inside = 1.0
        if not _unlimited(self.limit):
            inside = where(less_equal(s, self.limit), 1.0, 0.0)
        return where(less_equal(s, 0.0), 0.0, inside)


@dataclass(frozen=True)
class PotentialFactor:
    """h_nu(s) = c_nu (1 + (alpha_nu - 1) min(|s|/s_0, 1)), section 8.1.2, s = phi - phi_F.

    Parameters
    ----------
    stiffness
        c_nu >= 0 (stress/length).
    factor
        alpha_nu >= 1: the growth at large potential differences; 1 for no dependence.
    scale
        s_0 > 0: the difference from which the growth stops (128 in the thesis).
    """

    stiffness: float
    factor: float = 1.0
    scale: float = 128.0

    def __call__(self, s: Value) -> Value:
        """Return h_nu at the potential difference s."""
        return self.stiffness * (1 + (self.factor - 1) * minimum(absolute(s) / self.scale, 1.0))

    def derivative(self, s: Value) -> Value:
        """Return the generalised derivative of h_nu."""
        slope = self.stiffness * (self.factor - 1) / self.scale
        inside = where(less_equal(absolute(s), self.scale), slope, 0.0)
        return where(less_equal(s, 0.0), -inside, inside)
