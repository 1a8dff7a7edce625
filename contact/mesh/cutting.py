"""Which rank has which cells of a grid: blocks with straight cuts.

A general partitioner knows nothing of the grid, and cuts it along jagged lines that are a quarter
longer, at random places. What ranks eliminate by themselves leaves a dense matrix of the nodes at
the cuts and of their own contact nodes: straight cuts across the longest side make these few, and
share the work.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from contact import _compat

Ints = npt.NDArray[np.int64]


def blocks(positions: Ints, cells: Sequence[int], size: Sequence[float], ranks: int) -> Ints:
    """Return the rank of each square or cube of a grid.

    The grid is cut across its longest side in proportion to the ranks on both sides, and so are
    the pieces, until each has one rank.

    Parameters
    ----------
    positions
        Number along each axis, shape (squares, dim).
    cells, size
        Squares along the axes, and lengths.
    ranks
        How many there are.
    """
    owner = np.zeros(len(positions), dtype=np.int64)
    edges = np.asarray(size, dtype=float) / np.asarray(cells)

    def share(here: Ints, low: Ints, high: Ints, first: int, count: int) -> None:
        if count == 1:
            owner[here] = first
            return
        axis = int(np.argmax((high - low) * edges))
        few = count // 2
        cut = low[axis] + round((high - low)[axis] * few / count)
        below = positions[here, axis] < cut
        end, begin = high.copy(), low.copy()
        end[axis] = begin[axis] = cut
        share(here[below], low, end, first, few)
        share(here[~below], begin, high, first + few, count - few)

    everything = np.arange(len(positions))
    share(everything, np.zeros(len(cells), dtype=np.int64), np.array(cells), 0, ranks)
    return owner


def _squares(simplices: Ints, cells: Sequence[int]) -> Ints:
    """Return the square or cube of each simplex, shape (simplices, dim).

    Vertices are numbered along the first axis first; those in the middle of squares follow all
    others.
    """
    corners = np.asarray(cells) + 1
    inner = simplices - np.prod(corners)
    at = np.stack(np.unravel_index(np.minimum(simplices, np.prod(corners) - 1), corners, "F"))
    middle = np.stack(np.unravel_index(np.maximum(inner, 0) % np.prod(cells), cells, "F")) + 0.5
    return np.floor(np.where(inner < 0, at, middle).mean(axis=2)).astype(np.int64).T


def grid_partitioner(cells: Sequence[int], size: Sequence[float]) -> Callable[..., Any]:
    """Return what dolfinx asks for the ranks of a grid's simplices.

    Parameters
    ----------
    cells, size
        Squares or cubes along the axes, and lengths.
    """

    def partition(_comm: Any, ranks: int, _types: Any, vertices: Sequence[Ints]) -> Any:
        simplices = np.asarray(vertices[0]).reshape(-1, len(cells) + 1)
        owner = blocks(_squares(simplices, cells), cells, size, ranks)
        return _compat.destinations(owner)

    return partition
