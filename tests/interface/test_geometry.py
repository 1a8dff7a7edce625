"""The geometry of contact is a function of positions: by a motion, or on the moved mesh."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, GapFunction, Motion, Plane, Sphere
from contact.mesh.grid import rectangle
from contact.methods.method import METHODS
from contact.methods.options import OPTIONS
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant

COMM = MPI.COMM_WORLD
APART = 0.05
ARRAYS = ("weight", "normal", "admissible_normal", "tangential_projector", "gap", "deviation")


def shifted(x):
    return x + np.arange(1, x.shape[1] + 1) / 7


def turned(x):
    """Turn about a point beside the bodies, by more than a right angle."""
    angle, found = np.deg2rad(130), x.copy()
    a, b = x[:, 0] - 3, x[:, -1] + 1
    found[:, 0] = np.cos(angle) * a - np.sin(angle) * b
    found[:, -1] = np.sin(angle) * a + np.cos(angle) * b
    return found


def slid(x):
    """Move the upper block beyond the rim of the lower one."""
    along = np.eye(x.shape[1])[0]
    return x + 0.6 * (x[:, -1:] > 1 + APART / 2) * along


def pair(domain, degree):
    zero, down = constant(0.0, domain.dim), constant(-APART - 0.01, domain.dim)
    supports = [Fixed("bottom", [zero] * domain.dim)]
    supports.append(Fixed("top", [*[zero] * (domain.dim - 1), down]))
    contact = Contact("under", GapFunction(lambda x: np.zeros(len(x))), against="over")
    return ContactProblem(domain, Body(Linear(1.0, 0.3), supports), contact, degree=degree)


def on_a_ball(domain, degree):
    d = domain.dim
    ball = Sphere(centre=(0.5,) * (d - 1) + (-3.0,), radius=2.5)
    supports = [Fixed("top", [constant(0.0, d)] * d)]
    body = Body(Linear(1.0, 0.3), supports)
    return ContactProblem(domain, body, Contact("bottom", ball), degree=degree)


def displaced(problem, motion):
    """Return the geometry at a motion of the bodies."""
    body = problem.body
    x = body.space.tabulate_dof_coordinates()[: body.layout.index_map.size_local, : body.dim]
    (placement,) = problem.placements
    return placement.at(motion(x) - x)


def move(domain, motion):
    """Move a mesh; its values at corners are those of degree 1 and 2."""
    x, d = domain.mesh.geometry.x, domain.dim
    x[:, :d] = motion(x[:, :d].copy())


def check_alike(found, expected, kept=slice(None)):
    for name in ARRAYS:
        mine, theirs = getattr(found.nodes, name)[kept], getattr(expected.nodes, name)
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-11, err_msg=name)
    if found.jumps is None:
        return
    for names, of in (("slaves", "D"), ("masters", "M")):
        numbers = np.union1d(getattr(found.jumps, names), getattr(expected.jumps, names))
        dense = []
        for jumps, rows in ((found.jumps, kept), (expected.jumps, slice(None))):
            matrix = np.zeros((jumps.nodes.size, numbers.size))
            matrix[:, np.searchsorted(numbers, getattr(jumps, names))] = getattr(
                jumps, of
            ).toarray()
            dense.append(matrix[rows])
        np.testing.assert_allclose(*dense, rtol=0, atol=1e-11, err_msg=of)


@pytest.mark.core("shifted-2-1", "turned-2-2", "slid-2-1", "slid-3-2")
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("motion", [shifted, turned, slid], ids=lambda motion: motion.__name__)
def test_of_two_bodies(motion, dim, degree) -> None:
    """Nodes that are moved off the other body are open in the one, and absent in the other."""
    domain = Blocks(dim, 3, 4, gap=APART).domain(COMM)
    found = displaced(pair(domain, degree), motion)
    move(domain, motion)
    (expected,) = pair(domain, degree).geometries
    kept = np.isin(found.nodes.nodes, expected.nodes.nodes)
    opened = COMM.allreduce(np.count_nonzero(~kept))
    assert (opened > 0) == (motion is slid)
    assert np.isinf(found.nodes.gap[~kept]).all() and (found.nodes.weight > 0).all()
    check_alike(found, expected, kept)
    np.testing.assert_allclose(found.covered[kept], expected.covered, atol=1e-12)


@pytest.mark.core("2-1", "3-2")
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_in_front_of_a_ball(dim, degree) -> None:
    domain = Blocks(dim, 3, 4).domain(COMM)

    def motion(x):
        return x @ np.diag([1.1] * (dim - 1) + [0.9]) + 0.05

    found = displaced(on_a_ball(domain, degree), motion)
    move(domain, motion)
    check_alike(found, *on_a_ball(domain, degree).geometries)


@pytest.mark.parallel
@pytest.mark.parametrize("motion", [shifted, turned], ids=lambda motion: motion.__name__)
def test_moment_arms_on_a_moving_foundation_are_those_of_the_place(motion) -> None:
    """A force f on the body acts with x cross -f on the foundation, at the place x of its node."""
    domain, centre = Blocks(2, 3, 4).domain(COMM), np.array([0.5, -3.0])
    ball = Sphere(centre=(0.5, -3.0), radius=2.5)
    moving = Motion(displacement=[0.0, 0.0], rotation="free", moment=0.0, centre=list(centre))
    body = Body(Linear(1.0, 0.3), [Fixed("top", [constant(0.0, 2)] * 2)])
    problem = ContactProblem(domain, body, Contact("bottom", ball, rigid=moving))
    nodes = displaced(problem, motion).nodes
    (group,) = problem.body.global_unknowns.groups
    force = np.random.default_rng(nodes.size).standard_normal(nodes.normal.shape)
    into = np.zeros_like(problem.body.zero_displacement())
    nodes.add_jump_transposed(force, into)
    arm = motion(nodes.points) - centre
    moment = COMM.allreduce(float((arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]).sum()))
    assert abs(moment) > 0.1
    assert into[-1] / group.units[-1] == pytest.approx(-moment, rel=1e-12)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_solutions_are_those_of_the_moved_mesh(degree) -> None:
    """The upper block is at another place, with another transformation; the body is the same."""
    domain = Blocks(2, 4, 6, gap=APART).domain(COMM)
    problem = pair(domain, degree)
    before = problem.transformation
    moved = problem.with_geometry([displaced(problem, slid)])
    assert problem.transformation is before and moved.transformation is not before
    states = []
    for condense in (True, False):
        options = OPTIONS["newton"](tolerance=1e-12, condense=condense)
        state, outcome = METHODS["newton"](moved, options, None).solve()
        assert outcome.converged
        states.append(state.x)
    move(domain, slid)
    expected, outcome = METHODS["newton"](pair(domain, degree), options, None).solve()
    assert outcome.converged and problem.nodes.maximum(expected.multipliers.contact) > 1e-3
    for x in states:
        np.testing.assert_allclose(x, expected.x, rtol=0, atol=1e-10)


@pytest.mark.parallel
@pytest.mark.parametrize("name", ["newton", "whole", "uzawa", "penalty"])
def test_a_method_that_is_given_another_geometry_solves_there(name) -> None:
    """It has the jumps of that geometry in its linear systems, not those of its first one."""
    problem = pair(Blocks(2, 4, 6, gap=APART).domain(COMM), 1)
    moved = problem.with_geometry([displaced(problem, slid)])
    assert problem.same_unknowns(problem.at(0.5)) and not moved.same_unknowns(problem)
    make = METHODS["newton" if name == "whole" else name]
    options = OPTIONS["newton"](condense=False) if name == "whole" else OPTIONS[name]()
    first, anew = make(problem, options, None), make(moved, options, None)
    assert first.solve()[1].converged
    first.set_load_step(moved)
    (state, outcome), (expected, other) = first.solve(), anew.solve()
    assert outcome.converged and other.converged
    assert len(first.history) == len(anew.history)
    np.testing.assert_allclose(state.x, expected.x, rtol=0, atol=1e-12)


@pytest.mark.parallel
def test_rigid_body_modes_of_a_method_are_those_of_its_geometry() -> None:
    """Limit analysis in a load step at another geometry had the normals of the first one."""
    domain = Blocks(2, 3, 4).domain(COMM)
    ball = Sphere(centre=(0.5, -3.0), radius=2.5)
    body = Body(Linear(1.0, 0.3), Fixed("top", [constant(0.0, 2), "free"]))
    problem = ContactProblem(domain, body, Contact("bottom", ball), Friction(mu=0.3))
    moved = problem.with_geometry([displaced(problem, shifted)])
    method = METHODS["newton"](problem, OPTIONS["newton"](), None)
    method.set_load_step(moved)
    moved_anew, first = (UnconstrainedModes.of(one).groups for one in (moved, problem))
    off = 0.0
    for group, anew, before in zip(method.semismooth.modes.groups, moved_anew, first, strict=True):
        np.testing.assert_array_equal(group.normal, anew.normal)
        off = max(off, np.abs(anew.normal - before.normal).max(initial=0.0))
    assert COMM.allreduce(off, op=MPI.MAX) > 1e-3


@pytest.mark.parallel
def test_contact_of_a_geometry_tells_whether_a_step_is_regularised() -> None:
    """A body that has left the foundation was still one that contact constrains."""
    domain = rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (4, 4))
    body = Body(Linear(1.0, 0.3), Fixed("top", [constant(0.0, 2), "free"]))
    problem = ContactProblem(domain, body, Contact("bottom", Plane((0.0, 0.0), (0.0, 1.0))))
    method = METHODS["newton"](problem, OPTIONS["newton"](), None)
    assert not method.semismooth.step.underconstrained
    method.set_load_step(problem.with_geometry([displaced(problem, shifted)]))
    assert method.semismooth.step.underconstrained


def test_problems_and_geometries_do_not_change() -> None:
    """A value that is replaced would leave those that were made from it."""
    problem = ContactProblem(
        rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (2, 2)), Body(Linear(1.0, 0.3)), Contact("bottom")
    )
    for name in ("contacts", "contact", "time"):
        with pytest.raises(AttributeError, match=f"{name}: a problem does not change; make anoth"):
            setattr(problem, name, None)
    nodes = problem.geometries[0].nodes
    for array in (problem.interface.gap, problem.nodes.gap, nodes.normal, nodes.points):
        with pytest.raises(ValueError, match="read-only"):
            array[:] = 0.0
