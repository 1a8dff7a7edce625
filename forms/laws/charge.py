"""The charge psi phi_L per area of a contact surface on a conductive foundation.

phi_L is a difference of potentials (potential), psi a capacitance per area. The thesis calls psi
and its largest value k_e conductivities, and so do the names here; no current flows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from forms.ops import Condition, Value, absolute, clip, is_unlimited, less, less_equal, where


class PotentialLaw(Protocol):
    """phi_L: the factor of the charge at the potential difference s = phi - phi_F."""

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
        return s if is_unlimited(self.limit) else clip(s, -self.limit, self.limit)

    def derivative(self, s: Value) -> Value:
        """Return 1 inside the limits, 0 outside."""
        if is_unlimited(self.limit):
            return 1.0 + 0 * s
        return where(less_equal(absolute(s), self.limit), 1.0, 0.0)


class Conductivity(Protocol):
    """psi (capacitance/area), assumption (h~5) of chapter 5. A new law is a class with these."""

    @property
    def k_e(self) -> float:
        """The largest value of psi."""

    @property
    def delta(self) -> float:
        """Slope of psi over k_e (1/length); infinity where it jumps."""

    @property
    def follows_gap(self) -> bool:
        """Whether it is a differentiable function of the gap."""

    def at(self, s: Value, pressed: Condition, loaded: Condition) -> Value:
        """Return psi at nodes, k_e at most.

        Parameters
        ----------
        s
            u_nu - rho.
        pressed
            Whether the rigid part presses, and s = 0 but for the tolerance of a solver.
        loaded
            Whether any pressure acts, the layer's included.
        """

    def gap_slope(self, s: Value, pressed: Condition) -> Value:
        """Return the derivative by s, 0 where the rigid part presses."""


@dataclass(frozen=True)
class RampConductivity:
    """psi(s) = k_e clip(delta s, 0, 1), equation (1.34) as printed, s = u_nu - rho.

    With a unilateral constraint s never exceeds 0 and the ramp never conducts.

    Parameters
    ----------
    k_e
        Largest value k_e >= 0 of psi (capacitance/area).
    delta
        Slope of psi over k_e (1/length).
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
        """Return psi at s = u_nu - rho."""
        return self.k_e * clip(self.at_closing + self.delta * s, 0.0, 1.0)

    def derivative(self, s: Value) -> Value:
        """Return the generalised derivative, 0 at the kinks."""
        height, slope = self.at_closing + self.delta * s, self.k_e * self.delta
        return where(less(0.0, height), where(less(height, 1.0), slope, 0.0), 0.0)

    def at(self, s: Value, pressed: Condition, loaded: Condition) -> Value:
        """Return psi: that of s = 0 where the rigid part presses."""
        return self(where(pressed, 0.0, s))

    def gap_slope(self, s: Value, pressed: Condition) -> Value:
        """Return the generalised derivative by s, 0 where the rigid part presses."""
        return where(pressed, 0.0, self.derivative(s))


class ShiftedConductivity(RampConductivity):
    """psi(s) = k_e clip(1 + delta s, 0, 1): the ramp moved to the closing gap.

    k_e in contact, 0 beyond the distance 1/delta. Bounded and Lipschitz, as (h~5)(b) and (e) of the
    thesis ask; but (h~5)(d), psi = 0 for s <= 0, is given up: with it no contact has a charge, for
    s never exceeds 0. Its parameters are those of `RampConductivity`.

    Examples
    --------
    >>> float(ShiftedConductivity(k_e=2.0, delta=10.0)(-0.05))  # half way into the ramp
    1.0
    """

    at_closing = 1.0


@dataclass(frozen=True)
class PerfectConductivity:
    """psi = k_e where rigid part or layer press, 0 elsewhere, equation (1.33).

    (1.33) has u_nu >= rho: with a layer contact begins before.

    Parameters
    ----------
    k_e
        Value k_e >= 0 of psi in contact (capacitance/area).
    """

    k_e: float

    follows_gap = False
    delta = np.inf

    def at(self, s: Value, pressed: Condition, loaded: Condition) -> Value:
        """Return k_e where any pressure acts."""
        return where(loaded, self.k_e, 0.0)

    def gap_slope(self, s: Value, pressed: Condition) -> Value:
        """Return 0: the contact flag is kept."""
        return 0.0 * s
