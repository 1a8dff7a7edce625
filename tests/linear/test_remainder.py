"""What ranks leave of a matrix, against the same by one dense matrix."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.linear import schur
from contact.linear.schur import Remainder, send_to_first

WORLD = MPI.COMM_WORLD
KEPT, OTHERS = 7, 6


@pytest.mark.parallel
def test_shares_of_all_ranks_are_added_and_the_others_eliminated(monkeypatch):
    """Shares of unknowns that differ from rank to rank, sent three rows at a time."""
    monkeypatch.setattr(schur, "ROWS", 3)
    size = KEPT + OTHERS
    expected, shares = np.diag(np.arange(10.0, 10 + size)), []
    for rank in range(WORLD.size):
        rng = np.random.default_rng(rank)
        at = np.flatnonzero(rng.random(size) < 0.7)
        half = rng.standard_normal((at.size, at.size))
        shares.append((at, np.asfortranarray(half @ half.T)))
        expected[np.ix_(at, at)] += shares[-1][1]
    if WORLD.rank > 0:
        send_to_first(WORLD, shares[WORLD.rank][1])
        return
    found = Remainder(KEPT, OTHERS)
    diagonal = np.arange(size)
    found.set(diagonal, diagonal, np.arange(10.0, 10 + size))
    found.add(*shares[0])
    for rank in range(1, WORLD.size):
        found.receive(WORLD, rank, shares[rank][0])
    kept, coupling, among = expected[:KEPT, :KEPT], expected[:KEPT, KEPT:], expected[KEPT:, KEPT:]
    left = found.eliminate()
    assert left.flags.f_contiguous
    assert np.allclose(left, kept - coupling @ np.linalg.solve(among, coupling.T), atol=1e-12)
    values = np.ones(OTHERS)
    assert np.allclose(found.solve(values), np.linalg.solve(among, values), atol=1e-12)
    assert np.allclose(found.to_kept(values), coupling @ values, atol=1e-12)
    assert np.allclose(found.to_others(np.ones(KEPT)), coupling.T @ np.ones(KEPT), atol=1e-12)
