"""What Newton's method falls back on, and what is left where nothing helps.

What an iteration of the block relaxation is made of: projections and their acceleration.
"""

import signal
from functools import partial
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest
from mpi4py import MPI

from contact import Friction, InputError, NewtonOptions, build_problem, parse_case, solve
from contact.cli.main import main
from contact.errors import SingularError
from contact.interface.complementarity import project_disc, project_half_line
from contact.interface.foundation import NormalGraph
from contact.methods.interior_point import Cones, InteriorPoint, interior_point
from contact.methods.newton import Newton
from contact.methods.report import Outcome, Record
from contact.methods.signals import Interrupted
from contact.model.rigid import rigid_motions
from contact.problem.residuals import Residuals, evaluate
from contact.thesis.acceleration import ResidualMinimiser
from contact.thesis.uzawa import FrozenProblem, disc_derivative
from forms.laws import Compliance, ConstantCoefficient
from tests.problems import mechanics
from tests.problems.clamped import clamped
from tests.problems.mechanics import bar_case, close, newton
from tests.problems.rigid import PIEZO

SELF = MPI.COMM_SELF


COULOMB = Friction(ConstantCoefficient(0.5))


@pytest.mark.core
@pytest.mark.parametrize("friction", [COULOMB, Friction()])
def test_an_interior_point_takes_over_where_newton_gives_up(friction):
    problem = mechanics.bar(SELF, 8, -0.05, friction=friction)
    method = newton(problem, max_iterations=2, condense=False)
    assert any(record.note.startswith("interior point") for record in method.history)
    assert method.history[-1].residuals.largest <= 1e-8


@pytest.mark.core
def test_an_interior_point_on_a_body_that_friction_alone_keeps_from_sliding():
    """Without friction it would slide away: its nodes are first taken for stuck."""
    case = {
        "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [16, 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": ["free", -0.01]}],
        "load": [{"on": "right", "traction": [-2e-3, 0.0]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.5},
    }
    problem = build_problem(parse_case(case), SELF)
    state, outcome = Newton(problem, NewtonOptions()).solve()
    assert outcome.converged
    method = Newton(problem, NewtonOptions(condense=False))
    found, outcome = interior_point(method.semismooth)
    assert outcome.converged, outcome.reason
    assert close(found, state, rtol=1e-6, atol=1e-9)


def test_a_singular_matrix_in_the_last_steps_leaves_another_bound():
    """It ended the solve, though with the next friction bound there is a solution."""
    problem = mechanics.bar(SELF, 8, -0.05, friction=COULOMB)
    newton = Newton(problem, NewtonOptions(condense=False)).semismooth
    iterate, failed = newton.iterate, []

    def finish(state, **given):
        if not failed:
            failed.append(state)
            raise SingularError("the linear system is singular", "singular")
        return iterate(state, **given)

    newton.iterate = finish
    begin = newton.step.without_contact(problem, problem.start())
    _, outcome = interior_point(newton, begin)
    assert failed and outcome.converged


def test_too_little_memory_in_an_interior_point_is_said(monkeypatch):
    """It counted as the end of its digits."""
    problem = mechanics.bar(SELF, 8, -0.05, friction=COULOMB)
    newton = Newton(problem, NewtonOptions(condense=False)).semismooth
    begin = newton.step.without_contact(problem, problem.start())

    def exhausted(self):
        raise InputError("out of memory in the factorisation", "memory")

    monkeypatch.setattr("contact.methods.interior_point.InteriorPoint.step", exhausted)
    with pytest.raises(InputError, match=r"\[memory\]"):
        interior_point(newton, begin)


def test_what_an_interior_point_has_reached_is_kept_when_it_is_interrupted():
    """The state from before it was handed on."""
    problem = mechanics.bar(SELF, 8, -0.05, friction=COULOMB)
    seen = []

    def interrupt(record: Record) -> None:
        if record.note.startswith("interior point"):
            seen.append(record)
        if len(seen) == 5:
            raise Interrupted(signal.SIGTERM)

    options = NewtonOptions(max_iterations=2, condense=False)
    method = Newton(problem, options, monitor=interrupt)
    with pytest.raises(Interrupted):
        method.solve()
    assert evaluate(problem, method.state).equilibrium == seen[-1].residuals.equilibrium


def interior(
    case: dict[str, Any], linear: Literal["lu", "iterative"], atol: float = 1e-9
) -> tuple[Outcome, bool]:
    """Solve by the interior point; tell also whether Newton's method finds the same."""
    problem = build_problem(parse_case(case), SELF)
    state, _ = Newton(problem, NewtonOptions()).solve()
    newton = Newton(problem, NewtonOptions(condense=False, linear=linear)).semismooth
    supported = newton.modes.constrained_by_supports
    begin = newton.step.without_contact(problem, problem.start()) if supported else None
    found, outcome = interior_point(newton, begin)
    return outcome, close(found, state, rtol=1e-6, atol=atol)


@pytest.mark.core
@pytest.mark.parametrize("rigid", [False, True], ids=["layer alone", "rigid part behind"])
@pytest.mark.parametrize("kind", ["plane", "revolved", "in space"])
def test_an_interior_point_with_friction_on_a_layer(kind, rigid):
    """Where nothing is rigid the gap is infinite: there were no cones of friction."""
    dim = 3 if kind == "in space" else 2
    space = {"kinematics": "axisymmetric"} if kind == "revolved" else {}
    down = [0.0] * (dim - 1) + [-0.04]
    case = {
        "mesh": {"generator": "rectangle" if dim == 2 else "box", "size": [2.0] * (dim - 1) + [1.0],
                 "cells": [8, 4] if dim == 2 else [4, 4, 2]},
        "space": space,
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": down}],
        "load": [{"on": "right", "traction": [-0.02] + [0.0] * (dim - 1)}],
        "contact": {"on": "bottom", "law": "compliance", "gap": 0.001, "stiffness": 2.0,
                    "limit": np.inf, "layer": 0.01 if rigid else np.inf},
        "friction": {"law": "coulomb", "mu": 0.05},
    }  # fmt: skip
    problem = build_problem(parse_case(case), SELF)
    state, outcome = Newton(problem, NewtonOptions(tolerance=1e-11)).solve()
    assert outcome.converged, outcome.reason
    interface, nodal = problem.interface, problem.nodal(state)
    layer = interface.foundation.layer_pressure(nodal)
    bound = interface.bound(nodal, state.multipliers)
    slips = interface.slip_length(nodal) > 1e-6
    assert (slips & (layer > 0)).any()
    assert (problem.nodes.maximum(state.multipliers.contact) > 0) == rigid
    newton = Newton(problem, NewtonOptions(condense=False)).semismooth
    begin = newton.step.without_contact(problem, problem.start())
    method = InteriorPoint(newton, bound, begin)
    ended = method.iterate().ended
    assert ended.startswith("duality gap closed"), ended
    found = method.state  # in equilibrium to 1e-4
    assert np.abs(found.x - state.x).max() < 1e-4 * np.abs(state.x).max()
    assert (
        np.abs(found.multipliers.friction - state.multipliers.friction).max() < 1e-4 * bound.max()
    )
    # The friction bounds of the method itself, from zero on.
    found, outcome = interior_point(newton, begin)
    assert outcome.converged, outcome.reason
    assert close(found, state, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_an_interior_point_where_nothing_acts_but_a_foundation_that_moves(linear):
    """Without loads there was no work to begin with: it stood still, or its numbers were none."""
    contact = {"on": "bottom", "rigid": {"displacement": [0.01, 0.05]}}
    friction = {"law": "coulomb", "mu": 0.3}
    case = clamped([4.0, 1.0], [32, 8], contact=contact, friction=friction)
    outcome, same = interior(case, linear)
    assert outcome.converged, outcome.reason
    assert same


def test_an_interior_point_ends_where_an_iterative_solver_balances_no_further():
    """It went on until its slacks were 1e-35, and ended with "the body can move freely"."""
    case = {
        "mesh": {"generator": "rectangle", "size": [8.0, 4.0], "cells": [16, 8]},
        "material": {"young": 58.7, "poisson": 0.39, "piezo": PIEZO},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0], "potential": 0.0}],
        "load": [{"on": "top", "traction": [0.0, "-x"]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.2},
        "electric": {"k_e": 0.1, "phi_f": 32.0},
    }
    outcome, same = interior(case, "iterative", atol=1e-6)  # pressures are up to 8
    assert outcome.converged, outcome.reason
    assert same


def test_what_is_unloaded_to_nothing_rests(tmp_path):
    """Beside forces that vanish no residual was small: the interior point went on to the limit."""
    case = tmp_path / "case.toml"
    case.write_text("""
mesh = { generator = "rectangle", size = [8.0, 4.0], cells = [12, 6] }
material = { young = 58.7102, poisson = 0.3912 }
fixed = [{ on = "left", displacement = [0.0, 0.0] }]
load = [{ on = "top", traction = [0.0, "-x"], amplitude = "m" }]
contact = { on = "bottom" }
friction = { law = "coulomb", mu = 0.2 }
solver = { linear = "iterative" }
output = { fields = "none" }
[evolution]
times = [0.0, 1.0, 2.0]
steps = [1, 1]
amplitudes = { m = { time = [0.0, 1.0, 2.0], value = [0.0, 1.0, 0.0] } }
""")
    assert main(["solve", str(case), "--out", str(tmp_path / "out")]) == 0


@pytest.mark.parametrize("law", [{"law": "coulomb", "mu": 0.0}, {"law": "tresca", "bound": "0*x"}])
def test_no_friction_is_solved_like_none(law):
    """It took 44 solves instead of 7: half a ball was taken to be constrained by friction."""
    case = {
        "mesh": {"generator": "two_half_cylinders", "contact_size": 0.1, "size": 2.0},
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [{"on": "lower_cut", "displacement": [0.0, 0.0]}],
        "load": [{"on": "upper_cut", "traction": [0.0, -1.0]}],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
    }
    linear = NewtonOptions(linear="iterative", tolerance=1e-11)
    method, other = (
        Newton(build_problem(parse_case(case | given), SELF), linear)
        for given in ({"friction": law}, {})
    )
    (state, outcome), (found, _) = method.solve(), other.solve()
    assert outcome.converged, outcome.reason
    # The upper half rolls on the lower one at next to no force: two runs whose residuals are 2e-12
    # differ by 5e-6, and pressures, which are up to 27, by 1e-6 with it; by elastic strains less.
    assert np.allclose(state.multipliers.contact, found.multipliers.contact, rtol=0, atol=1e-5)
    body = method.problem.body
    points, component = body.layout.points, body.connected_components[0]
    upper = component == component[points[:, 1].argmax()]
    rigid = rigid_motions(points[upper]).reshape(-1, 3)
    moved = (body.nodal(state.x) - body.nodal(found.x))[upper].ravel()
    rolled = rigid @ np.linalg.lstsq(rigid, moved, rcond=None)[0]
    assert np.abs(rolled).max() < 5e-5
    assert np.allclose(moved, rolled, rtol=0, atol=1e-8)


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_the_number_of_outer_iterations_is_limited(method):
    solution = solve(bar_case(8, f"solver.method={method}", "solver.max_outer=2"), comm=SELF)
    assert not solution.outcome.converged
    # the frictionless start of the fixed point is its iteration 0
    assert len(solution.history) <= 3


def test_a_method_cannot_call_itself_converged(monkeypatch):
    """What it says of its end is one thing, the residuals of the whole problem another."""

    def boast(method: Newton, *given):
        allowed = Residuals(1.0, 1.0, 1.0)
        outcome = Outcome(Residuals(0.0, 0.0, 0.0), allowed, criterion="all is well")
        return method.problem.start(0.1), outcome

    monkeypatch.setattr(Newton, "solve", boast)
    solution = solve(bar_case(4), comm=SELF)
    assert not solution.converged
    assert solution.outcome.residuals == evaluate(solution.problem, solution.state)
    assert solution.state.time == 1.0
    assert "all is well, but the equilibrium residual is 1.00e+00" in solution.outcome.reason


def test_the_best_iterate_is_what_is_left_of_a_failure():
    """Where the limit ends the fall-backs, what they were left at may be far from anything."""
    problem = mechanics.bar(SELF, 8, -0.05, friction=Friction(ConstantCoefficient(0.5)))
    limits = NewtonOptions(tolerance=1e-14, condense=False, max_outer=8, max_iterations=3)
    method = Newton(problem, limits)
    state, outcome = method.solve()
    assert not outcome.converged
    assert "interior point" in method.history[-1].note
    assert outcome.residuals == evaluate(problem, state)
    assert outcome.residuals.largest == min(record.residuals.largest for record in method.history)


@pytest.mark.core
@pytest.mark.parametrize(
    ("slack", "length", "inside"),
    [(1, 2, True), (0, 2, False), (1, 1, False), (np.nan, 2, False), (1e200, 2, False)],
)
def test_a_point_on_the_rim_of_a_cone_is_not_inside(slack, length, inside):
    """No scaling is divided by its determinant there: bodies that nothing holds come to it."""
    ones, along = np.ones(1), np.array([[1.0, 0.0]])
    cones = Cones(slack * ones, ones, length * ones, along, 2 * ones, along)
    assert cones.interior() is inside


@pytest.mark.core
def test_projections():
    z = np.array([[3.0, 4.0], [0.3, 0.4], [0.0, 0.0], [-6.0, 8.0]])
    assert project_disc(z, np.array([1.0, 1.0, 0.0, 0.0])) == pytest.approx(
        np.array([[0.6, 0.8], [0.3, 0.4], [0.0, 0.0], [0.0, 0.0]])
    )
    assert project_half_line(np.array([-1.0, 2.0])).tolist() == [0.0, 2.0]


@pytest.mark.core
@pytest.mark.parametrize("dim", [1, 2, 3])
def test_the_derivative_of_the_projection_onto_a_disc(dim):
    random = np.random.default_rng(dim)
    z, radius = random.standard_normal((40, dim)), random.uniform(0, 2, 40)
    directions, h = random.standard_normal((40, dim, 5)), 1e-6
    exact = disc_derivative(z, radius, directions)
    for k in range(5):
        step = h * directions[:, :, k]
        slope = (project_disc(z + step, radius) - project_disc(z - step, radius)) / (2 * h)
        assert np.abs(exact[:, :, k] - slope).max() < 1e-6


@pytest.mark.core
@pytest.mark.parametrize("seed", range(5))
def test_the_acceleration_solves_random_complementarity_problems(seed):
    """Find p >= 0 with u = u_0 - C p <= 0, p u = 0, for a random positive definite C."""
    random = np.random.default_rng(seed)
    m, r = 60, 1.0
    basis = np.linalg.qr(random.standard_normal((m, m)))[0]
    compliance = basis @ np.diag(np.geomspace(0.02, 20, m)) @ basis.T
    u_0 = random.standard_normal(m)
    matrix = np.linalg.inv(np.eye(m) + r * compliance)

    def project(z):
        return np.maximum(z, 0.0)

    def solves(depth):
        accelerator = ResidualMinimiser(
            lambda a, b: a.T @ b, project, lambda z, d: (z > 0)[:, None] * d, depth
        )
        z = np.zeros(m)
        for count in range(1, 2000):
            force = project(z)
            q = 2 * force - z
            u = matrix @ (u_0 - compliance @ q)
            p = q + r * u
            if np.linalg.norm(p - project(p + r * u)) < 1e-9:
                return count, p
            image = force + r * u
            z = accelerator.next(p, p + r * u, image) if depth else image
        raise AssertionError("not converged")

    slow, expected = solves(0)
    for depth in (2, 10, 40):
        fast, found = solves(depth)
        assert fast < slow
        assert found == pytest.approx(expected, abs=1e-7)
    assert fast <= 60


@pytest.mark.core
@pytest.mark.parametrize("nodes", [0, 3])
@pytest.mark.parametrize("layer", [False, True])
def test_several_points_are_projected_as_one_after_the_other(nodes, layer):
    """Ranks without contact nodes too."""
    rng = np.random.default_rng(1)
    gap = np.full(nodes, 0.5)
    law = NormalGraph(Compliance(2.0), np.ones(nodes), 0 * gap, gap) if layer else None
    frozen = SimpleNamespace(
        layer=law, r=3.0, r_u_n=np.zeros((nodes, 3)), interface=SimpleNamespace(gap=gap)
    )  # fmt: skip
    project = partial(FrozenProblem.project, frozen, bound=np.full(nodes, 0.4))
    points = rng.normal(size=(5, nodes, 3))
    found = project(points)
    assert found.shape == points.shape
    for point, one in zip(points, found, strict=True):
        assert np.array_equal(project(point), one)
    assert nodes == 0 or (found[..., 0] > 0).any()
