"""Friction: coefficients mu, and bounds s of which Coulomb's and Tresca's are two."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from forms.ops import Value


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

    value: float | NDArray[np.float64]

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
    """mu(|u_tau|) = a + b / (rho |u_tau| + 2), equation (7.16), there with a = 0.5, b = 0.2.

    Parameters
    ----------
    a, b
        Limit for large slip, and twice the excess at zero slip (no unit).
    rho
        Decay rate (1/length), rho >= 0; not the gap of the body.

    Raises
    ------
    ValueError
        If mu is negative at zero slip or for large slip, or rho is.

    Examples
    --------
    >>> SlipCoefficient(0.5, 0.2, rho=1e4)(0.0)
    0.6
    """

    a: float
    b: float
    rho: float

    def __post_init__(self) -> None:
        """Refuse coefficients that do not resist at every slip."""
        try:
            fits = self.a >= 0 and self.a + self.b / 2 >= 0 and self.rho >= 0
        except TypeError:  # no numbers
            fits = False
        if not fits:
            raise ValueError(f"a, a + b/2 and rho must be >= 0; given: {self}")

    @property
    def maximum(self) -> float:
        """Upper bound mu*: mu(0) = a + b/2, or a where mu grows."""
        return self.a + max(self.b, 0.0) / 2

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant |b| rho / 4, reached at zero slip."""
        return abs(self.b) * self.rho / 4

    def __call__(self, slip: Value) -> Value:
        """Return mu at slips |u_tau| >= 0 (length)."""
        return self.a + self.b / (self.rho * slip + 2)

    def derivative(self, slip: Value) -> Value:
        """Return the derivative of mu by the slip (1/length)."""
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
    """Coulomb's law s = mu(|u_tau|) p, (1.38).

    Parameters
    ----------
    coefficient
        mu(|u_tau|) (no unit), for instance `SlipCoefficient`.

    Examples
    --------
    >>> Coulomb(SlipCoefficient(0.5, 0.2, rho=1e4))(0.0, 10.0)
    6.0
    """

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
        """Return mu p (stress) at slips >= 0 (length) and pressures >= 0 (stress)."""
        return self.coefficient(slip) * pressure

    def by_slip(self, slip: Value, pressure: Value) -> Value:
        """Return the derivative mu' p by the slip."""
        return self.coefficient.derivative(slip) * pressure

    def by_pressure(self, slip: Value, pressure: Value) -> Value:
        """Return the derivative mu by the pressure."""
        return self.coefficient(slip)


@dataclass(frozen=True)
class Tresca:
    """Tresca's law: a bound S that depends on nothing, a number or one value a node."""

    bound: float | NDArray[np.float64]

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
