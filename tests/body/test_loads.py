"""Resultants, and loads without an amplitude: one meaning in Python and in the case file."""

import warnings

import numpy as np
import pytest
from mpi4py import MPI

import contact
from contact import Body, Contact, Fixed, InputError, Linear, Load, Problem, evolve, solve
from contact.case.build import build_problem
from contact.case.checks import growing
from contact.case.file import parse_case
from contact.mesh.domain import revolved
from contact.mesh.grid import box, rectangle
from contact.model.fields import Ramp
from tests.problems.bar import changed

pytestmark = pytest.mark.parallel(2)

DOWN = -0.03


def external(problem, time=1.0):
    """Return the resultant of the loads. Collective."""
    body = problem.body
    nodal = body.nodal(body.external(time))[:, : body.dim]
    return body.comm.allreduce(nodal.sum(axis=0), op=MPI.SUM)


def block(load, dim=2, law=None, domain=None):
    size, count = (2.0, 1.0, 1.5)[:dim], (4, 2, 3)[:dim]
    make = rectangle if dim == 2 else box
    domain = make(MPI.COMM_WORLD, (0.0,) * dim, size, count) if domain is None else domain
    body = Body(Linear(10.0, 0.3), Fixed("left", [0.0] * dim), load)
    return Problem(domain, body, Contact("bottom"))


def resultant(*force, **more):
    return Load("top", force=force, **more)


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_a_force_is_the_resultant_and_a_traction_is_per_area(dim):
    force, area = [0.01, *[0.0] * (dim - 2), DOWN], {2: 2.0, 3: 2.0}[dim]
    found, known = block(resultant(*force), dim), block(Load("top", traction=force), dim)
    assert external(found) == pytest.approx(force, rel=1e-12)
    assert external(known) == pytest.approx(area * np.array(force), rel=1e-12)
    # Evenly: the traction of that resultant, on the same mesh, which ranks may share otherwise.
    evenly = Load("top", traction=[f / area for f in force])
    even = block(evenly, dim, domain=found.domain)
    loads = (p.body.external(1.0) for p in (found, even))
    assert np.allclose(*loads, rtol=0, atol=1e-15)


def case(**keys):
    return changed(load=[{"on": "loaded", **keys}])


def test_the_case_file_says_the_same_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        problem = build_problem(parse_case(case(force=[0.0, DOWN])))
    assert external(problem) == pytest.approx([0.0, DOWN])
    both = build_problem(parse_case(case(force=[0.0, DOWN], traction=[0.0, DOWN])))
    assert external(both) == pytest.approx([0.0, 3 * DOWN])
    solution = solve(parse_case(case(force=[0.0, DOWN], on=["loaded", "right"])))
    balance = solution.reaction("left")[1] - solution.contact_force[1]
    assert balance == pytest.approx(-DOWN, rel=1e-8)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"force": ["-x", 0.0]}, r"load\.0\.force\.0.*\[formula-variable\]"),
        ({"force": [0.0, 0.0, 1.0]}, r"\[components\]"),
        ({"resultant": [0.0, 1.0]}, r"\[unknown-key\]"),
    ],
)
def test_other_resultants_are_refused(keys, words):
    with pytest.raises(InputError, match=words):
        build_problem(parse_case(case(**keys)))


def test_a_resultant_in_the_whole_body_is_refused():
    with pytest.raises(
        InputError,
        match=r"load.0.force.*\[exclusive-keys\]",
    ):
        parse_case(changed(load=[{"everywhere": True, "force": [0.0, 1.0]}]))


@pytest.mark.core
def test_of_a_body_of_revolution_it_is_that_of_the_full_turn():
    domain = revolved(rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2)))

    def made(*force):
        body = Body(Linear(10.0, 0.3), Fixed("bottom", ["free", 0.0]), resultant(*force))
        return Problem(domain, body, Contact("right", 0.1))

    assert external(made(0.0, DOWN))[1] == pytest.approx(DOWN, rel=1e-12)
    with pytest.raises(InputError, match=r"load\.0\.force\.0.*\[value\]"):
        made(0.1, DOWN)


@pytest.mark.core
def test_a_ramp_grows_over_its_stage_and_stays():
    assert [Ramp()(t) for t in (0.0, 0.25, 1.0, 3.0)] == [0.0, 0.25, 1.0, 1.0]
    assert [Ramp(2.0, 4.0)(t) for t in (2.0, 3.0, 5.0)] == [0.0, 0.5, 1.0]


@pytest.mark.core
def test_loads_without_an_amplitude_follow_one_rule_in_python_and_in_a_case():
    """Those of a case acted from the first step on, those of Python grew on after time 1."""
    steps = {"times": [0.0, 1.0, 2.0], "steps": [2, 1]}
    data = changed(load__0__traction=[0.0, DOWN], evolution=steps)
    problem = build_problem(parse_case(data))
    python = block(Load("top", traction=[0.0, DOWN]))
    for time, share in ((0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (2.0, 1.0)):
        for given in (problem, python):
            assert external(given, time)[1] == pytest.approx(2 * share * DOWN, abs=1e-15)
    states = [state.x for state in evolve(problem, [0.5, 1.0, 2.0])]
    last = python.comm.allreduce(float(np.abs(states[2] - states[1]).max()), op=MPI.MAX)
    assert last < 1e-8


def test_the_first_stage_of_a_case_may_begin_and_end_anywhere():
    steps = {"times": [-1.0, 3.0, 4.0], "steps": [2, 1]}
    problem = build_problem(parse_case(changed(evolution=steps)))
    full = external(problem, 4.0)[1]
    assert external(problem, 1.0)[1] == pytest.approx(full / 2)


def test_a_constant_amplitude_acts_from_the_first_step_on():
    steps = {"times": [0.0, 1.0], "steps": [2]}
    data = changed(evolution=steps, load__0__amplitude="constant")
    case = parse_case(data)
    problem, python = build_problem(case), block(Load("top", [0.0, DOWN], amplitude="constant"))
    assert external(problem, 0.1) == pytest.approx(external(problem, 1.0))
    assert external(python, 0.1) == pytest.approx(external(python, 1.0))
    assert growing(case) == []
    own = {**steps, "amplitudes": {"constant": {"time": [0.0, 1.0], "value": [0.0, 2.0]}}}
    named = build_problem(parse_case({**data, "evolution": own}))
    assert external(named, 0.5) == pytest.approx(external(problem, 1.0))


def test_formulas_in_t_are_taken_as_they_are():
    steps = {"times": [0.0, 2.0], "steps": [2]}
    data = changed(load__0__traction=[0.0, "-0.01*t**2"], evolution=steps)
    problem = build_problem(parse_case(data))
    assert external(problem, 2.0)[1] == pytest.approx(4 * external(problem, 1.0)[1])
    data = case(force=[0.0, "-0.01*t**2"]) | {"evolution": steps}
    problem = build_problem(parse_case(data))
    assert external(problem, 2.0)[1] == pytest.approx(-0.04)


def test_supports_at_zero_drive_nothing():
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    body = Body(Linear(10.0, 0.3), Fixed("left", [0.0, 0.0]), Load("right", [0.0, DOWN]))
    solution = contact.solve_steps(Problem(domain, body, Contact("bottom", 1.0)), [0.5, 1.0])
    moved = [step.row["driven_force_y"] for step in solution.steps]
    assert moved == pytest.approx([DOWN / 2, DOWN])


@pytest.mark.parallel(2)
@pytest.mark.parametrize("by", ["load", "support"])
def test_the_force_that_drives_a_part_is_without_supports_beside_it(by):
    """They share the node of a corner."""
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    fixed = [Fixed("left", [0.0, 0.0] if by == "load" else [0.0, "free"])]
    fixed += [Fixed("top", ["free", DOWN])] if by == "support" else []
    loads = [Load("top", [0.0, DOWN])] if by == "load" else []
    loads += [Load(density=[0.0, 0.3 * DOWN]), Load("right", [DOWN, DOWN])]
    problem = Problem(domain, Body(Linear(10.0, 0.3), fixed, loads), Contact("bottom"))
    solution = contact.solve_steps(problem, [0.5, 1.0])
    assert abs(solution.reaction("left")[0]) > 1e-3
    for step in solution.steps:
        force = step.row["driven_force_x"], step.row["driven_force_y"]
        known = (0.0, step.row["reaction_y_top"] if by == "support" else 2 * DOWN * step.state.time)
        assert force == pytest.approx(known, abs=1e-14)
