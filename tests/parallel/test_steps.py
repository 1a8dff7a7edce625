"""Load steps and their checkpoints on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
from contact.cli.solve import solve_and_keep
from contact.ranks import on_root
from contact.results.quantities import values_of
from contact.results.quantity import NODES
from tests.results.test_steps import case_of

pytestmark = pytest.mark.parallel

LAWS = {
    "linear": {},
    "hencky": {"material__law": "log", "material__yield_strain": 0.002},
}


def tables(solution):
    """Return the rows and contact tables of the steps. Collective."""
    return [
        (dict(step.row), values_of(NODES, solution.at_step(step.state).contact))
        for step in solution.steps
    ]


def agree(some, others):
    for (row, table), (other_row, other_table) in zip(some, others, strict=True):
        for name, value in row.items():
            if name not in ("linear_solves", "factorizations", "kkt"):
                assert value == pytest.approx(other_row[name], rel=1e-11, abs=1e-12)
        for name in ("x", "u_n", "u_t", "pressure", "tau", "bound"):
            np.testing.assert_allclose(table[name], other_table[name], rtol=1e-11, atol=1e-10)


@pytest.mark.core
@pytest.mark.parametrize("law", LAWS)
def test_the_ranks_do_not_matter(law, comm, shared_tmp_path):
    """From rest; and from the checkpoints of a run on one rank, and back."""
    case = case_of(**LAWS[law])
    alone = solve(case, comm=MPI.COMM_SELF)
    together = solve_and_keep(case, None, comm, shared_tmp_path)
    known = tables(alone)
    agree(tables(together), known)

    folder = shared_tmp_path / "one"
    if comm.rank == 0:
        folder.mkdir()
        solve_and_keep(case, None, MPI.COMM_SELF, folder)
        for later in (4, 5):
            (folder / "checkpoints" / f"0000{later}.npz").unlink()
    comm.barrier()
    resumed = solve_and_keep(case, None, comm, folder, folder)
    agree(tables(resumed), known)
    assert len(resumed.history) < len(together.history)

    def back() -> list:
        for later in (3, 4, 5):
            (shared_tmp_path / "checkpoints" / f"0000{later}.npz").unlink()
        return tables(solve_and_keep(case, None, MPI.COMM_SELF, shared_tmp_path, shared_tmp_path))

    agree(on_root(comm, back), known)
