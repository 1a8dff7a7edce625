"""Hencky's deformation theory: secant modulus, energy, stress, secant form, tangent.

Equations (1.11)-(1.13), (7.7)-(7.9). The deviator is three-dimensional in plane strain too.
Laws are written as functions of q = |dev eps|^2, which is smooth at zero strain where
|dev eps| is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, Protocol, TypeAlias

import numpy as np
import ufl
from ufl.core.expr import Expr

from forms.elasticity import Anisotropic, ElasticConstants, moduli
from forms.history import HistoryLaw, QuadratureLaw
from forms.kinematics import CARTESIAN, Strained, deviator_squared, embed, strain
from forms.ops import Value, log, maximum, sqrt


class Hencky(ElasticConstants, Protocol):
    """A material as the forms see it: elastic constants and a secant shear modulus."""

    def secant_modulus(self, q: Value) -> Value:
        """Return g (stress) at q = |dev eps|^2, a number, an array or a UFL expression."""

    def shear_energy(self, q: Value) -> Value:
        """Return int_0^t 2 g(s) s ds with t = sqrt(q) (energy/volume), likewise."""


@dataclass(frozen=True)
class Isotropic:
    """Elastic constants that every law shares.

    Parameters
    ----------
    young
        Young's modulus E > 0 (stress).
    poisson
        Poisson's ratio, -1 < nu < 1/2.
    """

    young: float
    poisson: float

    @property
    def bulk(self) -> float:
        """Bulk modulus k0 = E / (3 - 6 nu), equation (7.9)."""
        return moduli(self.young, self.poisson)[0]

    @property
    def shear(self) -> float:
        """Initial shear modulus mu1 = E / (2 + 2 nu), equation (7.9)."""
        return moduli(self.young, self.poisson)[1]


@dataclass(frozen=True)
class Linear(Isotropic):
    """Linear isotropic elasticity: g = mu1.

    Parameters
    ----------
    young
        Young's modulus E > 0 (stress).
    poisson
        Poisson's ratio, -1 < nu < 1/2.

    Examples
    --------
    >>> round(Linear(young=210e3, poisson=0.3).bulk)
    175000
    """

    def secant_modulus(self, q: Value) -> Value:
        """Return g = mu1, whatever the strain."""
        return self.shear + 0 * q

    def shear_energy(self, q: Value) -> Value:
        """Return mu1 q."""
        return self.shear * q


@dataclass(frozen=True)
class Log(Isotropic):
    """The law (7.8): g(xi) = mu1 up to xi_0, mu1 (xi_0/xi) (ln(xi/xi_0) + 1) beyond.

    xi is the norm t = |dev eps| by default. As printed, by (1.13), it is t^2: `argument="square"`.
    Then d(g t)/dt < 0 beyond xi = e xi_0, against assumption (h1).

    Parameters
    ----------
    young, poisson
        Elastic constants: E > 0 (stress), -1 < nu < 1/2.
    yield_strain
        The limit xi_0 > 0 (no unit).
    argument
        "norm": xi = t = |dev eps|, so that d(g t)/dt = mu1 xi_0/t > 0 in the plastic range.
        "square": xi = t^2.
    g_min
        A lower bound of g (stress), so that assumption (h1) is met uniformly; 0 for none.

    Raises
    ------
    ValueError
        If `argument` is neither, or `g_min` is not below mu1.
    """

    yield_strain: float = field(kw_only=True)
    argument: Literal["norm", "square"] = field(default="norm", kw_only=True)
    g_min: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Refuse constants for which (7.8) has no meaning."""
        if self.argument not in ("norm", "square"):
            raise ValueError(f"argument must be 'norm' or 'square'; given: {self.argument!r}")
        # Without a floor the constants may be UFL expressions.
        if self.g_min != 0 and not 0 < self.g_min < self.shear:
            raise ValueError(f"g_min must lie between 0 and mu1; given: {self.g_min}")

    @property
    def _limit(self) -> float:
        """The value of q at first yield."""
        return self.yield_strain**2 if self.argument == "norm" else self.yield_strain

    @property
    def first_yield(self) -> float:
        """The strain |dev eps| at first yield."""
        return float(np.sqrt(self._limit))

    def _bare_modulus(self, q: Value) -> Value:
        # Evaluated at max(q, limit), where the elastic branch and the logarithm meet with
        # equal slopes: no case distinction, and no division by a vanishing strain.
        ratio = maximum(q, self._limit) / self._limit
        if self.argument == "norm":
            return self.shear / sqrt(ratio) * (log(ratio) / 2 + 1)
        return self.shear / ratio * (log(ratio) + 1)

    def _bare_energy(self, q: Value) -> Value:
        excess = maximum(q, self._limit)
        ratio = excess / self._limit
        elastic = self.shear * (q - excess + self._limit)
        if self.argument == "norm":
            return elastic + self.shear * self._limit * sqrt(ratio) * log(ratio)
        return elastic + self.shear * self._limit * log(ratio) * (1 + log(ratio) / 2)

    @cached_property
    def _floor_start(self) -> float:
        """The q from which the floor g_min acts (infinity without a floor)."""
        if self.g_min <= 0:
            return np.inf
        from scipy.optimize import brentq  # takes a while to load, and few need it

        upper = 4 * self._limit
        while self._bare_modulus(upper) > self.g_min:
            upper *= 4
        return float(brentq(lambda q: self._bare_modulus(q) - self.g_min, self._limit, upper))

    def secant_modulus(self, q: Value) -> Value:
        """Return g at q = |dev eps|^2, equation (7.8)."""
        g = self._bare_modulus(q)
        return g if self.g_min <= 0 else maximum(g, self.g_min)

    def shear_energy(self, q: Value) -> Value:
        """Return the integral of 2 g(s) s over [0, sqrt(q)] in closed form."""
        start = self._floor_start
        if not np.isfinite(start):
            return self._bare_energy(q)
        beyond = maximum(q - start, 0.0)
        return self._bare_energy(q - beyond) + self.g_min * beyond


@dataclass(frozen=True)
class UserLaw(Isotropic):
    """A law with a given secant modulus g(t), t = |dev eps|, made of `forms.ops` functions.

    Parameters
    ----------
    young, poisson
        Elastic constants of small strains (stress, no unit); g should tend to mu1 = E/(2+2 nu) at
        t = 0.
    modulus
        The function g(t) (stress); it must accept UFL expressions and NumPy arrays.

    Raises
    ------
    ValueError
        If the function is none, takes no UFL, or has no value without strain.

    Notes
    -----
    The energy is integrated by a 12-point Gauss rule on [0, t], exact for a polynomial g of
    degree 22 and accurate for smooth ones.
    """

    modulus: Callable[[Value], Value] = field(kw_only=True)

    def __post_init__(self) -> None:
        """Refuse functions without a scalar of UFL, or without a number at t = 0."""
        try:
            form = ufl.as_ufl(self.modulus(ufl.variable(ufl.as_ufl(1e-3))))
            with np.errstate(all="ignore"):
                start = np.asarray(self.secant_modulus(np.zeros(1)), dtype=float)
            found = f"returns {start} at t = 0, and UFL of shape {form.ufl_shape}"
            fits = form.ufl_shape == () and start.size == 1 and bool(np.isfinite(start).all())
        except Exception as error:
            found, fits = f"raises {type(error).__name__}: {error}", False
        if not fits:
            raise ValueError(
                f"UserLaw: modulus: the function {found}; accepted: one finite number at each "
                "t = |dev eps| >= 0, by arithmetic and forms.ops for UFL and NumPy alike; a "
                "modulus that varies in the body is Material(law, factor=...)"
            )

    def secant_modulus(self, q: Value) -> Value:
        """Return g(sqrt(q)), kept away from the kink of the square root at q = 0."""
        g = self.modulus(sqrt(maximum(q, 1e-28)))
        # A function may return one number for all strains.
        return g + 0 * q if isinstance(g, int | float | np.number) else g

    def shear_energy(self, q: Value) -> Value:
        """Return the integral of 2 g(s) s over [0, sqrt(q)]."""
        total = 0 * q
        # The rule on [-1, 1], moved to [0, 1].
        for point, weight in zip(*np.polynomial.legendre.leggauss(12), strict=True):
            z = float(point + 1) / 2
            total = total + float(weight) * z * self.secant_modulus(z**2 * q) * q
        return total


#: Laws of the stress of a material.
Law: TypeAlias = Hencky | Anisotropic | HistoryLaw


@dataclass(frozen=True, eq=False)
class Graded:
    """A law in forms whose stresses are multiplied by a function of position, in UFL."""

    law: Hencky | Anisotropic
    factor: Expr

    def secant_stress(self, frozen: Expr, eps: Expr) -> Expr:
        """Return the stress with secants at a frozen strain."""
        return self.factor * secant_stress(self.law, frozen, eps)


#: Laws in forms.
FormLaw: TypeAlias = Hencky | Anisotropic | QuadratureLaw | Graded


def is_linear(law: Law) -> bool:
    """Return true if the stress is a linear function of the strain."""
    return isinstance(law, Linear | Anisotropic)


def secant_stress(law: FormLaw, frozen: Expr, eps: Expr) -> Expr:
    """Return k0 tr(eps) I + 2 g dev(eps) with g taken at the frozen strain, (1.13).

    That is (k0 - 2g/3) tr(eps) I + 2 g eps, a 3 x 3 stress: in plane strain
    sigma_zz = (k0 - 2g/3) tr eps, which is not zero (Remark 7.1 of the thesis says otherwise).
    """
    if isinstance(law, Anisotropic):
        return law.stress(eps)
    if isinstance(law, QuadratureLaw | Graded):
        return law.secant_stress(frozen, eps)
    g = law.secant_modulus(deviator_squared(frozen))
    return (law.bulk - 2 * g / 3) * ufl.tr(eps) * ufl.Identity(3) + 2 * g * embed(eps)


def stress(law: FormLaw, eps: Expr) -> Expr:
    """Return the 3 x 3 stress sigma = k0 tr(eps) I + 2 g dev(eps), equation (1.13)."""
    return secant_stress(law, eps, eps)


def energy_density(law: Hencky | Anisotropic, eps: Expr) -> Expr:
    """Return M(eps) = (k0/2) (tr eps)^2 + int_0^t 2 g(s) s ds, equation (1.11)."""
    if isinstance(law, Anisotropic):
        return law.energy_density(eps)
    return law.bulk / 2 * ufl.tr(eps) ** 2 + law.shear_energy(deviator_squared(eps))


def secant_form(
    law: FormLaw, u_0: Expr, u: Expr, v: Expr, kinematics: Strained = CARTESIAN
) -> Expr:
    """Return the integrand of Kacanov's form B(u_0; u, v), (3.28); at u_0 = u that of A, (3.10)."""
    frozen, eps, test = (strain(f, kinematics) for f in (u_0, u, v))
    return ufl.inner(secant_stress(law, frozen, eps), test)
