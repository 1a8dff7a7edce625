"""Cells with fields, and columns of tables: results as files and figures take them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.mesh.cells import Shape
from contact.typing import Array

Values = NDArray[Any]
#: Columns of equal length by name.
Table = Mapping[str, Values]


@dataclass(frozen=True)
class Grid:
    """Cells with fields, or this rank's share of them.

    Attributes
    ----------
    points
        Coordinates of the nodes, shape (n, d), those of the ranks one rank after the other.
    cells
        Nodes of each cell in dolfinx's order, numbered over all ranks, shape (m, nodes a cell).
    shape
        Of the cells.
    at_points, in_cells
        Fields by name, one row per node or cell.
    """

    points: Array
    cells: NDArray[np.int64]
    shape: Shape
    at_points: Mapping[str, Values]
    in_cells: Mapping[str, Values] = field(default_factory=dict)
