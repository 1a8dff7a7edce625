"""Evolutions whose loads change so that contact alone no longer constrains a body."""

import pytest
from mpi4py import MPI

from contact import evolve
from contact.body.description import Body
from contact.mesh.grid import rectangle
from contact.methods.load_stepping import LoadStepping
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.model.body import Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.solving import NotConvergedError, solve_steps
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import constant, flat
from tests.problems.shaken import tabulated

TIMES = [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]

#: Amplitudes of press and push; when they let go, and why.
GONE = {
    "pulled": ((1.0, -0.2), (0.0, 0.0), 1 + 1 / 1.2, "pull the body off"),
    "pushed": ((1.0, 1.0), (0.0, 0.8), 1.75, "along it by more than friction holds"),
}


def lying(comm, press, push) -> ContactProblem:
    """Return a block 2 x 1 that friction alone holds, pressed by 0.02 and pushed by 0.01.

    The amplitudes are those at the times 1 and 2; in between they are linear, and at 3 they are
    what they were at 1.
    """

    def amplitude(values):
        return tabulated((0.0, 1.0, 2.0, 3.0), (0.0, values[0], values[1], values[0]))

    loads = (
        Load("top", [constant(0.0, 2), constant(-0.01, 2)], amplitude=amplitude(press)),
        Load("left", [constant(0.01, 2), constant(0.0, 2)], amplitude=amplitude(push)),
    )
    return ContactProblem(
        rectangle(comm, [0.0, 0.0], [2.0, 1.0], [8, 4]),
        Body(Linear(1.0, 0.3), [], loads),
        Contact("bottom", flat()),
        Friction(ConstantCoefficient(0.3)),
    )


@pytest.mark.parametrize(("press", "push", "when", "why"), GONE.values(), ids=GONE)
def test_an_evolution_ends_where_loads_let_the_body_go(press, push, when, why):
    """Steps that end beyond are not tried; the last one before is as near as halves come."""
    problem = lying(MPI.COMM_SELF, press, push)
    method = Newton(problem, NewtonOptions())
    *complete, (_, last) = LoadStepping(problem, method).steps(TIMES)
    assert [state.time for state, _ in complete[:3]] == [0.5, 1.0, 1.5]
    assert all(outcome.converged for _, outcome in complete)
    assert when - 0.5 / 16 <= complete[-1][0].time <= when * (1 + 1e-6)
    assert not last.converged
    assert last.counters.linear_solves == 0
    assert f"from t = {when:g} on the loads" in last.reason
    assert why in last.reason


def test_what_was_complete_remains():
    press, push, when, _ = GONE["pulled"]
    problem = lying(MPI.COMM_SELF, press, push)
    solution = solve_steps(problem, TIMES)
    assert not solution.converged
    assert 1.5 < solution.steps[-1].row["t"] < when
    assert solution.state.time == solution.steps[-1].row["t"]
    found: list[State] = []
    with pytest.raises(NotConvergedError, match=f"from t = {when:g} on the loads pull the body"):
        for state in evolve(problem, TIMES):
            found.append(state)
    assert [state.time for state in found] == [step.row["t"] for step in solution.steps]
