"""A linear system bordered by a few global unknowns: rigid motions, potentials of electrodes.

With u = u^ + R q the unknowns u^ at contact nodes are distances to what moves, the same nodal
blocks act on them as if nothing moved, and the matrix is [[K, K R], [R^T K, R^T K R]] with blocks
in its first corner alone. Either way it takes one solve: a factorisation solves for the columns of
K R together with the right-hand side; for an iterative solver q is eliminated, which takes a matrix
of rank m from K and leaves its preconditioner as it is. Where it is asked for a few digits, what
it leaves is left to the rows of nodes: the balance of what moves is met to rounding.

Right-hand sides and solutions have the values of q, the same on all ranks, behind the owned ones;
they belong to u and q, not to u^.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact.history import Evaluated
from contact.linear.layout import Layout
from contact.linear.operator import Bulk, Counters, SparseOperator
from contact.typing import Array

#: Share of the stiffness against q that is taken for none: rounding. Where nothing holds it, q is
#: left where it is.
NOTHING = 1e-13


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

    def assemble(self, matrix: PETSc.Mat, kind: str, state: Evaluated) -> None:
        """Assemble K, zero where an unknown is fixed or follows q, and the border. Collective."""
        self._bulk.assemble(matrix, kind, state)
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
        self._nodes, self._behind = nodes, False
        self._owned, self._free = bulk.layout.free.size, np.flatnonzero(bulk.free)
        self._responses = np.zeros((self._owned, self._free.size))
        self._inverse = np.zeros((self._free.size, self._free.size))
        self._gives = np.zeros_like(self._inverse)

    @property
    def symmetric(self) -> bool:
        """Whether the blocks are symmetric too."""
        return self._inner.symmetric

    def update(self, kind: str, state: Evaluated, blocks: Array, *, constant: bool = False) -> bool:
        """Assemble and factorise; see `SparseOperator.update`. Collective."""
        if not self._inner.update(kind, state, blocks, constant=constant):
            return False
        self._behind = self._free.size > 0
        if self._inner.iterative and self._behind:
            self._eliminate(blocks)
        return True

    def _eliminate(self, blocks: Array) -> None:
        """Eliminate those of q that anything resists, for an iterative solver. Collective."""
        bulk, inner, free = self._bulk, self._inner, self._free
        motion, pushed = self._pushed(blocks)
        held = self._held(pushed)
        resists = bulk.layout.comm.allreduce(motion.T @ pushed, op=MPI.SUM)
        self._gives = np.linalg.pinv(resists, rcond=NOTHING)
        stiffness, turned = np.linalg.eigh(held.T @ bulk.corner[np.ix_(free, free)] @ held)
        basis = held @ turned
        self._inverse = basis / stiffness @ basis.T
        size = (self._owned, None), (None, basis.shape[1])
        columns = PETSc.Mat().createDense(size, comm=bulk.layout.comm)
        columns.setUp()
        factors = PETSc.Vec().createSeq(basis.shape[1])
        columns.getDenseArray()[:] = bulk.columns[:, free] @ basis
        columns.assemble()
        factors.array[:] = -1 / stiffness
        inner.system = PETSc.Mat().createLRC(inner.matrix, columns, factors, columns)
        inner.ksp.setOperators(inner.system, inner.ksp.getOperators()[1])

    @property
    def _dofs(self) -> NDArray[np.intp]:
        """Owned unknowns of the nodes with blocks."""
        size = self._bulk.layout.block_size
        return (self._nodes[:, None] * size + np.arange(size)).ravel()

    def _pushed(self, blocks: Array) -> tuple[Array, Array]:
        """Return R at the nodes with blocks, and the blocks times it, (dofs, free) both."""
        n, size, free = self._nodes.size, self._bulk.layout.block_size, self._free
        motion = self._bulk.motions[self._dofs][:, free].toarray()
        nodal = motion.reshape(n, size, free.size)
        return motion, np.einsum("nij,njk->nik", blocks, nodal).reshape(-1, free.size)

    def _held(self, pushed: Array) -> Array:
        """Return a basis of the free motions that parts or blocks resist, (free, k). Collective."""
        bulk, free = self._bulk, self._free
        gram = bulk.layout.comm.allreduce(pushed.T @ pushed, op=MPI.SUM)
        other = np.ones(self._owned)
        other[self._dofs] = 0.0
        tied = bulk.motions[:, free].multiply(other[:, None]).toarray()
        parts = bulk.layout.comm.allreduce(tied.T @ tied, op=MPI.SUM)
        gram = sum(part / max(np.abs(part).max(initial=0.0), 1e-300) for part in (gram, parts))
        resistance, directions = np.linalg.eigh(gram)
        return np.asarray(directions[:, resistance > NOTHING * resistance.max(initial=0.0)])

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns and q; see `SparseOperator.solve`. Collective."""
        bulk, own, free = self._bulk, rhs[: self._owned], self._free
        columns = bulk.columns[:, free]
        forces = (rhs[self._owned :] + bulk.gathered(own))[free]
        if self._inner.iterative:
            if guess is not None:
                guess = self._relative(guess)[: self._owned]
            relative = self._inner.solve(own - columns @ (self._inverse @ forces), rtol, guess)
            moved = self._inverse @ (forces - self._on_q(columns, relative))
        else:
            if self._behind:
                first, *responses = self._inner.solve_all(np.column_stack([own, columns])).T
                self._responses, self._behind = np.column_stack(responses), False
                self._condense(columns)
            else:
                first = self._inner.solve(own)
            moved = self._inverse @ (forces - self._on_q(columns, first))
            relative = first - self._responses @ moved
        q = np.zeros(bulk.free.size)
        q[free] = moved
        solution = np.concatenate([relative + bulk.motions @ q, q])
        if self._inner.iterative and rtol is not None:  # blocks are stiff then: q hardly moves
            left = rhs[self._owned :] - self.multiply(solution)[self._owned :]
            solution[self._owned :][free] += self._gives @ left[free]
        return solution

    def _condense(self, columns: Array) -> None:
        """Find the inverse of the stiffness against q, given the columns' responses. Collective."""
        corner = self._bulk.corner[np.ix_(self._free, self._free)]
        left, size, right = np.linalg.svd(corner - self._on_q(columns, self._responses))
        resists = size > NOTHING * np.abs(corner).max(initial=0.0)
        self._inverse = (right[resists].T / size[resists]) @ left[:, resists].T

    def _on_q(self, columns: Array, values: Array) -> Array:
        """Return what relative unknowns do to free ones of q. Collective."""
        return np.asarray(self._bulk.layout.comm.allreduce(columns.T @ values, op=MPI.SUM))

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
