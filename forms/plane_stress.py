"""Plane stress: laws with sigma_zz = 0.

Of a linear material eps_zz is eliminated from the constants, by a Schur complement: elements and
forms are those of plane strain. Of other laws it is an internal variable, found at each point by
Newton's method on sigma_zz = 0 (de Souza Neto, Peric and Owen, Computational Methods for
Plasticity, 2008, section 9.2), and by bisection where that does not converge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.crystal import stiffness_tensor
from forms.elasticity import Anisotropic, isotropic, moduli
from forms.hencky import Hencky, Law, Linear
from forms.history import HistoryLaw, Response, isotropic_stiffness, with_stiffness
from forms.piezo import Piezo

Array = NDArray[np.float64]

#: Name of the strain across among the internal variables.
ACROSS = "strain_across"

#: Steps of Newton's method; then bisections, as many as take a bracket to the rounding of its ends.
NEWTON, BISECTIONS = 20, 2 * np.finfo(float).nmant

#: Stress across, as a part of the others, that is rounding.
ROUNDING = 1e-14


@dataclass(frozen=True, eq=False)
class PlaneStressElastic(Anisotropic):
    """A linear elastic material in plane stress, by its strains in the plane.

    Its stiffness has nothing between strains in the plane and across.

    Parameters
    ----------
    across
        b in eps_zz = b . (eps_xx, eps_yy, 2 eps_xy) + f . grad(phi), shape (3,).
    coupling
        f, shape (2,) (length/potential); zeros without a field.
    base
        The material, whose elastic constants are the law's; None for those of the stiffness.
    """

    across: ArrayLike = (0.0, 0.0, 0.0)
    coupling: ArrayLike = (0.0, 0.0)
    base: Linear | Anisotropic | None = None

    @property
    def bulk(self) -> float:
        """Bulk modulus of the material."""
        return super().bulk if self.base is None else float(self.base.bulk)

    @property
    def shear(self) -> float:
        """Shear modulus of the material."""
        return super().shear if self.base is None else float(self.base.shear)

    def strain_across(self, eps: Expr, gradient: Expr | None = None) -> Expr:
        """Return eps_zz of a strain in the plane and the gradient of a potential."""
        b = np.asarray(self.across, dtype=float)
        found = b[0] * eps[0, 0] + b[1] * eps[1, 1] + 2 * b[2] * eps[0, 1]
        if gradient is None:
            return found
        f = np.asarray(self.coupling, dtype=float)
        return found + f[0] * gradient[0] + f[1] * gradient[1]


def without_stress_across(stiffness: Array) -> Array:
    """Return stiffnesses from strains in the plane to stresses where none acts across.

    The Schur complement on sigma_zz, whose own entry stays, so that there is an inverse.

    Parameters
    ----------
    stiffness
        With zz as the third component, shape (..., s, s) (stress).
    """
    c = stiffness
    least = c - c[..., :, 2:3] * c[..., 2:3, :] / c[..., 2:3, 2:3]
    least[..., 2, 2] = c[..., 2, 2]
    return np.asarray(least)


@dataclass(frozen=True)
class _Around:
    """A law with the elastic constants of its base."""

    base: Hencky | HistoryLaw

    @property
    def young(self) -> float:
        """Young's modulus of small strains."""
        return float(self.base.young)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of these."""
        return float(self.base.poisson)

    @property
    def bulk(self) -> float:
        """Bulk modulus of these."""
        return moduli(self.young, self.poisson)[0]

    @property
    def shear(self) -> float:
        """Shear modulus of these."""
        return moduli(self.young, self.poisson)[1]

    @property
    def first_yield(self) -> float:
        """The strain |dev eps| at first yield."""
        return float(getattr(self.base, "first_yield", np.inf))


@dataclass(frozen=True)
class PlaneStressHistory(_Around):
    """A law at points whose stress across vanishes; a `forms.history.HistoryLaw`.

    Parameters
    ----------
    base
        The law.
    """

    base: HistoryLaw

    @property
    def symmetric(self) -> bool:
        """True if the tangent is a symmetric matrix."""
        return bool(getattr(self.base, "symmetric", True))

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return the variables of the law, and the strain across the plane."""
        return {**self.base.variables(size), ACROSS: 0.0}

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return the response at n points; see `forms.history.HistoryLaw`."""
        own = {name: value for name, value in variables.items() if name != ACROSS}
        eps, found, solved = self._without_stress(strain, own, variables[ACROSS])
        new = {**found.variables, ACROSS: eps[:, 2].copy()}
        assert found.stiffness is not None
        # To first order, without the rounding of a large bulk modulus.
        across = found.stiffness[:, :, 2] / found.stiffness[:, 2:3, 2]
        stress = found.stress - across * found.stress[:, 2:3]
        # Where no such strain is found the stress is no number, and the state no solution.
        stress[~solved] = np.nan
        stiffness = None
        if kind:
            if kind == "secant":
                asked = self.base.respond(eps, own, "secant")
                found = with_stiffness(self.base, eps, own, "secant", asked)
            assert found.stiffness is not None
            stiffness = without_stress_across(found.stiffness)
        return replace(found, stress=stress, variables=new, stiffness=stiffness)

    def _without_stress(
        self, strain: Array, variables: Mapping[str, Array], start: Array
    ) -> tuple[Array, Response, NDArray[np.bool_]]:
        """Return strains with those across at which no stress acts, the response, and where so.

        Newton's steps within the bracket of the signs so far, bisection in place of others and
        after the last one (Press et al. 2007, section 9.4); strains double without a bracket. It
        converges for every continuous stress that changes its sign.
        """
        eps = strain.copy()
        eps[:, 2] = start
        elastic = self.young * np.abs(eps).max(axis=1)
        low: Array = np.full(len(eps), -np.inf)
        high: Array = np.full(len(eps), np.inf)
        for step in range(NEWTON + BISECTIONS):
            found = self.base.respond(eps, variables, "tangent")
            found = with_stiffness(self.base, eps, variables, "tangent", found)
            assert found.stiffness is not None
            stress, slope, at = found.stress[:, 2], found.stiffness[:, 2, 2], eps[:, 2].copy()
            strained = np.abs(eps).max(axis=1)
            size = np.abs(found.stress).max(axis=1, initial=0.0)
            # Of nearly incompressible materials the rounding of strains is that of the slope.
            known = np.maximum.reduce([size, elastic, slope * strained])
            open_ = ~(np.abs(stress) <= ROUNDING * known)
            moving = open_ & np.isfinite(stress)
            if not moving.any():
                break
            low = np.where(stress < 0, np.maximum(low, at), low)
            high = np.where(stress > 0, np.minimum(high, at), high)
            to = at - stress / np.where(slope > 0, slope, np.nan)
            reach = 2 * np.maximum(strained, size / self.young)
            inside = (to > low) & (to < high) & (np.abs(to - at) <= reach) & (step < NEWTON)
            beyond = at - np.sign(stress) * reach
            closed = np.isfinite(low) & np.isfinite(high)
            middle = np.add(low, high, out=2 * beyond, where=closed) / 2
            eps[:, 2] = np.where(moving, np.where(inside, to, middle), at)
        return eps, found, ~open_


@dataclass(frozen=True)
class HenckyAtPoints(_Around):
    """Hencky's law as a stress update without internal variables.

    Parameters
    ----------
    base
        The law.
    """

    base: Hencky

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return none."""
        return {}

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return the response at n points; see `forms.history.HistoryLaw`."""
        size, law, bulk = strain.shape[1], self.base, self.bulk
        trace, deviator = strain[:, :3].sum(axis=1), strain.copy()
        deviator[:, :3] -= trace[:, None] / 3
        q = np.einsum("ni,ni->n", deviator, deviator)
        g = np.asarray(law.secant_modulus(q), dtype=float)
        stress = 2 * g[:, None] * deviator
        stress[:, :3] += bulk * trace[:, None]
        stiffness = None
        if kind:
            stiffness = isotropic_stiffness(np.full(len(q), bulk), g, size)
        if kind == "tangent":
            h = 1e-6 * q + 1e-24
            slope = (law.secant_modulus(q + h) - law.secant_modulus(np.maximum(q - h, 0.0))) / (
                h + np.minimum(q, h)
            )
            stiffness = stiffness + 4 * np.einsum("n,ni,nj->nij", slope, deviator, deviator)
        energy = bulk / 2 * trace**2 + np.asarray(law.shear_energy(q), dtype=float)
        return Response(stress, {}, stiffness, None, energy)


def base_of(law: Law) -> Law:
    """Return the law of a material in plane stress, or the law itself."""
    while isinstance(law, PlaneStressHistory | HenckyAtPoints):
        law = law.base
    return law


def hencky_of(law: Law) -> Hencky | None:
    """Return the law of a material if it is Hencky's, with a secant modulus, or None."""
    base = base_of(law)
    return None if isinstance(base, Anisotropic | HistoryLaw) else base


def in_plane_stress(law: Law, piezo: Piezo | None = None) -> tuple[Law, Piezo | None]:
    """Return the material of a plane body without stress across it.

    Parameters
    ----------
    law
        The law of the stress, a crystal in the axes of the body.
    piezo
        Its piezoelectric tensors in these axes, or None.

    Returns
    -------
    Law and tensors for the strains and fields in the plane.

    Examples
    --------
    >>> law, _ = in_plane_stress(Linear(3.0, 0.5 - 1e-9))
    >>> np.round(law.stiffness[:2, :2], 6)
    array([[4., 2.],
           [2., 4.]])
    """
    if isinstance(law, PlaneStressElastic | PlaneStressHistory):
        return law, piezo
    if isinstance(law, HistoryLaw):
        return PlaneStressHistory(law), piezo
    if not isinstance(law, Linear | Anisotropic):
        return PlaneStressHistory(HenckyAtPoints(law)), piezo
    if isinstance(law, Linear):
        c = isotropic(float(law.young), float(law.poisson))
    else:
        c = np.array(law.stiffness, dtype=float)
    least = without_stress_across(c)
    across = -c[2, [0, 1, 5]] / c[2, 2]
    if piezo is None:
        return PlaneStressElastic(least, True, across, base=law), None
    e, beta = np.array(piezo.e, dtype=float), np.array(piezo.beta, dtype=float)
    out = e[:, 2, 2]
    reduced = e - np.einsum("k,ij->kij", out, stiffness_tensor(c)[:, :, 2, 2]) / c[2, 2]
    coupling = -out[:2] / c[2, 2]
    tensors = Piezo(reduced, beta + np.outer(out, out) / c[2, 2])
    return PlaneStressElastic(least, True, across, coupling, law), tensors
