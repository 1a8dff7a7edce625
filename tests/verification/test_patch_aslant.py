"""Patch tests of contact nodes that supports hold aslant to the contact direction.

A block on an inclined foundation, or on another block, with planes of symmetry: under the same
pressure on all its other sides the contact pressure is that everywhere, at the nodes that a plane
of symmetry holds too.
"""

from functools import partial

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    FixedPointOptions,
    Friction,
    Linear,
    Load,
    NewtonOptions,
    PenaltyOptions,
    Plane,
    Problem,
    evolve,
    gap_gradient,
    sensitivity,
    solve,
)
from contact.derivatives.by_parameters import Parameter
from contact.mesh.domain import revolved
from contact.mesh.grid import rectangle
from contact.model.obstacle import GapFunction
from contact.model.rigid import Motion
from contact.results.quantities import named_functionals
from contact.results.resultants import contact_resultant, supports
from forms.laws import ConstantCoefficient
from scripts.force_balance import force_balance
from tests.problems.blocks import Blocks
from tests.problems.mechanics import Affine, constant

COMM = MPI.COMM_WORLD
PRESSURE, SLOPE = 5.0, 0.6
LAW = Linear(1e3, 0.3)
KINDS = [
    (2, 1, "triangle"),
    (2, 2, "quadrilateral"),
    (3, 1, "tetrahedron"),
    (3, 2, "tetrahedron"),
    (3, 1, "hexahedron"),
]
NAMES = [f"{cell}-{degree}" for _, degree, cell in KINDS]


def inclined(dim, cell="", **more):
    """Return two blocks whose common side rises along x: by half of that along y in 3-D."""
    domain = Blocks(dim, *((5, 4) if dim == 2 else (2, 3)), cell=cell, **more).domain(COMM)
    x = domain.mesh.geometry.x
    rise = SLOPE * (x[:, 0] + (x[:, 1] / 2 if dim == 3 else 0.0))
    x[:, dim - 1] += rise * (1 - np.abs(x[:, dim - 1] - 1))
    return domain


def upward(dim):
    """Return the unit normal of the common side."""
    normal = np.array([-SLOPE, 1.0] if dim == 2 else [-SLOPE, -SLOPE / 2, 1.0])
    return normal / np.linalg.norm(normal)


def pressed(dim, sides):
    return [Load(side, pressure=constant(PRESSURE, dim)) for side in sides]


def symmetric(dim, *parts):
    """Return the conditions of symmetry x = 0, and y = 0 in 3-D, and those of other parts."""
    zero = constant(0.0, dim)
    planes = [*(("left", 0), ("front", 1))[: dim - 1], *parts]
    return [Fixed(on, [zero if i == axis else None for i in range(dim)]) for on, axis in planes]


def on_plane(dim, cell="", degree=1, moving=None, friction=None):
    """Return the upper block on a plane; the lower one is pressed alike, and is far away."""
    sides = ["top", *(("right", "back")[: dim - 1])]
    foot = symmetric(dim, ("bottom", dim - 1))
    loads = [*pressed(dim, [*sides, "over"])]
    if moving is not None:
        foot += symmetric(dim, ("top", dim - 1))[-1:]
        loads = pressed(dim, [*sides[1:], "over"])
    plane = Plane([*np.eye(dim)[-1]], upward(dim))
    body = Body(LAW, foot, loads)
    contact = Contact("under", plane, friction=friction, rigid=moving)
    return Problem(inclined(dim, cell), body, contact, degree=degree)


def everywhere_the_same(solution, dim, rtol=1e-11):
    """Look at pressures, forces and equilibrium."""
    problem, state = solution.problem, solution.state
    assert solution.converged, solution.reason
    nodes = problem.nodes
    constrained = np.linalg.norm(nodes.admissible_normal - nodes.normal, axis=1) > 0.01
    assert COMM.allreduce(np.count_nonzero(constrained)) >= dim - 1
    np.testing.assert_allclose(solution.pressure, PRESSURE, rtol=rtol)
    area = nodes.sum(np.ones(nodes.gap.size))
    assert area == pytest.approx(1 / upward(dim)[-1], rel=1e-12)
    force = contact_resultant(problem, state).force
    assert force == pytest.approx(-PRESSURE * area * upward(dim), rel=rtol, abs=1e-9)
    # The planes of symmetry bear the pressure on their own areas, and none of the contact force.
    balance = force_balance(problem, state)
    assert balance.imbalance < 1e-12
    reaction = sum(one.force for one in supports(problem, state).values())
    assert reaction == pytest.approx(balance.supports, abs=1e-9)


METHODS = {
    "dense": NewtonOptions(tolerance=1e-13),
    "sparse": NewtonOptions(tolerance=1e-13, condense=False),
    "iterative": NewtonOptions(tolerance=1e-12, linear="iterative"),
    "uzawa": FixedPointOptions(tolerance=1e-12),
    "penalty": PenaltyOptions(tolerance=1e-12, eps_contact=1e-7),
}


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_on_a_plane(dim, degree, cell):
    solution = solve(on_plane(dim, cell, degree), METHODS["dense"])
    everywhere_the_same(solution, dim)
    reaction = solution.reaction("left")
    assert reaction[0] == pytest.approx(2 * PRESSURE, rel=1e-9)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("method", [*METHODS][1:])
@pytest.mark.parametrize("dim", [2, 3])
def test_by_all_methods(dim, method):
    everywhere_the_same(solve(on_plane(dim), METHODS[method]), dim, 1e-8)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_on_a_plane_that_moves_under_a_force(dim, condense):
    """That goes up and down alone, and is pressed against the block."""
    turns, force = [0.0] * (1 if dim == 2 else 3), [*[0.0] * (dim - 1), PRESSURE]
    moving = Motion([*[0.0] * (dim - 1), None], turns, force, turns, [0.0] * dim)
    solution = solve(
        on_plane(dim, moving=moving), NewtonOptions(tolerance=1e-13, condense=condense)
    )
    everywhere_the_same(solution, dim)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("pair", [("under", "over"), ("over", "under")], ids=["upper", "lower"])
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_on_another_block(dim, degree, cell, pair, condense):
    loads = pressed(dim, ["top", *(("right", "back")[: dim - 1])])
    body = Body(LAW, symmetric(dim, ("bottom", dim - 1)), loads)
    gap = GapFunction(lambda points: np.zeros(len(points)))
    contact = Contact(pair[0], gap, against=pair[1])
    problem = Problem(inclined(dim, cell), body, contact, degree=degree)
    solution = solve(problem, NewtonOptions(tolerance=1e-13, condense=condense))
    assert solution.converged
    np.testing.assert_allclose(solution.pressure, PRESSURE, rtol=1e-11)
    balance = force_balance(problem, solution.state)
    assert balance.imbalance < 1e-12
    assert solution.reaction("left")[0] == pytest.approx(2 * PRESSURE, rel=1e-10)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("method", ["dense", "sparse", "uzawa"])
def test_friction_across_the_plane_of_symmetry(method):
    """Sliding along y with the foundation's slope along x alone: the bound is that of p."""
    mu, sliding = 0.3, 0.2
    domain = Blocks(3, 2, 2).domain(COMM)
    x = domain.mesh.geometry.x
    x[:, 2] += SLOPE * x[:, 0] * (1 - np.abs(x[:, 2] - 1))
    normal = np.array([-SLOPE, 0.0, 1.0]) / np.hypot(SLOPE, 1)
    shear = mu * PRESSURE * np.hypot(SLOPE, 1)
    across = LAW.bulk - 2 * LAW.shear / 3
    strain, along_y = -PRESSURE / across, PRESSURE * (1 + 2 * LAW.shear / across)
    zero, y, s = (constant(value, 3) for value in (0.0, along_y, shear))
    minus_p, minus_y, minus_s = (constant(-value, 3) for value in (PRESSURE, along_y, shear))
    loads = [
        Load("right", [minus_p, zero, zero]),
        Load("front", [zero, y, minus_s]),
        Load("back", [zero, minus_y, s]),
        Load("top", [zero, zero, minus_p]),
    ]
    pushed = [
        Fixed("upper_left", [zero, None, None]),
        Fixed("top", [None, Affine((0.0, strain, 0.0), sliding), None]),
        Fixed("lower_left", [zero, zero, None]),
        Fixed("bottom", [zero, zero, zero]),
    ]
    friction = Friction(ConstantCoefficient(mu))
    contact = Contact("under", Plane([0.0, 0.0, 1.0], normal), friction=friction)
    problem = Problem(domain, Body(LAW, pushed, loads), contact)
    solution = solve(problem, METHODS[method])
    assert solution.converged
    np.testing.assert_allclose(solution.pressure, PRESSURE, rtol=1e-8)
    along = np.broadcast_to([0.0, mu * PRESSURE, 0.0], solution.friction.shape)
    np.testing.assert_allclose(solution.friction, along, atol=1e-8 * PRESSURE)
    assert force_balance(problem, solution.state).imbalance < 1e-10


def ramp(sliding=0.0, mu=0.0, pressure=PRESSURE, young=1e3, slope=SLOPE, gap=0.0, down=None):
    """Return a block whose left side is pushed along a foundation that rises there.

    The top is pressed, or moved down.
    """
    domain = rectangle(COMM, [0.0, 0.0], [1.0, 1.0], [6, 6])
    x = domain.mesh.geometry.x
    x[:, 1] += slope * x[:, 0] * (1 - x[:, 1])
    loads = [Load(side, pressure=constant(pressure, 2)) for side in ("top", "right")]
    fixed = [Fixed("left", [constant(sliding, 2), None])]
    if down is not None:
        fixed.append(Fixed("top", [None, constant(-down, 2)]))
    friction = Friction(ConstantCoefficient(mu))
    given = GapFunction(lambda points: np.full(len(points), gap))
    contact = Contact("bottom", given, friction=friction)
    return Problem(domain, Body(Linear(young, 0.3), fixed, loads[down is not None :]), contact)


@pytest.mark.parallel
def test_a_side_that_is_moved_along_the_foundation_in_time():
    """The pressure is that of the load at all times, as the block goes up the plane."""
    problem, shift = ramp(0.1), 0.1
    for time, state in zip(
        (0.25, 1.0), evolve(problem, [0.25, 1.0], METHODS["dense"]), strict=True
    ):
        np.testing.assert_allclose(state.multipliers.contact, time * PRESSURE, rtol=1e-10)
        nodal, nodes = problem.nodal(state), problem.nodes
        at_side = nodes.points[:, 0] < 1e-9
        lift = time * shift * SLOPE
        assert nodal[at_side, 1] == pytest.approx(np.full(at_side.sum(), lift), rel=1e-10)
        assert force_balance(problem.at(time), state).imbalance < 1e-12


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_friction_has_no_part_along_directions_that_are_held(mu):
    """At the node that the side pushes there is none: its pressure bears that share."""
    solution = solve(ramp(0.1, mu), METHODS["dense"])
    nodes = solution.problem.nodes
    constrained = nodes.points[:, 0] < 1e-9
    assert np.abs(solution.friction[constrained]).max() == 0
    slides = np.linalg.norm(solution.friction[~constrained], axis=1)
    np.testing.assert_allclose(slides, mu * solution.pressure[~constrained], rtol=1e-8, atol=1e-12)
    assert force_balance(solution.problem, solution.state).imbalance < 1e-12


def test_the_node_that_is_held_alone_is_off():
    """Sliding under a uniform stress: its pressure is p (1 + mu tan a) on all meshes."""
    p, mu, slope = 1.0, 0.05, 0.4
    stress = p * np.array([[2 * mu / slope - 1, mu], [mu, -1.0]])
    exact = p * np.array([slope - mu, -1 - mu * slope])
    off = []
    for count in (4, 8, 16):
        domain = rectangle(COMM, [0.0, 0.0], [1.0, 1.0], [count, count])
        x = domain.mesh.geometry.x
        x[:, 1] += slope * x[:, 0] * (1 - x[:, 1])
        loads = [Load("left", [0.0, -stress[0, 1]])]
        loads += [Load("top", list(stress[1])), Load("right", list(stress[0]))]
        contact = Contact("bottom", 0.0, friction=Friction(ConstantCoefficient(mu)))
        body = Body(Linear(1e3, 0.3), [Fixed("left", [0.0, None])], loads)
        solution = solve(Problem(domain, body, contact), METHODS["dense"])
        constrained = solution.problem.nodes.points[:, 0] < 1e-9
        np.testing.assert_allclose(solution.pressure[constrained], p * (1 + mu * slope), rtol=1e-6)
        off.append(np.linalg.norm(solution.contact_force - exact))
    np.testing.assert_allclose(off, mu * p * (1 + slope**2) / np.array([8, 16, 32]), rtol=1e-6)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_a_cone_under_a_cylinder(degree):
    """The axis holds its node aslant to the cone."""
    domain = rectangle(COMM, [0.0, 0.0], [1.0, 1.0], [6, 6])
    x = domain.mesh.geometry.x
    x[:, 1] += SLOPE * x[:, 0] * (1 - x[:, 1])
    domain = revolved(domain)
    body = Body(LAW, [], pressed(2, ["top", "right"]))
    problem = Problem(domain, body, Contact("bottom", Plane([0.0, 0.0], upward(2))), degree=degree)
    solution = solve(problem, METHODS["dense"])
    assert solution.converged
    np.testing.assert_allclose(solution.pressure, PRESSURE, rtol=1e-10)
    assert solution.contact_force[1] == pytest.approx(-np.pi * PRESSURE, rel=1e-12)


QUANTITIES = ["max_pressure", "contact_force_x", "contact_force_y", "reaction_x_left"]
POINT = {"pressure": PRESSURE, "young": 1e3, "sliding": -0.01, "gap": 1e-4, "down": 0.01}


@pytest.mark.parallel
@pytest.mark.parametrize(
    "names",
    [("sliding", "gap"), pytest.param((*POINT,), marks=pytest.mark.slow)],
    ids=["two", "all"],
)
def test_sensitivities(names):
    """Beside differences of solutions, by the load, the modulus, the pushes and a gap."""

    def made(name, value):
        return ramp(mu=0.2, slope=-SLOPE, **(POINT | {name: value}))

    solution = solve(made("young", 1e3), METHODS["dense"])
    assert solution.converged
    at = int(np.argmax(np.concatenate(COMM.allgather(solution.pressure))))
    points = np.concatenate(COMM.allgather(solution.problem.nodes.points))
    assert points[at, 0] < 1e-9  # the largest pressure is at the side
    parameters = {name: Parameter(POINT[name], partial(made, name)) for name in names}
    found = [
        sensitivity(solution, QUANTITIES, parameters, method=method)
        for method in ("tangent", "adjoint")
    ]
    known = named_functionals(solution.problem)
    for name, parameter in parameters.items():
        step, ends = 1e-4 * POINT[name], []
        for sign in (1, -1):
            beside = solve(parameter.problem(POINT[name] + sign * step), METHODS["dense"])
            ends.append([known[q](beside.problem, beside.state) for q in QUANTITIES])
        slope = (np.array(ends[0]) - np.array(ends[1])) / (2 * step)
        for one in found:
            got = np.array([one[q][name] for q in QUANTITIES])
            np.testing.assert_allclose(got, slope, rtol=1e-5, atol=1e-7 * np.abs(slope).max())
    by_gap = gap_gradient(solution, "contact_force_y")
    whole = COMM.allreduce(float(by_gap.sum()))
    for one in found:
        assert whole == pytest.approx(one["contact_force_y"]["gap"], rel=1e-6)
