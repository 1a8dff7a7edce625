"""Norms and volumes over the body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix
from mpi4py import MPI

from contact.problem.problem import ContactProblem
from contact.typing import Array


def volume(problem: ContactProblem, measure: ufl.Measure) -> float:
    """Return the volume or area that a UFL measure covers, over all ranks. Collective."""
    form = fem.form(problem.constant(1.0) * measure)
    return float(problem.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM))


def domain_norm(problem: ContactProblem) -> Callable[[Array], float]:
    """Return the L2(Omega) norm of owned unknowns (displacement and scaled potential)."""
    trial, test = ufl.TrialFunction(problem.space), ufl.TestFunction(problem.space)
    mass = assemble_matrix(fem.form(ufl.inner(trial, test) * problem.domain.dx))
    mass.assemble()
    vector, image = mass.createVecs()

    def norm(values: Array) -> float:
        vector.array[:] = values
        mass.mult(vector, image)
        return float(np.sqrt(max(vector.dot(image), 0.0)))

    return norm
