"""Load steps on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
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
def test_the_ranks_do_not_matter(law, comm):
    case = case_of(**LAWS[law])
    alone, together = solve(case, comm=MPI.COMM_SELF), solve(case, comm=comm)
    agree(tables(together), tables(alone))
