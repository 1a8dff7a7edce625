"""What fails on one rank alone is raised on all: they would wait for it for ever."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from contact.history import BodyState
from contact.linear.operator import Counters
from contact.linear.schur import DenseOperator, DenseStiffness
from contact.ranks import largest, on_all_ranks, on_root, summed
from tests.conftest import _covering, pytest_collection_modifyitems

COMM = MPI.COMM_WORLD


def fails():
    raise MemoryError("no room")


@pytest.mark.core
@pytest.mark.parallel
def test_what_the_first_rank_raises():
    with pytest.raises(MemoryError, match="no room"):
        on_root(COMM, fails)
    assert np.array_equal(on_root(COMM, lambda: np.arange(3.0)), np.arange(3.0))


@pytest.mark.core
@pytest.mark.parallel
def test_what_the_last_rank_raises():
    last = COMM.rank == COMM.size - 1
    with pytest.raises(MemoryError, match="no room"):
        with on_all_ranks(COMM):
            if last:
                fails()
    with on_all_ranks(COMM):
        pass


@pytest.mark.core
@pytest.mark.parallel
def test_a_dense_factorisation_without_room(monkeypatch):
    """The others went on to the next solve, and waited there."""
    free = np.ones((1, 2), dtype=bool)
    stiffness = DenseStiffness(np.eye(2 * COMM.size))
    operator = DenseOperator(COMM, free, stiffness, Counters())
    monkeypatch.setattr(stiffness, "factorise", lambda *_: fails())
    with pytest.raises(MemoryError, match="no room"):
        operator.update("tangent", BodyState(np.zeros(2)), np.ones((1, 2, 2)))


@pytest.mark.core
@pytest.mark.parallel
def test_sums_over_all_ranks():
    """Of numbers and arrays, in any order in memory, with none at all."""
    own, ranks = 1.0 + COMM.rank, sum(range(1, COMM.size + 1))
    given = own * np.arange(6.0).reshape(2, 3)
    assert float(summed(COMM, np.float64(own))) == ranks
    # that of rank 0 lies in memory by columns
    found = summed(COMM, given if COMM.rank else np.asfortranarray(given))
    assert np.array_equal(found, ranks * np.arange(6.0).reshape(2, 3))
    assert summed(COMM, np.zeros((0, 3))).shape == (0, 3)
    assert given[0, 1] == own, "the given values are changed"


@pytest.mark.core
@pytest.mark.parallel
def test_the_largest_over_all_ranks():
    """NaN on one rank is NaN on all: a comparison with it would be false on that rank alone."""
    assert largest(COMM, float(COMM.rank)) == COMM.size - 1
    assert np.isnan(largest(COMM, np.nan if COMM.rank == 0 else 1.0))
    assert largest(COMM, -np.inf) == -np.inf


class Collected:
    """A collected test, as far as it is looked at."""

    def __init__(self, nodeid, *marks, **params):
        self.nodeid, self.marks = nodeid, marks
        self.callspec = SimpleNamespace(params=params)

    def get_closest_marker(self, name):
        return name if name in self.marks else None

    def iter_markers(self, name):
        """Yield the lists of values: each parameter has one of its own."""
        yield from (SimpleNamespace(args=(given,)) for given in self.callspec.params)


@pytest.mark.core
def test_on_several_ranks_each_value_of_each_parameter_stays():
    """Not each combination; of a test without parameters itself."""
    found = [Collected("both", a=a, b=b) for a in range(3) for b in range(2)]
    kept = _covering(found)
    assert len(kept) == 3
    assert {item.callspec.params["a"] for item in kept} == {0, 1, 2}
    assert {item.callspec.params["b"] for item in kept} == {0, 1}
    assert _covering([single := Collected("single")]) == [single]


@pytest.mark.core
def test_rows_of_a_list_of_parameters_stay_whole():
    """Each row of values for several names is one: two with the same second value both stay."""
    found = [Collected("rows", a=a, b=b) for a, b in ((1, 2), (1, 3), (2, 2))]
    for item in found:
        item.iter_markers = lambda _: iter([SimpleNamespace(args=("a, b",))])
    assert _covering(found) == found


@pytest.mark.core
@pytest.mark.parametrize("short", [False, True])
def test_short_runs_leave_out_slow_tests_and_combinations(short):
    items = [Collected(f"both[{a}-{b}]", a=a, b=b) for a in range(2) for b in range(2)]
    items += [Collected("long", "slow"), Collected("one[0]", a=0), Collected("one[1]", "slow", a=1)]
    left_out = []
    config = SimpleNamespace(
        getoption=lambda name: short,
        hook=SimpleNamespace(pytest_deselected=lambda items: left_out.extend(items)),
    )
    pytest_collection_modifyitems(config, items)
    names = [item.nodeid for item in items]
    if not short:
        assert len(names) == 7
        assert not left_out
        return
    assert names == ["both[0-0]", "both[1-1]", "one[0]"]
    assert len(left_out) == 4
