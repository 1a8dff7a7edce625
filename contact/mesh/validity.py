"""Checks of a mesh given as arrays, before it is distributed."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from contact.errors import InputError

Ints = npt.NDArray[np.int64]

#: A cell is degenerate if its volume is below this times (longest edge)^d.
FLAT = 1e-10


@dataclass(frozen=True)
class Cells:
    """A checked mesh: points (n, d), cells (m, d + 1), tagged facets (k, d) and their masks.

    Bit i of a facet's mask says that it belongs to the part ``names[i]``.
    """

    names: list[str]
    points: npt.NDArray[np.float64]
    cells: Ints
    facets: Ints
    masks: npt.NDArray[np.int32]


def first_of_each(rows: Ints) -> Ints:
    """Return the index of the first occurrence of each distinct row, shape (k,)."""
    return np.unique(_number(rows), return_index=True)[1]


def _number(rows: Ints) -> Ints:
    """Return the number of each row, shape (n,), equal for equal rows."""
    order = np.lexsort(rows.T)
    new = np.any(rows[order][1:] != rows[order][:-1], axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])[: len(rows)]
    return number


def check_cells(
    names: list[str], points: npt.NDArray[np.float64], cells: Ints, rows: Ints, bits: Ints
) -> Cells:
    """Check cells and boundary groups.

    Parameters
    ----------
    names
        Names of the groups.
    points, cells
        Coordinates, shape (n, d), and vertices, shape (m, d + 1).
    rows, bits
        Vertices of the groups' facets, ascending in a row, shape (k, d), and the position in
        ``names`` of the group of each, shape (k,). A facet may occur several times.

    Raises
    ------
    InputError
        For cells without volume or that overlap, and for facets not on the boundary.
    """
    n = cells.shape[1]
    # Facet i of a cell lies opposite its vertex i.
    others = np.array([[j for j in range(n) if j != i] for i in range(n)])
    cell_facets = np.sort(cells[:, others], axis=2)
    corners = points[cell_facets]
    apex = points[cells]
    edges = np.concatenate([corners[:, :, 1:], apex[:, :, None]], axis=2) - corners[:, :, :1]
    volume = np.linalg.det(edges)
    longest = np.linalg.norm(edges, axis=-1).max(axis=(1, 2))
    flat = ~(np.abs(volume).min(axis=1) > FLAT * longest ** points.shape[1])
    if np.any(flat):
        middle = ", ".join(f"{v:g}" for v in points[cells[flat][0]].mean(axis=0))
        raise InputError(f"it has {flat.sum()} cell(s) of zero volume, the first near ({middle})")

    number = _number(np.vstack([cell_facets.reshape(-1, n - 1), rows]))
    inner, outer = number[: cells.size], number[cells.size :]
    total = int(number.max()) + 1
    count = np.bincount(inner, minlength=total)
    # Two cells that share a facet must lie on either side of it.
    side = np.bincount(inner, weights=np.sign(volume).ravel(), minlength=total)
    wrong = (count > 2) | ((count == 2) & (side != 0.0))
    if np.any(wrong):
        raise InputError(f"its cells overlap (inverted cells) at {wrong.sum()} facet(s)")
    for bit, name in enumerate(names):
        neighbours = count[outer[bits == bit]]
        if np.any(neighbours == 0):
            raise InputError(f"the physical group {name!r} has facets that bound no cell")
        if np.any(neighbours == 2):
            raise InputError(
                f"the physical group {name!r} has {np.count_nonzero(neighbours == 2)} interior "
                "facet(s); a part must lie on the boundary of the body"
            )
    masks = np.zeros(total, dtype=np.int32)
    np.bitwise_or.at(masks, outer, (1 << bits).astype(np.int32))
    first = np.unique(outer, return_index=True)[1]
    return Cells(names, points, cells, rows[first], masks[outer[first]])
