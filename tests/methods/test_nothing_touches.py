"""Problems whose solution touches nothing are found with the first solve.

Evolutions whose loads change so that contact alone no longer constrains a body.
What is unloaded to next to nothing, or to nothing.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact import Problem, build_problem, evolve, solve
from contact.case.file import parse_case
from contact.mesh.geometry import geometry_nodes
from contact.mesh.grid import rectangle
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.methods.report import Outcome
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.material import Material
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.solving import NotConvergedError, solve_steps
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.blocks import squares
from tests.problems.mechanics import constant, flat
from tests.problems.overlapping import POISSON, UNIAXIAL, YOUNG, body, layers
from tests.problems.shaken import steps_of, tabulated

COMM, SELF = MPI.COMM_WORLD, MPI.COMM_SELF

APPROACH = {
    "mesh": {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.3},
    "material": [
        {"on": "upper", "young": 1.0, "poisson": 0.3},
        {"on": "lower", "young": 3.0, "poisson": 0.3},
    ],
    "fixed": [
        {"on": "lower_bottom", "displacement": [0.0, 0.0]},
        {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*t"]},
    ],
    "contact": {"on": "upper_bottom", "against": "lower_top", "gap": 0.02},
    "friction": {"law": "coulomb", "mu": 0.3},
    "evolution": {"times": [0.0, 1.0], "steps": [10]},
}


def stepped(
    problem: ContactProblem, times: Sequence[float], **options: Any
) -> list[tuple[State, Outcome]]:
    """Return the load steps of a problem by Newton's method; all have converged."""
    method = METHODS["newton"](problem, NewtonOptions(**options), None)
    steps = list(LoadStepping(problem, method).steps(times))
    assert all(outcome.converged for _, outcome in steps)
    return steps


#: Ends of ten equal steps, and of six of an evolution that ends at 1.8.
TENTHS, SIXTHS = [k / 10 for k in range(1, 11)], [0.3, 0.6, 0.9, 1.2, 1.5, 1.8]


def test_an_approach_of_two_blocks():
    """It took 2884 solves and 990 factorisations: rounding of one block was compared with none."""
    problem = build_problem(parse_case(APPROACH), SELF)
    steps = stepped(problem, TENTHS)
    assert steps[-1][1].reason == "all residuals <= 1e-08"
    top = problem.body.nodal(steps[-1][0].x)[:, 1].min()
    assert np.isclose(top, -0.001)


def above_a_ball(aside: float | str) -> dict[str, Any]:
    """Return a block that goes down towards a rigid ball, and does not reach it."""
    ball = {"shape": "sphere", "centre": [1.0, -2.05], "radius": 2.0}
    return {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [12, 6]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [aside, "-0.01*t"]}],
        "contact": {"on": "bottom", "foundation": ball},
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {"times": [0.0, 1.0], "steps": [5]},
    }


@pytest.mark.parametrize("aside", ["0.003*t", "free"])
def test_an_approach_to_a_rigid_shape(aside):
    """Five steps took 346 dense solves, and ended with a reason of a failure."""
    solution = solve(parse_case(above_a_ball(aside)), comm=SELF)
    assert solution.converged and solution.pressure.max() == 0
    assert solution.outcome.reason == "all residuals <= 1e-08"


#: Two blocks are pressed, pushed aside and pulled apart.
LIFTED = {
    **APPROACH,
    "fixed": [
        APPROACH["fixed"][0],
        {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*sin(pi*t)"]},
    ],
    "contact": {"on": "upper_bottom", "against": "lower_top"},
    "evolution": {"times": [0.0, 1.8], "steps": [6]},
}


def test_an_evolution_that_lifts_off():
    """It took 300 solves a step."""
    steps = stepped(build_problem(parse_case(LIFTED), SELF), SIXTHS)
    presses = [bool(state.multipliers.contact.max() > 0) for state, _ in steps]
    assert presses == 3 * [True] + 3 * [False]


def unloaded(loads: str) -> dict[str, Any]:
    """Return blocks that are pressed, and pushed aside, by parabolas in time that end at zero."""
    push = {"on": "upper_top", "displacement": ["0.0003*t*(1 - t)", "-0.001*t*(1 - t)"]}
    if loads == "traction":
        push["displacement"] = [0.0, "free"]
    return {
        **APPROACH,
        "fixed": [APPROACH["fixed"][0], push],
        "load": [{"on": "upper_top", "traction": [0.0, "-0.001*t*(1 - t)"]}]
        * (loads != "supports"),
        "contact": {"on": "upper_bottom", "against": "lower_top"},
    }


@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("loads", ["supports", "traction"])
def test_two_blocks_unloaded_to_zero_end_at_zero(loads, condense):
    """The last step took up to 1655 dense solves: forces fell to 1e-164, by their rounding."""
    problem = build_problem(parse_case(unloaded(loads)), SELF)
    *pressed, (end, _) = stepped(problem, TENTHS, condense=condense)
    assert all(state.multipliers.contact.max() > 0 for state, _ in pressed)
    assert not end.x.any() and not end.multipliers.contact.any()


def leaves_let_go() -> list[tuple[State, Outcome]]:
    """Return the steps of leaves on each other that are pressed at their ends, and let go."""
    count = 4
    leaves = squares(SELF, [(0, k) for k in range(count)], (8, 7, 9, 10))
    leaves.mesh.geometry.x[:] *= (3.0, 0.25, 1.0)
    case = {
        "mesh": {"generator": "two_blocks"},  # replaced by the leaves
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": f"left{k}", "displacement": [0.0, 0.0]} for k in range(count)],
        "load": [{"on": f"right{count - 1}", "traction": [0.0, -1e-4], "amplitude": "a"}],
        "contact": [{"on": f"bottom{k + 1}", "against": f"top{k}"} for k in range(count - 1)],
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {
            "times": [0.0, 1.0, 2.0],
            "steps": [1, 1],
            "amplitudes": {"a": {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}},
        },
    }
    return stepped(build_problem(parse_case(case), SELF, domain=leaves), [1.0, 2.0])


def test_leaves_whose_loads_vanish_go_back_to_zero():
    """Their pressures ended at 1e-12 of those before, as rounding, and cycled: 300 dense solves."""
    (pressed, _), (gone, _) = leaves_let_go()
    assert pressed.multipliers.contact.max() > 0
    assert gone.multipliers.contact.max() == 0
    assert np.abs(gone.x).max() == 0


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


AT_EASE = {"newton": NewtonOptions(tolerance=1e-8), "uzawa": FixedPointOptions(tolerance=1e-8)}


@pytest.mark.parametrize("left", [1e-8, 1e-16, 0.0])
def test_what_is_unloaded_to_next_to_nothing_is_as_accurate(left):
    """Beside slips of the whole load the relaxation lost what it looked for."""
    amplitude = tabulated((0.0, 1.0, 2.0), (0.0, 1.0, left))
    loads = [
        Load("top", [constant(0.0, 2), constant(-0.01, 2)], amplitude=amplitude),
        Load("right", [constant(0.002, 2), constant(0.0, 2)], amplitude=amplitude),
    ]
    problem = ContactProblem(
        rectangle(SELF, [0.0, 0.0], [2.0, 1.0], [8, 4]),
        Body(Linear(1.0, 0.3), [Fixed("left", [constant(0.0, 2)] * 2)], loads),
        Contact("bottom"),
        Friction(mu=0.3),
    )
    loaded = steps_of(problem, [0.5, 1.0, 1.5])[-1]
    newton, uzawa = (steps_of(problem, [2.0], told, loaded) for told in AT_EASE.values())
    assert len(newton) == len(uzawa) == 1  # none was halved
    one, two = newton[0], uzawa[0]
    size = 0.02 * left + 1e-100
    assert np.abs(one.x - two.x).max() < 1e-6 * size
    assert np.abs(one.multipliers.friction - two.multipliers.friction).max() < 1e-6 * size
    assert 0.5 * left <= np.abs(one.multipliers.contact).max() / 0.01 < 100 * size


def test_a_penalised_body_that_is_unloaded_to_nothing_rests():
    """The last step was halved again and again, and the evolution ended before."""
    amplitude = tabulated((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
    pressed = Fixed("top", [constant(0.001, 2), constant(-0.002, 2)], amplitude=amplitude)
    problem = ContactProblem(
        rectangle(SELF, [0.0, 0.0], [1.0, 1.0], [4, 4]),
        Body(Linear(10.0, 0.3), [pressed]),
        Contact("bottom"),
        Friction(mu=0.3),
    )
    steps = steps_of(problem, [1.0, 2.0], PenaltyOptions())
    assert [state.time for state in steps] == [1.0, 2.0]
    assert np.abs(steps[0].x).max() > 1e-3
    assert np.abs(steps[-1].x).max() == 0


@pytest.mark.parallel
@pytest.mark.parametrize("ratio", [1e-5, 1e-8])
@pytest.mark.parametrize("on", ["outer0", "inner1"])
def test_soft_bodies_have_a_scale_of_their_own(on, ratio):
    """Their forces were rounding beside those of a stiff body that moves: nothing touched."""
    gap, push = 1e-3, 5e-3
    domain = layers(COMM, "quadrilateral", 1, "flat", -gap, counts=(12, 16))
    places = geometry_nodes(domain).mean(axis=1)[:, 0]
    soft = places[: domain.mesh.topology.index_map(2).size_local] < 1.5
    regions = {"soft": np.flatnonzero(soft), "hard": np.flatnonzero(~soft)}
    domain = replace(domain, regions={k: v.astype(np.int32) for k, v in regions.items()})
    laws = {"soft": Linear(ratio * YOUNG, POISSON), "hard": Linear(YOUNG, POISSON)}
    materials = [Material(law, on=name) for name, law in laws.items()]
    supports = [*body("flat", 2, 2).fixed[:-1], Fixed("outer1", [-push, None])]
    against = {"outer0": "inner1", "inner1": "outer0"}[on]
    problem = Problem(domain, Body(materials, supports), Contact(on, against=against))
    for options in (NewtonOptions(tolerance=100 * ratio), FixedPointOptions()):
        solution = solve(problem, options)
        assert solution.converged
        exact = UNIAXIAL * (push - gap) / 0.5 / (1 + 1 / ratio)
        np.testing.assert_allclose(solution.pressure, exact, rtol=max(1e-5, 100 * ratio))
