"""Cost of the methods: factorisations, solves and iterations, not seconds.

Other tests assert no counts, but of the thesis's algorithms, whose counts are results.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, nesting
from contact.case.file import parse_case
from contact.errors import InputError
from contact.history import BodyState
from contact.linear import multigrid
from contact.linear.operator import SparseOperator
from contact.methods.options import NewtonOptions
from contact.results.solution import Solution
from contact.solving import solve
from scripts.benchmarks.bench_one import block
from scripts.cases import bar
from scripts.studies.cantilevers import UNIFORM as PUSHED
from scripts.studies.cantilevers import cantilever
from scripts.studies.robustness.problems import problems
from tests.methods.test_nothing_touches import CASE as BLOCKS
from tests.methods.test_overload import wall
from tests.methods.test_slender import TIP, UNIFORM, beam
from tests.problems import pairs
from tests.problems.rigid import indented
from tests.problems.rings import between_plates, squeezed

SELF = MPI.COMM_SELF
CASE = -0.05, 1e5, "friction.mu=0.5"

#: Largest displacement of the block, found by a direct solver.
LARGEST = 0.0366836772


def of_case(case: dict[str, Any], *options: NewtonOptions, **given: Any) -> Callable[[], Solution]:
    return lambda: solve(parse_case(case), *options, comm=SELF, **given)


def drawn(name: str, kind: str = "hard", **mesh: str) -> Callable[[], Solution]:
    """Return the solution of a random problem."""

    def solution() -> Solution:
        tables = next(problems(kind, name)).tables
        case = parse_case({**tables, "mesh": tables["mesh"] | mesh})
        return solve(build_problem(case, SELF), NewtonOptions())

    return solution


def evolution(**more: Any) -> dict[str, Any]:
    """Return blocks that move in time."""
    return {**BLOCKS, **more}


def clamped(case: dict[str, Any]) -> dict[str, Any]:
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    return case


def ring() -> Solution:
    case = squeezed("newton", way=0.3, traction=(0.0, -1e-3))
    return solve(case, domain=between_plates(SELF, 1))


TOUCH = {"on": "upper_bottom", "against": "lower_top"}
LIFTED = {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*sin(pi*t)"]}
LIGHT = {"on": "top", "traction": [0.0, -1e-13]}
LONG = {"space": {"degree": 2}}

#: Problem -> (solution, what is seen: solves of the whole body, factorisations, and Newton
#: iterations on the condensed problem).
SEEN: dict[str, tuple[Callable[[], Solution], tuple[int, int, int]]] = {
    "beam on a stop": (of_case(beam(100.0, [200, 2], TIP, 0.5)), (1, 1, 3)),
    "beam on a stop, friction": (of_case(beam(100.0, [200, 2], TIP, 0.5, 0.3)), (1, 1, 3)),
    "beam on the ground": (of_case(beam(100.0, [400, 4], UNIFORM, 0.5)), (1, 1, 24)),
    "long beam": (of_case(beam(1000.0, [400, 1], LIGHT, 0.1, 0.8, **LONG)), (6, 4, 0)),
    "beam, iterative": (
        of_case(beam(100.0, [200, 2], TIP, 0.5, solver={"linear": "iterative"})),
        (4, 2, 0),
    ),
    "beam clamped at both ends": (
        of_case(clamped(beam(40.0, [160, 4], {"on": "top", "traction": [0.0, -3.9e-5]}, 0.3, 0.3))),
        (1, 1, 34),
    ),
    "beam on all of its length": (
        of_case(beam(600.0, [1200, 2], {"on": "top", "traction": [0.0, -1e-3]}, 0.0, 0.3)),
        (2, 2, 0),
    ),
    "beam, sparse interior point": (of_case(beam(100.0, [600, 2], UNIFORM, 0.5, 0.3)), (33, 20, 0)),
    "bimorph on a conductor": (drawn("bimorph-3"), (1, 1, 19)),
    "bimorph on a good conductor": (drawn("bimorph-8"), (1, 1, 33)),
    "unsupported block": (drawn("unsupported-5"), (1, 1, 4)),
    "beam pressed along the ground": (drawn("lifted-4"), (7, 7, 0)),
    "far in the plastic range": (drawn("yielding-0"), (10, 6, 24)),
    "farther in the plastic range": (drawn("yielding-1"), (15, 10, 44)),
    "falling friction": (drawn("bar-67", "plain", cell="quadrilateral"), (2, 1, 16)),
    "blocks that approach each other": (of_case(evolution()), (2, 1, 2)),
    "blocks that part": (
        of_case(
            evolution(
                fixed=[BLOCKS["fixed"][0], LIFTED],
                contact=TOUCH,
                evolution={"times": [0.0, 1.8], "steps": [6]},
            )
        ),
        (6, 1, 15),
    ),
    "block on a block": (of_case(pairs.case()), (1, 1, 3)),
    # From 16 to 231 in 170 runs with moduli that differ by rounding.
    "ring between plates": (ring, (2, 1, 231)),
    # From 47 to 381 in 120 runs with moduli that differ by 1e-12: all nodes slide. Proximal points,
    # tried after that, take as many.
    "block that friction cannot hold": (
        lambda: solve(wall(2, 1.01), comm=SELF),
        (1, 1, 844),
    ),
    "indenter under a force": (
        lambda: solve(indented(2, 10, displacement=[0.0, "free"], force=[0.0, -0.01]), comm=SELF),
        (1, 1, 4),
    ),
    "indenter under a force, 3-D": (
        lambda: solve(
            indented(3, 4, displacement=[0.0, 0.0, "free"], force=[0.0, 0.0, -0.01]), comm=SELF
        ),
        (1, 1, 2),
    ),
    "bar that yields": (lambda: solve(bar(16, *CASE), comm=SELF), (9, 1, 15)),
    "linear bar": (lambda: solve(bar(16, *CASE, "material.law=linear"), comm=SELF), (1, 1, 6)),
}


@pytest.mark.parametrize("name", SEEN)
def test_at_most_twice_what_is_seen(name: str) -> None:
    make, seen = SEEN[name]
    counters = make().counters
    counts = (counters.linear_solves, counters.factorizations, counters.contact_solves)
    assert all(count <= 2 * most for count, most in zip(counts, seen, strict=True)), counts


def test_a_large_body_that_yields_is_factorised_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tangent is that of a coarser mesh's solution, without being asked for."""
    cold = solve(bar(32, *CASE))
    assert cold.start == "the zero initial guess"
    monkeypatch.setitem(nesting.MANY, "condensed", 8000)
    found = solve(bar(32, *CASE))
    assert found.start == "the solution on a coarser mesh"
    assert found.converged
    assert found.counters.factorizations == 1
    assert found.counters.linear_solves < cold.counters.linear_solves
    assert np.allclose(found.pressure, cold.pressure, rtol=0, atol=1e-6 * cold.pressure.max())


@pytest.mark.parametrize(
    "change", ["solver.nested=false", "material.law=linear", "mesh.parts.loaded.from=2.125"]
)
def test_else_it_starts_from_rest(monkeypatch: pytest.MonkeyPatch, change: str) -> None:
    """A linear body is factorised once in any case; a part may not end on the coarser grid."""
    monkeypatch.setitem(nesting.MANY, "condensed", 100)
    assert solve(bar(8, *CASE, change)).start == "the zero initial guess"


def test_a_slender_body_starts_from_a_coarser_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it a linear beam that lies down takes more than twice as many factorisations."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    beam = cantilever(PUSHED, [640, 8], 2, 0.3, 0.5)
    found, cold = solve(parse_case(beam)), solve(parse_case({**beam, "solver": {"nested": False}}))
    assert (found.start, cold.start) == ("the solution on a coarser mesh", "the zero initial guess")
    assert found.converged and cold.converged
    assert 2 * found.counters.factorizations < cold.counters.factorizations
    assert np.allclose(found.state.x, cold.state.x, rtol=0, atol=1e-7)


def test_a_coarser_mesh_that_does_not_fit_the_case_is_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With an odd number of cells it has other nodes, at one of which this mu is negative."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    beam = cantilever(PUSHED, [803, 9], 1, 0.0, 0.5)
    beam["mesh"]["size"] = [402.0, 1.0]
    beam["friction"] = {"law": "coulomb", "mu": "0.05 * sqrt(abs(x - 200)) - 0.0005"}
    found = solve(parse_case(beam))
    assert (found.start, found.converged) == ("the zero initial guess", True)
    with pytest.raises(InputError, match=r"mu.* at a node"):
        solve(parse_case({**beam, "solver": {"nested": True}}))


@pytest.fixture
def small_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a mesh of some thousand unknowns be solved like one of a million."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    monkeypatch.setitem(multigrid.LARGE, (3, False), 1000)
    monkeypatch.setitem(multigrid.DEFAULTS, "pc_gamg_coarse_eq_limit", "200")


def largest(solution: Solution) -> float:
    """Return the largest displacement component."""
    here = np.abs(solution.state.x).max(initial=0.0)
    return float(solution.problem.comm.allreduce(here, op=MPI.MAX))


@pytest.mark.parallel
@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize(
    ("solver", "start", "iterations"),
    [({}, "the solution on a coarser mesh", 5), ({"nested": False}, "the zero initial guess", 6)],
    ids=["nested", "cold"],
)
def test_a_block_costs_few_set_ups_and_iterations(
    solver: dict[str, bool], start: str, iterations: int
) -> None:
    """A nested start is the program's own choice; coarse levels are not made in every step."""
    solution = solve(block(8, **solver))
    counters = solution.counters
    assert solution.converged
    assert solution.start == start
    assert largest(solution) == pytest.approx(LARGEST, rel=1e-7)
    assert counters.linear_solves <= 9
    assert counters.factorizations <= 2
    assert counters.linear_iterations <= iterations * counters.linear_solves


@pytest.mark.usefixtures("small_is_large")
def test_a_direct_solver_factorises_a_large_body_once():
    """It is condensed then, as where bodies are small: multigrid alone has each step anew."""
    law = {"young": 1.0, "poisson": 0.3}
    solution, other = (solve(block(6, law, linear=linear)) for linear in ("lu", "auto"))
    assert solution.converged
    assert other.converged
    assert largest(solution) == pytest.approx(largest(other), rel=1e-7)
    assert solution.counters.linear_solves == solution.counters.factorizations == 1
    assert other.counters.linear_solves > 1


@pytest.mark.usefixtures("small_is_large")
def test_coarse_levels_that_are_new_are_not_renewed_for_a_correction(monkeypatch):
    """Of the same operator they would be the same; those of an earlier one are renewed."""

    def correct(_, rhs, solution, solve, __) -> None:
        solve(rhs.copy(), solution.duplicate())

    monkeypatch.setattr(multigrid, "refine", correct)
    problem = build_problem(block(6))
    body, nodes = problem.equilibrium, problem.nodes.nodes
    operator, x = SparseOperator(body, nodes), problem.start().x
    blocks = np.zeros((nodes.size, body.block_size, body.block_size))
    for stiffness, made in ((0.0, 1), (1.0, 2)):
        operator.update(
            "secant", BodyState(x), blocks + stiffness * np.eye(body.block_size), constant=True
        )
        operator.solve(body.external(), 1e-8)
        assert operator.counters.factorizations == made


@pytest.mark.usefixtures("small_is_large")
@pytest.mark.parametrize("rtol", [0.9, 1e-8])
def test_the_iterations_a_digit_are_those_that_were_gained(monkeypatch, rtol):
    """One iteration for a twentieth of a digit was taken for 22 a digit: nothing was ever lost."""

    def correct(ksp, rhs, solution, solve, _) -> None:
        asked_for = ksp.getTolerances()[0]
        ksp.setTolerances(rtol=rtol)
        solve(rhs.copy(), solution.duplicate())
        ksp.setTolerances(rtol=asked_for)

    problem = build_problem(block(6))
    body, nodes = problem.equilibrium, problem.nodes.nodes
    operator, x = SparseOperator(body, nodes), problem.start().x
    for stiffness in (0.0, 1.0):
        operator.update(
            "secant", BodyState(x), stiffness * np.stack(nodes.size * [np.eye(3)]), constant=True
        )
        operator.solve(body.external(), 1e-8)
        monkeypatch.setattr(multigrid, "refine", correct)
    assert operator.counters.factorizations == 2
    assert operator._hierarchy._rate < 4
