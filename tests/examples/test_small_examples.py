"""The examples to read first run, on coarse meshes, and show what they say they show."""

import numpy as np
import pytest
from mpi4py import MPI

from scripts.examples import (
    own_contact,
    own_material,
    own_return_mapping,
    refinement,
)

pytestmark = pytest.mark.parallel(2)


def test_own_material():
    solutions = own_material.main((16, 4))
    assert all(solution.converged for solution in solutions.values())
    assert solutions["softening"].max_dev_strain > 1.2 * solutions["linear"].max_dev_strain


def test_own_return_mapping():
    solution = own_return_mapping.main(0.03)
    assert solution.converged
    forces = np.array([step.row["contact_force_y"] for step in solution.steps])
    assert forces.argmax() == 4 and forces[-1] == 0  # loaded in five steps, and a mark remains
    assert all(step.row["plastic_dissipation"] >= 0 for step in solution.steps)
    assert solution.plastic_dissipation > 0


def test_own_contact():
    mu, waves = own_contact.Weakening(0.5, 0.3, 1e-3), own_contact.Waves(2e-3, 1.0)
    solution = own_contact.main((32, 8))
    assert solution.converged
    nodes, touching = solution.problem.nodes, solution.status != "open"
    assert 0 < nodes.comm.allreduce(int(touching.sum())) < nodes.size
    # The crests bear the load, not the troughs, which are 4e-3 deep.
    _, gap = waves.measure(nodes.points, nodes.normal)
    assert np.all(gap[touching] < 3e-3)
    slips = solution.status == "slip"
    bound = mu(np.linalg.norm(solution.slip, axis=1)) * solution.pressure
    size = np.linalg.norm(solution.friction, axis=1)
    assert np.allclose(size[slips], bound[slips], rtol=1e-6, atol=0)


def test_refinement(shared_tmp_path):
    errors = refinement.main(shared_tmp_path, (2, 4, 16))
    coarse, fine = np.transpose(list(errors.values()))
    assert np.all(np.log2(coarse / fine) > 0.6)
    MPI.COMM_WORLD.barrier()
    assert (shared_tmp_path / "errors.png").is_file()
