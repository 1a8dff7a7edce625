"""The contact nodes: weights, directions, gaps, and what supports leave free."""

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.mesh.transfer import refined
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.obstacle import GapFunction, Level, Plane, Sphere
from contact.problem.problem import ContactProblem
from contact.results.resultants import supports
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import bar, constant, flat, leaning_block, solve, turn

LAW = Linear(1.0, 0.3)
ZERO = constant(0.0, 2)


def arch(cells=24):
    """Return a strip whose lower side is an arc of radius 2 about (0, 2), 60 degrees wide."""
    grid = mesh.create_rectangle(MPI.COMM_SELF, [[-1.0, 0.0], [1.0, 1.0]], [cells, 4])
    x = grid.geometry.x
    angle, radius = x[:, 0] * np.pi / 6, 2.0 - x[:, 1]
    low = {"arc": lambda x: np.isclose(np.hypot(x[0], x[1] - 2), 2.0)}
    x[:, :2] = np.column_stack([radius * np.sin(angle), 2 - radius * np.cos(angle)])
    return from_mesh(grid, low | {"top": lambda x: np.isclose(np.hypot(x[0], x[1] - 2), 1.0)})


def on_arch(foundation, degree=1, fixed=("top", (ZERO, ZERO))):
    body = Body(LAW, [Fixed(fixed[0], fixed[1])])
    return ContactProblem(arch(), body, Contact("arc", foundation), degree=degree).nodes


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_normals_of_a_curved_part_are_averaged(degree):
    nodes = on_arch(flat(), degree)
    radial = (nodes.points - [0.0, 2.0]) / np.hypot(*(nodes.points - [0.0, 2.0]).T)[:, None]
    corner = np.abs(np.hypot(*(nodes.points - [0.0, 2.0]).T) - 2) < 1e-9
    ends = np.abs(radial[:, 0]) > np.sin(np.pi / 6) - 1e-6
    # A straight facet's normal is that of its middle: at the ends there is but one facet.
    assert np.abs(nodes.normal - radial)[corner & ~ends].max() < 1e-12
    assert np.abs(nodes.normal - radial).max() < np.pi / 6 / 24 * 1.01
    assert np.linalg.norm(nodes.normal, axis=1) == pytest.approx(1.0, rel=1e-14)
    length = 24 * 2 * 2 * np.sin(np.pi / 6 / 24)
    assert nodes.sum(np.ones(nodes.size)) == pytest.approx(length, rel=1e-13)


@pytest.mark.core
def test_directions_and_gaps_of_a_curved_part_over_a_plane():
    plane = Plane((0.0, -0.1), (0.0, 1.0))
    theirs = on_arch(plane)
    assert theirs.normal == pytest.approx(np.tile([0.0, -1.0], (25, 1)))
    assert theirs.gap == pytest.approx(theirs.points[:, 1] + 0.1)
    own = on_arch(Plane((0.0, -0.1), (0.0, 1.0), direction="body"))
    # Along either direction, the gap ends on the plane.
    assert (own.points + own.gap[:, None] * own.normal)[:, 1] == pytest.approx(-0.1)
    assert np.all(own.gap >= theirs.gap - 1e-15)


@pytest.mark.core
def test_a_concentric_arc_has_a_constant_gap():
    nodes = on_arch(Sphere((0.0, 2.0), 2.25, inside=True))
    assert nodes.gap == pytest.approx(0.25)
    own = on_arch(Sphere((0.0, 2.0), 2.25, inside=True, direction="body"))
    assert own.gap == pytest.approx(0.25, rel=2e-3)


@pytest.mark.core
def test_tangents_project_onto_the_free_tangential_directions():
    for nodes in (on_arch(flat()), leaning_block(MPI.COMM_SELF, 2, 2).nodes):
        t = nodes.tangential_projector
        assert np.einsum("nij,njk->nik", t, t) == pytest.approx(t, abs=1e-14)
        assert np.abs(np.einsum("nij,nj->ni", t, nodes.normal)).max() < 1e-14
        assert np.einsum("nii->n", t) == pytest.approx(nodes.dim - 1)


@pytest.mark.core
def test_apply_and_transpose_are_each_other_s_transpose():
    problem = leaning_block(MPI.COMM_SELF, 2)
    nodes, owned = problem.nodes, problem.body.owned
    random = np.random.default_rng(0)
    x, y = random.standard_normal(owned), random.standard_normal((nodes.size, 3))
    total = np.zeros(owned)
    nodes.add_jump_transposed(y, total)
    assert total @ x == pytest.approx(np.sum(nodes.jump(x) * y), rel=1e-12)


def inclined(prescribed, degree):
    """Return a block over an inclined plane; its foot slides on a vertical line."""
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [1.0, 1.0], [3, 3])
    normal = turn(2, 20.0) @ [0.0, 1.0]
    body = Body(
        LAW,
        [Fixed("bottom", [constant(prescribed, 2), None])],
        [Load("top", [ZERO, constant(-0.05, 2)])],
    )
    plane = Plane((0.0, -0.5), tuple(normal))
    friction = Friction(ConstantCoefficient(0.3))
    problem = ContactProblem(domain, body, Contact("bottom", plane), friction, degree=degree)
    return problem, normal


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("prescribed", [0.0, 0.05, -0.1])
def test_a_direction_that_is_partly_fixed(prescribed, degree):
    """The plane is met where it is, also if the node is displaced along the fixed component."""
    problem, normal = inclined(prescribed, degree)
    nodes = problem.nodes
    assert nodes.normal == pytest.approx(np.tile(-normal, (nodes.size, 1)))
    assert nodes.admissible_normal == pytest.approx(np.tile([0.0, -1 / normal[1]], (nodes.size, 1)))
    assert np.abs(nodes.tangential_projector).max() == 0
    loop = solve(problem, 1e-10)
    u = problem.nodal(loop.state)
    assert u[:, 0] == pytest.approx(prescribed)
    distance = (nodes.points + u - [0.0, -0.5]) @ normal
    assert distance.min() == pytest.approx(0.0, abs=1e-10)
    assert np.abs(distance[loop.state.multipliers.contact > 1e-8]).max() < 1e-10
    # The load is carried: the wall takes the horizontal part.
    pressed = nodes.sum(loop.state.multipliers.contact)
    assert pressed * normal[1] == pytest.approx(0.05, rel=1e-9)
    reaction = supports(problem, loop.state)["bottom"].force
    assert reaction == pytest.approx([-pressed * normal[0], 0.0], rel=1e-9)


@pytest.mark.core
def test_nodes_that_cannot_reach_the_foundation_are_left_out():
    away = GapFunction(lambda p: np.where(p[:, 0] > 2, np.inf, 0.0))
    example = bar(MPI.COMM_SELF, 4)
    nodes = ContactProblem(example.domain, example.description, Contact("bottom", away)).nodes
    assert nodes.points[:, 0].max() <= 2.0
    assert np.all(np.isfinite(nodes.gap))


@pytest.mark.parametrize(
    ("radius", "fixed_part", "words"),
    [(0.2, "top", r"\[tip-on-axis\]"), (0.6, "bottom", r"\[held-part\]")],
)
def test_an_end_without_contact_nodes_says_why(radius, fixed_part, words):
    """A ball below the first element sees the node on the axis alone, which has no pressure."""
    tables = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
        "space": {"kinematics": "axisymmetric"},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": fixed_part, "displacement": ["free", 0.0]}],
        "contact": {
            "on": "bottom",
            "foundation": {"shape": "sphere", "centre": [0.0, -radius], "radius": radius},
            "direction": "axis",
            "axis": [0.0, -1.0],
        },
    }
    with pytest.raises(InputError, match=words):
        build_problem(parse_case(tables, source="tip"), MPI.COMM_SELF)


def circle(_, radius, *, direction):
    """Return the circle about (0, 2) as a formula."""
    return Level(lambda x: np.hypot(x[:, 0], x[:, 1] - 2.0) - radius, direction=direction)


def around_a_circle(radius, degree=1, levels=0, cells=24, direction="foundation", shape=Sphere):
    """Return the nodes of the arch's upper side, a concave arc of radius 1, on a circle."""
    domain = arch(cells)
    for _ in range(levels):
        domain = refined(domain)
    body = Body(LAW, [Fixed("arc", (ZERO, ZERO))])
    rigid = shape((0.0, 2.0), radius, direction=direction)
    return ContactProblem(domain, body, Contact("top", rigid), degree=degree).geometries[0]


@pytest.mark.core
@pytest.mark.parametrize("shape", [Sphere, circle])
@pytest.mark.parametrize("direction", ["foundation", "body"])
@pytest.mark.parametrize(("degree", "levels"), [(1, 0), (1, 1), (1, 2), (2, 0), (2, 1)])
def test_straight_facets_around_a_circle_touch_it(degree, levels, direction, shape):
    """The corners lie on the circle; refined edges are in it by the depth of their chords."""
    cells = 6
    close = around_a_circle(1.0, degree, levels, cells, direction, shape)
    depth = 1 - np.cos(np.pi / 6 / cells)
    assert np.abs(close.nodes.gap).max() < 1e-12
    assert close.cut == pytest.approx(depth if levels else 0.0)
    loose = around_a_circle(1.0 - 0.5 * depth, degree, levels, cells, direction, shape).nodes
    assert loose.gap.min() == pytest.approx(0.0 if levels else 0.5 * depth, rel=0.01)
    assert loose.gap.max() == pytest.approx(0.5 * depth, rel=0.01)


@pytest.mark.parametrize("shape", [Sphere, circle])
@pytest.mark.parametrize(("degree", "levels"), [(1, 0), (1, 1), (2, 0), (2, 1)])
def test_a_circle_larger_than_its_hole_is_refused(degree, levels, shape):
    with pytest.raises(InputError, match=r"\[overlap\]"):
        around_a_circle(1.01, degree, levels, shape=shape)
