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
    InputError,
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
    Sphere,
    UserLaw,
    build_problem,
    evolve,
    make_material,
    parse_case,
    solve,
)
from contact.problem.checks import meeting_supports
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
    "two supports": (
        solved(TOP, Fixed("top", [0.0, -0.001])),
        r"fixed\.1\.displacement\.1: -0\.001 on top; accepted: -0\.005, as fixed\.0 has there",
    ),
    "two supports on a list": (
        solved(TOP, Fixed(["left", "top"], [lambda x: 0.1 * x[1], None])),
        r"fixed\.1\.displacement\.0: 0\.1 on left\+top; accepted: 0",
    ),
    "two supports in steps": (
        lambda: next(
            evolve(problem(TOP, Fixed("top", [0, -0.005], amplitude=lambda t: t**2)), [0.5])
        ),
        r"fixed\.1\.displacement\.1: -0\.00125 on top; accepted: -0\.0025",
    ),
    "two supports on the way": (
        lambda: next(
            evolve(problem(TOP, Fixed("top", [0, -0.005], amplitude=lambda t: t**2)), [0.5, 1])
        ),
        r"-0\.00125 on top; accepted: -0\.0025, as fixed\.0 has there at t = 0\.5",
    ),
    "a traction without a value": (
        solved(loads=Load("right", traction=[0, hole])),
        r"load\.0\.traction\.1: a formula is not finite everywhere on its part",
    ),
    "a body force without a value": (
        solved(loads=[Load("right", [0, 1e-3]), Load(body_force=[hole, 0])]),
        r"load\.1\.body_force\.0: a formula is not finite",
    ),
    "a displacement without a value": (
        solved(Fixed("left", [0, 0]), Fixed("top", [None, hole])),
        r"fixed\.1\.displacement\.1: not finite at \(\d\.?\d*, 1\)",
    ),
    "a support without an amplitude": (
        solved(Fixed("top", [0, -0.005], amplitude=lambda t: np.nan)),
        "Fixed on 'top': amplitude: not finite at t = 1; accepted: ",
    ),
    "a load without an amplitude": (
        solved(loads=Load("right", [0, 1e-3], amplitude=lambda t: np.inf)),
        "Load on 'right': amplitude: not finite at t = 1",
    ),
    "a law without a value": (
        solved(
            Fixed("top", [0, -0.05]), law=UserLaw(10.0, 0.3, modulus=lambda t: (1e-3 - t) ** 0.5)
        ),
        "numbers overflow, or a law that is given has no value at these strains",
    ),
    "a load on the contact part": (
        solved(loads=Load(["right", "bottom"], [0, 1e-3])),
        r"load\.0\.on: right\+bottom shares facets with the contact part bottom",
    ),
    "a load in free directions": (lambda: Load("right", ["free", 1.0]), "0 where nothing acts"),
    "a load of nothing": (lambda: Load("right"), "Load: nothing is given"),
    "a pressure in the body": (lambda: Load(pressure=1.0), "Load: pressure: .*it on a part"),
    "a traction in the body": (lambda: Load(traction=[0, 1]), "Load: traction: .*it on a part"),
    "a body force on a part": (lambda: Load("top", body_force=[0, 1]), "Load: body_force: "),
    "two names for a force": (lambda: Load("top", [0, 1], traction=[0, 1]), "Load: .*one of dens"),
    "a resultant in the body": (lambda: Load(force=[0, 1]), "Load: force: .*it on a part"),
    "a resultant by place": (
        lambda: Load("top", force=[0, lambda x: x[0]]),
        r"Load: force: .*accepted: numbers, the resultant",
    ),
    "a gap of time": (lambda: Contact("bottom", Growing()), "gap: given .*; accepted: .*all times"),
    "a spring of time": (
        lambda: Elastic("top", [0.0, Growing()]),
        r"Elastic on 'top': stiffness\.1: given .*; accepted: .*all times",
    ),
    "a spring of time along the normal": (
        lambda: Elastic("top", normal=Growing()),
        "Elastic on 'top': normal: given .*; accepted: .*all times",
    ),
    "a support of nothing": (lambda: Fixed("top", ["free", None]), "nothing is prescribed"),
    "an amplitude": (
        lambda: Fixed("top", [0, 0], amplitude=2),
        "Fixed on 'top': amplitude: given 2",
    ),
    "no motion": (lambda: Motion(), "Motion: given 'nothing'; accepted: a displacement"),
    "a motion as a number": (lambda: Motion(0.1), r"Motion: displacement: given 0\.1; .*a comp"),
    "a motion in words": (
        lambda: Motion([0.0, "up"]),
        r"Motion: displacement: given \[0\.0, 'up'\]; accepted: a list of 2: numbers or functions",
    ),
    "an angle in a list": (
        lambda: Motion([0.0, None], [0.1, 0.0, 0.0]),
        r"Motion: rotation: given \[0\.1, 0\.0, 0\.0\]; accepted: a number",
    ),
    "a free force": (lambda: Motion([0.0, None], force=[0.0, None]), "Motion: force: .*a list of"),
    "a force in vain": (
        lambda: Motion([0.0, 0.0], force=[0.0, -3.0]),
        r"Motion: force: given \(0\.0, -3\.0\); accepted: a force where displacement is None",
    ),
    "no centre": (
        lambda: Motion([0.0, None], 0.1),
        r"Motion: centre: given \(\); accepted: a point about which it turns, a list of 2",
    ),
    "a moving centre": (lambda: Motion([0.0, None], 0.1, centre=[0.0, None]), "Motion: centre: "),
    "a rigid part in space": (
        lambda: problem(rigid=Rigid("right", Motion([0.0, 0.0, 0.0]))),
        "rigid on 'right': the motion has 3 components, the body has 2",
    ),
    "a negative gap": (on(-0.001), r"contact\.gap: -0\.001 at a node"),
    "a gap and a shape": (on(Plane((0, 0), (0, 1)), gap=0.1), "Contact: foundation: "),
    "a point in space": (on(Plane((0, 0, 0), (0, 1))), r"foundation: Plane: point: .*2 numbers"),
    "a normal in space": (on(Plane((0, 0), (0, 0, 1))), "Plane: normal: .*2 numbers in 2-D"),
    "a centre in space": (on(Sphere((0, 0, -5), 5.0)), r"Sphere: centre: given \(0, 0, -5\)"),
    "an axis in space": (on(Cylinder((0, -5), (0, 0, 1), 5.0)), "Cylinder: axis: "),
    "no normal": (on(Plane((0, 0), (0, 0))), "Plane: normal: .*a direction, not 0"),
    "no direction": (on(Plane((0, 0), (0, 1), direction="axis")), "Plane: along: "),
    "a direction": (lambda: Plane((0, 0), (0, 1), direction="up"), '"foundation", "body", "axis"'),
    "a radius": (lambda: Sphere((0, 0), "1"), "Sphere: radius: given '1'"),  # type: ignore[arg-type]
    "an angle": (lambda: Cone((0, 0), (0, 1), 90.0), "Cone: half_angle: "),
    "an angle in words": (lambda: Cone((0, 0), (0, 1), "a"), "Cone: half_angle: given 'a'"),  # type: ignore[arg-type]
    "an edge in words": (
        lambda: Punch((0, 0), (0, 1), 1.0, "a"),  # type: ignore[arg-type]
        "Punch: edge_radius: given 'a'; accepted: a length from 0",
    ),
    "an edge": (lambda: Punch((0, 0), (0, 1), 1.0, 2.0), "Punch: edge_radius: "),
    "a distance": (
        on(Level(lambda x: x[1])),
        r"contact\.foundation: .* of shape \(2,\); accepted: one number",
    ),
    "a number as distance": (lambda: Level(1.0), "Level: function: "),  # type: ignore[arg-type]
    "a layer": (on(layer=3), "Contact: layer: given 3"),
    "half a layer": (on(layer=lambda: Layer(0.1)), "Contact: layer: "),
    "friction": (on(friction=0.3), r"Contact: friction: given 0\.3; accepted: Friction\(mu="),
    "a law of friction": (lambda: Friction(law=3), "Friction: law: given 3"),  # type: ignore[arg-type]
    "a conductor": (on(conductor=3), "Contact: conductor: given 3"),
    "press": (on(press="press"), "Contact: press: given 'press'; accepted: True or False"),
    "no contact": (lambda: problem(contact=[]), r"contact: given \[\]"),
    "a law": (lambda: Body(3, TOP), "law: given 3"),  # type: ignore[arg-type]
    "no compressible law": (
        lambda: Problem(block(), Body(Linear(10.0, 0.5), TOP), Contact("bottom")),
        "Poisson's ratio 0.5; accepted: a modulus > 0, a ratio between -1 and 0.5",
    ),
    "a law among materials": (lambda: Body([Material(LAW), LAW], TOP), r"law: given Linear\("),
    "no material": (lambda: Body([], TOP), r"law: given \[\]; accepted: a law, Material"),
    "regions": (lambda: Material(LAW, on=3), "on: given 3; accepted: the name of a region"),
    "a crystal": (
        lambda: make_material(2, young=1.0, poisson=0.3, piezo={"e31": 1.0}),
        r"^make_material: piezo\.e33: only e31; accepted: either all of e31,",
    ),
    "a dimension": (lambda: make_material(1, name="PZT-4"), "make_material: dim: given 1"),
    "a load as support": (lambda: Body(LAW, [Load("top", [0, 1])]), r"fixed: given Load\("),  # type: ignore[list-item]
    "an electrode": (lambda: problem(electrodes=Electrode("left")), "a piezoelectric material"),
    "a mesh": (lambda: Problem(block().mesh, Body(LAW, TOP), Contact("bottom")), "domain: "),
    "a start": (lambda: solve(problem(), start=3), "start: given 3; accepted: an earlier sol"),  # type: ignore[arg-type]
    "no problem": (lambda: solve(block()), "solve: given <Domain"),  # type: ignore[arg-type]
    "a method": (
        lambda: solve(problem(), method="uzawa"),
        r"method: unknown; .*; a method and its tolerances as settings \[no-such-name\]$",
    ),
    "nan as support": (
        lambda: solve(Problem(block(), Body(LAW, Fixed("top", [np.nan, 0.0])), Contact("bottom"))),
        r"not finite at .* \[not-finite\]$",
    ),
    "a law in a list": (lambda: Body([LAW], TOP), r"a list of Material\(law, on=region\)"),
    "a replacement": (lambda: solve(problem(), domian=3), "domian: unknown; accepted: domain"),
    "a monitor": (lambda: solve(problem(), monitor=3), "monitor: given 3"),  # type: ignore[arg-type]
    "times": (lambda: next(evolve(problem(), 1.0)), r"times: given 1\.0; accepted: a list"),  # type: ignore[arg-type]
    "times none": (lambda: solve(problem(), times=[]), "times: given \\[\\]; accepted: a list"),
    "times in words": (lambda: solve(problem(), times=["a"]), "times: given \\['a'\\]; accepted: "),
    "times in rows": (lambda: solve(problem(), times=np.ones((2, 2))), "times: given array"),
    "an angle in space": (
        lambda: make_material(3, name="PZT-4", poling=90),
        "make_material: poling: given 90.*; accepted: a vector of 3 numbers",
    ),
    "an axis in the plane": (
        lambda: make_material(2, name="PZT-4", poling=np.array([0.0, 0.0, 1.0])),
        "make_material: poling: given .*; accepted: an angle from x in degrees",
    ),
    "no times": (lambda: solve(problem(), times=[0.5, 0.5]), "times: given 0.5, 0.5; accepted: "),
    "times of a case": (
        lambda: solve(parse_case(CASE), times=[1.0]),
        "times: given together with a case",
    ),
    "times and a start": (
        lambda: solve(problem(), times=[1.0], start=problem().start()),
        r"start: given together with times; evolve",
    ),
}


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name: str) -> None:
    make, words = WRONG[name]
    with pytest.raises(InputError, match=words) as error:
        make()
    assert "\n" not in str(error.value)


CASE = {
    "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]},
    "material": {"young": 10.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0, -0.005]}],
    "contact": {"on": "bottom"},
}


def test_a_case_is_refused_in_the_same_words() -> None:
    supports = [*CASE["fixed"], {"on": "top", "displacement": ["free", "-0.001*x"]}]
    case = parse_case({**CASE, "fixed": supports}, source="bar.toml")
    with pytest.raises(InputError, match=r"^bar\.toml: fixed\.1\.displacement\.1: .*as fixed\.0"):
        build_problem(case)
    table = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}
    later = {
        "evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, 1], "amplitudes": {"back": table}}
    }
    given = [{**CASE["fixed"][0], "amplitude": "back"}, CASE["fixed"][0]]
    with pytest.raises(InputError, match=r"fixed\.1\.displacement\.1: -0\.005 on top"):
        build_problem(parse_case({**CASE, **later, "fixed": given}))
    # At the ends of all stages both are 0, but for rounding.
    waves = [{"on": "top", "displacement": [f, -0.005]} for f in ("0.01*sin(pi*t)", 0)]
    steps = {"evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, 2]}}
    with pytest.raises(InputError, match=r"displacement\.0: 0 on top; .* -0\.01, .* at t = 1\.5"):
        build_problem(parse_case({**CASE, **steps, "fixed": waves}))
    steps["evolution"]["steps"] = [1, 1]
    build_problem(parse_case({**CASE, **steps, "fixed": waves}))


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
    assert len(start.history.records) <= len(plain.history.records)
    assert start.contact_force == pytest.approx(plain.contact_force)


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
