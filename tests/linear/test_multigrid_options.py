"""Options of the user for multigrid: those of GAMG hold on the levels that ranks make, too."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.operator import SparseOperator
from tests.problems import mechanics

WORLD = MPI.COMM_WORLD


def solved(given: dict[str, str]) -> tuple[SparseOperator, PETSc.PC, int]:
    """Return an operator that has solved with options, its preconditioner and iterations.

    Without the operator the preconditioner is empty. Collective.
    """
    problem = mechanics.leaning_block(WORLD, 8)
    blocks = np.tile(np.eye(3), (problem.nodes.nodes.size, 1, 1))
    rhs = problem.body.layout.mask(problem.body.external())
    known = PETSc.Options("contact_")
    for name, value in given.items():
        known[name] = value
    try:
        operator = SparseOperator(problem.body, problem.nodes.nodes, solver="iterative")
        operator.update("secant", problem.start(), blocks)
        found = operator.solve(rhs)
    finally:
        for name in given:
            known.delValue(name)
    residual = problem.body.norm(operator.multiply(found) - rhs)
    assert residual <= 1e-7 * problem.body.norm(rhs)
    return operator, operator.ksp.getPC(), operator.counters.linear_iterations


@pytest.mark.parallel
def test_cycles() -> None:
    """They were those of the levels of GAMG alone."""
    _usual, pc, usual = solved({})
    assert pc.getType() == "mg"
    assert pc.getMGCoarseSolve().getType() == "preonly"
    *_, twice = solved({"pc_mg_multiplicative_cycles": "2"})
    assert twice < 0.8 * usual
    _w, pc, taken = solved({"pc_mg_cycle_type": "w", "pc_gamg_coarse_eq_limit": "20"})
    coarse = pc.getMGCoarseSolve()
    assert coarse.getType() == "richardson"
    assert coarse.getIterationNumber() == 2
    assert coarse.getPC().getMGLevels() > 1
    # equal solves on ranks may differ by one: sums of random vectors bound Chebyshev's smoother
    assert taken <= solved({"pc_gamg_coarse_eq_limit": "20"})[2] + 1
    _additive, pc, additive = solved({"pc_mg_type": "additive"})
    assert pc.getMGType() == PETSc.PC.MGType.ADDITIVE
    assert additive > usual
