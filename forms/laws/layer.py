"""The compliant layer of the pressure h_nu p_nu: p_nu of its penetration, the stiffness h_nu."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from forms.ops import Value, absolute, is_unlimited, less_equal, minimum, positive_part, where


class PenetrationLaw(Protocol):
    """p_nu of the penetration s = u_nu - rho_0 of a layer of the pressure h_nu p_nu, (h~6).

    It vanishes for s <= 0 and should not fall: else several solutions may coexist.
    """

    def __call__(self, s: Value) -> Value:
        """Return p_nu at the penetration."""

    def derivative(self, s: Value) -> Value:
        """Return d p_nu / ds, one-sided at kinks."""


class StiffnessLaw(Protocol):
    """h_nu: the stiffness of a layer at s = phi - phi_F, (h~7) of chapter 6."""

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
        n_nu > 0 (length); infinity gives with h_nu = c the law (1.28).
    """

    limit: float

    def __call__(self, s: Value) -> Value:
        """Return p_nu at the penetration s = u_nu - rho_0."""
        depth = positive_part(s)
        return depth if is_unlimited(self.limit) else minimum(depth, self.limit)

    def derivative(self, s: Value) -> Value:
        """Return the generalised derivative: 1 for 0 < s < n_nu, else 0."""
        inside: Value = 1.0
        if not is_unlimited(self.limit):
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
