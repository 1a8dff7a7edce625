"""The unknowns of a linear system: nodes with a block of unknowns each, some of them fixed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.typing import Array


@dataclass(frozen=True)
class Layout:
    """Nodes and their unknowns: d displacement components, then a potential or none.

    Attributes
    ----------
    comm
        Communicator.
    index_map
        Of the nodes.
    points
        Coordinates of the owned nodes, shape (nodes, d) (length).
    free
        Which unknowns of the owned nodes are not fixed, shape (nodes, block size).
    size
        Largest extent of the body (length).
    stiffness
        Young's modulus, the unit of the operator (stress).
    revolved
        Whether the nodes are those of the half plane of a body of revolution, x its radius: it
        then moves along y alone.
    """

    comm: MPI.Intracomm
    index_map: IndexMap
    points: Array
    free: NDArray[np.bool_]
    size: float
    stiffness: float
    revolved: bool = False

    @property
    def dim(self) -> int:
        """Number d of displacement components of a node."""
        return self.points.shape[1]

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""
        return self.free.shape[1]

    @property
    def coupled(self) -> bool:
        """Whether there is a potential."""
        return self.block_size > self.dim

    @property
    def unknowns(self) -> int:
        """Number of unknowns over all ranks."""
        return int(self.index_map.size_global) * self.block_size

    def mask(self, values: Array) -> Array:
        """Return owned values, 0 where the unknown is fixed."""
        return np.where(self.free.ravel(), values, 0.0)


def times(matrix: PETSc.Mat | None, values: Array, transposed: bool = False) -> Array:
    """Return a matrix times owned values; None is the identity. Collective."""
    if matrix is None:
        return values
    vector, image = matrix.createVecs()
    vector.array[:] = values
    (matrix.multTranspose if transposed else matrix.mult)(vector, image)
    return np.asarray(image.array)


def balance(matrix: PETSc.Mat, layout: Layout) -> None:
    """Put the size of the matrix's own diagonal at fixed unknowns, in place of ones. Collective.

    Against a modulus of 1e12 ones are nothing, and multigrid takes them for a body that is not
    held; against 1e-12 they are all that it sees.
    """
    diagonal, free = matrix.getDiagonal(), layout.free.ravel()
    sizes = np.array([np.abs(diagonal.array[free]).sum(), np.count_nonzero(free)])
    layout.comm.Allreduce(MPI.IN_PLACE, sizes, op=MPI.SUM)
    if sizes[0] > 0 and np.isfinite(sizes[0]):
        diagonal.array[~free] = sizes[0] / sizes[1]
        matrix.setDiagonal(diagonal)


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
