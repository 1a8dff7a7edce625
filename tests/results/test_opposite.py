"""The other side of contacts between bodies: forces and pressures, tables and figures."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact.body.description import Body
from contact.methods.options import NewtonOptions
from contact.model.body import Fixed, Load
from contact.model.contact import Contact
from contact.model.obstacle import GapFunction
from contact.problem.problem import ContactProblem
from contact.results.contact_nodes import opposite_surface
from contact.solving import solve_problem
from forms.hencky import Linear
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant

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
    surface = opposite_surface(found)
    assert surface is not None
    fields = surface.at_points
    np.testing.assert_allclose(fields["pressure"], 0.01, rtol=1e-11)
    np.testing.assert_allclose(
        fields["traction"], np.tile(-0.01 * up, (len(fields["weight"]), 1)), atol=1e-13
    )
    np.testing.assert_allclose(
        fields["normal"], np.tile(up, (len(fields["weight"]), 1)), atol=1e-12
    )
    assert COMM.allreduce(fields["weight"].sum()) == pytest.approx(1.0)
