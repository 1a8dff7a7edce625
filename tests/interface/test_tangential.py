"""Friction multipliers are tangential, whatever the method; the residual sees where they are not.

Two contacts on one small body let errors along the normal grow: each contact presses by another
amount then, with all three residuals below the tolerance.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact.interface.multipliers import Multipliers
from contact.problem.residuals import evaluate
from contact.solving import solve
from tests.problems.mechanics import bar, leaning_block
from tests.problems.rings import between_plates, squeezed

COMM = MPI.COMM_WORLD

RING = Path(meshes.__file__).parent / "fixtures" / "ring.msh"


def along_normal(problem, forces) -> float:
    """Return the largest normal component of friction over the largest pressure. Collective."""
    largest = problem.nodes.maximum(np.abs(problem.nodes.normal_component(forces.friction)))
    return largest / problem.nodes.maximum(forces.pressure)


def forces_of(solution) -> np.ndarray:
    """Return what each contact exerts, shape (contacts, d). Collective."""
    problem, nodes = solution.problem, solution.problem.nodes
    vectors = solution.forces.pressure[:, None] * nodes.normal + solution.forces.friction
    sizes = [own.nodes.nodes.size for own in problem.geometries]
    groups = np.split(nodes.weight[:, None] * vectors, np.cumsum(sizes)[:-1])
    return problem.comm.allreduce(np.array([group.sum(axis=0) for group in groups]), op=MPI.SUM)


def check(solution) -> None:
    """Only the two contacts press on the ring: their forces are opposite. Collective."""
    assert solution.converged, solution.outcome.reason
    assert along_normal(solution.problem, solution.forces) < 1e-14
    plate, lid = forces_of(solution)
    assert abs(plate[1]) > 1e-6
    assert plate[1] == pytest.approx(-lid[1], rel=1e-7)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(
    ("method", "seed"), [("newton", 0), ("newton", 1), ("uzawa", 3), ("penalty", 2)]
)
def test_plate_and_lid_press_a_ring_alike(method, seed):
    # Penalty springs take thousands of steps to find where a free ring stays.
    case = squeezed(method, guided=method == "penalty")
    check(solve(case, domain=between_plates(COMM, seed)))


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_pressures_balance_the_reaction(method):
    """Uzawa's pressures have differed by 1.8 % here, with all residuals below 1e-9."""
    moduli = {
        "ring": (0.43666293017617736, 0.45),
        "plate": (0.6751374270856283, 0.2),
        "lid": (9.825794969270524, 0.45),
    }
    case = squeezed(method, moduli, "ring_top", -0.004130309947621388, file=str(RING))
    solution = solve(case, comm=MPI.COMM_SELF)
    nodes = solution.problem.nodes
    assert along_normal(solution.problem, solution.forces) < 1e-14
    assert solution.converged or method == "uzawa"
    if solution.converged:
        check(solution)
        for side in (nodes.normal[:, 1] > 0, nodes.normal[:, 1] < 0):
            pressed = nodes.sum(solution.forces.pressure * side)
            assert pressed == pytest.approx(2.3788e-5, rel=2e-4)


@pytest.mark.core
@pytest.mark.parametrize("share", [1e-3, -1e-3])
def test_residual_sees_friction_along_the_normal(share):
    """On sticking, slipping and open nodes, and where forces stay balanced."""
    solution = solve(squeezed("newton", tolerance=1e-11), domain=between_plates(MPI.COMM_SELF, 0))
    problem, state, nodes = solution.problem, solution.state, solution.problem.nodes
    assert evaluate(problem, state).largest < 1e-10
    closed = solution.status != "open"
    for there in (closed, ~closed):
        size = share * state.forces.pressure.max() * there
        friction = state.forces.friction + size[:, None] * nodes.normal
        pressure = state.forces.pressure - size * closed
        for taken in (state.forces.pressure, pressure):
            wrong = replace(state, forces=Multipliers(taken, friction))
            assert evaluate(problem, wrong).friction > 1e-5


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_tangential_part_of_a_displacement_nearly_along_the_normal(dim):
    """Beside a large normal displacement the small tangential one has no part along the normal."""
    nodes = leaning_block(MPI.COMM_SELF, 2).nodes if dim == 3 else bar(MPI.COMM_SELF, 4).nodes
    rng = np.random.default_rng(dim)
    normal = rng.standard_normal(nodes.normal.shape)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    tangent = np.eye(dim) - normal[:, :, None] * normal[:, None, :]
    nodes = replace(nodes, normal=normal, tangent=tangent)
    small = np.einsum("nij,nj->ni", tangent, rng.standard_normal(normal.shape))
    part = nodes.tangential_component(normal + 1e-9 * small)
    size = np.linalg.norm(part, axis=1)
    assert np.all(np.abs(nodes.normal_component(part)) < 1e-15 * size)
    np.testing.assert_allclose(part, 1e-9 * small, rtol=0, atol=1e-15)
