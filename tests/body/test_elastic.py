"""Elastic supports: closed forms, the turned problem, limits, energies, reactions."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Elastic,
    Linear,
    Load,
    Problem,
    parse_case,
    sensitivity,
    solve,
)
from contact.case.build import build_problem
from contact.case.file import to_toml
from contact.errors import InputError
from contact.mesh.grid import rectangle

COMM = MPI.COMM_WORLD
YOUNG, HEIGHT, PRESSURE = 10.0, 2.0, 0.05

MESH = {"generator": "rectangle", "size": [1.0, HEIGHT], "cells": [3, 6]}


def column(elastic, **more):
    """Return a column without lateral strain, pressed on an elastic bed, that touches nothing."""
    data = {
        "mesh": MESH,
        "material": {"young": YOUNG, "poisson": 0.0},
        "load": [{"on": "top", "pressure": PRESSURE}],
        "elastic": elastic,
        "contact": {"on": "right", "gap": 10.0},
        "solver": {"tolerance": 1e-12},
    }
    return parse_case(data | more)


def extremes(solution):
    """Return the largest |u_x|, and u_y at the bottom and at the top. Collective."""
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // body.block_size, : body.dim]
    y = body.layout.points[:, 1]
    here = [np.abs(u[:, 0]).max(initial=0.0)]
    here += [np.abs(u[np.isclose(y, end), 1]).max(initial=0.0) for end in (0.0, HEIGHT)]
    return np.max(COMM.allgather(here), axis=0)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    "elastic",
    [
        [{"on": "bottom", "stiffness": [1.0, 4.0]}],
        [{"on": "bottom", "stiffness": ["1 + x", 3.0], "normal": 1.0}],
        [{"on": "bottom", "normal": 4.0}, {"on": "left", "stiffness": [2.0, 0.0]}],
    ],
)
def test_a_column_on_an_elastic_bed(elastic, degree):
    """U = p/k at its foot, and p H/E more at the top."""
    solution = solve(column(elastic, space={"degree": degree}), comm=COMM)
    assert solution.converged
    side, foot, top = extremes(solution)
    assert foot == pytest.approx(PRESSURE / 4.0, rel=1e-9)
    assert top == pytest.approx(PRESSURE / 4.0 + PRESSURE * HEIGHT / YOUNG, rel=1e-9)
    assert side < 1e-10
    assert solution.reaction("bottom") == pytest.approx([0.0, PRESSURE], abs=1e-10)


@pytest.mark.parallel
def test_a_bed_of_springs_of_a_body_of_revolution_has_the_area_of_the_full_turn():
    axial = column([{"on": "bottom", "normal": 4.0}], space={"kinematics": "axisymmetric"})
    solution = solve(axial, comm=COMM)
    assert extremes(solution)[1] == pytest.approx(PRESSURE / 4.0, rel=1e-9)
    assert solution.reaction("bottom")[1] == pytest.approx(PRESSURE * np.pi, rel=1e-9)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("angle", [30.0, -75.0])
def test_a_normal_stiffness_on_an_inclined_face_is_that_of_the_turned_problem(angle):
    """A bed along the normal, pushed aside as well: all turns with the mesh."""

    def made(turn):
        c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
        push = np.array([[c, -s], [s, c]]) @ [0.02, -0.05]
        return solve(
            column(
                [{"on": "bottom", "normal": 4.0}, {"on": "left", "normal": 1.5}],
                mesh=MESH | {"rotation": turn},
                material={"young": YOUNG, "poisson": 0.3},
                load=[{"on": "top", "traction": push.tolist()}],
            ),
            comm=COMM,
        )

    straight, turned = made(0.0), made(angle)
    sizes = []
    for solution in (straight, turned):
        body = solution.problem.body
        u = body.nodal(solution.state.x)[: body.owned // 2]
        sizes.append(np.sort(np.concatenate(COMM.allgather(np.linalg.norm(u, axis=1)))))
    assert np.allclose(*sizes, rtol=0, atol=1e-12 * sizes[0].max() + 1e-13)
    force = np.linalg.norm(turned.reaction("bottom"))
    assert force == pytest.approx(np.linalg.norm(straight.reaction("bottom")), rel=1e-10)


def test_a_stiff_bed_is_a_support():
    """The difference falls as the inverse of the stiffness."""
    pushed = [{"on": "top", "traction": [0.02, -0.05]}]
    rigid = column([], fixed=[{"on": "bottom", "displacement": [0.0, 0.0]}], load=pushed)
    known = solve(rigid).displacement.x.array
    off = []
    for k in (1e4, 1e5):
        found = solve(column([{"on": "bottom", "stiffness": [k, k]}], load=pushed))
        off.append(np.abs(found.displacement.x.array - known).max())
    assert off[1] == pytest.approx(off[0] / 10, rel=0.01)


@pytest.mark.core
def test_forces_are_in_balance_beside_supports_and_contact():
    data = {
        "fixed": [{"on": "left", "displacement": [0.0, "free"]}],
        "load": [{"on": "top", "traction": [0.01, -0.05]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    solution = solve(column([{"on": "right", "stiffness": [0.5, 3.0]}], **data))
    assert solution.converged and solution.contact_force[1] < 0
    total = solution.reaction("left") + solution.reaction("right") - solution.contact_force
    assert total == pytest.approx([-0.01, 0.05], abs=1e-10)
    assert abs(solution.reaction("right")[1]) > 1e-3
    assert solution.error is not None and solution.error.relative < 0.5


def test_a_part_that_is_fixed_too_has_one_reaction():
    data = {"fixed": [{"on": "bottom", "displacement": ["free", 0.0]}]}
    both = column([{"on": "bottom", "stiffness": [1.0, 7.0]}], **data)
    assert solve(both).reaction("bottom") == pytest.approx([0.0, PRESSURE], abs=1e-10)


@pytest.mark.parallel
@pytest.mark.parametrize("name", ["log", "piezo"])
def test_other_materials_stand_on_it_too(name):
    """The foot sinks in by p/k about, whatever stands on the bed."""
    sides = [{"on": "left", "displacement": [0.0, "free"]}]
    material = {"law": "log", "young": YOUNG, "poisson": 0.3, "yield_strain": 0.001}
    if name == "piezo":
        material = {"name": "PZT-4", "units": "GPa"}
        sides[0]["potential"] = 0.0
    case = column([{"on": "bottom", "normal": 4.0}], material=material, fixed=sides)
    solution = solve(case, comm=COMM)
    assert solution.converged
    assert solution.reaction("bottom")[1] == pytest.approx(PRESSURE, rel=1e-8)
    # The metal is strained evenly; the field of the ceramic is not.
    assert extremes(solution)[1] == pytest.approx(
        PRESSURE / 4.0, rel=1e-6 if name == "log" else 0.1
    )


def test_results_have_derivatives_by_a_stiffness():
    data = {
        "fixed": [{"on": "left", "displacement": [0.0, "free"]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.3},
    }

    def force(k):
        case = column([{"on": "right", "stiffness": [0.5, k]}], **data)
        return solve(case)

    found = sensitivity(force(3.0), ["contact_force_y"], ["elastic.0.stiffness.1"])
    slope = (force(3.01).contact_force[1] - force(2.99).contact_force[1]) / 0.02
    assert found["contact_force_y"]["elastic.0.stiffness.1"] == pytest.approx(slope, rel=1e-4)
    assert abs(slope) > 1e-4


@pytest.mark.core
def test_energy_is_stored_and_comes_back():
    steps = {"times": [0.0, 1.0, 2.0], "steps": [2, 2]}
    pulse = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}
    loaded = {"on": "top", "pressure": PRESSURE, "amplitude": "pulse"}
    case = column(
        [{"on": "bottom", "stiffness": [1.0, 4.0]}],
        load=[loaded],
        evolution=steps | {"amplitudes": {"pulse": pulse}},
    )
    rows = [record.row for record in solve(case).steps]
    stored = PRESSURE**2 / 2 * (1 / 4.0 + HEIGHT / YOUNG)
    assert rows[1]["energy"] == pytest.approx(stored, rel=1e-9)
    assert rows[3]["energy"] == pytest.approx(0.0, abs=1e-12)
    assert sum(row["work"] for row in rows) == pytest.approx(0.0, abs=1e-12)


def test_in_python_and_in_a_case_alike():
    domain = rectangle(MPI.COMM_SELF, (0.0, 0.0), (1.0, HEIGHT), (3, 6))
    body = Body(
        Linear(YOUNG, 0.0),
        [],
        Load("top", pressure=PRESSURE),
        elastic=Elastic("bottom", [1.0, lambda x: 4.0 + 0 * x[0]]),
    )
    solution = solve(Problem(domain, body, Contact("right", 10.0)))
    assert solution.reaction("bottom")[1] == pytest.approx(PRESSURE)
    case = column([{"on": "bottom", "stiffness": [1.0, "4 + x"]}])
    assert "[[elastic]]" in to_toml(case)


WRONG = {
    "nothing": ([{"on": "bottom"}], r"elastic\.0\.stiffness.*\[elastic\]"),
    "negative": ([{"on": "bottom", "normal": -1.0}], r"elastic\.0\.normal.*\[negative\]"),
    "negative somewhere": (
        [{"on": "bottom", "normal": "100*(x-1)"}],
        r"elastic\.0\.normal.*\[negative-stiffness\]",
    ),
    "three": ([{"on": "bottom", "stiffness": [1.0] * 3}], r"\[elastic\]"),
    "in time": (
        [{"on": "bottom", "normal": "t"}],
        r"elastic\.0\.normal: \"t\" depends on the time.*\[formula-variable\]",
    ),
    "no part": ([{"on": "base", "normal": 1.0}], r"elastic\.0\.on.*\[part-name\]"),
    "the contact part": (
        [{"on": "right", "normal": 1.0}],
        r"elastic\.0\.on.*\[load-on-contact\]",
    ),
    "along the normal alone": ([{"on": "left", "normal": 1.0}], r"\[unsupported\]"),
    "one axis": ([{"on": "bottom", "stiffness": [1.0, 0.0]}], r"\[unsupported\]"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name):
    elastic, words = WRONG[name]
    with pytest.raises(InputError, match=words) as caught:
        build_problem(column(elastic))
    assert "\n" not in str(caught.value)
