"""Manufactured solutions of a piezoelectric body: orders of u and phi, P1 and P2, 2-D and 3-D."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.methods.options import FixedPointOptions
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Hencky, Log
from scripts.studies.exact_solutions import exact, manufactured
from tests.problems.piezo import POISSON, SCALED, YOUNG, pzt

COMM = MPI.COMM_WORLD


def errors(dim: int, degree: int, n: int, law: Hencky) -> np.ndarray:
    """Return the H1 seminorm and L2 errors of u and phi."""
    problem = manufactured(dim, degree, n, law, piezo=pzt(dim))
    *u, phi = exact(dim, charged=True)(ufl.SpatialCoordinate(problem.domain.mesh))
    state, outcome = FixedPoint(problem, FixedPointOptions(tolerance=1e-11)).solve()
    assert outcome.converged, outcome.reason
    body = problem.equilibrium
    u_h, phi_h = body.split(body.function(state.x))
    dx = ufl.Measure("dx", problem.domain.mesh, metadata={"quadrature_degree": 2 * degree + 3})
    squares = []
    for difference in (u_h - ufl.as_vector(u), phi_h - phi):
        gradient = ufl.grad(difference)
        squares += [ufl.inner(gradient, gradient) * dx, ufl.inner(difference, difference) * dx]
    local = [fem.assemble_scalar(fem.form(square)) for square in squares]
    return np.sqrt(COMM.allreduce(np.array(local), MPI.SUM))


CASES = [
    (2, 1, (16, 32)),
    (2, 2, (8, 16)),
    (3, 1, (5, 10)),
    (3, 2, (3, 6)),
]


@pytest.mark.core("2-1-cells0")
@pytest.mark.parametrize(("dim", "degree", "cells"), CASES)
def test_orders(dim, degree, cells):
    found = np.array([errors(dim, degree, n, SCALED.law()) for n in cells])
    orders = np.log2(found[:-1] / found[1:])[-1]
    expected = np.array([degree, degree + 1, degree, degree + 1])
    # Both fields, in H1 and in L2; the coarse meshes of 3-D are not yet asymptotic.
    assert np.all(orders > expected - (0.1 if dim == 2 else 0.25)), orders
    assert np.all(orders < expected + 0.5), orders


@pytest.mark.parametrize(
    ("degree", "cells"), [(1, (16, 32)), pytest.param(2, (8, 16), marks=pytest.mark.slow)]
)
def test_orders_beyond_yield(degree, cells):
    """With the logarithmic law, yielded throughout: |dev eps| is between 0.02 and 0.2."""
    law = Log(YOUNG, POISSON, yield_strain=0.01)
    found = np.array([errors(2, degree, n, law) for n in cells])
    orders = np.log2(found[:-1] / found[1:])[-1]
    assert np.all(orders > np.array([degree, degree + 1] * 2) - 0.15), orders
