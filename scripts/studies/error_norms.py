"""Norms of the difference between two displacements, by quadrature."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.equilibrium import BodyEquilibrium
from contact.body.materials import material_measures
from contact.typing import Array
from forms.hencky import secant_form


@dataclass(frozen=True)
class Errors:
    """Norms of the difference between two displacements.

    Attributes
    ----------
    l2, h1
        Norm in L2(Omega), and |grad(.)| in L2(Omega).
    energy
        sqrt(B(u; e, e)) with the secant form of the finer solution u: the norm in which Cea's
        lemma holds for a linear material.
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
        A function in `body.space`, or the displacement as a UFL vector of the coordinates; None
        for the norms of the solution itself.
    """
    solution = body.function(x)
    u, _ = body.split(solution)
    if isinstance(other, fem.Function):
        e = body.split(solution - other)[0]
    elif other is None:
        e = u
    else:
        e = u - other(ufl.SpatialCoordinate(body.domain.mesh))
    materials = list(
        material_measures(body.domain, body.body.materials, body.cells, 2 * body.degree + 4)
    )
    kinematics = body.domain.kinematics
    gradient = kinematics.gradient(e)
    squares = (
        sum(ufl.inner(e, e) * dx for _, _, dx in materials),
        sum(ufl.inner(gradient, gradient) * dx for _, _, dx in materials),
        sum(secant_form(law, u, e, e, kinematics) * dx for law, _, dx in materials),
    )
    integrals = [fem.assemble_scalar(fem.form(square)) for square in squares]
    totals = body.comm.allreduce(np.array(integrals), op=MPI.SUM)
    return Errors(*(float(np.sqrt(max(total, 0.0))) for total in totals))
