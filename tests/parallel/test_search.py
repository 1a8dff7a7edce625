"""Facets divided among ranks at random: each has the sums of its own nodes, those of one rank."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import Delaunay, cKDTree

from contact.interface.mortar.coupling import couple
from contact.interface.mortar.lumping import Lumping
from contact.interface.mortar.search import nearest, nearest_named
from contact.mesh.deviation import deviations
from contact.mesh.owners import Halo, Owners
from contact.ranks import exchanged
from tests.problems.sides import FIRST, KINDS, NAMES, flat, oriented

COMM = MPI.COMM_WORLD
pytestmark = pytest.mark.parallel


def owners_of(count):
    """Return owners of as many nodes, of which the last rank has none where there are several."""
    shares = max(COMM.size - 1, 1)
    begins = [count * min(k, shares) // shares for k in range(COMM.size + 1)]
    return Owners(COMM, np.array(begins, dtype=np.int64))


def facets_here(count, seed):
    """Return some of the facets; the first of several ranks has none."""
    owner = np.random.default_rng(seed).integers(min(1, COMM.size - 1), COMM.size, count)
    return np.flatnonzero(owner == COMM.rank)


def share(side, owners, seed):
    """Return a share of a side."""
    own = facets_here(side.count, seed)
    arrays = (side.nodes, side.points, side.normal, side.deviation)
    names = ("nodes", "points", "normal", "deviation")
    return replace(side, owners=owners, **dict(zip(names, (a[own] for a in arrays), strict=True)))


@pytest.mark.core
def test_rows_are_sent_where_they_are_to_go():
    rank, size = COMM.rank, COMM.size
    to = np.repeat(np.arange(size), np.arange(size) + rank)[::-1]
    rows = np.column_stack([np.full(to.size, rank), to])
    source, found, flags = exchanged(COMM, to, rows, rows[:, 0] > 0)
    np.testing.assert_array_equal(source, np.repeat(np.arange(size), np.arange(size) + rank))
    np.testing.assert_array_equal(found, np.column_stack([source, np.full(source.size, rank)]))
    np.testing.assert_array_equal(flags, source > 0)


@pytest.mark.core
def test_the_nearest_place_of_any_rank():
    """The same as of one tree of all places; of places that are equally near the first."""
    rng = np.random.default_rng(0)
    places, points = rng.uniform(size=(200, 2)), rng.uniform(-1, 2, size=(50, 2))
    own, mine = facets_here(200, 1), np.arange(50) % COMM.size == COMM.rank
    expected, which = cKDTree(places).query(points[mine])
    np.testing.assert_allclose(nearest(COMM, points[mine], places[own]), expected, rtol=1e-14)
    np.testing.assert_array_equal(nearest_named(COMM, points[mine], places[own], own), which)
    around = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    own = np.flatnonzero(np.arange(4) % COMM.size == COMM.rank)
    assert nearest_named(COMM, np.zeros((1, 2)), around[own], own).tolist() == [2]
    none = np.zeros((0, 2))
    assert np.isinf(nearest(COMM, points, none)).all()
    assert (nearest_named(COMM, points, none, np.zeros(0, dtype=np.int64)) == -1).all()


@pytest.mark.core
def test_values_of_nodes_of_other_ranks():
    owners = owners_of(20)
    begin, end = owners.begins[COMM.rank : COMM.rank + 2]
    halo = Halo(owners, int(end - begin), np.array([3, 17, 11, 3]))
    field = np.arange(40.0).reshape(20, 2)
    np.testing.assert_array_equal(halo.forward(field[begin:end]), field[halo.numbers])
    asked = np.array([19, 0, 19, 7])
    np.testing.assert_array_equal(owners.values(asked, lambda given: field[given]), field[asked])
    taken = np.zeros((halo.numbers.size, 1))
    taken[halo.places(np.array([3, 11, 17]))] = 1.0
    expected = COMM.size * np.isin(np.arange(20), [3, 11, 17])
    np.testing.assert_array_equal(halo.reverse(taken)[:, 0], expected[begin:end])
    assert owners.requested(asked).tolist() == [n for n in (0, 7, 19) if begin <= n < end]
    nodes, sums = owners.sums(asked, np.ones((4, 1)))
    np.testing.assert_array_equal(sums[:, 0], COMM.size * np.where(nodes == 19, 2.0, 1.0))


@pytest.mark.core
@pytest.mark.parametrize("levels", [0, 1])
def test_deviations_depend_on_no_share(levels):
    """On a sphere that ends, with facets of four rings on other ranks."""
    rng = np.random.default_rng(2)
    places = rng.uniform(-1, 1, size=(300, 2))
    triangles = Delaunay(places).simplices.astype(np.int64)
    wave = 0.1 * np.sin(3 * places[:, 0]) * np.cos(2 * places[:, 1])
    corners, normal, _ = oriented(
        np.column_stack([places, wave]), triangles, np.array([0.0, 0.0, 1.0])
    )
    whole = deviations(triangles, corners, normal, levels=levels)
    # Stripes, so that the inner facets of one see nothing of the others; and at random.
    stripe = np.floor((corners[:, :, 0].mean(axis=1) + 1) / 2 * COMM.size)
    for own in (np.flatnonzero(stripe == COMM.rank), facets_here(len(triangles), 4)):
        found = deviations(
            triangles[own], corners[own], normal[own], owners_of(len(places)), levels
        )
        for values, known in zip(found, whole, strict=True):
            np.testing.assert_allclose(values, known[own], rtol=0, atol=1e-12 * np.abs(known).max())


def rows_of(found, nodes, numbers, matrix, count):
    """Return the rows of some nodes with columns by global number."""
    rows = np.searchsorted(found.nodes, nodes)
    dense = np.zeros((nodes.size, count))
    dense[:, numbers] = matrix.toarray()[rows]
    return dense


@pytest.mark.core
@pytest.mark.parametrize("constrained", [False, True], ids=["free", "constrained"])
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_the_mortar_operator_of_shares(kind, constrained):
    """The master covers a part; with nodes without multipliers, whole facets of them too."""
    slave, x = flat(kind, 7, 0.0, 1.0, 1)
    master, y = flat(kind, 5, 0.05, -1.0, 2, FIRST, size=0.61)
    without = np.flatnonzero(x[:, 0] < 0.35) if constrained else np.zeros(0, dtype=np.int64)
    whole = couple(slave, master, 1.0, no_multiplier=without)
    owners = owners_of(len(x))
    begin, end = owners.begins[COMM.rank : COMM.rank + 2]
    mine = share(slave, owners, 5)
    known = np.intersect1d(without, np.union1d(mine.nodes, np.arange(begin, end)))
    found = couple(mine, share(master, owners, 6), 1.0, no_multiplier=known)
    own = (whole.nodes >= begin) & (whole.nodes < end)
    np.testing.assert_array_equal(found.nodes, whole.nodes[own])
    for name in ("weight", "normal", "gap", "gap_positive_part", "covered"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(whole, name)[own], rtol=0, atol=1e-13
        )
    for names, matrix, count in (("slaves", "D", len(x)), ("masters", "M", len(y))):
        first = FIRST if names == "masters" else 0
        one, other = (
            rows_of(c, found.nodes, getattr(c, names) - first, getattr(c, matrix), count)
            for c in (found, whole)
        )
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_areas_of_shares(kind):
    side, x = flat(kind, 6, 0.0, 1.0, 1)
    whole, owners = Lumping.of(side), owners_of(len(x))
    begin, end = owners.begins[COMM.rank : COMM.rank + 2]
    found, own = Lumping.of(share(side, owners, 7)), slice(begin, end)
    np.testing.assert_array_equal(found.nodes, np.arange(begin, end))
    for name in ("weight", "normal", "deviation"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(whole, name)[own], rtol=0, atol=1e-15
        )
    if whole.jumps is not None:
        values = np.random.default_rng(8).normal(size=(len(x), 2))
        expected = whole.jumps.apply(side.owners, values)[own]
        np.testing.assert_allclose(found.jumps.apply(owners, values[own]), expected, atol=1e-14)
