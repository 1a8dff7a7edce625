"""A linear system bordered by a few global unknowns: rigid motions, potentials of electrodes.

With u = u^ + R q the unknowns u^ at contact nodes are distances to what moves, the same nodal
blocks act on them as if nothing moved, and the matrix is [[K, K R], [R^T K, R^T K R]] with blocks
in its first corner alone. It is solved by one solve a column of R beside that of the right-hand
side, all with one factorisation or one multigrid hierarchy.

Right-hand sides and solutions have the values of q, the same on all ranks, behind the owned ones;
they belong to u and q, not to u^.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact.linear.layout import Layout
from contact.linear.operator import Bulk, Counters, SparseOperator
from contact.typing import Array

#: Share of the stiffness against q that is taken for none: rounding, and what iterative solvers
#: leave. Where nothing holds it, q is left where it is.
NOTHING = {False: 1e-13, True: 1e-9}

#: Relative tolerance of the columns' solves.
TOLERANCE = 1e-12


class BorderedBulk:
    """The matrices of a body in the unknowns u^ and q.

    Parameters
    ----------
    bulk
        Assembles the matrices in the unknowns u.
    motions
        R, shape (owned, m): rows of zeros where an unknown is fixed.
    free
        Which of q are unknown, shape (m,).

    Attributes
    ----------
    columns, corner
        K R and R^T K R of what was assembled last, shapes (owned, m) and (m, m).
    """

    def __init__(self, bulk: Bulk, motions: sparse.csr_array, free: NDArray[np.bool_]) -> None:
        self._bulk, self.motions, self.free = bulk, motions, free
        self.columns: Array = np.zeros(motions.shape)
        self.corner: Array = np.zeros((free.size, free.size))

    @property
    def layout(self) -> Layout:
        """The unknowns."""
        return self._bulk.layout

    def create_matrix(self) -> PETSc.Mat:
        """Return an empty matrix with the pattern of the body. Collective."""
        return self._bulk.create_matrix()

    def assemble(self, matrix: PETSc.Mat, kind: str, x: Array) -> None:
        """Assemble K, zero where an unknown is fixed or follows q, and the border. Collective."""
        self._bulk.assemble(matrix, kind, x)
        own = self.layout.free.ravel().astype(float)
        vector, image = matrix.createVecs()
        for k, column in enumerate(self.motions.T.toarray()):
            vector.array[:] = column
            matrix.mult(vector, image)
            self.columns[:, k] = image.array
        self.corner = self.gathered(self.columns)
        self.columns *= own[:, None]
        vector.array[:] = own
        matrix.diagonalScale(vector, vector)

    def take_apart(self, matrix: PETSc.Mat) -> PETSc.Mat | None:
        """Fill a matrix with bodies that do not touch; see `operator.Bulk`. Collective."""
        change = self._bulk.take_apart(matrix)
        if change is None:
            return None
        own = matrix.createVecLeft()
        own.array[:] = self.layout.free.ravel()
        matrix.diagonalScale(own, own)
        return change

    def gathered(self, forces: Array) -> Array:
        """Return R^T f of owned forces, shape (owned,) or (owned, k). Collective."""
        return np.asarray(self.layout.comm.allreduce(self.motions.T @ forces, op=MPI.SUM))


class BorderedOperator:
    """Bulk matrix plus nodal blocks plus border; as `operator.SparseOperator`.

    Parameters
    ----------
    bulk
        The body.
    nodes, symmetric, counters, kind
        As of `SparseOperator`.
    """

    def __init__(
        self,
        bulk: BorderedBulk,
        nodes: NDArray[np.int32],
        *,
        symmetric: bool,
        counters: Counters,
        kind: str,
    ) -> None:
        self._bulk = bulk
        self._inner = SparseOperator(bulk, nodes, symmetric=symmetric, counters=counters, kind=kind)
        self._owned, self._free = bulk.layout.free.size, np.flatnonzero(bulk.free)
        self._responses = np.zeros((self._owned, self._free.size))

    @property
    def symmetric(self) -> bool:
        """Whether the blocks are symmetric too."""
        return self._inner.symmetric

    def update(self, kind: str, x: Array, blocks: Array, *, constant: bool = False) -> bool:
        """Assemble and factorise; see `SparseOperator.update`. Collective."""
        if not self._inner.update(kind, x, blocks, constant=constant):
            return False
        free, bulk = self._free, self._bulk
        # Copies: an iterative solver takes the last ones for where it begins.
        for k in range(free.size):
            column = bulk.columns[:, free[k]]
            guess = self._responses[:, k].copy()
            self._responses[:, k] = self._inner.solve(column, TOLERANCE, guess)
        coupling = bulk.columns[:, free].T @ self._responses
        corner = bulk.corner[np.ix_(free, free)]
        stiffness = corner - bulk.layout.comm.allreduce(coupling, op=MPI.SUM)
        left, size, right = np.linalg.svd(stiffness)
        resists = size > NOTHING[self._inner.iterative] * np.abs(corner).max(initial=0.0)
        self._inverse = (right[resists].T / size[resists]) @ left[:, resists].T
        return True

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns and q; see `SparseOperator.solve`. Collective."""
        bulk, own = self._bulk, rhs[: self._owned]
        if guess is not None:
            guess = self._relative(guess)[: self._owned] + self._responses @ self._moved(guess)
        first = self._inner.solve(own, rtol, guess)
        forces = rhs[self._owned :] + bulk.gathered(own)
        coupling = bulk.layout.comm.allreduce(bulk.columns.T @ first, op=MPI.SUM)
        q = np.zeros(forces.size)
        q[self._free] = self._inverse @ (forces - coupling)[self._free]
        own = first - self._responses @ q[self._free] + bulk.motions @ q
        return np.concatenate([own, q])

    def _moved(self, values: Array) -> Array:
        """Return the free ones of q."""
        return np.asarray(values[self._owned :][self._free])

    def _relative(self, values: Array) -> Array:
        """Return u^ and q of u and q."""
        q = values[self._owned :]
        return np.concatenate([values[: self._owned] - self._bulk.motions @ q, q])

    def multiply(self, values: Array) -> Array:
        """Return the matrix times owned values and q, as forces on u and q. Collective."""
        bulk, inner = self._bulk, self._inner
        relative = self._relative(values)
        own, q = relative[: self._owned], relative[self._owned :]
        vector, image = inner.matrix.createVecs()
        vector.array[:] = bulk.layout.mask(own)
        inner.matrix.mult(vector, image)
        forces = bulk.layout.mask(image.array + bulk.columns @ q)
        on_q = bulk.layout.comm.allreduce(bulk.columns.T @ own, op=MPI.SUM) + bulk.corner @ q
        return np.concatenate([forces, np.where(bulk.free, on_q - bulk.gathered(forces), 0.0)])

    @property
    def jacobian(self) -> PETSc.Mat:
        """The matrix by its products, q on the first rank."""
        return shell(self, self._bulk.layout.comm, self._owned, self._bulk.free.size)


class Multiplies(Protocol):
    """What is known by its products."""

    def multiply(self, values: Array) -> Array:
        """Return the matrix times owned values and q. Collective."""


class _Products:
    """The context of a matrix that is known by its products."""

    def __init__(self, operator: Multiplies, packing: Packing) -> None:
        self._operator, self._packing = operator, packing

    def mult(self, _: Any, vector: PETSc.Vec, image: PETSc.Vec) -> None:
        """Multiply."""
        values = self._packing.unpacked(vector.array_r)
        image.array[:] = self._packing.packed(self._operator.multiply(values))


class Packing:
    """Global unknowns in PETSc's vectors: the first rank holds them, behind its own.

    Parameters
    ----------
    comm
        Communicator.
    size
        Number of global unknowns.
    """

    def __init__(self, comm: MPI.Intracomm, size: int) -> None:
        self._comm, self._size = comm, size

    @property
    def here(self) -> int:
        """How many of them this rank holds."""
        return self._size if self._comm.rank == 0 else 0

    def packed(self, values: Array) -> Array:
        """Return what of owned values and global ones a rank holds."""
        return values if self.here == self._size else values[: values.size - self._size]

    def unpacked(self, values: Array) -> Array:
        """Return owned values and global ones behind them, the same on all ranks. Collective."""
        if self._size == 0:
            return values.copy()
        own = values[: values.size - self.here]
        return np.concatenate([own, self._comm.bcast(values[own.size :])])


def shell(operator: Multiplies, comm: MPI.Intracomm, owned: int, size: int) -> PETSc.Mat:
    """Return a matrix that multiplies as an operator does."""
    packing = Packing(comm, size)
    local = owned + packing.here
    context = _Products(operator, packing)
    matrix = PETSc.Mat().createPython(((local, None), (local, None)), context, comm)
    matrix.setUp()
    return matrix
