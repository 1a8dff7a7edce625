"""Blocks of quadrilaterals and hexahedra that no two of are alike, and others to compare with."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.mesh.domain import Domain
from contact.mesh.grid import box, rectangle
from contact.typing import Array

#: Shapes of cells by dimension, simplices first.
SHAPES = {2: ("triangle", "quadrilateral"), 3: ("tetrahedron", "hexahedron")}


def shaken(points: Array, amount: float) -> Array:
    """Return points moved inside the unit square or cube, those of its sides along these."""
    x = points.T
    waves = np.stack([np.sin(9 * x[k - 1] + 4 * x[k] + k) for k in range(len(x))])
    return np.asarray((x + amount * x * (1 - x) * waves).T)


def unit_block(
    comm: MPI.Comm, cell: str, n: int = 3, amount: float = 0.3, low: float = 0.0
) -> Domain:
    """Return a unit square or cube of n x n (x n) distorted cells, from the height `low` on."""
    dim = 2 if cell in SHAPES[2] else 3
    make = rectangle if dim == 2 else box
    domain = make(comm, (0.0,) * dim, (1.0,) * dim, (n,) * dim, cell=cell)
    x = domain.mesh.geometry.x
    x[:, :dim] = shaken(x[:, :dim], amount)
    x[:, dim - 1] += low
    return domain
