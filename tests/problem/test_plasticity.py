"""Bodies of flow theory in evolutions: contact, friction, several materials, methods, ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, NewtonOptions, evolve, parse_case, solve
from contact.case.build import build_problem
from contact.cli.solve import solve_and_keep
from contact.errors import InputError
from contact.io.checkpoint import read_steps
from contact.io.fields import write_fields
from tests.problems.mechanics import close
from tests.problems.plasticity import homogeneous, homogeneous_values

YOUNG, LIMIT = 200e3, 250.0
HARDENING = {
    "linear": {"hardening": 2e3, "kinematic": 3e3},
    "voce": {"hardening": {"saturation": 100.0, "rate": 200.0}},
    "chaboche": {"kinematic": [{"modulus": 50e3, "recovery": 400.0}, {"modulus": 2e3}]},
}


def block(hardening="linear", cells=6, degree=1, mu=0.3, **more):
    """Return a block that is pressed onto a foundation, sheared, and lifted half of the way."""
    driven = ["4e-3*min(max(t-1,0),1)", "-4e-3*min(t,1) + 2e-3*max(t-2,0)"]
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [2 * cells, cells]},
            "space": {"degree": degree},
            "material": {
                **{"law": "j2", "young": YOUNG, "poisson": 0.3, "yield_stress": LIMIT},
                **HARDENING[hardening],
            },
            "fixed": [{"on": "top", "displacement": driven}],
            "contact": {"on": "bottom", "friction": {"law": "coulomb", "mu": mu}},
            "evolution": {"times": [0.0, 1.0, 2.0, 3.0], "steps": [2, 2, 2]},
            **more,
        }
    )


def totals(solution):
    """Return forces of all steps, and the work of plastic flow."""
    names = ("contact_force_x", "contact_force_y", "plastic_dissipation")
    return np.array([[step.row[name] for name in names] for step in solution.steps])


@pytest.mark.core
def test_confined_block_on_a_smooth_foundation():
    """Yield, unloading, reversed yield and lifting off in the oedometer, in closed form."""
    pressed = [0.001625, 0.004875, 0.004875 - 875 / 269230.76923, 0.001, 0.0005]
    given = {"young": YOUNG, "yield_stress": LIMIT}
    times = [float(i + 1) for i in range(len(pressed))]
    solution = solve(homogeneous("oedometer", given, times, [-value for value in pressed]))
    assert solution.converged
    forces = [step.row["contact_force_y"] for step in solution.steps]
    last = 979.1667 - 875
    known = [437.5, 979.1667, last, last - 166666.667 * (pressed[2] - 0.001), 0.0]
    assert forces == pytest.approx([-p for p in known], abs=1e-4)
    stress, _, _ = homogeneous_values(solution, 3)
    assert stress[0, 0] == pytest.approx(-250.0, abs=1e-4)


@pytest.mark.core("voce")
@pytest.mark.parallel
@pytest.mark.parametrize("hardening", [*HARDENING][-1 if MPI.COMM_WORLD.size > 2 else 1 :])
def test_a_restart_goes_on_with_the_same_history(tmp_path, hardening):
    comm = MPI.COMM_WORLD
    tmp_path = comm.bcast(tmp_path)
    given = block(hardening)
    whole = solve_and_keep(given, None, comm, tmp_path)
    assert whole.converged and len(whole.steps) == 6
    steps = read_steps(tmp_path, build_problem(given, comm))
    for one, two in zip(whole.steps, steps, strict=True):
        assert close(one.state, two.state, rtol=1e-12, atol=1e-18)
    # From any step on, on any number of ranks; on one bit for bit. On several, sums are rounded as
    # messages arrive: two uninterrupted runs differ as well.
    here = comm.allreduce(accumulated(whole.problem, whole.state), op=MPI.SUM)
    times = [step.state.time for step in steps]
    for other, rel in ((comm, 0.0 if comm.size == 1 else 1e-12), (MPI.COMM_SELF, 1e-12)):
        problem = build_problem(given, other)
        states = [step.state for step in read_steps(tmp_path, problem)]
        *_, last = evolve(problem, times[3:], start=states[2], before=states[1])
        found = other.allreduce(accumulated(problem, last), op=MPI.SUM)
        assert found == pytest.approx(here, rel=rel, abs=0.0)
    # Without the state before, another initial guess ends within the tolerance.
    *_, last = evolve(problem, times[3:], start=states[2])
    assert accumulated(problem, last) == pytest.approx(here, rel=1e-7, abs=0.0)


def accumulated(problem, state):
    """Return the integral of the equivalent plastic strain over the cells of this rank."""
    a = problem.commit(state).arrays()["material.equivalent_plastic_strain"]
    return float(problem.body.laws.volumes @ a)


@pytest.mark.core("voce-2")
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("hardening", list(HARDENING))
def test_methods_agree(hardening, degree):
    """Condensed and whole body, chord steps or not, and the fixed points of the thesis."""
    given, found = block(hardening, cells=3, degree=degree), {}
    for name, options in {
        "condensed": NewtonOptions(),
        "no chord steps": NewtonOptions(reuse="never"),
        "whole": NewtonOptions(condense=False),
        "uzawa": FixedPointOptions(max_outer=500),
    }.items():
        solution = solve(given, options)
        assert solution.converged, (name, solution.outcome.reason)
        found[name] = totals(solution)
    scale = np.abs(found["whole"]).max(axis=0)
    for name, values in found.items():
        assert np.abs((values - found["whole"]) / scale).max() < 1e-6, name
    assert found["whole"][:, 2].min() >= 0 and found["whole"][:, 2].max() > 0


def test_the_files_of_all_steps_have_the_plastic_strain(tmp_path):
    solution = solve(block(cells=2))
    write_fields(solution, tmp_path)
    files = sorted(tmp_path.glob("fields-*.vtu"))
    assert len(files) == len(solution.steps) == 6
    for path in files:
        text = path.read_text(errors="replace")
        for name in ("plastic_strain", "equivalent_plastic_strain", "back_stress_1"):
            assert f'Name="{name}"' in text
            assert f'Name="{name}_cell"' in text


def test_recovery_is_condensed_by_the_symmetric_part():
    """Its tangent is not symmetric: chord steps lead to the solution of the whole body."""
    found = {}
    for condense in (True, False):
        settings = NewtonOptions(tolerance=1e-11, condense=condense)
        solution = solve(block("chaboche", degree=2), settings)
        assert solution.converged, solution.outcome.reason
        found[condense] = totals(solution)
        chord = any("chord step" in record.note for record in solution.history)
        assert chord == condense
    scale = np.abs(found[False]).max(axis=0)
    assert np.abs((found[True] - found[False]) / scale).max() < 1e-9


def test_checkpoints_of_other_materials_are_refused(tmp_path):
    """They have a back stress less."""
    folder = MPI.COMM_WORLD.bcast(tmp_path)
    assert solve_and_keep(block(), None, MPI.COMM_WORLD, folder).converged
    assert len(read_steps(folder, build_problem(block()))) == 6
    with pytest.raises(InputError, match=r"\[other-checkpoint\]"):
        read_steps(folder, build_problem(block("chaboche")))
