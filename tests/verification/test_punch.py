"""Flat punches under force and moment on half spaces, against the closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, InputError, Motion, Plane, solve
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.methods.newton import Newton
from contact.problem.problem import ContactProblem
from contact.results.resultants import movements
from forms.hencky import Linear
from scripts.studies.indentation_in_space import punch, rotation
from tests.problems.mechanics import constant, newton

SELF = MPI.COMM_SELF
NU, FORCE, MOMENT = 0.3, 0.01, 0.002

#: Motions of a punch under a force, and under a moment too.
SUNK = Motion([0.0, None], [0.0], [0.0, -FORCE], [0.0], [0.0, 0.0])
TILTED = Motion([0.0, None], [None], [0.0, -FORCE], [MOMENT], [0.0, 0.0])


def growing(first, far):
    """Return distances from 0 to `far` whose steps grow by a fourth."""
    count = int(np.ceil(np.log(1 + 0.25 * far / first) / np.log(1.25)))
    distances = np.cumsum(np.concatenate([[0.0], first * 1.25 ** np.arange(count)]))
    return distances * far / distances[-1]


def half_space(n: int, far: float, revolved: bool) -> Domain:
    """Return a piece of the half space y < 0, refined towards the ends of |x| <= 1."""
    under = 1 - (1 - np.linspace(0, 1, n + 1)) ** 3
    first = under[-1] - under[-2]
    x = np.concatenate([under, 1 + growing(first, far - 1)[1:]])
    x = x if revolved else np.concatenate([-x[:0:-1], x])
    y = -growing(first, far)[::-1]
    cells = x.size - 1, y.size - 1
    mesh = rectangle(SELF, (0.0, 0.0), (float(cells[0]), float(cells[1])), cells).mesh
    for k, values in enumerate((x, y)):
        mesh.geometry.x[:, k] = np.interp(mesh.geometry.x[:, k], np.arange(values.size), values)

    def distant(p):
        left = np.zeros_like(p[0], dtype=bool) if revolved else p[0] < -far + 1e-9
        return (p[1] < -far + 1e-9) | (p[0] > far - 1e-9) | left

    def under_punch(p):
        return (p[1] > -1e-9) & (np.abs(p[0]) < 1 + 1e-9)

    domain = from_mesh(mesh, {"punch": under_punch, "far": distant})
    return replace(domain, revolved=revolved)


def punched(n: int, far: float, revolved: bool, motion: Motion) -> Newton:
    """Return the method that has solved for a punch."""
    fixed = [Fixed("far", [constant(0.0, 2), constant(0.0, 2)])]
    body = Body(Linear(1.0, NU), fixed)
    contact = Contact("punch", Plane((0.0, 0.0), (0.0, -1.0)), rigid=motion)
    problem = ContactProblem(half_space(n, far, revolved), body, contact, degree=2)
    return newton(problem, tolerance=1e-9)


def pressed(n: int, far: float, revolved: bool, motion: Motion):
    """Return how a punch moves, and its problem."""
    method = punched(n, far, revolved, motion)
    problem, state = method.problem, method.state
    # Nothing lifts off.
    assert np.all(state.multipliers.contact > 0)
    return problem, state, movements(problem, state)["rigid"]


@pytest.mark.core
def test_a_moment_tilts_a_flat_punch():
    """M = pi a^2 E theta/(4 (1 - nu^2)) a unit length; the force does not tilt it."""
    problem, state, moved = pressed(7, 20.0, False, TILTED)
    theta = 4 * (1 - NU**2) * MOMENT / np.pi
    assert np.deg2rad(moved["rotation"]) == pytest.approx(theta, rel=5e-3)
    nodes, pressure = problem.nodes, state.multipliers.contact
    assert nodes.weight @ pressure == pytest.approx(FORCE, rel=1e-12)
    # The moment of the pressure upwards on the punch balances that which is given.
    assert nodes.weight @ (nodes.points[:, 0] * pressure) == pytest.approx(-MOMENT, rel=1e-12)
    # p = (P - 2 M x/a^2)/(pi sqrt(a^2 - x^2)), a little inside of the edges.
    x = nodes.points[:, 0]
    inside = np.abs(x) < 0.8
    closed = (FORCE - 2 * MOMENT * x) / (np.pi * np.sqrt(1 - np.minimum(x**2, 0.99)))
    assert np.abs(pressure - closed)[inside].max() < 0.05 * closed[inside].max()


def test_a_circular_punch_has_no_way_but_along_its_axis():
    still = [0.0, 0.0]
    for motion in (
        Motion([None, 0.0], [0.0], still, [0.0], still),
        Motion(still, [0.1], still, [0.0], still),
    ):
        with pytest.raises(InputError, match=r"\[rigid-part\]"):
            pressed(2, 4.0, True, motion)


@pytest.mark.core
def test_a_circular_punch_sinks_by_its_force():
    """P = 2 E* a delta; what the far supports take off falls like the inverse of their distance."""
    depths = [-pressed(6, far, True, SUNK)[2]["displacement"][1] for far in (10.0, 20.0)]
    stiffness = [FORCE / (2 * depth) * (1 - NU**2) for depth in depths]
    assert 2 * stiffness[1] - stiffness[0] == pytest.approx(1.0, rel=5e-3)


def tilted(n: float) -> float:
    """Return the rotation of a circular punch in space over the closed form's."""
    solution = solve(punch(n))
    assert solution.converged
    weight, x = solution.problem.nodes.weight, solution.problem.nodes.points[:, 0]
    pressure = solution.pressure
    assert np.all(pressure > 0)
    assert weight @ pressure == pytest.approx(0.005, rel=1e-12)
    # About y an upward force at x turns by -x.
    assert weight @ (x * pressure) == pytest.approx(0.0005, rel=1e-12)
    turned = movements(solution.problem, solution.state)["rigid"]["rotation"]
    assert turned[0] == turned[2] == 0
    return rotation(solution)


def test_a_moment_tilts_a_circular_punch_in_space_its_own_way():
    """On a coarse mesh, which is too stiff."""
    pytest.importorskip("gmsh")
    assert 0 < 1 - tilted(0.5) < 0.15


@pytest.mark.slow
def test_a_moment_tilts_a_circular_punch_in_space():
    """Graded towards the edge, order 2: finer meshes stand in docs/indentation.md."""
    pytest.importorskip("gmsh")
    coarse, fine = (1 - tilted(n) for n in (0.5, 1))
    assert 0 < fine < 0.021
    assert coarse / fine > 2.5
