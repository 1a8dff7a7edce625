"""Errors between finite element functions on different meshes of one body.

A coarse function is carried to the mesh of a finer one, where it is compared: exactly where
the meshes are nested, for its values at the nodes of the fine element are then all there is
to know, and up to the fine mesh's interpolation error where they are not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.problem.problem import ContactProblem, with_constants
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


def carry(coarse: fem.Function, space: fem.FunctionSpace) -> fem.Function:
    """Return the interpolant of a function in a space on another mesh. Collective.

    Parameters
    ----------
    coarse
        The function.
    space
        Space on another mesh of the same body.

    Notes
    -----
    A node of the new mesh that lies slightly outside of the old one, as on a curved boundary,
    gets the value of the closest cell.
    """
    made = fem.Function(space, name=coarse.name)
    topology = space.mesh.topology
    cells = np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
    padding = 1e-3 * float(np.ptp(space.mesh.geometry.x, axis=0).max(initial=0.0))
    padding = space.mesh.comm.allreduce(padding, op=MPI.MAX)
    source = coarse.function_space
    data = fem.create_interpolation_data(space, source, cells, padding=padding)
    made.interpolate_nonmatching(coarse, cells, interpolation_data=data)
    made.x.scatter_forward()
    return made


def errors(problem: ContactProblem, other: fem.Function | None) -> Errors:
    """Return the norms of `problem.x` - `other`, or of `problem.x` itself for None. Collective.

    Parameters
    ----------
    problem
        The problem on the finer mesh; its iterate is the solution.
    other
        A function in `problem.space`.
    """
    e = problem.x if other is None else problem.x - other
    u, _ = problem.parts_of(problem.x)
    difference, _ = problem.parts_of(e)
    law = with_constants(problem.body.law, problem.constant)
    return Errors(
        *_norms(
            problem,
            ufl.inner(difference, difference),
            ufl.inner(ufl.grad(difference), ufl.grad(difference)),
            secant_form(law, u, difference, difference),
        )
    )


def errors_to(
    problem: ContactProblem, exact: Callable[[ufl.SpatialCoordinate], ufl.core.expr.Expr]
) -> Errors:
    """Return the norms of the displacement's distance to a given one. Collective.

    Parameters
    ----------
    problem
        Whose iterate is measured.
    exact
        Displacement as a UFL vector of the coordinates.
    """
    u, _ = problem.parts_of(problem.x)
    given = exact(ufl.SpatialCoordinate(problem.domain.mesh))
    e = u - given
    law = with_constants(problem.body.law, problem.constant)
    return Errors(
        *_norms(
            problem, ufl.inner(e, e), ufl.inner(ufl.grad(e), ufl.grad(e)), secant_form(law, u, e, e)
        )
    )


def _norms(problem: ContactProblem, *integrands: ufl.core.expr.Expr) -> list[float]:
    """Return the square roots of integrals over the body."""
    dx = problem.domain.dx(metadata={"quadrature_degree": 2 * problem.degree + 4})
    integrals = [fem.assemble_scalar(fem.form(integrand * dx)) for integrand in integrands]
    totals = problem.comm.allreduce(np.array(integrals), op=MPI.SUM)
    return [float(np.sqrt(max(total, 0.0))) for total in totals]
