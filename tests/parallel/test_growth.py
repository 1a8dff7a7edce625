"""Arrays and messages of a rank do not grow with the number of ranks, at fixed work each."""

import pytest
from mpi4py import MPI

from scripts.benchmarks.weak import measure

COMM = MPI.COMM_WORLD

#: A start from a coarser mesh, means beside a part.
STAGES = ("nested", "separated")


@pytest.mark.parallel(3, alone=False)  # which measures 1 and 2 as well
@pytest.mark.parametrize("bodies", [1, 2])
def test_no_rank_has_more_where_there_are_more(bodies: int) -> None:
    """Slices in a row, so that ranks exchange at the cuts: lists of all would be of each rank."""
    found = {}
    for size in range(1, COMM.size + 1):
        some = COMM.Split(0 if COMM.rank < size else MPI.UNDEFINED, COMM.rank)
        if some != MPI.COMM_NULL:
            found[size] = measure(some, 8, bodies)
        COMM.Barrier()
    found = COMM.bcast(found)  # the first rank is in all of them
    for size, counts in found.items():
        assert counts["coupling"] <= 1.1 * found[1]["coupling"], size
        # Slices are small: ghosts of a cut are up to .37 of one, and a rank has two cuts at most.
        most = 1 + 0.4 * min(size - 1, 2)
        assert counts["python"] <= most * found[1]["python"], size
        for stage in STAGES:
            assert counts[stage] <= 1.1 * found[1][stage], (stage, size)
        for stage in ("received", *(f"{stage}, received" for stage in STAGES)) if size > 1 else ():
            assert counts[stage] / (size - 1) <= 1.1 * found[2][stage], (stage, size)
