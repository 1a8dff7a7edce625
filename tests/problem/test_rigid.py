"""Foundations that move as rigid bodies.

Rigid motions, plates and electrodes that are none.
Rigid plates on bodies that touch each other.
"""

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from contact import write_outputs
from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.mesh.grid import rectangle
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.model.body import Body, Fixed
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.rigid import Motion, Rigid
from contact.plot.figures import plot
from contact.problem.checks import check_rigid_modes
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.state import State
from contact.results.resultants import movements
from contact.solving import solve
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant, flat, state_of
from tests.problems.mechanics import solve as relax
from tests.problems.rigid import indented, plate, solved

SELF = MPI.COMM_SELF

#: Pushed aside by a given way, down by a force, and free to turn.
FREE = {"displacement": [0.05, "free"], "force": [0.0, -0.01], "rotation": "free"}


@pytest.mark.core("2-1-10", "3-1-4")
@pytest.mark.parametrize(("dim", "degree", "n"), [(2, 1, 10), (3, 1, 4), (3, 2, 2)])
def test_force_and_displacement_control_agree(dim, degree, n):
    still = [0.0] * (dim - 1)
    case = indented(dim, n, degree, displacement=[*still, "free"], force=[*still, -0.01])
    forced, moved = solved(case, SELF)
    _, same = solved(case, SELF, NewtonOptions(tolerance=1e-10, condense=False, linear="lu"))
    depth = moved["rigid"]["displacement"][-1]
    assert same["rigid"]["displacement"][-1] == pytest.approx(depth, rel=1e-9)
    assert depth < -0.005
    driven, summary = solved(indented(dim, n, degree, displacement=[*still, depth]), SELF)
    assert summary["rigid"]["force"][-1] == pytest.approx(-0.01, rel=1e-10)
    scale = np.abs(driven.state.x).max()
    assert np.allclose(forced.state.x, driven.state.x, rtol=0, atol=1e-10 * scale)


@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_unknown_motions_of_a_whole_body(linear):
    """Not condensed, and as with the motion given."""
    options = NewtonOptions(tolerance=1e-10, condense=False, linear=linear)
    forced, moved = solved(indented(n=8, **FREE), SELF, options)
    found = moved["rigid"]
    driven, _ = solved(
        indented(n=8, displacement=found["displacement"], rotation=found["rotation"]), SELF, options
    )
    assert np.allclose(forced.state.x, driven.state.x, rtol=0, atol=1e-8)


@pytest.mark.core
@pytest.mark.parametrize(
    "solver",
    [
        NewtonOptions(),
        NewtonOptions(condense=False, linear="lu"),
        NewtonOptions(condense=False, linear="iterative"),
    ],
    ids=["condensed", "direct", "iterative"],
)
def test_a_ball_rolls_to_where_no_moment_is_left(solver):
    """Its balances are met to rounding, whatever the tolerance of the nodes' rows."""
    case = indented(displacement=[0.05, "free"], force=[0.0, -0.01], rotation="free", moment=0.0)
    solution, moved = solved(case, SELF, solver)
    rigid, nodes = moved["rigid"], solution.problem.nodes
    stress = solution.problem.interface.traction(solution.nodal, solution.multipliers)
    force = nodes.weight[:, None] * stress
    arm = nodes.points - np.array([1.0, 2.0])
    moment = np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])
    size = np.sum(np.linalg.norm(arm, axis=1) * np.linalg.norm(force, axis=1))
    assert abs(moment) < 1e-12 * size
    assert force.sum(axis=0) == pytest.approx([-rigid["force"][0], 0.01], abs=1e-14)
    # Rolling without sliding: the ball turns as far as its centre goes, but for the strain.
    assert np.deg2rad(rigid["rotation"]) == pytest.approx(-0.05, rel=0.05)
    assert (solution.status == "stick").any()


@pytest.mark.core
@pytest.mark.parametrize(
    ("solver", "tolerance"),
    [
        (NewtonOptions(tolerance=1e-10, condense=False), 1e-9),
        (NewtonOptions(tolerance=1e-9, condense=False, linear="iterative"), 1e-7),
        (FixedPointOptions(tolerance=1e-10), 1e-7),
        (PenaltyOptions(eps_contact=1e-5, eps_slip=1e-6), 3e-3),
    ],
)
@pytest.mark.parametrize("law", ["linear", "log"])
def test_all_methods_find_the_same_motion(solver, tolerance, law):
    case = indented(n=8, displacement=["free", "free"], force=[0.002, -0.01], rotation=-0.5)
    if law == "log":
        material = {"law": "log", "young": 1.0, "poisson": 0.3, "yield_strain": 0.01}
        case = parse_case({**case.model_dump(exclude_unset=True), "material": material})
    expected = solved(case, SELF)[1]["rigid"]
    found = solved(case, SELF, solver)[1]["rigid"]
    for key in ("displacement", "force"):
        assert found[key] == pytest.approx(expected[key], rel=tolerance), key


@pytest.mark.core
def test_residuals_see_an_indenter_out_of_balance():
    case = indented(displacement=[0.0, "free"], force=[0.0, -0.01])
    problem = build_problem(case, SELF)
    state = state_of(problem, 1e-8)
    less = Multipliers(0.9 * state.multipliers.contact, 0.9 * state.multipliers.friction)
    residual = residual_forces(problem, State(state.x, less))
    q = problem.body.motion(problem.body.unbalanced(residual))
    # A tenth of the force is missing, and what is given bears its reaction.
    assert q == pytest.approx([0.0, 0.1 * 0.01, 0.0], abs=1e-14)
    assert evaluate(problem, State(state.x, less)).equilibrium > 1e-3


@pytest.mark.core
@pytest.mark.parametrize("condense", [True, False])
def test_supports_on_an_inclined_normal_take_their_share(condense):
    # Half of the block: on the line of symmetry, which lies beside the ball's lowest point, the
    # ball's normal leans towards the support.
    whole = indented(n=8, displacement=[0.0, "free"], force=[0.0, -0.01]).model_dump(
        exclude_unset=True
    )
    whole["mesh"] |= {"size": [1.0, 1.0], "cells": [8, 8]}
    symmetry = {"on": "right", "displacement": [0.0, "free"]}
    whole["fixed"] = [*whole["fixed"], symmetry]
    whole["contact"]["foundation"]["centre"] = [0.9, 2.0]
    case = parse_case(whole)
    solution, moved = solved(case, SELF, NewtonOptions(tolerance=1e-10, condense=condense))
    weight, nodes = solution.problem.nodes.weight, solution.problem.nodes
    # The vertical motion of the ball does the work of its force, node by node.
    rate = nodes.motion[:, 1, 1] * nodes.normal[:, 1] + nodes.motion[:, 0, 1] * nodes.normal[:, 0]
    friction = np.einsum("ni,ni->n", solution.friction, nodes.motion[:, :2, 1])
    assert weight @ (solution.pressure * rate + friction) == pytest.approx(0.01, rel=1e-10)
    # The exact direction of the foundation, also where a support holds nodes aslant to it.
    points = nodes.points
    radial = (np.array([0.9, 2.0]) - points) / np.linalg.norm([0.9, 2.0] - points, axis=1)[:, None]
    assert rate == pytest.approx(radial[:, 1])
    assert moved["rigid"]["force"][1] == pytest.approx(-0.01, rel=1e-10)


@pytest.mark.core
def test_a_press_fit_presses():
    data = indented(n=8, displacement=[0.0, 0.0]).model_dump(exclude_unset=True)
    data["contact"]["foundation"]["centre"] = [1.0, 1.98]
    with pytest.raises(InputError, match=r"\[overlap\]"):
        build_problem(parse_case(data), SELF)
    data["contact"]["overlap"] = "press"
    pressed = solved(parse_case(data), SELF)[0]
    driven = solved(indented(n=8, displacement=[0.0, -0.02]), SELF)[0]
    # The ball that overlaps and the ball that is driven in differ in their normals alone.
    assert pressed.contact_force[1] == pytest.approx(driven.contact_force[1], rel=0.03)
    assert pressed.contact_force[1] > 0.004


def stepped(amplitudes=None, **rigid):
    """Return the rows of an indentation with friction in four steps."""
    data = indented(n=10).model_dump(exclude_unset=True)
    data["contact"]["rigid"] |= rigid
    data["evolution"] = {"times": [0.0, 1.0], "steps": [4], "amplitudes": amplitudes or {}}
    solution = solve(parse_case(data), NewtonOptions(tolerance=1e-11), comm=SELF)
    assert solution.converged
    return [record.row for record in solution.steps]


def test_what_an_indentation_in_steps_writes(tmp_path):
    """Global unknowns are no part of the fields; the foundation's force over its way is drawn."""
    data = indented(n=6).model_dump(exclude_unset=True)
    data["contact"]["rigid"]["displacement"] = [0.0, "-0.02*t"]
    data["evolution"] = {"times": [0.0, 1.0], "steps": [2]}
    solution = solve(parse_case(data), comm=SELF)
    write_outputs(solution, tmp_path)
    plot(tmp_path)
    assert (tmp_path / "fields-0001.vtu").is_file()
    assert (tmp_path / "figure-loop.png").is_file()


def test_an_indentation_driven_by_force_goes_the_way_of_one_driven_by_displacement():
    driven = stepped(displacement=[0.0, "-0.02*t*(2-t)"])
    ways, forces = ([row[name] for row in driven] for name in ("rigid_y", "rigid_force_y"))
    press = {"time": [0.0, 0.25, 0.5, 0.75, 1.0], "value": [0.0, *forces]}
    forced = stepped(
        {"press": press}, displacement=[0.0, "free"], force=[0.0, 1.0], amplitude="press"
    )
    assert [row["rigid_y"] for row in forced] == pytest.approx(ways, rel=1e-9)
    assert [row["rigid_force_y"] for row in forced] == pytest.approx(forces, rel=1e-9)
    assert [row["dissipation"] for row in forced] == pytest.approx(
        [row["dissipation"] for row in driven], rel=1e-7
    )
    # The work of the force is that of the motion, by the trapezoidal rule both times.
    for before, row in pairwise([{"rigid_y": 0.0, "rigid_force_y": 0.0, "energy": 0.0}, *forced]):
        mean = 0.5 * (row["rigid_force_y"] + before["rigid_force_y"])
        assert row["work"] == pytest.approx(mean * (row["rigid_y"] - before["rigid_y"]), rel=1e-9)
        lost = row["work"] - (row["energy"] - before["energy"])
        assert abs(lost - row["dissipation"]) < 0.1 * row["work"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"force": [0.0, -1.0]}, r"contact.rigid.force.1.*\[value\]"),
        ({"rotation": 1.0, "centre": None}, r"contact.rigid.centre.*\[missing\]"),
        ({"displacement": [0.0, "-0.01*t"]}, r"\[value\]"),
        (
            {"displacement": [0.0, "free"], "force": [0.0, 0.01]},
            r"\[pulled-off\]",
        ),
        ({"rotation": "free"}, r"\[unsupported\]"),
    ],
)
def test_bad_motions_are_refused(changes, words):
    data = indented().model_dump(exclude_unset=True)
    data["friction"] = {"law": "none"}
    rigid = {**data["contact"]["rigid"], **changes}
    data["contact"]["rigid"] = {key: value for key, value in rigid.items() if value is not None}
    with pytest.raises(InputError, match=words):
        build_problem(parse_case(data), SELF)


@pytest.mark.parametrize(
    ("rigid", "words"),
    [
        ([{"on": "bottom"}], r"\[held-part\]"),
        ([{"on": "top"}, {"on": "right"}], r"\[rigid-part\]"),
        ([{"on": "top", "displacement": ["free", 0.0]}], r"\[rigid-part\]"),
    ],
)
def test_bad_rigid_parts_are_refused(rigid, words):
    with pytest.raises(InputError, match=words):
        build_problem(plate(rigid=rigid), SELF)


def supported(motion, on="top", **more):
    """Return a block with a supported top, and a rigid part."""
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (8, 4))
    fixed = Fixed("top", **({"displacement": [0.002, -0.01]} | more))
    body = Body(Linear(1.0, 0.3), fixed, rigid=Rigid(on, motion))
    return ContactProblem(domain, body, Contact("bottom"))


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("motion", "more"),
    [
        (Motion([0.0, -0.02]), {}),
        (Motion([0.0, -0.01]), {"displacement": [0.002, "free"]}),
        (Motion([0.0, -0.01], 0.01, centre=[1.0, 1.0]), {"displacement": ["free", -0.01]}),
        (Motion([0.0, None], force=[0.0, -0.3]), {"displacement": [0.002, "free"]}),
    ],
    ids=["both", "x", "rotation", "force"],
)
def test_a_support_that_moves_a_rigid_part_otherwise_is_refused(motion, more):
    """It won at each node, and the motion that was given was reported."""
    with pytest.raises(InputError, match=r"rigid on 'top': at \(.*\), where .*\[supports\]"):
        solve(supported(motion, **more))


@pytest.mark.parallel
def test_a_support_that_moves_a_rigid_part_alike_is_accepted():
    solution = solve(supported(Motion([0.002, -0.01])))
    without = solve(ContactProblem(solution.problem.domain, Body(Linear(1.0, 0.3), Fixed(
        "top", [0.002, -0.01])), Contact("bottom")))  # fmt: skip
    assert solution.contact_force == pytest.approx(without.contact_force, rel=1e-9)
    beside = solve(supported(Motion([0.0, 0.0]), "left"))
    assert any("rigid on 'left': at (0, 1), where it meets" in said for said in beside.warnings)


@pytest.mark.parametrize(("end", "constrained"), [(2.0, True), (1.2, False)])
def test_nodes_beyond_the_foundation_hold_nothing(end, constrained):
    """A block 2 x 1 on a ledge that ends at 1.2: pressed at its right end it tips."""
    ledge = {"shape": "punch", "centre": [0.5 * end, 0.0], "axis": [0.0, -1.0]}
    ledge["radius"] = 0.51 * end
    case = {
        "mesh": {
            "generator": "rectangle",
            "size": [2.0, 1.0],
            "cells": [20, 10],
            "parts": {"end": {"side": "top", "from": 1.6, "to": 2.0}},
        },
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "end", "pressure": 1e-4}],
        "contact": {"on": "bottom", "foundation": ledge},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    if constrained:
        build_problem(parse_case(case), SELF)
        return
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        build_problem(parse_case(case), SELF)


def stacked() -> ContactProblem:
    """Return a block on another, pressed and tilted by a plate that is free to move."""
    plate = Motion([None, None], [None], [0.001, -0.01], [0.001], [0.5, 2.0])
    still = [constant(0.0, 2), constant(0.0, 2)]
    body = Body(Linear(1.0, 0.3), [Fixed("bottom", still)], (), rigid=(Rigid("top", plate),))
    friction = Friction(ConstantCoefficient(0.5))
    contact = Contact("under", flat(), friction=friction, against="over")
    return ContactProblem(Blocks().domain(SELF), body, contact)


@pytest.mark.core
@pytest.mark.parametrize("how", ["condensed", "whole", "uzawa"])
def test_a_free_plate_loads_two_bodies(how):
    problem = stacked()
    check_rigid_modes(problem)
    if how == "uzawa":
        state = relax(problem, 1e-10).state
    else:
        state = state_of(problem, 1e-10, condense=how == "condensed")
    nodes = problem.nodes
    stress = problem.interface.traction(problem.nodal(state), state.multipliers)
    force = nodes.weight[:, None] * stress
    # What the upper body exerts on the lower one is what acts on the plate.
    assert force.sum(axis=0) == pytest.approx([0.001, -0.01], abs=1e-12)
    arm = nodes.points - np.array([0.5, 2.0])
    moment = np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])
    assert moment == pytest.approx(0.001, rel=1e-9)
    # The same motion by all methods: that of the condensed one.
    plate = movements(problem, state)["rigid_parts"]["top"]
    expected = movements(problem, state_of(problem, 1e-11))["rigid_parts"]["top"]
    for key in ("displacement", "rotation"):
        assert plate[key] == pytest.approx(expected[key], rel=1e-6), key
