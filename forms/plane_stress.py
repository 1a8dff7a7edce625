"""Plane stress: laws without stress across a plane body, which is free to grow thinner.

Of a linear material the strain across is eliminated from the constants, which are those of the
Schur complement on the stress sigma_zz: no element and no form notices. Of other laws it is found
at each point, by Newton's method on sigma_zz = 0 within a bracket (de Souza Neto, Peric and Owen,
Computational Methods for Plasticity, 2008, section 9.2), and is one of their internal variables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.crystal import stiffness_tensor
from forms.elasticity import Anisotropic, isotropic
from forms.hencky import Hencky, Law, Linear
from forms.history import HistoryLaw, Response, isotropic_stiffness, with_stiffness
from forms.piezo import Piezo

Array = NDArray[np.float64]

#: Name of the strain across among the internal variables.
ACROSS = "strain_across"

#: Steps of Newton's method, or bisections, in which the stress across vanishes.
MOST = 100


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
    """

    across: ArrayLike = (0.0, 0.0, 0.0)
    coupling: ArrayLike = (0.0, 0.0)

    def strain_across(self, eps: Expr, gradient: Expr | None = None) -> Expr:
        """Return eps_zz of a strain in the plane and the gradient of a potential."""
        b = np.asarray(self.across, dtype=float)
        found = b[0] * eps[0, 0] + b[1] * eps[1, 1] + 2 * b[2] * eps[0, 1]
        if gradient is None:
            return found
        f = np.asarray(self.coupling, dtype=float)
        return found + f[0] * gradient[0] + f[1] * gradient[1]


@dataclass(frozen=True)
class PlaneStressHistory:
    """A law at points whose stress across vanishes; a `forms.history.HistoryLaw`.

    Parameters
    ----------
    base
        The law.
    """

    base: HistoryLaw

    @property
    def young(self) -> float:
        """Young's modulus of small strains."""
        return self.base.young

    @property
    def poisson(self) -> float:
        """Poisson's ratio of these."""
        return self.base.poisson

    @property
    def bulk(self) -> float:
        """Bulk modulus of these."""
        return self.young / (3 - 6 * self.poisson)

    @property
    def shear(self) -> float:
        """Shear modulus of these."""
        return self.young / (2 + 2 * self.poisson)

    @property
    def first_yield(self) -> float:
        """The strain |dev eps| at first yield."""
        return float(getattr(self.base, "first_yield", np.inf))

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is a symmetric matrix."""
        return bool(getattr(self.base, "symmetric", True))

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return those of the law, and the strain across."""
        return {**self.base.variables(size), ACROSS: 0.0}

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return the response at n points; see `forms.history.HistoryLaw`."""
        own = {name: value for name, value in variables.items() if name != ACROSS}
        eps, found = self._without_stress(strain, own, variables[ACROSS])
        new = {**found.variables, ACROSS: eps[:, 2].copy()}
        stress = found.stress.copy()
        stress[:, 2] = 0.0
        stiffness = None
        if kind:
            if kind == "secant":
                asked = self.base.respond(eps, own, "secant")
                found = with_stiffness(self.base, eps, own, "secant", asked)
            assert found.stiffness is not None
            c = found.stiffness
            stiffness = c - c[:, :, 2:3] * c[:, 2:3] / c[:, 2:3, 2:3]
            stiffness[:, 2, 2] = c[:, 2, 2]
        return replace(found, stress=stress, variables=new, stiffness=stiffness)

    def _without_stress(
        self, strain: Array, variables: Mapping[str, Array], start: Array
    ) -> tuple[Array, Response]:
        """Return strains with those across at which no stress acts, and the response with tangent.

        The stress across grows with the strain across: where Newton's step leaves the bracket of
        the signs that were seen, its middle is taken.
        """
        eps = strain.copy()
        eps[:, 2] = start
        low: Array = np.full(len(eps), -np.inf)
        high: Array = np.full(len(eps), np.inf)
        for _ in range(MOST):
            found = self.base.respond(eps, variables, "tangent")
            found = with_stiffness(self.base, eps, variables, "tangent", found)
            assert found.stiffness is not None
            stress, slope = found.stress[:, 2], found.stiffness[:, 2, 2]
            size = np.abs(found.stress).max(axis=1, initial=0.0)
            open_ = np.abs(stress) > 1e-14 * np.maximum(size, self.young * np.abs(eps).max(axis=1))
            if not open_.any():
                break
            low = np.where(stress < 0, np.maximum(low, eps[:, 2]), low)
            high = np.where(stress > 0, np.minimum(high, eps[:, 2]), high)
            to = eps[:, 2] - stress / slope
            outside = ~((to > low) & (to < high)) & np.isfinite(low) & np.isfinite(high)
            eps[:, 2] = np.where(open_, np.where(outside, (low + high) / 2, to), eps[:, 2])
        return eps, found


@dataclass(frozen=True)
class HenckyAtPoints:
    """Hencky's law as a stress update without internal variables.

    Parameters
    ----------
    law
        The law.
    """

    law: Hencky

    @property
    def young(self) -> float:
        """Young's modulus."""
        return float(self.law.young)

    @property
    def poisson(self) -> float:
        """Poisson's ratio."""
        return float(self.law.poisson)

    @property
    def first_yield(self) -> float:
        """The strain |dev eps| at first yield."""
        return float(getattr(self.law, "first_yield", np.inf))

    def variables(self, size: int) -> Mapping[str, ArrayLike]:
        """Return none."""
        return {}

    def respond(self, strain: Array, variables: Mapping[str, Array], kind: str = "") -> Response:
        """Return the response at n points; see `forms.history.HistoryLaw`."""
        size, law = strain.shape[1], self.law
        trace, deviator = strain[:, :3].sum(axis=1), strain.copy()
        deviator[:, :3] -= trace[:, None] / 3
        q = np.einsum("ni,ni->n", deviator, deviator)
        g = np.asarray(law.secant_modulus(q), dtype=float)
        stress = 2 * g[:, None] * deviator
        stress[:, :3] += float(law.bulk) * trace[:, None]
        stiffness = None
        if kind:
            stiffness = isotropic_stiffness(np.full(len(q), float(law.bulk)), g, size)
        if kind == "tangent":
            h = 1e-6 * q + 1e-24
            slope = (law.secant_modulus(q + h) - law.secant_modulus(np.maximum(q - h, 0.0))) / (
                h + np.minimum(q, h)
            )
            stiffness = stiffness + 4 * np.einsum("n,ni,nj->nij", slope, deviator, deviator)
        energy = float(law.bulk) / 2 * trace**2 + np.asarray(law.shear_energy(q), dtype=float)
        return Response(stress, {}, stiffness, None, energy)


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
    least = c - np.outer(c[:, 2], c[2]) / c[2, 2]
    least[2, 2] = c[2, 2]
    across = -c[2, [0, 1, 5]] / c[2, 2]
    if piezo is None:
        return PlaneStressElastic(least, True, across), None
    e, beta = np.array(piezo.e, dtype=float), np.array(piezo.beta, dtype=float)
    out = e[:, 2, 2]
    reduced = e - np.einsum("k,ij->kij", out, stiffness_tensor(c)[:, :, 2, 2]) / c[2, 2]
    coupling = -out[:2] / c[2, 2]
    tensors = Piezo(reduced, beta + np.outer(out, out) / c[2, 2])
    return PlaneStressElastic(least, True, across, coupling), tensors
