"""Starts: used, and said to be what they are; refused where they would be ignored."""

from dataclasses import replace

import numpy as np
import pytest

from contact import (
    FixedPointOptions,
    InputError,
    NewtonOptions,
    PenaltyOptions,
    build_problem,
    load_case,
    solve,
)
from contact.interface.multipliers import Multipliers
from contact.refining import prolong
from scripts.cases import CASES

SMALL = ["mesh.cells=[16, 4]", "solver.method=newton"]


def bar(*changes: str):
    return load_case(CASES / "bar.toml", [*SMALL, *changes])


@pytest.mark.core
@pytest.mark.parametrize("options", [NewtonOptions(), FixedPointOptions(), PenaltyOptions()])
def test_a_solution_is_found_again_at_once(options):
    problem = build_problem(bar())
    cold = solve(problem, options)
    warm = solve(problem, options, start=cold.state)
    assert cold.converged and warm.converged
    assert sum(r.inner for r in warm.history) < sum(r.inner for r in cold.history)
    assert warm.contact_force == pytest.approx(cold.contact_force, rel=1e-6)
    assert (cold.start, warm.start) == ("the zero initial guess", "the state that was given")


@pytest.mark.parallel
def test_a_coarse_state_is_linear_between_its_nodes_on_any_ranks():
    """Pressures 1 + x at the coarse nodes, of whatever ranks these are, are so at all between."""
    coarse, fine = (build_problem(bar(f"mesh.cells={cells}")) for cells in ("[16, 4]", "[64, 16]"))
    x = coarse.nodes.points[:, 0]
    ends = -coarse.nodes.maximum(-x, -np.inf), coarse.nodes.maximum(x)
    forces = Multipliers.of(coarse.nodes, 1 + x, np.zeros((x.size, 2)))
    found = prolong(coarse, replace(coarse.start(), forces=forces), fine).forces.pressure
    at = fine.nodes.points[:, 0]
    between = (at >= ends[0]) & (at <= ends[1])
    assert fine.comm.allreduce(int(between.sum())) > 50
    assert found[between] == pytest.approx(1 + at[between], abs=1e-6)


@pytest.mark.core
def test_the_solution_of_a_case_starts_another():
    """With other loads: prescribed values are those of the new problem."""
    first = solve(bar("load.0.traction=[0, -0.004]"))
    case = bar("solver.tolerance=1e-11")
    warm, cold = (solve(case, start=start) for start in (first.state, None))
    assert warm.contact_force == pytest.approx(cold.contact_force, rel=1e-7)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"law": 1}, r"\[ignored-argument\]"),
        ({"settings": NewtonOptions(nested=True)}, r"\[ignored-argument\]"),
    ],
)
def test_what_a_problem_would_ignore_is_refused(given, message):
    with pytest.raises(InputError, match=message):
        solve(build_problem(bar()), **given)
