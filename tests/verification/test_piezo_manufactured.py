"""Manufactured solutions of a piezoelectric body: orders of u and phi, P1 and P2, 2-D and 3-D."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.mesh.cells import rule, shape_of
from contact.mesh.geometry import geometry_nodes, integration_weights
from forms.hencky import Hencky, Log
from scripts.studies.exact_solutions import exact, manufactured
from tests.problems.mechanics import solve
from tests.problems.piezo import POISSON, SCALED, YOUNG, pzt

COMM = MPI.COMM_WORLD


def errors(dim: int, degree: int, n: int, law: Hencky) -> np.ndarray:
    """Return the H1 seminorm and L2 errors of u and phi."""
    problem = manufactured(dim, degree, n, law, piezo=pzt(dim))
    *u, phi = exact(dim, charged=True)(ufl.SpatialCoordinate(problem.domain.mesh))
    state = solve(problem, 1e-11).state
    body, mesh, shape = problem.body, problem.domain.mesh, shape_of(problem.domain.mesh)
    u_h, phi_h = body.split(body.function(state.x))
    off = ufl.as_vector([*(u_h[i] - u[i] for i in range(dim)), phi_h - phi])
    slopes = ufl.grad(off)
    every = [*off, *(slopes[i, j] for i in range(dim + 1) for j in range(dim))]
    at, weights = rule(shape, 2 * degree + 3)
    of = geometry_nodes(problem.domain)
    values = fem.Expression(ufl.as_vector(every), at).eval(mesh, np.arange(len(of), dtype=np.int32))
    squares = np.reshape(values, (len(of), len(at), -1)) ** 2
    sums = np.einsum("cq,cqk->k", integration_weights(False, shape, of, at, weights), squares)
    ends = np.cumsum([0, dim, 1, dim * dim, dim])
    l2_u, l2_phi, h1_u, h1_phi = np.sqrt(np.add.reduceat(COMM.allreduce(sums), ends[:-1]))
    return np.array([h1_u, l2_u, h1_phi, l2_phi])


CASES = [
    (2, 1, (16, 32)),
    (2, 2, (8, 16)),
    (3, 1, (5, 10)),
    pytest.param(3, 2, (3, 6), marks=pytest.mark.slow),
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
