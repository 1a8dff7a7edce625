"""Smoothed aggregation whose coarse operator ranks make of their own rows."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear import aggregation
from contact.linear.aggregation import Aggregation, tentative
from contact.linear.multigrid import DEFAULTS, held_motions, options
from contact.problem.problem import ContactProblem
from tests.problems import mechanics

WORLD = MPI.COMM_WORLD


def level_of(problem: ContactProblem) -> tuple[PETSc.Mat, Aggregation]:
    """Return the stiffness of a body, and its first coarse level. Collective."""
    body = problem.equilibrium
    matrix = body.create_matrix()
    body.assemble(matrix, "secant", problem.start())
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setNearNullSpace(held_motions(body.layout))
    names = {k: v for k, v in DEFAULTS.items() if k.startswith("pc_gamg_")}
    with options("coarsened_", names | aggregation.AGGREGATES):
        found = tentative(matrix, "coarsened_")
    assert found is not None
    return matrix, Aggregation(matrix, found)


@pytest.mark.parallel
@pytest.mark.parametrize("n", [1, 8])
def test_the_coarse_operator_is_that_of_petsc(n: int) -> None:
    """Also of another matrix and with other rows of P; and where ranks have no nodes."""
    problem = mechanics.leaning_block(WORLD, n)
    matrix, level = level_of(problem)
    for factor in (1.0, 3.0):
        matrix.scale(factor)
        starts, columns, values = level.rows.getValuesCSR()
        level.rows.setValuesIJV(starts, columns, factor * values)
        level.rows.assemble()
        found = level.update()
        whole = level.interpolation.convert("aij", PETSc.Mat())
        expected = matrix.ptap(whole)
        assert found.getBlockSize() == 6
        assert found.getSizes() == expected.getSizes()
        vector = expected.createVecRight()
        vector.setRandom()
        assert (found * vector - expected * vector).norm() <= 1e-13 * (expected * vector).norm()


@pytest.mark.parallel
def test_the_interpolation_is_smoothed_by_one_step_of_jacobi() -> None:
    """Coarse rigid motions become (1 - w D^-1 K) B of those of the body, with one w for all."""
    problem = mechanics.leaning_block(WORLD, 8)
    matrix, level = level_of(problem)
    coarse, diagonal = level.update(), matrix.getDiagonal()
    modes = (each.getNearNullSpace().getVecs() for each in (matrix, coarse))
    damping = []
    for fine, rough in zip(*modes, strict=True):
        assert abs(rough.norm() - 1) <= 1e-12
        strained, moved = matrix * fine, fine - level.interpolation * rough
        moved.pointwiseMult(moved, diagonal)
        damping.append(moved.dot(strained) / strained.dot(strained))
        moved.axpy(-damping[-1], strained)
        assert moved.norm() <= 1e-12 * matrix.norm()
    assert np.ptp(damping) <= 1e-10 * damping[0]
    assert 0.2 < damping[0] < 1.4
