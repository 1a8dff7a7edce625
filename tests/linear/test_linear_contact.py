"""Multigrid for operators with contact blocks that are far stiffer than the body.

The dense operator: a matrix plus blocks at nodes, factorised by the first rank.
"""

from __future__ import annotations

import gc
import tracemalloc
import weakref

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.errors import InputError
from contact.history import BodyState
from contact.linear.operator import Counters, SparseOperator
from contact.linear.schur import DenseOperator, DenseStiffness
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.typing import Array
from tests.problems import mechanics

SELF, WORLD = MPI.COMM_SELF, MPI.COMM_WORLD
GAMMA, MU = 1e4, 0.4


def operator_of(problem: ContactProblem, kind: str, *, symmetric: bool = True) -> SparseOperator:
    """Return the operator with blocks at the contact nodes."""
    body, nodes = problem.body, problem.nodes.nodes
    return SparseOperator(body, nodes, symmetric=symmetric, solver=kind)


def with_little_workspace(problem: ContactProblem) -> SparseOperator:
    """Return an operator whose factorisation gets a tenth of the room that MUMPS expects."""
    operator = operator_of(problem, "lu")
    operator.ksp.setOperators(operator.matrix)
    operator.ksp.getPC().setFactorSetUpSolverType()
    operator.ksp.getPC().getFactorMatrix().setMumpsIcntl(14, -90)
    return operator


def sticking(problem: ContactProblem) -> Array:
    """Return the blocks of nodes that stick."""
    return np.tile(GAMMA * np.eye(problem.dim), (problem.nodes.nodes.size, 1, 1))


def sliding(problem: ContactProblem, mu: float) -> tuple[Array, Array]:
    """Return blocks and contact forces of nodes that slide along x, for pressure GAMMA."""
    normal = problem.nodes.normal
    along = np.zeros_like(normal)
    along[:, 0] = 1.0
    force = GAMMA * (normal + mu * along)
    return force[:, :, None] * normal[:, None, :], force


@pytest.mark.parallel
def test_no_solve_takes_more_iterations_than_are_allowed() -> None:
    """The limit of the first solve was forgotten in those that follow it."""
    problem, most = mechanics.leaning_block(WORLD, 12), 5
    body, weight = problem.body, problem.nodes.weight[:, None, None]
    x, load, sticks = problem.start().x, body.external(), weight * sticking(problem)
    options = PETSc.Options()
    options["contact_ksp_max_it"] = most
    try:
        operator = operator_of(problem, "iterative")
        for count, blocks in enumerate((sticks, 1.1 * sticks, 0 * sticks, 0 * sticks), start=1):
            operator.update("secant", BodyState(x), blocks)
            operator.solve(load, 1e-9)
            assert operator.counters.linear_iterations == count * most
    finally:
        options.delValue("contact_ksp_max_it")


@pytest.mark.parallel
def test_aggregates_that_are_too_small_are_no_fault_of_the_body() -> None:
    """It was called free to move."""
    problem = mechanics.leaning_block(WORLD, 12)
    options = PETSc.Options()
    options["contact_pc_gamg_aggressive_coarsening"] = 0
    try:
        operator = operator_of(problem, "iterative")
        operator.update("secant", problem.start(), sticking(problem))
        with pytest.raises(InputError, match=r"\[multigrid\]"):
            operator.solve(problem.body.external(), 1e-6)
    finally:
        options.delValue("contact_pc_gamg_aggressive_coarsening")


def test_an_operator_is_freed_at_once() -> None:
    """It holds most of the memory, and ranks would collect a cycle at different times."""
    problem = mechanics.leaning_block(SELF, 4)
    operator = operator_of(problem, "iterative")
    operator.update("secant", problem.start(), sticking(problem))
    operator.solve(problem.body.external(), 1e-6)
    left = weakref.ref(operator)
    gc.disable()
    try:
        del operator
        assert left() is None
    finally:
        gc.enable()


@pytest.mark.core
@pytest.mark.parallel
def test_forces_that_contact_carries_do_not_blur_the_solution() -> None:
    """The tolerance is one on the solution, however large the contact forces on the right are."""
    problem = mechanics.leaning_block(WORLD, 4)
    body, x = problem.body, problem.start().x
    blocks, force = sliding(problem, MU)
    rhs = body.external()
    problem.nodes.add_jump_transposed(1e-3 * force, rhs)
    solutions = []
    for kind in ("lu", "iterative"):
        operator = operator_of(problem, kind, symmetric=False)
        operator.update("secant", BodyState(x), blocks)
        solutions.append(operator.solve(rhs, 1e-6))
    exact, found = solutions
    assert body.norm(found - exact) <= 1e-5 * body.norm(exact)


def test_a_tolerance_is_that_of_one_solve() -> None:
    """A solve to the solver's own tolerance was one to that of the solve before."""
    problem = mechanics.leaning_block(SELF, 4)
    operator, rhs = operator_of(problem, "iterative"), problem.body.external()
    operator.update("secant", problem.start(), sticking(problem))
    first = operator.solve(rhs)
    rough = operator.solve(rhs, 1e-2)
    assert np.abs(rough - first).max() > 1e-4 * np.abs(first).max()
    assert np.array_equal(operator.solve(rhs), first)


def test_without_contact_the_interpolation_is_that_of_the_body() -> None:
    problem = mechanics.leaning_block(SELF, 4)
    x, operator = problem.start().x, operator_of(problem, "iterative")
    nothing = 0 * sticking(problem)
    operator.update("secant", BodyState(x), nothing)
    pc = operator.ksp.getPC()
    finest = pc.getMGInterpolation(pc.getMGLevels() - 1).getISLocalMat()
    body = finest.getValuesCSR()[2].copy()
    nodes = problem.nodes.nodes
    rows = (nodes[:, None] * 3 + np.arange(3)).ravel()
    operator.update("secant", BodyState(x), sticking(problem))
    starts, _, values = finest.getValuesCSR()
    largest = np.maximum.reduceat(np.abs(values), starts[:-1])
    assert largest[rows].max() < 1e-3 < 0.1 < largest.max()
    operator.update("secant", BodyState(x), nothing)
    assert np.array_equal(finest.getValuesCSR()[2], body)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_contact_alone_may_hold_the_body(dim: int) -> None:
    """The body's operator is singular then, from which the interpolation is made."""
    problem = mechanics.pressed_block(WORLD, dim)
    method = Newton(problem, NewtonOptions(linear="iterative"))
    state, outcome = method.solve()
    assert outcome.converged
    assert np.allclose(state.multipliers.contact, 0.02, rtol=1e-6)


@pytest.mark.core
def test_fixed_unknowns_stay_exactly_where_they_are():
    """An iterative solver leaves them to its tolerance: a body that flew first kept 2e-5 of it."""
    problem = mechanics.leaning_block(MPI.COMM_SELF, 4)
    body = problem.body
    operator = body.operator(
        problem.nodes.nodes, symmetric=True, counters=Counters(), solver="iterative"
    )
    blocks = np.zeros((problem.nodes.nodes.size, 3, 3))
    operator.update("secant", BodyState(body.zero_displacement()), blocks)
    found = operator.solve(1e6 * body.external(), rtol=1e-2)
    assert np.abs(found).max() > 1.0
    assert np.all(found[~body.free.ravel()] == 0.0)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_a_factorisation_takes_the_workspace_it_needs(degree: int) -> None:
    """Where less is left to MUMPS than it has estimated, it is given more."""
    problem = mechanics.bar(WORLD, 16, degree=degree)
    kept, poor = operator_of(problem, "lu"), with_little_workspace(problem)
    sides = np.column_stack([problem.body.external(), np.ones(problem.body.owned)])
    for operator in (kept, poor):
        operator.update("secant", BodyState(problem.body.zero_displacement()), sticking(problem))
    known, found = (operator.solve_all(sides) for operator in (kept, poor))
    np.testing.assert_allclose(found, known, rtol=1e-9, atol=1e-12)
    assert poor.ksp.getPC().getFactorMatrix().getMumpsIcntl(14) > 0


@pytest.mark.parametrize("several", [True, False])
def test_a_failed_factorisation_solves_for_nothing(
    several: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Several right-hand sides are refused with the words of one; a new factorisation has room."""
    monkeypatch.setattr("contact.linear.petsc.MOST_WORKSPACE", 0)
    problem = mechanics.bar(SELF, 16)
    operator, kept = with_little_workspace(problem), operator_of(problem, "lu")
    state, side = BodyState(problem.body.zero_displacement()), problem.body.external()
    operator.update("secant", state, sticking(problem))
    with pytest.raises(InputError, match=r"\[memory\]"):
        if several:
            operator.solve_all(np.column_stack([side, side]))
        else:
            operator.solve(side)
    for made in (operator, kept):
        made.update("secant", state, sticking(problem))
    np.testing.assert_allclose(operator.solve(side), kept.solve(side), rtol=1e-9, atol=1e-12)


NODES, SIZE = 40, 2


class Bulk:
    """A positive definite matrix of 40 nodes, one of which is fixed."""

    def __init__(self):
        random = np.random.default_rng(3)
        half = random.standard_normal((NODES * SIZE, NODES * SIZE))
        self.stiffness = half @ half.T + np.eye(NODES * SIZE)
        self.free = np.ones((NODES, SIZE), dtype=bool)
        self.free[7] = False
        self.stiffness[14:16] = self.stiffness[:, 14:16] = 0.0
        self.stiffness[14:16, 14:16] = np.eye(2)

    def total(self, blocks):
        total = self.stiffness.copy()
        for node, block in enumerate(blocks):
            if self.free[node].all():
                total[2 * node : 2 * node + 2, 2 * node : 2 * node + 2] += block
        return total

    def operator(self):
        return DenseOperator(MPI.COMM_SELF, self.free, DenseStiffness(self.stiffness), Counters())


@pytest.mark.core
@pytest.mark.parametrize("kind", ["definite", "indefinite", "asymmetric"])
def test_solves_are_those_of_the_whole_matrix(kind):
    """By Cholesky or LU, with stiff blocks that come and go."""
    random, bulk = np.random.default_rng(5), Bulk()
    operator = bulk.operator()
    operator.update("secant", BodyState(np.zeros(0)), 1e4 * np.ones((NODES, SIZE, SIZE)))
    blocks = 1e4 * random.standard_normal((NODES, SIZE, SIZE)) ** 2
    if kind != "asymmetric":
        blocks = blocks @ blocks.transpose(0, 2, 1) * {"definite": 1e-4, "indefinite": -1e-4}[kind]
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    expected = np.linalg.solve(bulk.total(blocks), rhs)
    assert np.allclose(operator.solve(rhs), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_one_copy_of_the_matrix_is_made_where_blocks_act_at_all_unknowns():
    """There were two: the matrix without what is eliminated was a copy too."""
    stiffness = DenseStiffness(np.eye(1000))
    blocks = np.tile(np.eye(2), (500, 1, 1))
    tracemalloc.start()
    try:
        stiffness.factorise(blocks)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1.2 * stiffness.matrix.nbytes


def test_the_same_sum_is_factorised_once():
    """By all operators of one stiffness, each of which solves with its own blocks."""
    random, bulk = np.random.default_rng(6), Bulk()
    stiffness, state = DenseStiffness(bulk.stiffness), BodyState(np.zeros(0))
    given = [random.standard_normal((NODES, SIZE, SIZE)) ** 2 for _ in "ab"]
    first, second, again = (
        DenseOperator(MPI.COMM_SELF, bulk.free, stiffness, Counters()) for _ in "abc"
    )
    for operator, blocks in ((first, given[0]), (again, given[0].copy()), (second, given[1])):
        operator.update("secant", state, blocks)
    made = [operator.counters.factorizations for operator in (first, again, second)]
    assert made == [1, 0, 1]
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    for operator, blocks in ((again, given[0]), (second, given[1]), (first, given[0])):
        expected = np.linalg.solve(bulk.total(blocks), rhs)
        assert operator.solve(rhs) == pytest.approx(expected, abs=1e-10)


@pytest.mark.core
def test_blocks_that_alone_hold_a_node_are_taken_away():
    """The whole matrix is singular then: a solution without numbers, not an error."""
    bulk = Bulk()
    bulk.stiffness[20:22] = bulk.stiffness[:, 20:22] = 0.0
    blocks = np.zeros((NODES, SIZE, SIZE))
    blocks[10] = np.eye(SIZE)
    operator = bulk.operator()
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    operator.update("secant", BodyState(np.zeros(0)), np.zeros_like(blocks))
    assert not np.isfinite(operator.solve(np.ones(NODES * SIZE))).all()
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    assert np.allclose(operator.solve(np.ones(NODES * SIZE))[20:22], 1.0)
