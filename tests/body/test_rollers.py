"""Rollers on inclined and curved faces: the turned problem, closed forms, ranks, solvers."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Load, Problem, parse_case, sensitivity, solve
from contact import NewtonOptions as Newton
from contact.case.build import build_problem
from contact.errors import InputError
from contact.mesh.grid import rectangle

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 10.0, 0.3


def turned(vector, angle):
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    return [c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], *vector[2:]]


def block(angle, dim=2, given=0.0, sides=("left",), **more):
    """Return a block on rollers, pressed aside onto a plane by tractions; all turns about z."""
    size, cells = [1.5, 1.0, 0.8][:dim], [6, 4, 3][:dim]
    rolls = [{"on": side, "normal": given} for side in sides]
    rolls += [{"on": "front", "normal": 0.0}] if dim == 3 else []
    plane = {"shape": "plane", "point": [0.0] * dim}
    up, traction = ([0.0, 1.0], [0.02, -0.05]) if dim == 2 else ([0.0, 0, 1], [0.02, 0.01, -0.05])
    data = {
        "mesh": {
            "generator": "rectangle" if dim == 2 else "box",
            "size": size,
            "cells": cells,
            "rotation": angle,
        }
        | ({"axis": [0.0, 0.0, 1.0]} if dim == 3 else {}),
        "material": {"young": YOUNG, "poisson": POISSON},
        "fixed": rolls,
        "load": [{"on": "top", "traction": turned(traction, angle)}],
        "contact": {
            "on": "bottom",
            "foundation": plane | {"normal": turned(up, angle)},
        },
        "friction": {"law": "coulomb", "mu": 0.3},
        "solver": {"tolerance": 1e-13},
    }
    return parse_case(data | more)


def lengths(solution):
    """Return the lengths of all displacements, sorted. Collective."""
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // body.block_size, : body.dim]
    found = np.concatenate(COMM.allgather(np.column_stack([body.layout.points, u])))
    return np.sort(np.linalg.norm(found[:, body.dim :], axis=1))


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
@pytest.mark.parametrize("given", [0.0, 0.01])
def test_rollers_on_an_inclined_face_are_those_of_the_turned_problem(dim, degree, linear, given):
    """The face shares nodes with the contact part, at one of which both hold."""
    more = {"space": {"degree": degree}, "solver": {"tolerance": 1e-13, "linear": linear}}
    straight, inclined = (
        solve(block(angle, dim, given, **more), comm=COMM) for angle in (0.0, 30.0)
    )
    assert straight.converged and inclined.converged
    assert np.linalg.norm(straight.contact_force) > 0.01
    known = lengths(straight)
    assert np.allclose(lengths(inclined), known, rtol=0, atol=1e-12 * max(known.max(), 1.0))
    for part in ("left", "front")[: dim - 1]:
        force = turned(straight.reaction(part), 30.0)
        assert inclined.reaction(part) == pytest.approx(force, abs=1e-11)
    force = turned(straight.contact_force, 30.0)
    assert inclined.contact_force == pytest.approx(force, abs=1e-11)


@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_rollers_along_an_axis_are_a_fixed_component(linear):
    solver = {"tolerance": 1e-13, "linear": linear}
    axis = [{"on": "left", "displacement": [-0.01, "free"]}]
    known, found = (
        solve(block(0.0, given=0.01, solver=solver, **more), comm=COMM)
        for more in ({"fixed": axis}, {})
    )
    assert np.allclose(lengths(found), lengths(known), rtol=0, atol=1e-13)
    assert found.reaction("left") == pytest.approx(known.reaction("left"), abs=1e-11)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("order", [["left", "bottom"], ["bottom", "left"]])
def test_nodes_of_two_inclined_faces_are_held_by_both(law, order):
    """A block between rollers and a wall, pressed from above: it is strained that way alone."""
    material = {"law": law, "young": YOUNG, "poisson": POISSON}
    material |= {"yield_strain": 0.01} if law == "log" else {}
    wall = {
        "shape": "plane",
        "point": turned([1.5, 0.0], 30.0),
        "normal": turned([-1.0, 0.0], 30.0),
    }
    solution = solve(
        block(
            30.0,
            sides=order,
            material=material,
            load=[{"on": "top", "pressure": 0.05}],
            contact={"on": "right", "foundation": wall},
            friction={"law": "none"},
        ),
        comm=COMM,
    )
    assert solution.converged
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // 2] @ np.array(turned([1, 0], 30.0))
    assert np.abs(u).max(initial=0.0) < 1e-13
    assert solution.reaction("bottom") == pytest.approx(turned([0.0, 0.075], 30.0), abs=1e-12)
    if law == "linear":
        modulus = YOUNG * (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)
        assert lengths(solution)[-1] == pytest.approx(0.05 / modulus, rel=1e-12)


def sector(comm, around, angle=30.0):
    """Return a sector of a ring of radii 1 and 2: parts left (inside), right, bottom and top."""
    domain = rectangle(comm, (1.0, 0.0), (1.0, np.deg2rad(angle)), (2 * around, around))
    x = domain.mesh.geometry.x
    r, phi = x[:, 0].copy(), x[:, 1].copy()
    x[:, 0], x[:, 1] = r * np.cos(phi), r * np.sin(phi)
    return replace(domain, size=2.0)


def shrunk(domain, degree, amount):
    """Return a sector on rollers whose outer circle is pressed in by an amount."""
    rolls = [Fixed(side, normal=0.0) for side in ("bottom", "top")]
    body = Body(Linear(YOUNG, POISSON), [*rolls, Fixed("right", normal=-amount)])
    return solve(Problem(domain, body, Contact("left", 10.0), degree=degree))


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("degree", "bound", "order"), [(1, 2e-3, 1.6), (2, 2e-3, 1.8)])
def test_a_circle_pressed_in_is_the_closed_form_of_a_ring(degree, bound, order):
    """Lame: u = A r + B/r, no pressure inside; facets are chords: errors of order h^2 log h."""
    amount, shear = 0.01, YOUNG / 2 / (1 + POISSON)
    b = 1 / (1 - 2 * POISSON)  # B/A a^2
    a = -amount / (2 + b / 2)
    off = []
    for around in (8, 16) if degree == 1 else (3, 6):
        solution = shrunk(sector(COMM, around), degree, amount)
        assert solution.converged
        body = solution.problem.body
        u, x = body.nodal(solution.state.x)[: body.owned // 2], body.layout.points
        r = np.linalg.norm(x, axis=1)
        error = np.abs(u - (a + a * b / r**2)[:, None] * x).max(initial=0.0)
        off.append(COMM.allreduce(error, op=MPI.MAX) / amount)
    assert off[1] < bound
    assert np.log2(off[0] / off[1]) > order
    pressure = -2 * shear * a * b * (1 - 1 / 4)
    # A reaction of rollers is the resultant of their normal forces.
    along = np.array([np.sin(np.pi / 6), 1 - np.cos(np.pi / 6)])
    assert solution.reaction("right") == pytest.approx(-2 * pressure * along, rel=5e-3)


@pytest.mark.core
def test_rollers_move_in_time_and_results_have_derivatives_by_them():
    steps = {"evolution": {"times": [0.0, 1.0], "steps": [2]}}
    clamped = {"on": "right", "displacement": [0.0, 0.0]}

    def made(given, **more):
        return solve(block(30.0, fixed=[{"on": "left", "normal": given}, clamped], **more))

    at_once, moved = made(0.01), made("0.01*t", **steps, friction={"law": "none"})
    rows, whole = [step.row for step in moved.steps], made(0.01, friction={"law": "none"})
    final = whole.reaction("left")
    for row, share in zip(rows, (0.5, 1.0), strict=True):
        assert [row["reaction_x_left"], row["reaction_y_left"]] == pytest.approx(share * final)
    found = sensitivity(at_once, ["contact_force_y", "reaction_x_left"], ["fixed.0.normal"])
    one, other = (made(0.01 + h) for h in (-1e-5, 1e-5))
    for name, value in (
        ("contact_force_y", lambda s: s.contact_force[1]),
        ("reaction_x_left", lambda s: s.reaction("left")[0]),
    ):
        slope = (value(other) - value(one)) / 2e-5
        assert found[name]["fixed.0.normal"] == pytest.approx(slope, rel=1e-4)
        assert abs(slope) > 1e-3


@pytest.mark.parallel
def test_two_bodies_beside_rollers():
    """A block on another that stands on rollers, inclined: as without the angle."""

    def made(angle):
        mesh = {"generator": "two_blocks", "rotation": angle}
        return parse_case(
            {
                "mesh": mesh,
                "material": {"young": YOUNG, "poisson": POISSON},
                "fixed": [
                    {"on": "lower_bottom", "normal": 0.0},
                    {"on": "lower_left", "normal": 0.0},
                ],
                "load": [{"on": "upper_top", "traction": turned([0.001, -0.01], angle)}],
                "contact": {"on": "upper_bottom", "against": "lower_top"},
                "friction": {"law": "coulomb", "mu": 0.5},
                "solver": {"tolerance": 1e-12},
            }
        )

    straight, inclined = (solve(made(angle), comm=COMM) for angle in (0.0, 30.0))
    assert straight.converged and inclined.converged
    known = lengths(straight)
    assert np.allclose(lengths(inclined), known, rtol=0, atol=1e-11 * known.max())


@pytest.mark.parallel
def test_a_roller_in_front_of_a_plate_that_moves():
    """The foundation is pressed on by a force; its contact shares a node with the roller."""
    plane = {"shape": "plane", "point": [0.0, 0.0]}

    def made(angle):
        rigid = {"displacement": ["free", "free"], "force": turned([0.0, 0.05], angle)}
        contact = {"on": "bottom", "rigid": rigid}
        normal = turned([0.0, 1.0], angle)
        contact["foundation"] = plane | {"normal": normal}
        return block(
            angle,
            sides=("left", "top"),
            load=[],
            contact=contact,
            solver={"tolerance": 1e-12},
        )

    straight, inclined = (solve(made(angle), comm=COMM) for angle in (0.0, 30.0))
    assert straight.converged and inclined.converged
    known = lengths(straight)
    assert np.allclose(lengths(inclined), known, rtol=0, atol=1e-11 * known.max())


WRONG = {
    "two": (
        {"displacement": [0.0, "free"]},
        r"fixed\.0\.normal.*\[one-condition\]",
    ),
    "no number": ({"normal": "log(-1 - x)"}, r"fixed\.0\.normal.*\[not-finite\]"),
    "no part": ({"on": "base"}, r"fixed\.0\.on.*\[part-name\]"),
    "an edge": ({"on": ["left", "top"]}, r"fixed\.0\.normal.*\[roller-normal\]"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name):
    given, words = WRONG[name]
    fixed = [{"on": "left", "normal": 0.0} | given, {"on": "right", "displacement": [0.0, 0.0]}]
    with pytest.raises(InputError, match=words) as caught:
        build_problem(block(0.0, fixed=fixed))
    assert "\n" not in str(caught.value)


def test_a_roller_alone_leaves_a_motion_along_it():
    far = {"on": "bottom", "gap": 1.0}
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        build_problem(block(30.0, contact=far | {"on": "right"}, friction={"law": "none"}))


def wedge(order, values=(0.0, 0.0), more=()):
    """Return a block whose left side is inclined by 20 degrees, on rollers there and below."""
    domain = rectangle(COMM, [0.0, 0.0], [1.0, 1.0], [5, 4])
    x = domain.mesh.geometry.x
    x[:, 0] += np.tan(np.deg2rad(20)) * x[:, 1] * (1 - x[:, 0])
    sides = dict(zip(("left", "bottom"), values, strict=True))
    rolls = [Fixed(side, normal=sides[side]) for side in order] + list(more)
    return domain, Body(Linear(YOUNG, POISSON), rolls, [Load("right", [-0.3, 0.0])])


@pytest.mark.parallel
def test_forces_of_rollers_that_share_nodes_are_along_their_normals_in_any_order():
    """The corner is constrained by two normals that are not orthogonal; a fixed one is no other."""
    found = []
    for order in (["left", "bottom"], ["bottom", "left"]):
        domain, body = wedge(order)
        solution = solve(Problem(domain, body, Contact("top", gap=1.0)), Newton(tolerance=1e-13))
        found.append([solution.reaction("left"), solution.reaction("bottom")])
    domain, body = wedge(["left"], more=[Fixed("bottom", [None, 0.0])])
    solution = solve(Problem(domain, body, Contact("top", gap=1.0)), Newton(tolerance=1e-13))
    found.append([solution.reaction("left"), solution.reaction("bottom")])
    np.testing.assert_allclose(found[1], found[0], atol=1e-13)
    np.testing.assert_allclose(found[2], found[0], atol=1e-13)
    left, bottom = found[0]
    assert left[1] / left[0] == pytest.approx(-np.tan(np.deg2rad(20)), rel=1e-11)
    assert abs(bottom[0]) < 1e-13
    assert left + bottom == pytest.approx([0.3, 0.0], abs=1e-12)


@pytest.mark.parallel
def test_rollers_on_two_pieces_of_a_face_bear_the_same_in_any_order():
    """At the node of both each bears the half."""
    halves = {"low": {"side": "left", "to": 0.5}, "high": {"side": "left", "from": 0.5}}
    found = []
    for order in (["low", "high"], ["high", "low"]):
        mesh = {"generator": "rectangle", "size": [1.5, 1.0], "cells": [6, 4], "rotation": 30.0}
        mesh["parts"] = halves
        case = block(30.0, sides=order, friction={"law": "none"}, mesh=mesh)
        solution = solve(case, comm=COMM)
        assert solution.converged
        found.append([solution.reaction(side) for side in ("low", "high")])
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    assert np.linalg.norm(found[0], axis=1).min() > 1e-3


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("given", "more"),
    [
        ((0.01, 0.0), [Fixed("bottom", [0.0, 0.0])]),
        ((0.01, 0.0), [Fixed("left", normal=0.02)]),
        ((0.0, 0.0), [Fixed("bottom", [0.01, 0.0])]),
    ],
)
def test_rollers_that_contradict_other_supports_are_refused(given, more):
    order = ["left"] if more[0].normal is None else ["left", "bottom"]
    domain, body = wedge(order, given, more)
    with pytest.raises(InputError, match=r"fixed\.0\.normal.*\[roller-values\]"):
        Problem(domain, body, Contact("top", gap=1.0))
    agreeing = [Fixed("bottom", [-0.01 / np.cos(np.deg2rad(20)), 0.0])]
    domain, body = wedge(["left"], (0.01, 0.0), agreeing)
    Problem(domain, body, Contact("top", gap=1.0))


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("two bodies", "contact of two bodies"),
        ("revolved", "contact of a body of revolution that reaches its axis"),
        ("solid", "contact of degree 2 in 3-D"),
    ],
)
def test_rollers_at_jumps_of_several_nodes(kind, words):
    """Nodes of the contact's corner; the words are those of the contact that it is."""
    case = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [2, 2]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "right", "normal": 0.0}],
        "load": [{"on": "top", "traction": [0.0, -0.01]}],
        "contact": {"on": "bottom"},
    }
    if kind == "revolved":
        case["space"] = {"kinematics": "axisymmetric"}
    elif kind == "solid":
        case["mesh"] = {"generator": "box", "size": [1.0] * 3, "cells": [2] * 3}
        case["load"] = [{"on": "top", "traction": [0.0, 0.0, -0.01]}]
        case["space"] = {"degree": 2}
    else:
        case["mesh"] = {"generator": "two_blocks"}
        case["fixed"] = [{"on": "upper_left", "normal": 0.0}]
        case["load"] = [{"on": "upper_top", "traction": [0.0, -0.01]}]
        case["contact"] = {"on": "upper_bottom", "against": "lower_top"}
    with pytest.raises(InputError, match=rf"{words}.*\[roller-contact\]"):
        build_problem(parse_case(case))
