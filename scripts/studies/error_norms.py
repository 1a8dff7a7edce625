"""Norms of the difference between two displacements, by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.elements import kinematics_of
from contact.body.equilibrium import BodyEquilibrium
from contact.body.materials import material_measures
from contact.history import BodyState
from contact.typing import Array
from forms.hencky import FormLaw, secant_stress
from forms.kinematics import deviator_squared, strain
from forms.piezo import Piezo
from forms.plane_stress import ACROSS, HenckyAtPoints, PlaneStressHistory


@dataclass(frozen=True)
class Errors:
    """Norms of the difference between two displacements.

    Attributes
    ----------
    l2, h1
        Norm in L2(Omega), and |grad(.)| in L2(Omega).
    energy
        sqrt(B(u; e, e)) with the secant form of the finer solution u: the norm in which Cea's
        lemma holds for a linear material. In a piezoelectric body with E . beta E besides. Strains
        of u are those of its element: of the mean dilatation the error is that of the pressure. In
        plane stress strains across are those at which e has no stress there.
    """

    l2: float
    h1: float
    energy: float

    def __truediv__(self, other: Errors) -> Errors:
        """Return relative errors."""
        return Errors(self.l2 / other.l2, self.h1 / other.h1, self.energy / other.energy)


def errors(
    body: BodyEquilibrium,
    x: Array,
    other: fem.Function | Callable[[ufl.SpatialCoordinate], Expr] | None,
) -> Errors:
    """Return the norms of the displacement's distance to another one. Collective.

    Parameters
    ----------
    body, x
        The body on the finer mesh, and its unknowns: the solution.
    other
        A function in `body.space`, or the displacement, with the potential of a piezoelectric body,
        as a UFL vector of the coordinates; None for the norms of the solution itself.
    """
    solution = body.function(x)
    u, phi = body.split(solution)
    kinematics, own = body.domain.kinematics, kinematics_of(body.domain, body.element)
    frozen = eps = strain(u, own)
    e, electric = u, phi
    if isinstance(other, fem.Function):
        e, electric = body.split(solution - other)
        eps = strain(e, own)
    elif other is not None:
        every = other(ufl.SpatialCoordinate(body.domain.mesh))
        given = ufl.as_vector([every[i] for i in range(body.dim)])
        e, eps = u - given, eps - strain(given, kinematics)
        electric = None if phi is None else phi - every[body.dim]
    materials = list(
        material_measures(body.domain, body.body.materials, body.cells, 2 * body.degree + 4)
    )
    body.laws.fit(BodyState(x))
    gradient = kinematics.gradient(e)
    squares = (
        sum(ufl.inner(e, e) * dx for _, _, dx in materials),
        sum(ufl.inner(gradient, gradient) * dx for _, _, dx in materials),
        sum(
            (_elastic(body, law, frozen, eps) + _electric(piezo, electric, body.dim)) * dx
            for law, piezo, dx in materials
        ),
    )
    integrals = [fem.assemble_scalar(fem.form(square)) for square in squares]
    totals = body.comm.allreduce(np.array(integrals), op=MPI.SUM)
    return Errors(*(float(np.sqrt(max(total, 0.0))) for total in totals))


def _elastic(body: BodyEquilibrium, law: FormLaw, frozen: Expr, eps: Expr) -> Expr:
    """Return eps : C eps with the secant stiffness C at a frozen strain."""
    if isinstance(law, PlaneStressHistory):
        assert isinstance(law.base, HenckyAtPoints)
        across = ufl.as_tensor([[0, 0, 0], [0, 0, 0], [0, 0, 1]])
        law, frozen = law.base.base, frozen + body.laws.fits[ACROSS] * across
        g = law.secant_modulus(deviator_squared(frozen))
        eps -= (law.bulk - 2 * g / 3) / (law.bulk + 4 * g / 3) * ufl.tr(eps) * across
    return ufl.inner(secant_stress(law, frozen, eps), eps)


def _electric(piezo: Piezo | None, potential: Expr | None, dim: int) -> Expr:
    """Return E . beta E, zero in a material without a field."""
    if piezo is None or potential is None:
        return ufl.as_ufl(0)
    field = ufl.grad(potential)
    return sum(piezo.beta[i, j] * field[i] * field[j] for i in range(dim) for j in range(dim))
