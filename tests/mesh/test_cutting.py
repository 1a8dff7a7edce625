"""Grids are handed out in blocks with straight cuts."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.mesh.grid import blocks, grid_partitioner


def all_positions(*cells):
    return np.stack(np.unravel_index(np.arange(np.prod(cells)), cells), axis=1)


@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 8])
@pytest.mark.parametrize(("cells", "size"), [((40, 10), (4, 1)), ((16, 12, 10), (2, 1, 1))])
def test_ranks_share_a_grid_alike(ranks, cells, size):
    owner = blocks(all_positions(*cells), cells, size, ranks)
    shares = np.bincount(owner, minlength=ranks)
    assert shares.min() > 0.8 * shares.max()


def test_a_bar_is_cut_across():
    positions = all_positions(40, 10)
    owner = blocks(positions, (40, 10), (4.0, 1.0), 4)
    assert np.array_equal(owner, positions[:, 0] // 10)


def test_the_longest_side_is_a_length_not_a_number_of_cells():
    positions = all_positions(10, 40)
    owner = blocks(positions, (10, 40), (4.0, 1.0), 2)
    assert np.array_equal(owner, positions[:, 0] // 5)


def test_more_ranks_than_squares_leave_some_without():
    owner = blocks(all_positions(2, 1), (2, 1), (2.0, 1.0), 5)
    assert len(set(owner)) == 2
    assert owner.max() < 5


def test_cells_of_a_grid_are_found_by_their_vertices(grid):
    """Every simplex goes to the rank of the square or cube that its middle lies in."""
    make, cells = grid
    asked = []
    partition = grid_partitioner(cells, cells)

    def seen(*arguments):
        asked.append((np.array(arguments[-1][0]), partition(arguments[0], 3, *arguments[2:])))
        return partition(arguments[0], 1, *arguments[2:])

    made = make(seen)
    ((vertices, links),) = asked
    tdim = len(cells)
    middles = dmesh.compute_midpoints(
        made, tdim, np.arange(made.topology.index_map(tdim).size_local)
    )
    original = made.topology.original_cell_index
    original = np.asarray(original[0] if isinstance(original, list) else original)
    expected = blocks(np.floor(middles[:, :tdim]).astype(int), cells, cells, 3)
    assert len(vertices) == (tdim + 1) * len(middles)
    assert np.array_equal(np.asarray(links.array)[original], expected)


GRIDS = [*dmesh.DiagonalType.__members__.values(), "box"]


@pytest.fixture(params=GRIDS, ids=str)
def grid(request):
    if request.param == "box":
        corners, cells = [[0.0] * 3, [4.0, 3.0, 2.0]], (4, 3, 2)
        return lambda p: dmesh.create_box(MPI.COMM_SELF, corners, cells, partitioner=p), cells
    corners, cells = [[0.0] * 2, [5.0, 3.0]], (5, 3)
    return (
        lambda p: dmesh.create_rectangle(
            MPI.COMM_SELF, corners, cells, partitioner=p, diagonal=request.param
        ),
        cells,
    )
