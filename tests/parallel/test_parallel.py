"""The same solutions on any number of ranks, also where a rank has nothing to do."""

import numpy as np
import pytest
from dolfinx import fem, graph, mesh
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Load
from contact._compat import geometry_dofmap
from contact.interface.friction import Smoothing
from contact.mesh.domain import from_mesh
from contact.mesh.grid import Piece, rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Log
from forms.laws import SlipCoefficient
from tests.problems import everywhere
from tests.problems.everywhere import displacements
from tests.problems.mechanics import (
    bar,
    constant,
    contact_data,
    flat,
    leaning_block,
    pressed_block,
    solve,
)
from tests.problems.meshes import assembled
from tests.problems.revolution import pressed_cylinder

pytestmark = pytest.mark.parallel(alone=False)


def agree(make):
    """Solve on all ranks together and on one alone, and compare."""

    def quantities(loop):
        data = contact_data(loop)
        assert data["pressure"].max() > 0
        names = ("points", "pressure", "friction", "bound", "open", "sticks")
        found = {name: data[name] for name in names}
        return found | {"u": displacements(loop), "r": loop.r, "size": loop.problem.domain.size}

    return everywhere.agree(lambda comm: solve(make(comm), 1e-10), quantities, atol=1e-13)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_example_7_2(comm, degree):
    agree(lambda c: bar(c, 8 // degree, -0.005, 1e5, degree))


@pytest.mark.core
def test_example_7_2_with_yield_and_smoothing(comm):
    law = Log(1.0, 0.3, yield_strain=0.05)
    friction = Friction(SlipCoefficient(0.5, 0.2, 1e5), radius=0.3)
    agree(lambda c: bar(c, 8, -0.05, law=law, friction=friction))


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_in_space(comm, degree):
    agree(lambda c: leaning_block(c, 3 - degree // 2, degree))


@pytest.mark.core
def test_a_body_that_only_the_foundation_holds(comm):
    agree(lambda c: pressed_block(c, 3, 2, gap=0.05))


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_a_body_of_revolution(comm, degree):
    agree(lambda c: pressed_cylinder(c, 6, degree, radius=0.3))


def tower(comm, cells=(2, 24)):
    """Return a tower on a small part of its foot: some rank is far from the ground."""
    domain = rectangle(
        comm, [0.0, 0.0], [1.0, 12.0], cells, parts={"foot": Piece("bottom", 0.0, 0.5)}
    )
    zero = constant(0.0, 2)
    body = Body(
        Log(1.0, 0.3, yield_strain=0.05),
        [Fixed("top", [zero, constant(-0.1, 2)])],
        [Load("right", [constant(-1e-5, 2), zero])],
    )
    return ContactProblem(domain, body, Contact("foot", flat()), Friction(radius=0.0))


@pytest.mark.core
def test_a_rank_without_contact_nodes(comm):
    together = agree(tower)
    counts = comm.allgather(together.problem.nodes.nodes.size)
    assert comm.size == 1 or min(counts) == 0


def tower_with_friction(comm):
    plain = tower(comm)
    friction = Friction(SlipCoefficient(0.3, 0.2, 10.0), radius=0.4)
    contact = plain.contacts[0].model_copy(update={"friction": friction})
    return ContactProblem(plain.domain, plain.description, contact, degree=2)


@pytest.mark.core
def test_a_rank_without_contact_nodes_with_friction_and_smoothing(comm):
    agree(tower_with_friction)


def on_one_rank(comm):
    """Return a unit square whose cells are all on rank 0."""
    whole = mesh.create_unit_square(MPI.COMM_SELF, 4, 4)

    def partitioner(_comm, _parts, _types, cells):
        size = len(cells[0]) // 3
        return adjacency(np.zeros((size, 1), dtype=np.int32))

    x = whole.geometry.x[:, :2].copy()
    return assembled(comm, x, geometry_dofmap(whole), partitioner=partitioner)


def adjacency(links):
    made = graph.adjacencylist(links)
    return getattr(made, "_cpp_object", made)


def idle(comm):
    """Return a problem of which all ranks but one hold nothing."""
    square = on_one_rank(comm) if comm.size > 1 else mesh.create_unit_square(comm, 4, 4)
    domain = from_mesh(
        square, {"bottom": lambda x: np.isclose(x[1], 0), "top": lambda x: np.isclose(x[1], 1)}
    )
    body = Body(
        Log(1.0, 0.3, yield_strain=0.05),
        [Fixed("top", [constant(0.02, 2), constant(-0.03, 2)])],
    )
    friction = Friction(SlipCoefficient(0.3, 0.2, 10.0), radius=0.3)
    return ContactProblem(domain, body, Contact("bottom", flat()), friction)


@pytest.mark.core
def test_ranks_without_cells(comm):
    together = agree(idle)
    cells = comm.allgather(together.problem.domain.mesh.topology.index_map(2).size_local)
    assert comm.size == 1 or min(cells) == 0


@pytest.mark.core
def test_a_mesh_of_two_cells(comm):
    def make(c):
        domain = rectangle(c, [0.0, 0.0], [1.0, 1.0], [1, 1])
        body = Body(
            Log(1.0, 0.3, yield_strain=0.05),
            [Fixed("top", [constant(0.05, 2), constant(-0.03, 2)])],
        )
        friction = Friction(SlipCoefficient(0.3, 0.2, 10.0))
        return ContactProblem(domain, body, Contact("bottom", flat()), friction, degree=2)

    agree(make)


@pytest.mark.core
@pytest.mark.parametrize("radius", [0.0, 0.2, 1.0, 9.0])
def test_smoothing(comm, radius):
    """Neighbours within the radius count, whichever rank has them."""
    results = []
    for c in (comm, MPI.COMM_SELF):
        nodes = bar(c, 8, degree=2).nodes
        pressure = np.sin(3 * nodes.points[:, 0]) + 1
        smooth = nodes.gather(Smoothing(nodes, radius)(pressure))
        results.append(smooth[np.argsort(nodes.gather(nodes.points)[:, 0])])
    assert results[0] == pytest.approx(results[1], rel=1e-13)


@pytest.mark.core
def test_sums_norms_and_maxima_are_global(comm):
    nodes, alone = bar(comm, 8).nodes, bar(MPI.COMM_SELF, 8).nodes
    assert nodes.size == alone.size == 32
    x, y = nodes.points[:, 0], alone.points[:, 0]
    assert nodes.sum(x) == pytest.approx(alone.sum(y), rel=1e-14)
    assert nodes.norm(nodes.points) == pytest.approx(alone.norm(alone.points), rel=1e-14)
    assert nodes.maximum(-x, -9.0) == pytest.approx(-y.min())
    assert sorted(nodes.gather(x)) == pytest.approx(sorted(y))


@pytest.mark.core
def test_every_node_has_one_owner_and_full_weight(comm):
    for degree in (1, 2):
        nodes = leaning_block(comm, 2, degree).nodes
        alone = leaning_block(MPI.COMM_SELF, 2, degree).nodes
        order = [np.lexsort(np.round(t.gather(t.points), 9).T) for t in (nodes, alone)]
        for quantity in ("points", "weight", "normal", "gap", "tangential_projector"):
            ours, theirs = (
                t.gather(getattr(t, quantity))[o]
                for t, o in zip((nodes, alone), order, strict=True)
            )
            assert ours == pytest.approx(theirs, abs=1e-14)


@pytest.mark.core
def test_prescribed_values_reach_ghosts(comm):
    problem = idle(comm)
    x = problem.start().x
    height = fem.Function(problem.body.space)
    height.interpolate(lambda x: np.vstack([x[1], x[1]]))
    top = np.isclose(height.x.array, 1.0)
    assert set(np.unique(x[top]).tolist()) <= {0.02, -0.03}


@pytest.mark.core
def test_a_mesh_is_distributed_in_the_same_way_each_time(comm):
    made = [mesh.create_unit_cube(comm, 8, 8, 8).geometry.x for _ in range(8)]
    assert all(np.array_equal(made[0], x) for x in made[1:])
