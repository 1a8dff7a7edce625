"""Contact nodes of regular meshes: their areas, normals, and what supports leave of them."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import SlidingBlock, flat, pressed_block, solve


@pytest.mark.core
def test_p2_contact_nodes_of_triangles_are_all_nodes_with_positive_areas():
    problem = pressed_block(MPI.COMM_SELF, 3, 2)
    corners = problem.domain.mesh.geometry.x
    distance = np.linalg.norm(problem.nodes.points[:, None] - corners[None], axis=2)
    at_corners = distance.min(axis=1) < 1e-9
    # A grid of 2 x 3 squares, each cut in two: edges along x, along y, and diagonals.
    assert np.count_nonzero(at_corners) == 3 * 4
    assert np.count_nonzero(~at_corners) == 2 * 4 + 3 * 3 + 6
    # A triangle gives 2/15 of its area to each corner, 1/5 to the middle of each edge.
    weight = problem.nodes.weight
    assert weight[at_corners].sum() == pytest.approx(3 * 2 / 15, rel=1e-12)
    assert weight[~at_corners].max() == pytest.approx(2 / 5 / 12, rel=1e-12)


@pytest.mark.core
def test_normals_are_the_body_s_own_for_a_given_gap():
    """A turned block whose contact direction is computed from its facets."""
    for dim in (2, 3):
        block = SlidingBlock(Linear(1.0, 0.3), ConstantCoefficient(0.5), 0.01, 0.03, 0.0125)
        with_plane = block.problem(MPI.COMM_SELF, dim, 2, 30.0)
        with_gap = ContactProblem(
            with_plane.domain,
            with_plane.description,
            Contact("bottom", flat()),
            with_plane.contacts[0].friction,
            degree=2,
        )
        assert np.abs(with_plane.nodes.normal - with_gap.nodes.normal).max() < 1e-12
        loop = solve(with_gap, 1e-11)
        assert loop.state.multipliers.contact == pytest.approx(block.pressure, abs=1e-9)


@pytest.mark.core
def test_a_fixed_node_carries_no_contact_and_a_fixed_direction_slips_as_given():
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [1.0, 1.0], [4, 4])
    zero = pressed_block(MPI.COMM_SELF, 2).description.fixed[0].displacement[0]
    clamped = Body(Linear(1.0, 0.3), [Fixed("left", [zero, zero])])
    symmetric = Body(Linear(1.0, 0.3), [Fixed("left", [zero, None])])
    assert ContactProblem(domain, clamped, Contact("bottom", flat())).nodes.size == 4
    nodes = ContactProblem(domain, symmetric, Contact("bottom", flat())).nodes
    assert nodes.size == 5
    assert np.abs(nodes.tangential_projector - np.diag([1.0, 0.0])).max() < 1e-14
