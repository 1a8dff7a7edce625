"""Degree 2 in space: all nodes of Gamma_3 carry positive areas and forces, vertices too."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
from contact.mesh.grid import box
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.model.body import Body, Fixed
from contact.model.contact import Contact
from contact.model.obstacle import Sphere
from contact.problem.problem import ContactProblem
from contact.results.contact_nodes import contact_table
from forms.hencky import Linear
from tests.problems.mechanics import constant, leaning_block
from tests.problems.piezo import Column, potential

SELF = MPI.COMM_SELF


METHODS = {
    "sparse": (NewtonOptions(tolerance=1e-9, condense=False), 1e-7),
    "multigrid": (NewtonOptions(tolerance=1e-9, linear="iterative"), 1e-7),
    "fixed point": (FixedPointOptions(tolerance=1e-9), 1e-6),
    "penalty": (PenaltyOptions(eps_contact=1e-6, eps_slip=1e-7), 2e-3),
}


def test_all_methods_find_the_same_pressures():
    """Friction, yield, and a clamped side: nodes without forces whose neighbours have some."""
    found = solve(leaning_block(SELF, 2, 2), NewtonOptions(tolerance=1e-10))
    assert found.converged
    for name, (options, tolerance) in METHODS.items():
        other = solve(leaning_block(SELF, 2, 2), options)
        assert other.converged, name
        for one, two in ((found.pressure, other.pressure), (found.friction, other.friction)):
            assert np.abs(one - two).max() < tolerance * np.abs(found.pressure).max(), name


@pytest.mark.core
def test_no_node_is_in_the_ball():
    """The means of the constraint hold: with them, so do nodal values, which are their mixtures."""
    radius, rise = 3.0, 0.03
    domain = box(SELF, [-0.5, -0.5, -0.5], [1.0, 1.0, 0.5], [4, 4, 2])
    lifted = Fixed("bottom", [constant(0.0, 3)] * 2 + [constant(rise, 3)])
    ball = Sphere((0.0, 0.0, radius), radius)
    problem = ContactProblem(
        domain, Body(Linear(1.0, 0.3), [lifted]), Contact("top", ball), degree=2
    )
    solution = solve(problem, NewtonOptions(tolerance=1e-10))
    points = problem.body.space.tabulate_dof_coordinates()
    top = np.abs(points[:, 2]) < 1e-9
    u = solution.state.x.reshape(-1, 3)[top]
    direction, gap = ball.measure(points[top], np.tile([0.0, 0.0, 1.0], (len(u), 1)))
    depth = np.einsum("ni,ni->n", direction, u) - gap
    # Directions differ from node to node, by h/R over an edge.
    assert depth.max() < 0.02 * rise
    pressed = problem.nodes.points[solution.pressure > 1e-6]
    vertices = np.abs(pressed[:, :2] * 4 - np.round(pressed[:, :2] * 4)).max(axis=1) < 1e-9
    assert 5 <= np.count_nonzero(vertices) < len(pressed)
    table = contact_table(solution.contact)
    assert table is not None
    assert table["x"].size == np.count_nonzero(top)


@pytest.mark.parallel
@pytest.mark.parametrize("method", [NewtonOptions(tolerance=1e-11), FixedPointOptions()])
def test_current_through_nodes_that_are_held(comm, method):
    """Closed form 3 with all sides constrained: the rim of Gamma_3 cannot move, but conducts."""
    column = Column(k_e=2.0, phi_f=32.0)
    problem = column.problem(comm, 3, degree=2, degrees=30.0)
    constrained = problem.interface.fixed_conducting
    assert constrained is not None
    assert comm.allreduce(constrained.nodes.nodes.size) > 0
    solution = solve(problem, method.model_copy(update={"tolerance": 1e-10}))
    assert solution.converged
    _, bottom = column.solution()
    found = potential(problem, solution.state)
    assert np.abs(found - bottom).max(initial=0.0) < 1e-8 * abs(bottom)
