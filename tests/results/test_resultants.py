"""Resultants: areas, forces, moments, largest stresses, share beyond yield.

What a solution offers in Python.
"""

from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, InputError, Linear, Load, Problem, solve
from contact.io.fields import body_share
from contact.mesh.grid import rectangle
from tests.problems.written import block, electric, written

PRESSURE = 0.1


def pressed(dim: int, degree: int, **sections: object):
    """Return a block under a uniform pressure, free to grow sideways: a homogeneous state."""
    supports = [{"on": "left", "displacement": [0.0, *["free"] * (dim - 1)]}]
    if dim == 3:
        supports.append({"on": "front", "displacement": ["free", 0.0, "free"]})
    case = {
        "fixed": supports,
        "load": [{"on": "top", "pressure": PRESSURE}],
        "friction": {},
        "material": {"young": 10.0, "poisson": 0.3},
    }
    return solve(block(dim, degree, **(case | sections)))


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_homogeneous_state(dim: int, degree: int, shared_tmp_path: Path) -> None:
    """Closed forms: sigma_zz = nu sigma_yy in plane strain, one stress alone in space."""
    summary, _ = written(pressed(dim, degree), shared_tmp_path)
    force = 2.0 * PRESSURE
    assert summary["contact_area"] == pytest.approx(2.0, rel=1e-12)
    moment = [-force] if dim == 2 else [-0.5 * force, force, 0.0]
    np.testing.assert_allclose(summary["contact_moment"], moment, atol=1e-9 * force)
    mises = PRESSURE * (np.sqrt(1 - 0.3 + 0.3**2) if dim == 2 else 1.0)
    assert summary["max_von_mises"] == pytest.approx(mises, rel=1e-8)
    assert summary["plastic_share"] is None
    for part, reaction in summary["reactions"].items():
        assert part in ("left", "front")
        np.testing.assert_allclose(reaction, 0.0, atol=1e-9 * force)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_supports_balance_contact(dim: int) -> None:
    """Forces and moments of two supports, of which one shares nodes with the other."""
    supports = [
        {"on": "top", "displacement": [0.02, *[0.0] * (dim - 2), "-0.02-0.02*x"]},
        {"on": "left", "displacement": [0.02, *["free"] * (dim - 1)]},
    ]
    solution = solve(block(dim, fixed=supports))
    supports = solution.supports
    assert set(supports) == {"top", "left"}
    force = sum(support.force for support in supports.values())
    moment = sum(support.moment for support in supports.values())
    np.testing.assert_allclose(force, solution.contact_force, rtol=1e-7, atol=1e-8)
    # A load would add to the moment, and friction acts at the bottom, y = 0.
    scale = np.abs(solution.contact_moment).max()
    np.testing.assert_allclose(moment, solution.contact_moment, atol=1e-7 * scale)
    np.testing.assert_array_equal(solution.reaction("left"), supports["left"].force)
    with pytest.raises(InputError, match=r"\[no-such-name\]"):
        solution.reaction("right")


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("limit", "share"), [(1e-3, 1.0), (0.1, 0.0)])
def test_plastic_share(limit: float, share: float) -> None:
    law = {"law": "log", "young": 10.0, "poisson": 0.3, "yield_strain": limit}
    assert pressed(2, 1, material=law).plastic_share == pytest.approx(share, abs=1e-12)


@pytest.mark.core
def test_part_of_the_body_is_beyond_yield() -> None:
    """The share is that of the cells' areas, taken from the written strains."""
    solution = solve(block(2))
    strain = body_share(solution.problem, solution.state).in_cells["dev_strain_cell"]
    beyond = np.mean(strain > 0.02)  # the cells are alike
    assert 0.0 < beyond < 1.0
    assert solution.plastic_share == pytest.approx(beyond, rel=1e-12)


@pytest.mark.core
def test_what_is_open_has_no_area() -> None:
    """A gap of which half is closed by an imposed displacement."""
    gap = "0.05*(x > 1.01)"
    solution = solve(
        block(
            2,
            fixed=[{"on": "top", "displacement": [0.0, -0.02]}],
            contact={"on": "bottom", "gap": gap},
        )
    )
    assert solution.contact_area == pytest.approx(1.125, rel=1e-12)


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
