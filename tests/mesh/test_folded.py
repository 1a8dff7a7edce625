"""Straight hexahedra that are folded inside, with corners that are not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.cells import HEXAHEDRON
from contact.mesh.contents import _check_volumes
from contact.mesh.geometry import determinant, jacobians
from contact.mesh.reader import from_file

#: One of them, by its corners in the order of dolfinx.
TWISTED = np.array(
    [
        *([-0.34, 0.05, -0.42], [1.38, 0.22, 0.36], [-0.22, 1.42, 0.35], [1.39, 1.29, 0.23]),
        *([0.50, -0.46, 0.71], [0.51, 0.43, 0.99], [0.15, 0.71, 1.36], [1.17, 0.95, 0.61]),
    ]
)


def hexahedra(amount: float, count: int) -> np.ndarray:
    """Return unit cubes whose corners are moved at random."""
    rng = np.random.default_rng(1)
    return HEXAHEDRON.nodes(1) + rng.uniform(-amount, amount, (count, 8, 3))


def least(x: np.ndarray, n: int) -> np.ndarray:
    """Return the least Jacobian of each at n x n x n points, by the sign at the first corner."""
    at = np.moveaxis(np.indices((n,) * 3) / (n - 1), 0, -1).reshape(-1, 3)
    found = determinant(jacobians(HEXAHEDRON, x, at))
    return (found * np.sign(found[:, :1])).min(axis=1)


def test_folded_cells_are_counted() -> None:
    """Those whose Jacobian is negative in the middle of an edge, a face or the cell; of many."""
    x = hexahedra(0.55, 3000)
    x = x[(least(x, 2) > 0.01) & ((least(x, 3) < 0) | (least(x, 9) > 0.01))]
    folded = np.count_nonzero(least(x, 3) < 0)
    assert 0 < folded < len(x)
    with pytest.raises(InputError, match=rf"it has {folded} cell\(s\) that are folded inside"):
        _check_volumes(HEXAHEDRON, x, 1.0)
    _check_volumes(HEXAHEDRON, x[least(x, 3) > 0], 1.0)


def test_such_a_cell_is_refused(tmp_path: Path) -> None:
    assert least(TWISTED[None], 2) > 0.01 and least(TWISTED[None], 9) < -0.1
    around = TWISTED[[0, 1, 3, 2, 4, 5, 7, 6]]
    lines = [f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(around, 1)]
    text = ["*NODE", *lines, "*ELEMENT, TYPE=C3D8, ELSET=all", "1,1,2,3,4,5,6,7,8"]
    (tmp_path / "twisted.inp").write_text("\n".join([*text, "*SURFACE, NAME=low", "all, S1"]))
    with pytest.raises(InputError, match=r"\[folded-cells\]"):
        from_file(MPI.COMM_SELF, tmp_path / "twisted.inp")
