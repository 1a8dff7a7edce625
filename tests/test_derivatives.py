"""Derivatives through contact and friction: published values, differences, adjoint, errors."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    InputError,
    NewtonOptions,
    Parameter,
    gap_gradient,
    load_case,
    parse_case,
    sensitivity,
    solve,
)
from contact.case.build import build_problem
from contact.case.text import with_number
from contact.derivatives import logger
from contact.output.differentiable import named_quantities
from scripts.studies.derivatives import FAMILIES, compared, problem
from tests.problems.rigid import indented

SELF = MPI.COMM_SELF


def solution(seed):
    return solve(parse_case(problem(seed)[1]), comm=SELF)


def test_bar_by_its_friction_coefficient():
    # computed independently, by central differences
    given = ["mesh.cells=[64,16]", "material.law=linear", "friction.mu=0.3"]
    bar = load_case("scripts/cases/bar.toml", [*given, "solver.tolerance=1e-12"])
    names = ["contact_force_x", "contact_force_y", "max_pressure"]
    found = sensitivity(solve(bar, comm=SELF), names, ["friction.mu", "material.young"])
    by_mu = [found[name]["friction.mu"] for name in names]
    assert by_mu == pytest.approx([-6.2189744e-4, 1.4790623e-4, 1.25772757e-2], rel=5e-8)
    # forces under a given load do not depend on the modulus of a linear body
    assert [found[name]["material.young"] for name in names] == pytest.approx([0, 0, 0], abs=1e-11)


@pytest.mark.parametrize("family", FAMILIES)
def test_differences_and_adjoint(family):
    found = compared(FAMILIES.index(family), SELF, each=False)
    assert found.weak == 0
    assert found.apart < 1e-6
    # The update of internal variables is differentiated numerically.
    assert found.adjoint < (1e-9 if "j2" in family else 1e-10)


@pytest.mark.parallel
@pytest.mark.parametrize("family", ["two bodies", "ball under a force", "evolution"])
def test_ranks(family):
    seed = FAMILIES.index(family)
    names, keys = ["contact_force_x", "max_pressure"], ["material.0.young", "friction.mu"]
    keys[0] = keys[0] if family == "two bodies" else "material.young"
    found = [
        [sensitivity(run, names, keys, method) for method in ("tangent", "adjoint")]
        for run in (
            solve(parse_case(problem(seed)[1]), comm=comm) for comm in (MPI.COMM_WORLD, SELF)
        )
    ]
    alone = found[1][0]
    for one in (*found[0], found[1][1]):
        for name in names:
            for key in keys:
                assert one[name][key] == pytest.approx(alone[name][key], rel=1e-7, abs=1e-11)


def test_steps_and_their_adjoint():
    run = solution(FAMILIES.index("evolution, slip"))
    keys = ["friction.mu.a", "material.young", "fixed.1.displacement.0"]
    found = sensitivity(run, ["contact_force_x"], keys, "tangent")
    adjoint = sensitivity(run, ["contact_force_x"], keys)
    assert adjoint.method == "adjoint"
    for key in keys:
        steps = found.steps["contact_force_x"][key]
        assert steps.shape == (6,)
        assert adjoint["contact_force_x"][key] == pytest.approx(steps[-1], rel=1e-9)
    # each step by itself is the end of a shorter run
    data = problem(FAMILIES.index("evolution, slip"))[1]
    data["evolution"] |= {"times": [0.0, 1.0, 2.0], "steps": [2, 2]}
    shorter = sensitivity(solve(parse_case(data), comm=SELF), ["contact_force_x"], keys)
    for key in keys:
        assert shorter["contact_force_x"][key] == pytest.approx(
            found.steps["contact_force_x"][key][3], rel=1e-8
        )


def test_a_problem_in_python_and_a_function():
    case = indented(force=[0.0, -0.01], displacement=[0.0, "free"])
    base = build_problem(case, SELF)
    run = solve(base)

    def at(value):
        return build_problem(with_number(case, "material.young", value), SELF)

    parameter = {"E": Parameter(1.0, at)}
    work = {
        "compliance": lambda problem, state: -0.01 * float(problem.equilibrium.motion(state.x)[1])
    }
    found = sensitivity(run, work, parameter)
    named = sensitivity(run, ["rigid_y"], parameter, "adjoint")
    assert found.method == "tangent"
    assert found["compliance"]["E"] == pytest.approx(-0.01 * named["rigid_y"]["E"], rel=1e-7)
    with pytest.raises(InputError, match="'compliance' has no gradient; accepted: 'tangent'"):
        sensitivity(run, work, parameter, "adjoint")
    with pytest.raises(InputError, match="built in Python; accepted"):
        sensitivity(run, ["rigid_y"], ["material.young"])


def test_hertz_exponents():
    # P = (4/3) E* R^(1/2) d^(3/2): of a half space, which the block is not, E alone is exact
    case = indented(displacement=[0.0, -0.02])
    run = solve(case, comm=SELF)
    keys = ["material.young"]
    found = sensitivity(run, ["contact_force_y", "max_pressure"], keys)
    for name in found:
        value = named_quantities(run.problem)[name](run.problem, run.state)
        assert found[name]["material.young"] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("family", ["number", "evolution", "two bodies", "3-D"])
def test_gradient_by_the_gap(family):
    data = problem(FAMILIES.index(family))[1]
    data["contact"].setdefault("gap", 0.0)
    base = build_problem(parse_case(data), SELF)
    times = None if family != "evolution" else [1 / 3, 2 / 3, 1.0, 4 / 3, 5 / 3, 2.0, 2.5, 3.0]
    tight = NewtonOptions(tolerance=1e-13)
    name = "max_pressure" if family == "two bodies" else "contact_force_y"
    gradient = gap_gradient(solve(base, tight, times=times), name)
    change = np.cos(3 * base.nodes.points[:, 0])

    def force(way):
        there = copy(base)
        jump = replace(base.nodes, gap=base.nodes.gap + way * change)
        there.interface = replace(base.interface, jump=jump)
        run = solve(there, tight, times=times)
        return named_quantities(there)[name](run.problem, run.state)

    way = 1e-7
    assert gradient @ change == pytest.approx((force(way) - force(-way)) / (2 * way), rel=1e-6)


def test_weakly_active_nodes_are_named(monkeypatch):
    # a block that rests without friction on a plane: pushed by exactly mu p it is at the border
    data = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "top", "displacement": [0.0, -0.01]}],
        "contact": {"on": "bottom", "gap": 0.01},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    run, said = solve(parse_case(data), comm=SELF), []
    monkeypatch.setattr(logger, "warning", lambda text, *_: said.append(text))
    found = sensitivity(run, ["max_pressure"], ["fixed.0.displacement.1"])
    assert len(found.weakly_active) == 5
    assert found.weakly_active[:, 1] == pytest.approx(np.zeros(5), abs=1e-12)
    assert "between two states" in said[0]


@pytest.mark.parametrize(
    ("quantity", "parameter", "message"),
    [
        ("pressure", "friction.mu", r"quantities: given 'pressure'; accepted: max_pressure, "),
        ("max_pressure", "friction.nu", r"friction.nu: nothing stands there; accepted: a key with"),
        ("max_pressure", "friction.law", r"friction.law: 'coulomb' stands there; accepted"),
        ("max_pressure", "mesh.cells.0", r"mesh.cells.0: .*accepted"),
    ],
)
def test_refused(quantity, parameter, message):
    run = solution(0)
    with pytest.raises(InputError, match=message):
        sensitivity(run, [quantity], [parameter])


def test_an_end_that_has_not_converged_is_refused():
    data = problem(FAMILIES.index("log"))[1]
    data["solver"] = {"max_outer": 1}
    run = solve(parse_case(data), comm=SELF)
    assert not run.converged
    with pytest.raises(InputError, match="accepted: one that has converged"):
        sensitivity(run, ["max_pressure"], ["friction.mu"])
