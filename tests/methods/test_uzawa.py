"""Block relaxation and the fixed point around it: counts, options, and honest ends."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, FixedPointOptions, Friction, build_problem, parse_case
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Linear, Log
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import (
    Affine,
    attempt,
    bar,
    contact_data,
    flat,
    pressed_block,
    solve,
)


@pytest.mark.core
@pytest.mark.parametrize(
    ("n", "f2", "rho", "pressure", "largest"),
    [
        (16, -0.005, 1e5, 0.01367, 0.00499),
        (32, -0.005, 1e5, 0.01679, 0.00501),
        (32, -0.05, 1e5, 0.14840, 0.05022),
        (32, -0.05, 6e7, 0.14806, 0.05022),
    ],
)
def test_reference_values_of_another_code(n, f2, rho, pressure, largest):
    problem = bar(MPI.COMM_SELF, n, f2, rho)
    loop = solve(problem, 1e-8)
    assert loop.state.multipliers.contact.max() == pytest.approx(pressure, abs=5.1e-6)
    assert np.abs(loop.state.x).max() == pytest.approx(largest, abs=5.1e-6)


def coarse(**options):
    law = Log(1.0, 0.3, yield_strain=0.05)
    friction = Friction(ConstantCoefficient(0.4))
    return solve(bar(MPI.COMM_SELF, 8, -0.05, law=law, friction=friction), **options)


@pytest.fixture(scope="module")
def reference():
    return contact_data(coarse(tolerance=1e-11))


PLAIN = {"acceleration": "none"}

VARIANTS = [
    {**PLAIN, "max_inner": 20000},
    {**PLAIN, "relaxation": 1.7, "max_inner": 20000},
    {"depth": 1},
    {"depth": 3},
    {"depth": 60},
    {"single_loop": True},
    {"material_step": "secant"},
    {"material_step": "tangent"},
    {"r": 0.3},
    {"r": 30.0},
]


@pytest.mark.core
@pytest.mark.parametrize("options", VARIANTS, ids=str)
def test_every_variant_finds_the_same_solution(options, reference):
    data = contact_data(coarse(tolerance=1e-9, **options))
    for name in ("pressure", "friction", "u_t", "u_n"):
        assert np.abs(data[name] - reference[name]).max() < 1e-7 * reference["pressure"].max()


def test_acceleration_and_over_relaxation_save_solves():
    counts = [
        coarse(tolerance=1e-8, max_inner=20000, **options).counters.linear_solves
        for options in (PLAIN, {**PLAIN, "relaxation": 1.7}, {})
    ]
    # what the parameters of Algorithm 1 are for
    assert counts[2] < 0.7 * counts[1] < 0.7 * counts[0]


def test_factorisations_are_kept():
    """One for the start and one for all steps with friction, if the material is linear."""
    linear = bar(MPI.COMM_SELF, 8, law=Linear(1.0, 0.3))
    loop = solve(linear)
    assert loop.counters.factorizations == 2
    assert len(loop.history) > 3
    free = bar(MPI.COMM_SELF, 8, law=Linear(1.0, 0.3), friction=Friction())
    assert solve(free).counters.factorizations == 1
    loop = solve(bar(MPI.COMM_SELF, 8, -0.05))
    assert loop.counters.factorizations == len(loop.history)
    assert loop.counters.linear_solves == sum(record.inner for record in loop.history)


@pytest.mark.core
def test_tresca_friction_is_one_step():
    """A given bound leaves nothing for the outer loop to update."""
    friction = Friction(tresca=Affine((0.001, 0.0), 0.0005))
    loop = solve(bar(MPI.COMM_SELF, 8, law=Linear(1.0, 0.3), friction=friction))
    assert len(loop.history) == 2
    data = contact_data(loop)
    size = np.linalg.norm(data["friction"], axis=1)
    assert np.all(size <= data["bound"] * (1 + 1e-9))
    assert data["bound"] == pytest.approx(0.001 * data["points"][:, 0] + 0.0005)
    slides = size > 0.999 * data["bound"]
    assert slides.any()
    assert not slides.all()
    # Friction resists: the body drags the foundation along.
    assert np.all(np.sum(data["friction"] * data["u_t"], axis=1) >= -1e-12)


@pytest.mark.parametrize("gap", [1e-3, 1.0, 1e3])
def test_a_wide_gap(gap):
    """The body is constrained by nothing until it touches."""
    loop = solve(pressed_block(MPI.COMM_SELF, 2, gap=gap), 1e-9)
    assert loop.state.multipliers.contact == pytest.approx(0.02, abs=1e-9)


def test_the_single_loop_needs_no_outer_one():
    """One solve after the other, with the bound of the newest pressure and slip."""
    problem = bar(MPI.COMM_SELF, 32, law=Linear(1.0, 0.3))
    loop = solve(problem, 1e-8, single_loop=True)
    assert len(loop.history) == 1
    twice = solve(bar(MPI.COMM_SELF, 32, law=Linear(1.0, 0.3)), 1e-8)
    assert loop.state.multipliers.contact == pytest.approx(
        twice.state.multipliers.contact, abs=1e-8
    )


def test_the_augmentation_parameter():
    problem = bar(MPI.COMM_SELF, 16)
    h = 4.0 / 64
    found = problem.scales.c
    assert found == pytest.approx(1.39 / (1 - 0.3**2) / np.sqrt(h * 1.0), rel=1e-12)
    fine = bar(MPI.COMM_SELF, 8, degree=2)
    assert fine.scales.c == pytest.approx(found, rel=1e-12)


#: More than numbers can give.
ROUNDING = {"tolerance": 1e-18, "inner_tolerance": 1e-18, "max_inner": 10**6}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"max_outer": 1}, "1 outer iterations"),
        ({"max_inner": 3, "max_outer": 8}, "8 outer iterations"),
        ({"stopping": "thesis", "eps": 1e-3, "eps_fp": 1e-3}, "criterion is met, but"),
        ({"r": 1e7, "max_inner": 5}, "stalled at"),
        ({**PLAIN, "r": 1e-7, "max_inner": 2}, "stalled at"),
        ({**ROUNDING, "stopping": "thesis", "eps": 1e-17}, "criterion is met, but"),
    ],
)
def test_a_run_that_has_not_converged_says_so(options, words):
    loop, outcome = attempt(bar(MPI.COMM_SELF, 8), **options)
    assert not outcome.converged
    assert words in outcome.reason
    assert outcome.residuals.largest > options.get("tolerance", 1e-8)
    found = [record.residuals for record in loop.history]
    last = "stopping" in options
    assert outcome.residuals == (found[-1] if last else min(found, key=lambda each: each.largest))


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {**PLAIN, "r": 3.0}])
def test_all_digits_are_found(options):
    """What is held is about the iterate: nothing is lost beneath it."""
    _, outcome = attempt(bar(MPI.COMM_SELF, 8), **ROUNDING, **options)
    assert outcome.residuals.significant < 1e-15


def test_the_rules_of_the_thesis_end_the_loops():
    loop, outcome = attempt(bar(MPI.COMM_SELF, 8), stopping="thesis", tolerance=1e-3)
    assert outcome.converged
    assert "criterion" in outcome.reason
    assert loop.history[-1].change < 1e-5
    assert 3 <= len(loop.history) - 1 <= 12  # as in Table 7.1
    free = bar(MPI.COMM_SELF, 8, friction=Friction())
    assert attempt(free, stopping="thesis", tolerance=1e-3)[1].converged


def test_a_start_from_the_solution_takes_one_step():
    """A disturbed one leads back. Nothing has to be frozen before, or remembered."""
    problem = bar(MPI.COMM_SELF, 8)
    exact = solve(problem).state
    for disturbance in (0.0, 1e-3):
        start = State((1 + disturbance) * exact.x, exact.multipliers)
        loop = FixedPoint(problem, FixedPointOptions(tolerance=1e-9))
        state, outcome = loop.solve(start)
        assert outcome.converged
        assert disturbance > 0 or len(loop.history) == loop.counters.linear_solves == 1
        assert np.allclose(state.x, exact.x, rtol=0, atol=1e-7 * np.abs(exact.x).max())


def test_what_is_frozen_may_change_to_and_fro():
    """A voltage bends a beam onto a foundation that grounds it: then nothing bends it any more."""
    charge = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}
    case = {
        "mesh": {"generator": "rectangle", "size": [40.0, 1.0], "cells": [40, 1]},
        "material": {"young": 58.7102, "poisson": 0.3912, "piezo": charge},
        "fixed": [
            {"on": "left", "displacement": [0.0, 0.0]},
            {"on": "top", "potential": 0.3},
        ],
        "load": [{"on": "right", "traction": [0.0, -58.7 * 0.2 / 40.0**3]}],
        "contact": {"on": "bottom", "gap": 0.01},
        "electric": {"k_e": 1e3, "phi_f": 0.0, "delta": 10.0},
    }
    problem = build_problem(parse_case(case), MPI.COMM_SELF)
    options = FixedPointOptions(r=0.06, depth=60)  # that of a block fits no slender beam
    _, outcome = FixedPoint(problem, options).solve()
    assert not outcome.converged
    assert "conducting nodes" in outcome.reason


def test_nothing_to_do():
    """No load: a body at rest on its foundation, and one that does not touch it."""
    for gap in (0.0, 1.0):
        example = bar(MPI.COMM_SELF, 4)
        body = Body(example.description.law, example.description.fixed)
        contact = example.contacts[0].model_copy(update={"foundation": flat(gap)})
        problem = ContactProblem(example.domain, body, contact)
        loop = solve(problem)
        assert np.abs(loop.state.x).max() < 1e-14
        assert np.abs(loop.state.multipliers.contact).max() < 1e-14
    lifted = bar(MPI.COMM_SELF, 4, 0.005)
    gapped = ContactProblem(lifted.domain, lifted.description, Contact("bottom", flat(5.0)))
    assert np.abs(solve(gapped).state.multipliers.contact).max() < 1e-13
