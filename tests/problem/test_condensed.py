"""The body condensed onto the contact nodes: against the whole one, on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.history import BodyState
from contact.linear.operator import Counters, SparseOperator
from contact.linear.schur import SchurComplement
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.model.friction import Friction
from contact.problem import condensed
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.ranks import on_root
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems import mechanics

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF


def bar(comm: MPI.Intracomm, **options) -> ContactProblem:
    return mechanics.bar(comm, 8, friction=Friction(ConstantCoefficient(0.5)), **options)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("cells", [8, 1])
def test_condensing_and_expanding_solves_the_whole_system(cells):
    problem = mechanics.bar(WORLD, cells, law=Linear(1.0, 0.3))
    body, nodes = problem.body, problem.nodes.nodes
    operator = SparseOperator(body, nodes)
    size = body.block_size
    operator.update(
        "secant", BodyState(body.zero_displacement()), np.zeros((nodes.size, size, size))
    )
    whole = operator.solve(body.external())

    kept = (problem.nodes.nodes[:, None] * size + np.arange(size, dtype=np.int32)).ravel()
    schur = SchurComplement(operator.matrix, kept, "contact_")
    # The second time the analysis is used again.
    assert np.array_equal(schur.complement(operator.matrix), schur.complement(operator.matrix))
    stiffness = schur.complement(operator.matrix)
    assert stiffness.shape == (problem.nodes.size * size * (WORLD.rank == 0),) * 2
    assert np.allclose(stiffness, stiffness.T, rtol=0, atol=1e-13)
    rhs = body.layout.mask(body.external())
    forces = schur.condense(rhs, schur.interior(rhs))
    assert np.allclose(schur.condense(rhs), forces, rtol=0, atol=1e-13 * np.abs(forces).max())
    found = schur.expand(rhs, on_root(WORLD, lambda: np.linalg.solve(stiffness, forces)))
    largest = WORLD.allreduce(np.abs(whole).max(initial=0.0), op=MPI.MAX)
    assert np.allclose(found, whole, rtol=0, atol=1e-9 * largest)
    for times in (2.0, 4.0):
        operator.matrix.scale(2.0)
        again = schur.complement(operator.matrix)
        assert np.allclose(again, times * stiffness, rtol=0, atol=1e-12)
        assert np.allclose(schur.interior(times * rhs), schur.interior(times * rhs))


@pytest.mark.core
@pytest.mark.parametrize("few", [1, 5, 10])
def test_few_unknowns_are_eliminated_beside_many_that_are_kept(few):
    """MUMPS's own estimate of its workspace is too small there."""
    problem = mechanics.bar(SELF, 8, law=Linear(1.0, 0.3))
    matrix = problem.body.create_matrix()
    problem.body.assemble(matrix, "secant", BodyState(problem.body.zero_displacement()))
    order = np.random.default_rng(1).permutation(problem.body.owned).astype(np.int32)
    kept, eliminated = np.sort(order[few:]), np.sort(order[:few])
    found = SchurComplement(matrix, kept, "contact_").complement(matrix)
    dense = matrix[:, :]
    coupling = dense[np.ix_(eliminated, kept)]
    inside = dense[np.ix_(eliminated, eliminated)]
    expected = dense[np.ix_(kept, kept)] - coupling.T @ np.linalg.solve(inside, coupling)
    assert np.allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parallel
def test_the_first_rank_alone_holds_the_dense_matrix_and_factors():
    problem = bar(WORLD, law=Linear(1.0, 0.3))
    left = condensed.Condensation(problem, Counters()).linearise("secant", problem.start())
    assert left is not None
    body = left.body
    operator = left.operator(symmetric=False, counters=Counters(), solver="auto")
    blocks = np.tile(np.eye(body.block_size), (len(body.free), 1, 1))
    operator.update("secant", BodyState(body.x_0), blocks)
    assert (body.stiffness._solve is not None) == (WORLD.rank == 0)
    rhs = np.where(body.free.ravel(), 1.0, 0.0)
    found = np.concatenate(WORLD.allgather(operator.solve(rhs)))
    own = body.rows @ found + np.where(rhs > 0, found[body.local_rows], 0)
    assert np.allclose(own, rhs, rtol=0, atol=1e-9)
    assert body.stiffness.matrix.shape[0] == (found.size if WORLD.rank == 0 else 0)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(
    "made",
    [
        lambda comm: mechanics.leaning_block(comm, 4),
        lambda comm: mechanics.bar(comm, 1, -0.05, friction=Friction(ConstantCoefficient(0.5))),
    ],
    ids=["small block", "few cells"],
)
def test_a_small_mesh_is_condensed_on_any_number_of_ranks(made):
    """On three ranks one of them eliminates next to nothing."""
    found = []
    for comm in (WORLD, SELF):
        problem = made(comm)
        method = mechanics.newton(problem)
        force = problem.nodes.norm(method.state.multipliers.contact)
        found.append((force, method.counters.linear_solves))
    assert np.isclose(found[0][0], found[1][0], rtol=1e-9)
    assert found[0][1] == found[1][1]


@pytest.mark.core
@pytest.mark.parallel
def test_what_is_left_of_a_problem_has_the_same_residuals():
    """The trace of a state of equilibrium is one of the condensed problem, and no other."""
    problem = bar(WORLD, law=Linear(1.0, 0.3))
    state = mechanics.state_of(problem, 1e-10)
    condensation = condensed.Condensation(problem, Counters())
    left = condensation.linearise("secant", state)
    assert left is not None
    body = left.body
    assert evaluate(left, State(body.x_0, state.multipliers)).largest < 1e-10
    x = body.updated(body.x_0, 1e-3 * np.where(body.free.ravel(), body.x_0, 0.0))
    moved = evaluate(left, State(x, state.multipliers))
    whole = problem.body.updated(state.x, condensation.expand(left, x))
    found = evaluate(problem, State(whole, state.multipliers))
    assert np.isclose(moved.equilibrium, found.equilibrium, rtol=1e-3)
    assert moved.equilibrium > 1e-6


def test_a_condensed_body_is_no_body_that_has_lost_its_mesh():
    """Loads are as long as the unknowns; once, inherited ones were those of the whole body."""
    problem = bar(SELF, law=Linear(1.0, 0.3))
    left = condensed.Condensation(problem, Counters()).linearise("secant", problem.start())
    assert left is not None
    assert not hasattr(left.body, "__dict__") or "space" not in vars(left.body)
    for load in (0.0, 0.5, 1.0):
        assert left.body.external(load).shape == (left.body.owned,)
        state = State(
            left.body.prescribe(left.body.zero_displacement(), load),
            left.start().multipliers,
        )
        assert np.isfinite(evaluate(left, state).largest)


@pytest.mark.core
def test_slower_methods_work_at_the_contact_nodes_too():
    problem = bar(SELF, law=Linear(1.0, 0.3))
    reference, method = mechanics.newton(problem), mechanics.newton(problem, max_iterations=2)
    assert "interior point" in method.history[0].note
    assert np.allclose(
        method.state.multipliers.friction, reference.state.multipliers.friction, rtol=0, atol=1e-9
    )


def condenses(problem: ContactProblem, kind: str = "auto") -> bool:
    return condensed.condensable(problem, kind)


def test_where_the_body_is_condensed(monkeypatch):
    problem = bar(SELF)
    assert condenses(problem)
    assert condenses(problem, "lu")
    assert not condenses(problem, "iterative")
    monkeypatch.setattr(condensed, "LARGEST", 10)
    assert not condenses(problem)


@pytest.mark.parametrize(
    ("option", "value"), [("ksp_type", "gmres"), ("pc_factor_mat_solver_type", "petsc")]
)
def test_a_solver_of_the_users_takes_the_whole_body(option, value):
    problem, options = bar(SELF, law=Linear(1.0, 0.3)), PETSc.Options()
    options[f"contact_{option}"] = value
    try:
        assert not condenses(problem)
        mechanics.newton(problem)
    finally:
        options.delValue(f"contact_{option}")


def test_steps_run_out_where_the_body_is_condensed():
    method = Newton(bar(SELF), NewtonOptions(tolerance=1e-14, max_outer=1))
    # The second time none is left: what has been taken is told.
    for _ in range(2):
        _, outcome = method.solve()
        assert not outcome.converged
        assert outcome.ended == "not converged in 1 steps"


def test_a_body_that_cannot_be_condensed_is_solved_whole(monkeypatch):
    monkeypatch.setattr(condensed.Condensation, "linearise", lambda *_: None)
    assert mechanics.newton(bar(SELF)).counters.contact_solves == 0
