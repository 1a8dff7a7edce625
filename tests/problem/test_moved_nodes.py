"""Friction at contact nodes that supports move along the foundation: they slip as others do."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Linear, Problem, solve, solve_steps
from contact.mesh.grid import box, rectangle
from contact.methods.options import OPTIONS
from scripts.force_balance import force_balance
from tests.problems.blocks import Blocks

COMM = MPI.COMM_WORLD

MU, WAY = 0.3, 0.1


def moved(domain, contact, supports, method="newton", **options):
    """Return the solution of bodies of which supports move some along x on others."""
    body = Body(Linear(10, 0.3), [Fixed(part, values) for part, values in supports.items()])
    problem = Problem(domain, body, contact, Friction(mu=MU))
    solution = solve(problem, OPTIONS[method](tolerance=1e-9), **options)
    assert solution.converged, solution.outcome.reason
    return solution


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(
    ("method", "within"), [("newton", 1e-9), ("uzawa", 1e-7), ("penalty", 0.02)]
)
def test_ends_that_supports_move_slip_as_the_others(method, within):
    domain = rectangle(COMM, (0, 0), (2, 1), (8, 4))
    supports = {"top": [WAY, -0.005], "left": [WAY, "free"], "right": [WAY, "free"]}
    solution = moved(domain, Contact("bottom"), supports, method)
    force = solution.contact_force
    assert force[0] == pytest.approx(-MU * force[1], rel=within)
    contact = solution.contact
    assert set(contact.status) == {"slip"}
    ends = np.isin(contact.points[:, 0], (0.0, 2.0))
    assert contact.slip[ends, 0] == pytest.approx(WAY, rel=1e-12)
    borne = sum(solution.reaction(part)[0] for part in supports)
    assert borne == pytest.approx(force[0], rel=1e-6)


@pytest.mark.core
@pytest.mark.parallel
def test_there_and_back():
    domain = rectangle(COMM, (0, 0), (2, 1), (4, 2))
    body = Body(
        Linear(10, 0.3),
        [
            Fixed("top", ["free", -0.005], amplitude="constant"),
            *(
                Fixed(part, [WAY, "free"], amplitude=lambda t: np.sin(np.pi * t))
                for part in ("top", "left", "right")
            ),
        ],
    )
    problem = Problem(domain, body, Contact("bottom"), Friction(mu=MU))
    solution = solve_steps(problem, [0.25, 0.5, 0.75, 1.0])
    assert solution.converged
    assert solution.contact_force[0] == pytest.approx(MU * solution.contact_force[1], rel=1e-8)
    lost = sum(float(step.row["dissipation"]) for step in solution.steps)
    # Less by what the block gives way before it slides back; the ends alone bear a quarter.
    assert lost == pytest.approx(-2 * WAY * MU * solution.contact_force[1], rel=0.03)


@pytest.mark.parallel
def test_faces_of_a_block_in_space():
    domain = box(COMM, (0, 0, 0), (1, 1, 1), (3, 3, 3))
    sides = ["left", "right"]
    supports = {"top": [WAY, 0.0, -0.005]} | {side: [WAY, "free", "free"] for side in sides}
    force = moved(domain, Contact("bottom"), supports).contact_force
    assert np.linalg.norm(force[:2]) == pytest.approx(-MU * force[2], rel=1e-3)


@pytest.mark.core
@pytest.mark.parallel
def test_a_block_that_slides_over_held_nodes():
    supports = {
        "bottom": [0.0, 0.0],
        "lower_left": [0.0, "free"],
        "upper_left": [WAY, "free"],
        "top": [WAY, -0.005],
    }
    solution = moved(Blocks(2).domain(COMM), Contact("over", against="under"), supports)
    balance = force_balance(solution.problem, solution.state)
    assert balance.contact == pytest.approx([0.0, 0.0], abs=1e-12)
    across, down = balance.passed[0]
    assert abs(across) == pytest.approx(MU * abs(down), rel=1e-6)


def halved(on, against):
    """Return the solution of a box that is pressed on another; a side of both is a symmetry."""
    sides = ["lower_left", "upper_left"]
    supports = {"bottom": [0.0] * 3, "top": ["free", "free", -0.02]}
    supports |= {side: [0.0, "free", "free"] for side in sides}
    return moved(Blocks(3).domain(COMM), Contact(on, against=against), supports)


@pytest.mark.parallel
@pytest.mark.parametrize(("on", "against"), [("over", "under"), ("under", "over")])
def test_a_plane_of_symmetry_between_boxes(on, against):
    """Nodes in the plane face masters beside it, which move: their jump is no unknown."""
    contact = halved(on, against).contact
    plane = contact.points[:, 0] < contact.points[:, 0].min() + 1e-9
    assert contact.slip[plane, 0] == pytest.approx(0.0, abs=1e-15)
    assert (contact.pressure[plane] > 0).any()
