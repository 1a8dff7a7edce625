"""Parts that move as rigid bodies, and electrodes of unknown potential."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Motion, Rigid, build_problem, solve
from contact.case.file import parse_case
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.problem.problem import ContactProblem
from contact.results.resultants import charge_balance, movements
from tests.problems.rigid import PIEZO, column, plate, solved

SELF = MPI.COMM_SELF


@pytest.mark.core
@pytest.mark.parametrize("condense", [True, False])
def test_a_plate_stays_plane_and_balances_force_and_moment(condense):
    solution, moved = solved(plate(), SELF, NewtonOptions(tolerance=1e-10, condense=condense))
    part, problem = moved["rigid_parts"]["top"], solution.problem
    points, u = problem.body.layout.points, problem.body.nodal(solution.state.x)
    top = points[:, 1] > 1.0 - 1e-9
    angle = np.deg2rad(part["rotation"])
    assert u[top, 1] == pytest.approx(part["displacement"][1] + angle * (points[top, 0] - 1.0))
    assert np.abs(u[top, 0]).max() < 1e-15
    weight, x = problem.nodes.weight, problem.nodes.points[:, 0]
    assert weight @ solution.pressure == pytest.approx(0.02, rel=1e-12)
    # The moment of the pressure, of the plate and of what holds it and the symmetry line sideways.
    assert part["force"][1] == pytest.approx(-0.02, rel=1e-12)
    assert part["moment"] == pytest.approx(0.002, rel=1e-10)
    assert weight @ (solution.pressure * (x - 1.0)) < 0


@pytest.mark.core
def test_columns_under_a_plate_shorten_as_hooke_says():
    data = plate().model_dump(exclude_unset=True)
    data["rigid"] = [{"on": "top", "displacement": [0.0, "free"], "force": [0.0, -0.02]}]
    data["material"]["poisson"] = 0.0
    solution, moved = solved(parse_case(data), SELF)
    assert moved["rigid_parts"]["top"]["displacement"] == pytest.approx([0.0, -0.01], abs=1e-12)
    assert solution.pressure == pytest.approx(0.01, rel=1e-10)


def test_a_plate_in_python_is_that_of_a_case():
    """Components that are not given are 0, one angle is a number, and None leaves it free."""
    case = plate(rigid=[{"on": "top", "displacement": [0.0, "free"], "force": [0.0, -0.02]}])
    motion = Motion([0.0, None], force=[0.0, -0.02])
    whole = motion.filled(2)
    assert (whole.values, whole.centre) == ((0.0, None, 0.0), (0.0, 0.0))
    turned = Motion(rotation=[0.0, 0.0, 0.1], centre=[1.0, 0.0, 0.0]).filled(3)
    assert turned.values == (0.0, 0.0, 0.0, 0.0, 0.0, 0.1)
    solution = solved(case, SELF)[0]
    same = solve(built_of(case, Rigid("top", motion)), NewtonOptions(tolerance=1e-10))
    assert same.pressure == pytest.approx(solution.pressure, rel=1e-12)
    for angle in (None, "free"):
        tilting = Motion([0.0, "free"], angle, [0.0, -0.02], 0.002, [1.0, 1.0])
        assert tilting.filled(2).values == (0.0, None, None)
        free = solve(built_of(case, Rigid("top", tilting)), NewtonOptions(tolerance=1e-10))
        part = movements(free.problem, free.state)["rigid_parts"]["top"]
        assert part["moment"] == pytest.approx(0.002, rel=1e-10)
        assert abs(part["rotation"]) > 1e-4


def built_of(case, rigid):
    """Return the problem of a case with other rigid parts."""
    problem = build_problem(case, SELF)
    body = replace(problem.description, rigid=(rigid,))
    return ContactProblem(problem.domain, body, problem.contacts)


def beside_the_contact_part(degree, *, rigid=(), fixed=()):
    """Return a block that is pressed on its foundation, and whose right side does not bend."""
    data = plate().model_dump(exclude_unset=True)
    data["space"] = {"degree": degree}
    data["load"] = [{"on": "top", "traction": [0.0, -0.05]}]
    data["friction"] = {"law": "coulomb", "mu": 0.3}
    return parse_case({**data, "rigid": rigid, "fixed": [*data["fixed"], *fixed]})


@pytest.mark.parametrize("degree", [1, 2])
def test_a_plate_that_meets_the_contact_part_holds_the_nodes_there_as_a_support_does(degree):
    """At the corner; where the plate is free, force and moment balance on every road."""
    moves = {"on": "right", "displacement": [-0.01, 0.002]}
    one, two = (
        solved(beside_the_contact_part(degree, **{key: [moves]}), SELF)[0]
        for key in ("rigid", "fixed")
    )
    assert two.pressure.max() > 0.05
    assert one.pressure == pytest.approx(two.pressure, abs=1e-12)
    pushed = {"on": "right", "displacement": ["free", "free"], "force": [-0.01, 0.0]}
    case = beside_the_contact_part(degree, rigid=[pushed])
    first = solved(case, SELF)[0]
    for condense in (True, False):
        solution, moved = solved(case, SELF, NewtonOptions(tolerance=1e-10, condense=condense))
        assert moved["rigid_parts"]["right"]["force"] == pytest.approx([-0.01, 0.0], abs=1e-12)
        assert solution.pressure == pytest.approx(first.pressure, abs=1e-9)


def sheared(stretch, shear, **moves):
    """Return a block of quadratic tetrahedra that is pressed and sheared, its right side a plate.

    With u = (stretch x, 0, -shear x) its bottom lies on the foundation and slides everywhere.
    """
    young, poisson = 1.0, 0.3
    lame, modulus = young * poisson / ((1 + poisson) * (1 - 2 * poisson)), young / (2 + 2 * poisson)
    supports = [
        ("left", [0.0] * 3),
        ("front", ["free", 0.0, "free"]),
        ("back", ["free", 0.0, "free"]),
    ]
    traction = [-modulus * shear, 0.0, lame * stretch]
    data = {
        "mesh": {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 2, 2]},
        "space": {"degree": 2},
        "material": {"young": young, "poisson": poisson},
        "fixed": [{"on": on, "displacement": values} for on, values in supports],
        "load": [{"on": "top", "traction": traction}],
        "rigid": [{"on": "right", "centre": [2.0, 0.5, 0.5], "rotation": [0.0] * 3, **moves}],
        "contact": {"on": "bottom", "gap": f"{shear}*x"},
        "friction": {"law": "tresca", "bound": modulus * shear},
    }
    return parse_case(data), -lame * stretch


def test_a_plate_at_quadratic_triangles():
    """A patch test: jumps there are sums over nodes, and those of its edge follow the plate."""
    stretch, shear = -0.01, 0.004
    move = [2 * stretch, 0.0, -2 * shear]
    case, pressure = sheared(stretch, shear, displacement=move)
    one, moved = solved(case, SELF)
    assert one.pressure == pytest.approx(pressure, rel=1e-9)
    force = moved["rigid_parts"]["right"]["force"]
    free = {"displacement": ["free", 0.0, "free"], "force": [force[0], 0.0, force[2]]}
    case, _ = sheared(stretch, shear, **free)
    for condense in (True, False):
        two, moved = solved(case, SELF, NewtonOptions(tolerance=1e-10, condense=condense))
        assert moved["rigid_parts"]["right"]["displacement"] == pytest.approx(move, abs=1e-10)
        assert two.pressure == pytest.approx(pressure, rel=1e-8)


def test_balls_whose_cuts_are_plates():
    """The rims of both cuts belong to the contact parts too, far from where these touch."""
    mesh = {"radius": 1.0, "size": 0.3, "contact_size": 0.1, "contact_width": 0.3}
    found = [
        solved(
            parse_case(
                {
                    "mesh": {"generator": "two_half_cylinders", **mesh},
                    "material": {"young": 1.0, "poisson": 0.3},
                    "rigid": [
                        {"on": "lower_cut"},
                        {
                            "on": "upper_cut",
                            "displacement": [0.0, "free"],
                            "force": [0.0, -0.02],
                        },
                    ],
                    "contact": {"on": f"{slave}_arc", "against": f"{master}_arc"},
                }
            ),
            SELF,
        )[1]["rigid_parts"]["upper_cut"]
        for slave, master in (("lower", "upper"), ("upper", "lower"))
    ]
    for part in found:
        assert part["force"][1] == pytest.approx(-0.02, rel=1e-9)
        assert part["displacement"][1] == pytest.approx(found[0]["displacement"][1], rel=1e-3)


@pytest.mark.core
@pytest.mark.parametrize("charge", [0.0, 2e-3])
@pytest.mark.parametrize(
    "solver",
    [
        NewtonOptions(tolerance=1e-10),
        NewtonOptions(tolerance=1e-10, condense=False),
        NewtonOptions(tolerance=1e-10, condense=False, linear="iterative"),
        FixedPointOptions(tolerance=1e-10),
        PenaltyOptions(eps_contact=1e-8),
    ],
)
def test_an_open_electrode_reads_the_potential_of_a_column(charge, solver):
    solution, moved = solved(column(electrode=[{"on": "top", "charge": charge}]), SELF, solver)
    young, nu = 100.0, 0.3
    c = young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    # sigma = c eps - e E, D = e eps + beta E, with D.nu = charge/width at the top.
    matrix = np.array([[c, PIEZO["e33"]], [PIEZO["e33"], -PIEZO["beta33"]]])
    strain, slope = np.linalg.solve(matrix, [-1e-3, charge])
    found = moved["electrodes"]["top"]
    assert found["potential"] == pytest.approx(2.0 * slope, rel=1e-8)
    assert found["charge"] == pytest.approx(charge, rel=1e-8, abs=1e-12)
    body = solution.problem.body
    top = body.nodal(solution.state.x)[body.layout.points[:, 1] > 2.0 - 1e-9, 1]
    assert top == pytest.approx(2.0 * strain, abs=1e-10)
    charges = charge_balance(solution.problem, solution.state)
    assert charges.electrodes["top"] == pytest.approx(charge, rel=1e-8, abs=1e-12)
    assert charges.total == pytest.approx(0.0, abs=1e-12)
