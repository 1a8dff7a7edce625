"""Friction from which on there may be several solutions, by the solution's own Jacobian.

Where several solutions may exist it is said, also of nearly incompressible bodies.
The other side of contacts between bodies: forces and pressures, tables and figures.
Starts: used, and said to be what they are; refused where they would be ignored.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, InputError, PenaltyOptions, build_problem, load_case, solve
from contact.case.file import parse_case
from contact.interface.multipliers import Multipliers
from contact.mesh.contents import Contents
from contact.methods.options import NewtonOptions
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.obstacle import GapFunction
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.refining import prolong
from contact.results.contact_nodes import opposite_surface
from contact.results.uniqueness import uniqueness
from contact.solving import solve_problem
from forms.hencky import Linear
from scripts.cases import CASES
from scripts.studies.robustness.bodies import Bodies
from scripts.studies.robustness.check import Mesh, write_msh
from scripts.studies.robustness.problems import problems
from tests.problems import files
from tests.problems.blocks import Blocks
from tests.problems.clamped import clamped
from tests.problems.mechanics import constant
from tests.problems.rings import between_plates, squeezed

SAID = "several solutions may exist"


def triangle(folder, mu, load, method="newton", height=0.5345, poisson=0.3):
    """Return one triangle on a plane, clamped along its slope: one contact node, at the origin."""
    mesh = Mesh(
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, height]]), np.array([[0, 1, 2]]), np.array([0]),
        ["body"], {"bottom": np.array([[0, 1]]), "slope": np.array([[1, 2]]),
                   "side": np.array([[0, 2]])},
    )  # fmt: skip
    write_msh(mesh, folder / "triangle.msh")
    return parse_case({
        "mesh": {"file": str(folder / "triangle.msh")},
        "material": {"young": 1.0, "poisson": poisson},
        "fixed": [{"on": "slope", "displacement": [0.0, 0.0]}],
        "load": [{"on": "side", "traction": load}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": mu},
        "solver": {"method": method},
    })  # fmt: skip


@pytest.mark.core
@pytest.mark.parametrize(("height", "poisson"), [(0.5345, 0.3), (1.0, 0.3), (0.3, 0.45)])
def test_critical_friction_of_a_triangle_in_closed_form(height, poisson, tmp_path):
    """K = lambda g g + mu (g g + |g|^2 I), g = (1, 1/h): K_tt/|K_nt| is the critical mu."""
    case = triangle(tmp_path, 0.5, [0.01, -0.01], height=height, poisson=poisson)
    solution = solve(case, comm=MPI.COMM_SELF)
    ratio = 2 * poisson / (1 - 2 * poisson)
    critical = (ratio + 2 + 1 / height**2) * height / (ratio + 1)
    assert 0.5 * solution.critical_factor == pytest.approx(critical, rel=1e-10)


@pytest.mark.parametrize("method", ["newton", "uzawa"])
@pytest.mark.parametrize(("mu", "warned"), [(0.5, False), (1.49, False), (1.5, True), (3.0, True)])
@pytest.mark.parametrize("load", [[0.01, -0.01], [-0.01, -0.01], [-0.01, 0.005]])
def test_several_solutions_of_a_triangle_are_warned_of(mu, warned, load, method, tmp_path):
    """The node slips, sticks or has lifted off: one sticks where another method lets it go."""
    solution = solve(triangle(tmp_path, mu, load, method), comm=MPI.COMM_SELF)
    assert solution.converged
    said = [text for text in solution.warnings if SAID in text]
    assert bool(said) is warned
    assert not warned or "a friction coefficient of 1.497 on" in said[0]


def test_a_body_on_supports_that_friction_alone_keeps_in_contact(tmp_path):
    """It sticks, and without contact forces lifts off: nothing is jammed, nor lacks a support."""
    solution = solve(triangle(tmp_path, 3.0, [-0.02, -0.01]), comm=MPI.COMM_SELF)
    assert solution.converged and solution.pressure.max() > 0 and solution.jammed
    (said,) = [text for text in solution.warnings if "[several-solutions]" in text]
    assert "friction alone keeps the bodies in contact, which" in said


def under_a_cylinder(method):
    """Return a block on a plane, pressed by a rigid cylinder up whose flanks it slides."""
    ball = {"shape": "sphere", "centre": [1.07, 2.4], "radius": 1.6}
    pressed = {"displacement": [0.0, "free"], "force": [0.0, -0.01]}
    contacts = [{"on": "bottom"}, {"on": "top", "foundation": ball, "rigid": pressed}]
    given = {"friction": {"law": "coulomb", "mu": 0.2}, "solver": {"method": method}}
    return parse_case(clamped([2.0, 0.8], [20, 8], fixed=[], contact=contacts, **given))


def test_bodies_that_slide_like_rigid_ones_are_not_warned_of():
    """The pencil was singular from mu = 0.19 on, and other methods found the same pressures."""
    newton, uzawa = (
        solve(under_a_cylinder(method), comm=MPI.COMM_SELF) for method in ("newton", "uzawa")
    )
    assert newton.converged and uzawa.converged
    largest = newton.pressure.max()
    np.testing.assert_allclose(newton.pressure, uzawa.pressure, rtol=0, atol=1e-5 * largest)
    for solution in (newton, uzawa):
        assert 5 < solution.critical_factor < np.inf
        assert not [text for text in solution.warnings if SAID in text]


def test_critical_friction_beside_a_body_that_slides(tmp_path):
    """The triangle's, beside a free block: nothing was known, since the block slides like rigid."""
    case = triangle(tmp_path, 3.0, [0.01, -0.01])
    points = [[0.0, 0.0], [1.0, 0.0], [0.0, 0.5345], [3.0, 0.0], [4.0, 0.0], [4.0, 1.0], [3.0, 1.0]]
    parts = {"bottom": [[0, 1], [3, 4]], "slope": [[1, 2]], "side": [[0, 2]], "top": [[5, 6]]}
    mesh = Mesh(
        np.array(points), np.array([[0, 1, 2], [3, 4, 5], [3, 5, 6]]), np.zeros(3, dtype=int),
        ["body"], {name: np.array(rows) for name, rows in parts.items()},
    )  # fmt: skip
    write_msh(mesh, tmp_path / "triangle.msh")
    loads = [{"on": part, "traction": [0.01 * (part == "side"), -0.01]} for part in ("side", "top")]
    tables = case.model_dump(mode="json", exclude_unset=True) | {"load": loads}
    solution = solve(parse_case(tables), comm=MPI.COMM_SELF)
    assert solution.converged
    assert 3 * solution.critical_factor == pytest.approx(1.4966629560336764, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plain", "hard"])
def test_single_solutions_are_not_warned_of(kind):
    """Random problems at mu up to 0.5."""
    seen = 0
    for case in (problem.case for problem in problems(kind, coarse=True)):
        problem = build_problem(case, MPI.COMM_SELF)
        law = problem.interface.friction.law
        if law is None or np.max(law.maximum) > 0.5 or problem.piezoelectric:
            continue
        solution = solve(problem)
        assert not solution.critical_factor <= 1, case.source  # NaN beyond 300 nodes
        assert not solution.jammed, case.source
        seen += 1
    assert seen >= 2


@pytest.mark.core
@pytest.mark.parallel
def test_any_number_of_ranks():
    """The factor of a beam's contact nodes, which are on all ranks."""
    load, friction = {"on": "top", "traction": [0.002, -0.01]}, {"law": "coulomb", "mu": 0.6}
    tables = clamped([4.0, 1.0], [32, 8], load=[load], friction=friction)
    alone, shared = (solve(parse_case(tables), comm=c) for c in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert np.isfinite(alone.critical_factor)
    assert shared.critical_factor == pytest.approx(alone.critical_factor, rel=1e-8)
    # Another method has no condensed body: it is made for this.
    again, jams = uniqueness(shared.problem, shared.state)
    assert not jams
    assert again == pytest.approx(alone.critical_factor, rel=1e-8)


@pytest.mark.parametrize("method", ["newton", "uzawa"])
@pytest.mark.parametrize("yaw", [0.0, 0.7, np.pi / 2])
def test_critical_friction_does_not_depend_on_the_axes(yaw, method, tmp_path):
    """A tetrahedron on a plane, clamped along its slope: one node, and K as of the triangle."""
    turn = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    height, poisson = 0.5345, 0.3
    points = np.array([[0.0, 0.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, height]])
    points[:, :2] @= turn
    sides = {"bottom": [0, 1, 2], "slope": [1, 2, 3], "side": [0, 1, 3]}
    nodes = {name: np.array(own) for name, own in sides.items()}
    files.write(
        tmp_path / "tet.inp", Contents(points, [("tetra", np.arange(4)[None])], nodes=nodes)
    )
    load = np.array([-0.015, 0.018]) @ turn
    case = parse_case({
        "mesh": {"file": str(tmp_path / "tet.inp")},
        "material": {"young": 1.0, "poisson": poisson},
        "fixed": [{"on": "slope", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "side", "traction": [*load.tolist(), -0.01]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 3.0},
        "solver": {"method": method},
    })  # fmt: skip
    solution = solve(case, comm=MPI.COMM_SELF)
    assert solution.converged
    ratio = 2 * poisson / (1 - 2 * poisson)
    critical = (ratio + 2 + 1 / height**2) * height / (ratio + 1)
    assert 3.0 * solution.critical_factor == pytest.approx(critical, rel=1e-5)
    assert [text for text in solution.warnings if "several solutions" in text]


def test_no_critical_friction_where_supports_let_no_node_slide():
    """A single node of 15 touches, at the corner of a clamped side."""
    case = next(problems("hard", "few-5")).case
    solution = solve(case, comm=MPI.COMM_SELF)
    assert solution.converged and solution.critical_factor == np.inf


def test_a_friction_that_overflows_is_critical() -> None:
    case = parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]},
            "material": {"young": 1e3, "poisson": 0.3},
            "fixed": [{"on": "top", "displacement": [0.0, -1e-3]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 1e307},
        }
    )
    solution = solve(case)
    assert solution.converged and solution.critical_factor == 0


def test_a_critical_friction_that_is_not_looked_for_is_no_number(monkeypatch):
    case = next(problems("hard", "few-5")).case
    monkeypatch.setattr("contact.results.uniqueness.MOST", 3)
    solution = solve(case, comm=MPI.COMM_SELF)
    assert np.isnan(solution.critical_factor)


def rhombus(folder, mu):
    """Return a body between two jaws that touch its corners a tenth above and below its middle."""
    bodies = Bodies(np.random.default_rng(0))
    bodies.block("left", [[-2.0, -0.6], [-0.5, -0.6], [-0.5, 0.6], [-2.0, 0.6]], 0.125)
    bodies.block("body", [[0.0, -0.5], [0.5, 0.1], [0.0, 0.5], [-0.5, -0.1]], 0.125)
    bodies.block("right", [[0.5, -0.6], [2.0, -0.6], [2.0, 0.6], [0.5, 0.6]], 0.125)
    write_msh(bodies.mesh(), folder / "rhombus.msh")
    return parse_case({
        "mesh": {"file": str(folder / "rhombus.msh")},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [
            {"on": "left_left", "displacement": [0.0015, 0.0]},
            {"on": "right_right", "displacement": [-0.0015, 0.0]},
        ],
        "contact": [
            {"on": "left_right", "against": "body_left"},
            {"on": "right_left", "against": "body_right"},
        ],
        "friction": {"law": "coulomb", "mu": mu},
    })  # fmt: skip


def test_a_body_that_friction_alone_jams(tmp_path):
    """With less friction it turns out of the way, and nothing presses: a solution with more too."""
    free, jammed = (solve(rhombus(tmp_path, mu), comm=MPI.COMM_SELF) for mu in (0.05, 0.5))
    assert free.converged and jammed.converged
    assert free.pressure.max() == 0 < jammed.pressure.max()
    assert evaluate(jammed.problem, free.state).largest < 1e-8
    assert jammed.jammed and not free.jammed
    said = "friction alone keeps the bodies in contact"
    assert [said in "".join(each.warnings) for each in (free, jammed)] == [False, True]
    # Flat facets deviated by 1e-17 from a curve, and gaps are nothing.
    assert "curved" not in "".join(free.warnings)


def test_a_body_that_is_turned_aside_by_fixed_points(tmp_path):
    """Its pressures are rounding at last: the end was a friction residual of 5e-6, and no more."""
    tables = rhombus(tmp_path, 0.05).model_dump(mode="json", exclude_unset=True)
    free = solve(parse_case(tables | {"solver": {"method": "uzawa"}}), comm=MPI.COMM_SELF)
    assert free.converged and free.pressure.max() == 0
    assert np.abs(free.state.x).max() == pytest.approx(0.2031, rel=1e-3)
    assert "nothing holds body against rigid motions" in "".join(free.warnings)


def test_a_weight_needs_contact_however_hard_jaws_clamp(tmp_path):
    """It was compared with the clamping forces, and "in balance without any contact force"."""
    tables = rhombus(tmp_path, 0.5).model_dump(mode="json", exclude_unset=True)
    tables["load"] = [{"on": "body_top", "traction": [0.0, -1e-8]}]
    solution = solve(parse_case(tables), comm=MPI.COMM_SELF)
    assert solution.converged and solution.pressure.max() > 1e-4
    assert not solution.jammed


@pytest.mark.parallel
@pytest.mark.parametrize("seed", range(3))
def test_a_ring_that_is_squeezed_without_friction_too(seed):
    found = solve(squeezed("newton"), domain=between_plates(MPI.COMM_WORLD, seed))
    assert found.converged and found.problem.frictional and not found.jammed


FALLING = "friction.mu={law='slip', a=0.5, b=0.2, rho=1e4}"


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("bar", ["material.law='linear'", "material.poisson=0.499", FALLING, "mesh.cells=[32, 8]"]),
        ("piezo-8-1-conductive", ["electric.phi_f=1e6", "mesh.cells=[16, 8]"]),
    ],
)
def test_several_solutions_are_warned_of(name, changes):
    """Methods were 3 to 5 % apart, and 24 %, without a word."""
    solution = solve(load_case(CASES / f"{name}.toml", changes), comm=MPI.COMM_SELF)
    assert any("several solutions may exist" in text for text in solution.warnings)


COMM = MPI.COMM_WORLD


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_constant_pressure_is_constant_on_both_sides(dim: int, degree: int) -> None:
    domain = Blocks(dim, *((5, 8) if dim == 2 else (2, 3)), turn=30.0).domain(COMM)
    up, zero = Blocks(dim, turn=30.0).axes[:, -1], constant(0.0, dim)
    body = Body(
        Linear(1.0, 0.0),
        [Fixed("bottom", [zero] * dim)],
        [Load("top", pressure=constant(0.01, dim))],
    )
    gap = GapFunction(lambda points: np.zeros(len(points)))
    problem = ContactProblem(domain, body, Contact("under", gap, against="over"), degree=degree)
    # The upper block can move as a rigid body, which `solve` would refuse.
    found = solve_problem(problem, NewtonOptions(tolerance=1e-13))
    surface = opposite_surface(problem, found.state)
    assert surface is not None
    fields = surface.at_points
    away = [
        fields["pressure"] / 0.01 - 1,
        fields["traction"] / 0.01 + up,
        fields["normal"] - up,
    ]
    # On all ranks together, for the next line is collective. Contact alone holds the upper block:
    # on three ranks its solution has 2e-10 of rounding, on one 1e-13.
    most = [COMM.allreduce(np.abs(each).max(initial=0.0), op=MPI.MAX) for each in away]
    exact = 1e-11 if COMM.size < 3 else 1e-9
    np.testing.assert_array_less(most, [exact, exact, 1e-12])
    assert COMM.allreduce(fields["weight"].sum()) == pytest.approx(1.0)


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
    multipliers = Multipliers.of(coarse.nodes, 1 + x, np.zeros((x.size, 2)))
    found = prolong(
        coarse, replace(coarse.start(), multipliers=multipliers), fine
    ).multipliers.contact
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
