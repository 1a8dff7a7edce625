"""Load steps and their checkpoints on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
from contact.ranks import on_root
from tests.output.test_steps import case_of

pytestmark = pytest.mark.parallel

LAWS = {
    "linear": {},
    "hencky": {"material__law": "log", "material__yield_strain": 0.002},
}


def tables(steps, comm):
    """Return the rows and contact tables of steps, from rank 0."""
    own = [(dict(step.row), step.table) for step in steps]
    return comm.bcast(own)


def agree(some, others):
    for (row, table), (other_row, other_table) in zip(some, others, strict=True):
        for name, value in row.items():
            if name not in ("linear_solves", "factorizations", "kkt"):
                assert value == pytest.approx(other_row[name], rel=1e-11, abs=1e-12)
        for name in ("x", "u_n", "u_t", "pressure", "tau", "bound"):
            np.testing.assert_allclose(table[name], other_table[name], rtol=1e-11, atol=1e-10)


@pytest.mark.parametrize("law", LAWS)
def test_the_ranks_do_not_matter(law, comm, shared_tmp_path):
    """From rest; and from the checkpoints of a run on one rank, and back."""
    case = case_of(**LAWS[law])
    alone = solve(case, comm=MPI.COMM_SELF)
    together = solve(case, comm=comm, folder=shared_tmp_path)
    agree(tables(together.steps, comm), tables(alone.steps, comm))
    agree(tables(together.steps, comm), [(dict(s.row), s.table) for s in alone.steps])

    folder = shared_tmp_path / "one"
    if comm.rank == 0:
        folder.mkdir()
        solve(case, comm=MPI.COMM_SELF, folder=folder)
        for later in (4, 5):
            (folder / "checkpoints" / f"0000{later}.npz").unlink()
    comm.barrier()
    resumed = solve(case, comm=comm, folder=folder, restart=folder)
    agree(tables(resumed.steps, comm), tables(alone.steps, comm))
    assert len(resumed.history.records) < len(together.history.records)

    def back() -> list:
        for later in (3, 4, 5):
            (shared_tmp_path / "checkpoints" / f"0000{later}.npz").unlink()
        found = solve(case, comm=MPI.COMM_SELF, restart=shared_tmp_path)
        return [(dict(step.row), step.table) for step in found.steps]

    again = on_root(comm, back)
    agree(again, tables(alone.steps, comm))
