"""Flow theory of plasticity (J2, von Mises), with isotropic and kinematic hardening.

A step is one of backward Euler: with the deviatoric trial stress s_tr = 2G (dev eps - e_p) and
back stresses b_k,

    xi = s - sum b_k,    |xi| <= sqrt(2/3) R(a),    de_p = dg xi/|xi|,    da = sqrt(2/3) dg,
    db_k = (2/3) C_k de_p - gamma_k b_k da,

with the terms of Chaboche, which are Armstrong and Frederick's with a recovery gamma, and
Prager's without. It is a radial return (return mapping): xi points along
z = s_tr - sum b_k/(1 + gamma_k da), and one scalar equation is left for dg. Without recovery it is
Hencky's law about a moved origin.

References
----------
Simo and Hughes, Computational Inelasticity, Springer (1998), boxes 3.1 and 3.2.
Chaboche, A review of some plasticity and viscoplasticity constitutive theories, Int. J. Plasticity
24 (2008) 1642.
Kobayashi and Ohno, Implementation of cyclic plasticity models based on a general form of kinematic
hardening, Int. J. Numer. Meth. Engng 53 (2002) 2217.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from forms.hencky import Isotropic
from forms.history import Response, isotropic_stiffness

Array = NDArray[np.float64]

#: |dev| of a uniaxial plastic strain over that, and of a uniaxial stress over that.
ROOT = np.sqrt(2.0 / 3.0)

#: Residual of the local equation that counts as zero, over the trial stress; iterations at most.
LOCAL, MOST = 2e-14, 60


class Hardening(Protocol):
    """The yield stress that plastic strain adds, R(a) - Y."""

    def __call__(self, a: Array) -> Array:
        """Return it at equivalent plastic strains."""

    def slope(self, a: Array) -> Array:
        """Return its derivative."""

    def energy(self, a: Array) -> Array:
        """Return its integral from 0 on: the energy that it stores, by volume."""


@dataclass(frozen=True)
class Voce:
    """Linear and saturating hardening, H a + Q (1 - exp(-q a)).

    Parameters
    ----------
    modulus, saturation
        H and Q (stress).
    rate
        q.
    """

    modulus: float = 0.0
    saturation: float = 0.0
    rate: float = 0.0

    def __post_init__(self) -> None:
        """Refuse softening."""
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"hardening: given {name} {value:g}; accepted: numbers >= 0")

    def __call__(self, a: Array) -> Array:
        """Return R(a) - Y."""
        return self.modulus * a - self.saturation * np.expm1(-self.rate * a)

    def slope(self, a: Array) -> Array:
        """Return R'(a)."""
        return self.modulus + self.saturation * self.rate * np.exp(-self.rate * a)

    def energy(self, a: Array) -> Array:
        """Return the integral of R - Y from 0 to a."""
        saturating = a + np.expm1(-self.rate * a) / self.rate if self.rate > 0 else 0.0
        return np.asarray(0.5 * self.modulus * a**2 + self.saturation * saturating)


@dataclass(frozen=True)
class Tabulated:
    """A curve by points, linear between them and constant behind.

    Parameters
    ----------
    strain, stress
        Equivalent plastic strains, from 0 on, and the yield stress R there.
    """

    strain: tuple[float, ...]
    stress: tuple[float, ...]

    def __post_init__(self) -> None:
        """Refuse points that are no hardening curve."""
        strain, stress = np.asarray(self.strain, dtype=float), np.asarray(self.stress, dtype=float)
        fits = strain.ndim == 1 and strain.shape == stress.shape and strain.size >= 2
        fits = fits and bool(np.isfinite(strain).all() and np.isfinite(stress).all())
        if not (fits and strain[0] == 0 and (np.diff(strain) > 0).all()):
            raise ValueError(
                "hardening: accepted: two points [strain, stress] at least, plastic strains that "
                "increase from 0"
            )
        if not (stress[0] > 0 and (np.diff(stress) >= 0).all()):
            raise ValueError("hardening: accepted: stresses > 0 that do not decrease")

    def __call__(self, a: Array) -> Array:
        """Return R(a) - Y."""
        return np.interp(a, self.strain, self.stress) - self.stress[0]

    def slope(self, a: Array) -> Array:
        """Return R'(a), to the right at the points."""
        slopes = np.append(np.diff(self.stress) / np.diff(self.strain), 0.0)
        return np.asarray(slopes[np.searchsorted(self.strain, a, side="right") - 1])

    def energy(self, a: Array) -> Array:
        """Return the integral of R - Y from 0 to a."""
        strain, stress = np.array(self.strain), np.array(self.stress) - self.stress[0]
        below = np.append(0.0, np.cumsum(0.5 * (stress[1:] + stress[:-1]) * np.diff(strain)))
        k = np.searchsorted(strain, a, side="right") - 1
        return np.asarray(below[k] + 0.5 * (stress[k] + self(a)) * (a - strain[k]))


@dataclass(frozen=True)
class J2(Isotropic):
    """Elasto-plasticity of metals by the flow theory of von Mises.

    Parameters
    ----------
    young, poisson
        Elastic constants.
    yield_stress
        Y > 0, in uniaxial tension (stress).
    hardening
        Its increase with plastic strain: a modulus, `Voce`, `Tabulated`, or another `Hardening`.
    kinematic
        Prager's modulus C, uniaxial stress over plastic strain, or pairs of a modulus and a
        recovery (Armstrong and Frederick, Chaboche).

    Raises
    ------
    ValueError
        If a number is none of a material.

    Examples
    --------
    >>> law = J2(200e3, 0.3, yield_stress=250.0, hardening=Voce(saturation=100.0, rate=20.0))
    >>> law.respond(np.array([[1e-2, 0, 0, 0]]), {
    ...     name: np.array([value]) for name, value in law.variables(4).items()
    ... }).variables["equivalent_plastic_strain"].round(6).tolist()
    [0.005538]
    """

    yield_stress: float = field(kw_only=True)
    hardening: Hardening | float = field(default=0.0, kw_only=True)
    kinematic: Sequence[tuple[float, float]] | float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        """Refuse numbers that are none of a material; make functions and pairs of numbers."""
        if not (np.isfinite(self.yield_stress) and self.yield_stress > 0):
            raise ValueError(f"yield_stress: given {self.yield_stress:g}; accepted: a number > 0")
        if isinstance(self.hardening, float | int):
            object.__setattr__(self, "hardening", Voce(float(self.hardening)))
        given = self.kinematic
        pairs = [(given, 0.0)] if isinstance(given, float | int) else given
        terms = tuple((float(c), float(recovery)) for c, recovery in pairs if c != 0)
        if not all(np.isfinite(term).all() and min(term) >= 0 for term in terms):
            raise ValueError(f"kinematic: given {given}; accepted: moduli and recoveries >= 0")
        object.__setattr__(self, "kinematic", terms)

    @property
    def symmetric(self) -> bool:
        """True if the tangent is symmetric: without recovery."""
        return all(recovery == 0 for _, recovery in self._terms)

    @property
    def _terms(self) -> tuple[tuple[float, float], ...]:
        """The kinematic terms as pairs."""
        return self.kinematic  # type: ignore[return-value]

    @property
    def _back(self) -> list[str]:
        """Names of the back stresses."""
        return [f"back_stress_{k + 1}" for k in range(len(self._terms))]

    def strength(self, a: Array) -> Array:
        """Return the yield stress R at equivalent plastic strains."""
        return self.yield_stress + self.hardening(a)  # type: ignore[operator]

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return plastic strain, equivalent plastic strain and back stresses, all zero."""
        zero = np.zeros(size)
        fixed: dict[str, ArrayLike] = {"plastic_strain": zero, "equivalent_plastic_strain": 0.0}
        return fixed | dict.fromkeys(self._back, zero)

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return the response at n points; see `forms.history.HistoryLaw`."""
        n, size = strain.shape
        trial, plastic, flow = self._flow(strain, variables)
        new = {name: value.copy() for name, value in variables.items()}
        new["plastic_strain"][plastic] += flow.plastic_strain
        new["equivalent_plastic_strain"][plastic] += ROOT * flow.dg
        stress, dissipation = trial, np.zeros(n)
        stress[plastic] -= 2 * self.shear * flow.plastic_strain
        stress += strain @ isotropic_stiffness(self.bulk, 0.0, size)
        dissipation[plastic] = self.yield_stress * ROOT * flow.dg
        for name, (c, recovery), theta, old in zip(
            self._back, self._terms, flow.theta, flow.back, strict=True
        ):
            at_end = theta[:, None] * (old + 2 / 3 * c * flow.plastic_strain)
            new[name][plastic] = at_end
            square = _dot(at_end, at_end)
            dissipation[plastic] += 1.5 * recovery / c * square * ROOT * flow.dg
        stiffness = None
        if kind:
            shear = np.full(n, self.shear)
            shear[plastic] *= 1 - flow.turn
            stiffness = isotropic_stiffness(self.bulk, shear, size)
            if kind == "tangent":
                stiffness[plastic] += flow.tangent_minus_secant()
        return Response(stress, new, stiffness, dissipation, self._energy(strain, stress, new))

    def _energy(self, strain: Array, stress: Array, variables: Mapping[str, Array]) -> Array:
        """Return the stored energy by volume, shape (n,): elastic, and of the hardening."""
        total = 0.5 * _dot(stress, strain - variables["plastic_strain"])
        total += self.hardening.energy(variables["equivalent_plastic_strain"])  # type: ignore[union-attr]
        for name, (c, _) in zip(self._back, self._terms, strict=True):
            total += 0.75 / c * _dot(variables[name], variables[name])
        return total

    def differential(
        self,
        strain: Array,
        variables: Mapping[str, Array],
        moved: Array,
        changed: Mapping[str, Array],
    ) -> Response:
        """Return the differential of the response at n points; see `forms.history.differential`."""
        size, g2 = strain.shape[1], 2 * self.shear
        _, plastic, flow = self._flow(strain, variables)
        trial = moved @ isotropic_stiffness(0.0, self.shear, size) - g2 * changed["plastic_strain"]
        back = [changed[name][plastic] for name in self._back]
        a = changed["equivalent_plastic_strain"]
        dg, strained = flow.differential(trial[plastic], a[plastic], back)
        new = {name: np.array(value) for name, value in changed.items()}
        new["plastic_strain"][plastic] += strained
        new["equivalent_plastic_strain"][plastic] += ROOT * dg
        trial[plastic] -= g2 * strained
        for name, (c, recovery), theta, old, change in zip(
            self._back, self._terms, flow.theta, flow.back, back, strict=True
        ):
            less = (recovery * ROOT * theta**2 * dg)[:, None]
            new[name][plastic] = theta[:, None] * (change + 2 / 3 * c * strained)
            new[name][plastic] -= less * (old + 2 / 3 * c * flow.plastic_strain)
        return Response(trial + moved @ isotropic_stiffness(self.bulk, 0.0, size), new)

    def _flow(
        self, strain: Array, variables: Mapping[str, Array]
    ) -> tuple[Array, NDArray[np.intp], _Flow]:
        """Return the trial stress, the points that yield, and the flow there."""
        a = variables["equivalent_plastic_strain"]
        # Products with a matrix take a third of the time of sums over a few columns.
        trial = strain @ isotropic_stiffness(0.0, self.shear, strain.shape[1])
        trial -= 2 * self.shear * variables["plastic_strain"]
        back = [variables[name] for name in self._back]
        relative = _norm(trial - sum(back) if back else trial)
        plastic = np.flatnonzero(relative > ROOT * self.strength(a))
        return trial, plastic, _Flow(self, trial[plastic], a[plastic], [b[plastic] for b in back])


def _dot(one: Array, other: Array) -> Array:
    """Return the inner products of the rows."""
    return np.asarray(np.einsum("ni,ni->n", one, other))


def _norm(tensors: Array) -> Array:
    """Return the norms of the rows; NumPy's own take five times as long where these are short."""
    return np.sqrt(_dot(tensors, tensors))


class _Flow:
    """Plastic flow in a step at points that yield.

    Attributes
    ----------
    dg
        The plastic multiplier |de_p|, shape (n,).
    plastic_strain
        de_p, shape (n, s).
    theta
        1/(1 + gamma_k da) of each back stress, shape (n,).
    turn
        2G dg/|z|: how much stiffness is lost across the direction of flow.
    """

    def __init__(self, law: J2, trial: Array, a: Array, back: Sequence[Array]) -> None:
        self._law, self._a, self.back = law, a, back
        self._relative = trial - sum(back) if back else trial
        #: Back stresses that recover, with modulus and recovery: the others do not turn z.
        recovering = [(c, g, b) for (c, g), b in zip(law._terms, back, strict=True) if g > 0]
        parts = [b for _, _, b in recovering]
        self._square = _dot(self._relative, self._relative)
        self._towards = [_dot(self._relative, b) for b in parts]
        self._between = [[_dot(one, other) for other in parts] for one in parts]
        self._recovering = [(c, g) for c, g, _ in recovering]
        self._fixed = 2 * law.shear + sum(2 / 3 * c for c, g in law._terms if g == 0)
        self.dg = self._solve(_norm(trial) + sum(_norm(b) for b in back))
        self.theta = [1 / (1 + recovery * ROOT * self.dg) for _, recovery in law._terms]
        along = self._relative + sum(
            ((1 - part)[:, None] * b for part, b in zip(self.theta, back, strict=True)),
            np.zeros_like(trial),
        )
        self._size, self._slope = _norm(along), self._at(self.dg)[1]
        self._normal = along / self._size[:, None]
        self.plastic_strain = self.dg[:, None] * self._normal
        self.turn = 2 * law.shear * self.dg / self._size

    def _at(self, dg: Array) -> tuple[Array, Array]:
        """Return the local equation's value, and minus its derivative.

        They are of the inner products of the trial stress and the back stresses alone, which no
        step of the iteration changes.
        """
        law, a = self._law, self._a + ROOT * dg
        theta = [1 / (1 + recovery * ROOT * dg) for _, recovery in self._recovering]
        gone = [1 - part for part in theta]
        on = [
            towards + sum(part * b for part, b in zip(gone, between, strict=True))
            for towards, between in zip(self._towards, self._between, strict=True)
        ]
        square, moduli = self._square.copy(), np.full_like(dg, self._fixed)
        for part, towards, along in zip(gone, self._towards, on, strict=True):
            square += part * (towards + along)
        size = np.sqrt(square)
        slope = self._fixed + 2 / 3 * law.hardening.slope(a)  # type: ignore[union-attr]
        for (c, recovery), part, along in zip(self._recovering, theta, on, strict=True):
            # d(theta)/d(dg) = -gamma sqrt(2/3) theta^2
            change = recovery * ROOT * part**2
            moduli += 2 / 3 * c * part
            slope += 2 / 3 * c * (part - change * dg) - change * along / size
        return size - moduli * dg - ROOT * law.strength(a), slope

    def _solve(self, scale: Array) -> Array:
        """Solve |z| - (2G + sum (2/3) C_k theta_k) dg = sqrt(2/3) R by Newton's method.

        Bisection where a step leaves the interval in which the sign changes.

        Parameters
        ----------
        scale
            Size of the stresses, shape (n,).
        """
        low: Array = np.zeros(scale.size)
        high: Array = np.asarray(scale / (2 * self._law.shear), dtype=float)
        dg: Array = low.copy()
        for _ in range(MOST):
            left, slope = self._at(dg)
            open_ = np.abs(left) > LOCAL * scale
            if not open_.any():
                break
            low, high = np.where(left > 0, dg, low), np.where(left < 0, dg, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = dg + left / slope
            inside = (step > low) & (step < high)
            dg = np.where(open_, np.where(inside, step, (low + high) / 2), dg)
        return dg

    def differential(self, trial: Array, a: Array, back: Sequence[Array]) -> tuple[Array, Array]:
        """Return the differentials of dg and de_p by the trial stress, a and the back stresses.

        Parameters
        ----------
        trial, a, back
            Their changes.
        """
        hardening = self._law.hardening.slope(self._a + ROOT * self.dg)  # type: ignore[union-attr]
        along = trial - sum(
            (part[:, None] * b for part, b in zip(self.theta, back, strict=True)),
            np.zeros_like(trial),
        )
        towards = _dot(along, self._normal)
        dg = (towards - ROOT * hardening * a) / self._slope
        along -= dg[:, None] * self._recovered()
        along -= _dot(along, self._normal)[:, None] * self._normal
        turned = (self.dg / self._size)[:, None] * along
        return dg, dg[:, None] * self._normal + turned

    def _recovered(self) -> Array:
        """Return minus the derivative of z by dg: back stresses that recover."""
        found = np.zeros_like(self._normal)
        for (_, recovery), part, b in zip(self._law._terms, self.theta, self.back, strict=True):
            found -= (recovery * ROOT * part**2)[:, None] * b
        return found

    def tangent_minus_secant(self) -> Array:
        """Return the tangent less the secant."""
        normal, g2 = self._normal, 2 * self._law.shear
        left = (g2 * self.turn - g2**2 / self._slope)[:, None] * normal
        turned = self._recovered()
        turned -= _dot(turned, normal)[:, None] * normal
        left += (self.turn * g2 / self._slope)[:, None] * turned
        return np.asarray(left[:, :, None] * normal[:, None, :])
