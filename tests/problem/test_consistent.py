"""What is put together in Python is refused as a case is, in one message that names the place."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from contact import (
    Body,
    Cone,
    Contact,
    Cylinder,
    Elastic,
    Electrode,
    Fixed,
    Friction,
    Layer,
    Level,
    Linear,
    Load,
    Material,
    Motion,
    Plane,
    Problem,
    Punch,
    Rigid,
    Solution,
    Sphere,
    UserLaw,
    evolve,
    make_material,
    parse_case,
    solve,
    solve_steps,
)
from contact.case.build import build_problem
from contact.errors import InputError
from contact.problem.checks import meeting_supports
from tests.problems.bar import changed
from tests.problems.messages import message_of
from tests.problems.put_together import LAW, TOP, block, problem


def hole(x: Any) -> Any:
    """Return 1e-3, and no number on the right."""
    return np.where(x[0] > 1.5, np.nan, 1e-3)


class Growing:
    """A value that grows with the time."""

    def at(self, time: float) -> float:
        return time


def on(*shape: Any, **more: Any) -> Callable[[], Problem]:
    return lambda: problem(contact=Contact("bottom", *shape, **more))


def solved(*fixed: Any, **more: Any) -> Callable[[], object]:
    return lambda: solve(problem(*fixed, **more))


WRONG = {
    "two supports": solved(TOP, Fixed("top", [0.0, -0.001])),
    "two supports on a list": solved(TOP, Fixed(["left", "top"], [lambda x: 0.1 * x[1], None])),
    "two supports in steps": lambda: next(
        evolve(problem(TOP, Fixed("top", [0, -0.005], amplitude=lambda t: t**2)), [0.5])
    ),
    "two supports on the way": lambda: next(
        evolve(problem(TOP, Fixed("top", [0, -0.005], amplitude=lambda t: t**2)), [0.5, 1])
    ),
    "a traction without a value": solved(loads=Load("right", traction=[0, hole])),
    "a body force without a value": solved(
        loads=[Load("right", [0, 1e-3]), Load(body_force=[hole, 0])]
    ),
    "a displacement without a value": solved(Fixed("left", [0, 0]), Fixed("top", [None, hole])),
    "a support without an amplitude": solved(Fixed("top", [0, -0.005], amplitude=lambda t: np.nan)),
    "a load without an amplitude": solved(
        loads=Load("right", [0, 1e-3], amplitude=lambda t: np.inf)
    ),
    "a law without a value": solved(
        Fixed("top", [0, -0.05]), law=UserLaw(10.0, 0.3, modulus=lambda t: (1e-3 - t) ** 0.5)
    ),
    "a load on the contact part": solved(loads=Load(["right", "bottom"], [0, 1e-3])),
    "a load in free directions": lambda: Load("right", ["free", 1.0]),
    "a load of nothing": lambda: Load("right"),
    "a pressure in the body": lambda: Load(pressure=1.0),
    "a traction in the body": lambda: Load(traction=[0, 1]),
    "a body force on a part": lambda: Load("top", body_force=[0, 1]),
    "two names for a force": lambda: Load("top", [0, 1], traction=[0, 1]),
    "a resultant in the body": lambda: Load(force=[0, 1]),
    "a resultant by place": lambda: Load("top", force=[0, lambda x: x[0]]),
    "a gap of time": lambda: Contact("bottom", Growing()),
    "a spring of time": lambda: Elastic("top", [0.0, Growing()]),
    "a spring of time along the normal": lambda: Elastic("top", normal=Growing()),
    "a support of nothing": lambda: Fixed("top", ["free", None]),
    "an amplitude": lambda: Fixed("top", [0, 0], amplitude=2),
    "a motion as a number": lambda: Motion(0.1),
    "a motion in words": lambda: Motion([0.0, "up"]),
    "an angle in a list": lambda: Motion([0.0, None], [0.1, 0.0, 0.0]),
    "a free force": lambda: Motion([0.0, None], force=[0.0, None]),
    "a force in vain": lambda: Motion([0.0, 0.0], force=[0.0, -3.0]),
    "no centre": lambda: Motion([0.0, None], 0.1),
    "a moving centre": lambda: Motion([0.0, None], 0.1, centre=[0.0, None]),
    "a rigid part in space": lambda: problem(rigid=Rigid("right", Motion([0.0, 0.0, 0.0]))),
    "a gap that is endless": on(-np.inf),
    "a gap and a shape": on(Plane((0, 0), (0, 1)), gap=0.1),
    "a point in space": on(Plane((0, 0, 0), (0, 1))),
    "a normal in space": on(Plane((0, 0), (0, 0, 1))),
    "a centre in space": on(Sphere((0, 0, -5), 5.0)),
    "an axis in space": on(Cylinder((0, -5), (0, 0, 1), 5.0)),
    "no normal": lambda: Plane((0, 0), (0, 0)),
    "no direction": on(Plane((0, 0), (0, 1), direction="axis")),
    "a direction": lambda: Plane((0, 0), (0, 1), direction="up"),
    "a radius": lambda: Sphere((0, 0), "1"),  # type: ignore[arg-type]
    "an angle": lambda: Cone((0, 0), (0, 1), 90.0),
    "an angle in words": lambda: Cone((0, 0), (0, 1), "a"),  # type: ignore[arg-type]
    "an edge in words": lambda: Punch((0, 0), (0, 1), 1.0, "a"),
    "an edge": lambda: Punch((0, 0), (0, 1), 1.0, 2.0),
    "a distance": on(Level(lambda x: x[1])),
    "a layer": on(layer="thick"),
    "half a layer": on(layer=lambda: Layer(0.1)),
    "friction": on(friction=0.3),
    "a law of friction": lambda: Friction(law=3),  # type: ignore[arg-type]
    "a conductor": on(conductor=3),
    "press": on(press="press"),
    "no contact": lambda: problem(contact=[]),
    "a law": lambda: Body(3, TOP),  # type: ignore[arg-type]
    "no compressible law": lambda: Problem(
        block(), Body(Linear(10.0, 0.5), TOP), Contact("bottom")
    ),
    "a law among materials": lambda: Body([Material(LAW), LAW], TOP),
    "no material": lambda: Body([], TOP),
    "regions": lambda: Material(LAW, on=3),
    "a crystal": lambda: make_material(2, young=1.0, poisson=0.3, piezo={"e31": 1.0}),
    "a load as support": lambda: Body(LAW, [Load("top", [0, 1])]),  # type: ignore[list-item]
    "an electrode": lambda: problem(electrodes=Electrode("left")),
    "a mesh": lambda: Problem(block().mesh, Body(LAW, TOP), Contact("bottom")),
    "a start": lambda: solve(problem(), start=3),  # type: ignore[arg-type]
    "no problem": lambda: solve(block()),  # type: ignore[arg-type]
    "a method": lambda: solve(problem(), method="uzawa"),
    "nan as support": lambda: solve(
        Problem(block(), Body(LAW, Fixed("top", [np.nan, 0.0])), Contact("bottom"))
    ),
    "a law in a list": lambda: Body([LAW], TOP),
    "a replacement": lambda: solve(problem(), domian=3),
    "a monitor": lambda: solve(problem(), monitor=3),  # type: ignore[arg-type]
    "times": lambda: next(evolve(problem(), 1.0)),  # type: ignore[arg-type]
    "times none": lambda: solve_steps(problem(), []),
    "times in words": lambda: solve_steps(problem(), ["a"]),
    "times in rows": lambda: solve_steps(problem(), np.ones((2, 2))),
    "an angle in space": lambda: make_material(3, name="PZT-4", poling=90),
    "an axis in the plane": lambda: make_material(
        2, name="PZT-4", poling=np.array([0.0, 0.0, 1.0])
    ),
    "no times": lambda: solve_steps(problem(), [0.5, 0.5]),
    "times of a case": lambda: solve(parse_case(CASE), times=[1.0]),
}


@pytest.mark.wording
@pytest.mark.parallel(2)
def test_messages_of_wrong_descriptions(
    snapshot: Callable[[str, dict[str, str]], None],
) -> None:
    snapshot("wrong-descriptions", {name: message_of(make) for name, make in WRONG.items()})


CASE = {
    "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]},
    "material": {"young": 10.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0, -0.005]}],
    "contact": {"on": "bottom"},
}


@pytest.mark.parallel(2)
def test_what_agrees_is_accepted() -> None:
    plain = solve(problem())
    # The same value by another formula; parts that meet at a corner alone.
    again = problem(
        TOP,
        Fixed("top", [lambda x: 0.0 * x[0], lambda x: -0.005 + 0.0 * x[0]]),
        Fixed("right", [None, lambda x: -0.005 * x[1]]),
        # 0 at the ends but for rounding
        Fixed("left", [lambda x: 1e-3 * np.sin(np.pi * x[1]), None]),
        Fixed("left", [lambda x: 1e-3 * np.sin(np.pi * (1 - x[1])), None]),
    )
    assert solve(again).converged
    start = solve(problem(), start=plain)
    assert start.contact_force == pytest.approx(plain.contact_force)


def test_a_solution_at_a_step_is_a_start_and_has_figures():
    solution = solve(problem())
    step = solution.at_step(solution.state)
    assert type(step) is Solution
    assert solve(problem(), start=step).converged


def test_a_half_plane_is_no_mesh_of_a_plane_case():
    """The domain of a solution of revolution was solved as that, whatever the case said."""
    turned = changed(fixed__0__displacement=[0.0, "free"], space__kinematics="axisymmetric")
    domain = build_problem(parse_case(turned)).domain
    with pytest.raises(InputError, match=r"domain: given a body of revolution.*\[axisymmetric\]"):
        build_problem(parse_case(changed()), domain=domain)
    assert build_problem(parse_case(turned), domain=domain).domain.revolved


@pytest.mark.parametrize("given", ["start", "before", "kept"])
def test_a_state_of_another_problem_is_no_start(given):
    """It ended in an error of NumPy, or evolve and solve_steps went on with it."""
    other = parse_case(changed(mesh__cells=[4, 2], evolution={"times": [0.0, 1.0], "steps": [2]}))
    run = solve(other)
    with pytest.raises(InputError, match=rf"{given}: given a state of another problem.*\[start\]"):
        if given == "kept":
            solve_steps(problem(), [1.0, 2.0], kept=run.steps)
        else:
            own = next(evolve(problem(), [0.5]))
            states = {"start": own, "before": own} | {given: run.state}
            next(evolve(problem(), [2.0], **states))


@pytest.mark.parallel(2)
def test_supports_that_meet_with_different_values_are_warned_of() -> None:
    left, moving = Fixed("left", [0, 0]), Fixed("left", [None, -0.005], amplitude=lambda t: t**2)
    pzt = make_material(2, name="PZT-4")
    electrodes = [Fixed("top", [0, -0.005], potential=0.0), Fixed("left", potential=1.0)]
    for given, law, times, words in (
        ((left, TOP), LAW, [1.0], r"\.1 is 0 of the first and -0\.005 of the second: "),
        ((TOP, left), LAW, [1.0], r"\.1 is -0\.005 of the first and 0 of the second: "),
        ((TOP, moving), LAW, [0.5, 1.0], r"-0\.0025 of .* -0\.00125 of the second at t = 0\.5:"),
        (electrodes, pzt, [1.0], r"meet at \(0, 1\), where potential is 0 of the first and 1"),
    ):
        (said,) = meeting_supports(problem(*given, law=law), times)
        assert re.search(words, said), said
    assert not [*meeting_supports(problem(TOP, moving), [1.0])]
    again = Fixed("right", [lambda x: 0.0 * x[0], lambda x: -0.005 * x[1]])
    assert not [*meeting_supports(problem(TOP, again), [0.5, 1.0])]
    (said,) = (text for text in solve(problem(TOP, left)).warnings if "meet" in text)
    assert said.startswith("fixed.0 and fixed.1: top and left meet at (0, 1), where")
