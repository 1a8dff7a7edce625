"""Blocks of a matrix at nodes: what each node's unknowns do to themselves."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.typing import Array


def nodal_blocks(matrix: PETSc.Mat, nodes: NDArray[np.int32]) -> Array:
    """Return the blocks at owned nodes, local numbers, shape (n, block size, block size)."""
    bs, order = matrix.getBlockSize(), np.argsort(nodes)
    rows = bs * nodes[order][:, None] + np.arange(bs)
    chosen = PETSc.IS().createGeneral(rows.astype(PETSc.IntType).ravel(), MPI.COMM_SELF)
    part = matrix.getDiagonalBlock().createSubMatrix(chosen, chosen)
    starts, columns, values = part.getValuesCSR()
    row = np.repeat(np.arange(rows.size), np.diff(starts))
    blocks = np.empty((nodes.size, bs, bs))
    blocks[order] = values[row // bs == columns // bs].reshape(-1, bs, bs)
    return blocks


def insert_blocks(matrix: PETSc.Mat, nodes: NDArray[np.int32], blocks: Array) -> None:
    """Put blocks at owned nodes, in place of those that are there. Collective."""
    rows, at = np.arange(nodes.size + 1, dtype=PETSc.IntType), nodes.astype(PETSc.IntType)
    matrix.setValuesBlockedLocalIJV(rows, at, blocks, rowmap=at)
    matrix.assemble()
