"""Cost of Newton's method with multigrid in 3-D: set-ups and iterations, not seconds."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, nesting
from contact.history import BodyState
from contact.linear import multigrid
from contact.linear.operator import SparseOperator
from contact.results.solution import Solution
from contact.solving import solve
from scripts.benchmarks.bench_one import block

#: Largest displacement of the block, found by a direct solver.
LARGEST = 0.0366836772


@pytest.fixture
def small_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a mesh of some thousand unknowns be solved like one of a million."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    monkeypatch.setitem(multigrid.LARGE, (3, False), 1000)
    monkeypatch.setitem(multigrid.DEFAULTS, "pc_gamg_coarse_eq_limit", "200")


def largest(solution: Solution) -> float:
    """Return the largest displacement component."""
    here = np.abs(solution.state.x).max(initial=0.0)
    return float(solution.problem.comm.allreduce(here, op=MPI.MAX))


@pytest.mark.parallel
@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize(
    ("solver", "start", "iterations"),
    [({}, "the solution on a coarser mesh", 5), ({"nested": False}, "the zero initial guess", 6)],
    ids=["nested", "cold"],
)
def test_a_block_costs_few_set_ups_and_iterations(
    solver: dict[str, bool], start: str, iterations: int
) -> None:
    """A nested start is the program's own choice; coarse levels are not made in every step."""
    solution = solve(block(8, **solver))
    counters = solution.counters
    assert solution.converged
    assert solution.start == start
    assert largest(solution) == pytest.approx(LARGEST, rel=1e-7)
    assert counters.linear_solves <= 9
    assert counters.factorizations <= 2
    assert counters.linear_iterations <= iterations * counters.linear_solves


@pytest.mark.usefixtures("small_is_large")
def test_a_direct_solver_factorises_a_large_body_once():
    """It is condensed then, as where bodies are small: multigrid alone has each step anew."""
    law = {"young": 1.0, "poisson": 0.3}
    solution, other = (solve(block(6, law, linear=linear)) for linear in ("lu", "auto"))
    assert solution.converged
    assert other.converged
    assert largest(solution) == pytest.approx(largest(other), rel=1e-7)
    assert solution.counters.linear_solves == solution.counters.factorizations == 1
    assert other.counters.linear_solves > 1


@pytest.mark.usefixtures("small_is_large")
def test_coarse_levels_that_are_new_are_not_renewed_for_a_correction(monkeypatch):
    """Of the same operator they would be the same; those of an earlier one are renewed."""

    def correct(_, rhs, solution, solve, __) -> None:
        solve(rhs.copy(), solution.duplicate())

    monkeypatch.setattr(multigrid, "refine", correct)
    problem = build_problem(block(6))
    body, nodes = problem.equilibrium, problem.nodes.nodes
    operator, x = SparseOperator(body, nodes), problem.start().x
    blocks = np.zeros((nodes.size, body.block_size, body.block_size))
    for stiffness, made in ((0.0, 1), (1.0, 2)):
        operator.update(
            "secant", BodyState(x), blocks + stiffness * np.eye(body.block_size), constant=True
        )
        operator.solve(body.external(), 1e-8)
        assert operator.counters.factorizations == made


@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize("rtol", [0.9, 1e-8])
def test_the_iterations_a_digit_are_those_that_were_gained(monkeypatch, rtol):
    """One iteration for a twentieth of a digit was taken for 22 a digit: nothing was ever lost."""

    def correct(ksp, rhs, solution, solve, _) -> None:
        asked_for = ksp.getTolerances()[0]
        ksp.setTolerances(rtol=rtol)
        solve(rhs.copy(), solution.duplicate())
        ksp.setTolerances(rtol=asked_for)

    problem = build_problem(block(6))
    body, nodes = problem.equilibrium, problem.nodes.nodes
    operator, x = SparseOperator(body, nodes), problem.start().x
    for stiffness in (0.0, 1.0):
        operator.update(
            "secant", BodyState(x), stiffness * np.stack(nodes.size * [np.eye(3)]), constant=True
        )
        operator.solve(body.external(), 1e-8)
        monkeypatch.setattr(multigrid, "refine", correct)
    assert operator.counters.factorizations == 2
    assert operator._hierarchy._rate < 4
