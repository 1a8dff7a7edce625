"""What a solution offers in Python."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, InputError, Linear, Load, Problem, solve
from contact.mesh.grid import rectangle
from tests.problems.written import block, electric


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_contact_as_arrays_and_functions(dim: int, degree: int) -> None:
    """All ranks have all nodes; a function on the surface integrates to the same force."""
    solution = solve(block(dim, degree))
    contact = solution.contact
    total = contact.weight @ contact.traction
    np.testing.assert_allclose(total, solution.contact_force, rtol=1e-12)
    assert contact.pressure.max() == pytest.approx(
        solution.problem.nodes.maximum(solution.pressure)
    )
    assert np.all(contact.opening >= -1e-9)
    sliding = contact.status == "slip"
    friction = np.linalg.norm(contact.traction - contact.pressure[:, None] * contact.normal, axis=1)
    np.testing.assert_allclose(friction[sliding], contact.friction_bound[sliding], rtol=1e-6)
    pressure = contact.function("pressure")
    assert pressure.function_space.mesh.topology.dim == dim - 1
    if (dim, degree) != (3, 2):  # whose weights are those of other functions
        form = fem.form(pressure * ufl.dx)
        integral = MPI.COMM_WORLD.allreduce(fem.assemble_scalar(form), op=MPI.SUM)
        assert integral == pytest.approx(contact.weight @ contact.pressure, rel=1e-10)
    assert contact.function("traction").x.array.size == dim * pressure.x.array.size
    with pytest.raises(InputError, match=r"\[no-such-name\]"):
        contact.function("status")


@pytest.mark.core
@pytest.mark.parallel
def test_fields() -> None:
    solution = solve(electric(2))
    mises = solution.von_mises.x.array.max(initial=0.0)
    largest = MPI.COMM_WORLD.allreduce(float(mises), op=MPI.MAX)
    assert largest == pytest.approx(solution.max_von_mises)
    assert solution.stress.ufl_shape == (3, 3)
    assert solution.potential is not None
    assert solution.contact.charge is not None


@pytest.mark.parallel
def test_a_body_that_nothing_holds_is_refused() -> None:
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (1.0, 1.0), (2, 2))
    body = Body(Linear(1.0, 0.3), [], [Load("top", traction=[0.1, 0.0])])
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        solve(Problem(domain, body, Contact("bottom")))
