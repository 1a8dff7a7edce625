"""The examples to read first run, on coarse meshes, and show what they say they show."""

import numpy as np
import pytest
from mpi4py import MPI

from scripts.examples import (
    bar_pressure,
    cyclic_sensor,
    electrode_charge,
    fretting,
    own_contact,
    own_material,
    own_return_mapping,
    refinement,
)

pytestmark = pytest.mark.parallel(2)


def test_bar_pressure(shared_tmp_path, capsys):
    solution = bar_pressure.main(shared_tmp_path, (32, 8))
    assert solution.converged
    MPI.COMM_WORLD.barrier()
    assert (shared_tmp_path / "pressure.png").stat().st_size > 0
    if MPI.COMM_WORLD.rank == 0:
        assert "all residuals <= 1e-08" in capsys.readouterr().out


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


def test_electrode_charge():
    charges = electrode_charge.main((16, 8), (5.0, 10.0, 20.0))
    assert charges[1] == pytest.approx(2 * charges[0], rel=1e-6)
    assert abs(charges[2]) > 2.02 * abs(charges[1])  # beyond yield


def test_refinement(shared_tmp_path):
    errors = refinement.main(shared_tmp_path, (2, 4, 16))
    coarse, fine = np.transpose(list(errors.values()))
    assert np.all(np.log2(coarse / fine) > 0.6)
    MPI.COMM_WORLD.barrier()
    assert (shared_tmp_path / "errors.png").is_file()


def test_fretting():
    """Around the loop the force changes its sign and comes back to the same size."""
    rows = fretting.main((24, 12), 4)
    force = dict(zip(rows[:, 0], rows[:, 1], strict=True))
    assert force[4.0] == pytest.approx(-force[2.0], rel=0.02)
    assert force[6.0] == pytest.approx(force[2.0], rel=1e-6)
    assert abs(force[3.0]) > 0.1 * force[2.0]  # friction remembers


def test_cyclic_sensor(shared_tmp_path):
    load, charge = cyclic_sensor.main(shared_tmp_path, (16, 8))
    # The way back is another one, and from then on nearly the same again.
    ends = np.flatnonzero(np.isclose(load, 1.0))
    assert charge[ends[1]] == pytest.approx(charge[ends[2]], rel=1e-3)
    first, back = (k for k in np.flatnonzero(np.isclose(load, 0.5))[:2])
    assert abs(charge[back] - charge[first]) > 1e-2 * np.ptp(charge)
