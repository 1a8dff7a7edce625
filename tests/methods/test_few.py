"""Bodies that touch at a few nodes: found one by one, on columns of the body's flexibility."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, solve_problem
from contact.case.file import parse_case
from contact.linear.first_rank import with_questions
from contact.methods import few, newton
from contact.solving import solve
from tests.methods.test_sure import TIP, beam

SELF = MPI.COMM_SELF
FINE = [800, 8]


def solved(monkeypatch, case: dict, comm: MPI.Intracomm = SELF, road: bool = True):
    """Return a solution, with or without this road."""
    with monkeypatch.context() as patch:
        if not road:
            patch.setattr(newton, "at_few_nodes", lambda *_: None)
        parsed = parse_case(case)
        return solve_problem(build_problem(parsed, comm=comm), parsed.solver)


def notes(solution) -> set[str]:
    return {record.note for record in solution.history.records}


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_the_tip_of_a_fine_beam_takes_one_factorisation(monkeypatch, mu):
    """The interior point at its 801 contact nodes took 13 to 20 dense factorisations more."""
    case = beam(100.0, FINE, TIP, 0.5, mu)
    quick, sure = (solved(monkeypatch, case, road=road) for road in (True, False))
    assert quick.converged and sure.converged
    assert notes(quick) == {"", "few nodes"} and "interior point" in notes(sure)
    assert quick.counters.factorizations == 1
    assert quick.counters.linear_solves == 3  # without contact, a column a direction, refined
    assert quick.counters.contact_solves == 0
    assert np.count_nonzero(quick.status != "open") == 1
    size = np.abs(sure.contact_force).max()
    assert np.allclose(quick.contact_force, sure.contact_force, rtol=0, atol=1e-7 * size)
    along, down = np.abs(quick.contact_force)
    assert along <= mu * down * (1 + 1e-9)


def test_friction_may_press_a_second_node_down(monkeypatch):
    """Neighbours hardly differ in flexibility: Newton's loop settles how they share the force."""
    case = beam(100.0, FINE, TIP, 0.5, 0.3, space={"degree": 2})
    quick, sure = (solved(monkeypatch, case, road=road) for road in (True, False))
    assert quick.converged and sure.converged
    assert np.array_equal(quick.status, sure.status)
    assert np.count_nonzero(quick.status != "open") == 2
    size = np.abs(sure.contact_force).max()
    assert np.allclose(quick.contact_force, sure.contact_force, rtol=0, atol=1e-6 * size)


def test_the_middle_of_a_beam_clamped_at_both_ends(monkeypatch):
    """Three nodes join one after the other."""
    load = {"on": "top", "traction": [0.0, -9e-7]}
    case = beam(100.0, [200, 2], load, 0.5, 0.2)
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    quick, sure = (solved(monkeypatch, case, road=road) for road in (True, False))
    assert quick.converged and sure.converged
    assert quick.counters.contact_solves < 5 < sure.counters.contact_solves
    assert np.count_nonzero(quick.status != "open") == 3
    assert np.array_equal(quick.status, sure.status)
    size = np.abs(sure.contact_force).max()
    assert np.allclose(quick.contact_force, sure.contact_force, rtol=0, atol=1e-7 * size)


def test_more_than_a_few_nodes_are_left_to_others(monkeypatch):
    case = beam(100.0, [400, 4], {"on": "top", "traction": [0.0, -1e-5]}, 0.5)
    solution = solved(monkeypatch, case)
    assert solution.converged
    assert np.count_nonzero(solution.status != "open") > few.MOST
    assert notes(solution) == {"interior point"}


@pytest.mark.parallel
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("cells", [[200, 2], FINE], ids=["condensed", "whole"])
def test_it_is_the_same_on_many_ranks(monkeypatch, cells, mu):
    case = beam(100.0, cells, TIP, 0.5, mu)
    alone, together = (solved(monkeypatch, case, comm) for comm in (SELF, MPI.COMM_WORLD))
    assert together.converged
    assert alone.counters.contact_solves == together.counters.contact_solves
    size = np.abs(alone.contact_force).max()
    assert np.allclose(together.contact_force, alone.contact_force, rtol=0, atol=1e-9 * size)


@pytest.mark.parallel
def test_ranks_without_cells(monkeypatch):
    """Two triangles on any number of ranks."""
    load = {"on": "right", "traction": [0.0, -3e-6]}
    case = beam(100.0, [1, 1], load, 0.5, 0.3)
    alone, together = (solved(monkeypatch, case, comm) for comm in (SELF, MPI.COMM_WORLD))
    assert together.converged == alone.converged
    assert np.allclose(together.contact_force, alone.contact_force, rtol=1e-9, atol=0)


@pytest.mark.parallel
def test_what_a_question_raises_is_raised_on_all():
    comm = MPI.COMM_WORLD

    def answer(value: int) -> int:
        if value > 2:
            raise KeyboardInterrupt
        return comm.allreduce(value)

    def work(ask):
        return sum(ask(value) for value in (1, 2))

    assert with_questions(comm, work, answer) == 3 * comm.size
    with pytest.raises(KeyboardInterrupt):
        with_questions(comm, lambda ask: ask(3), answer)

    def of_one(value: int) -> int:
        if comm.rank == 0:
            raise ValueError("of the answer")
        return value

    with pytest.raises(ValueError, match="of the answer"):
        with_questions(comm, lambda ask: ask(1), of_one)

    def broken(ask):
        ask(1)
        raise ValueError("of the first rank")

    with pytest.raises(ValueError, match="first rank"):
        with_questions(comm, broken, answer)


def test_tresca_friction_acts_on_nodes_that_do_not_touch(monkeypatch):
    """The few are not alone there."""
    case = beam(100.0, [200, 2], TIP, 0.5) | {"friction": {"law": "tresca", "bound": 1e-5}}
    assert notes(solved(monkeypatch, case)) == {"interior point"}


def test_what_has_slipped_before_is_remembered(monkeypatch):
    """The tip is pressed down and rubbed to and fro, so that it slips both ways."""
    load = {"on": "right", "traction": ["1e-4*sin(3*t)", "-1e-4*t"]}
    steps = {"evolution": {"times": [0.0, 2.0], "steps": [8]}}
    case = parse_case(beam(100.0, [200, 2], load, 0.5, 0.3) | steps)
    quick = solve(case, comm=SELF)
    monkeypatch.setattr(newton, "at_few_nodes", lambda *_: None)
    sure = solve(case, comm=SELF)
    assert quick.converged and sure.converged
    for one, other in zip(quick.steps, sure.steps, strict=True):
        size = np.abs(other.state.forces.pressure).max()
        for name in ("pressure", "friction"):
            given, expected = (getattr(step.state.forces, name) for step in (one, other))
            assert np.allclose(given, expected, rtol=0, atol=1e-8 * size)
