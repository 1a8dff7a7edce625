"""Transformation of a linear system: unknowns x = C y + d, jumps among y, and C^T K C in y.

Such relations are also called affine or multi-point constraints.

In the increments of a solve d is 0: prescribed values are in x already. y has as many nodal
unknowns as x, and m global ones q behind them,

    x = Q (y^ + N_q q),     C = [Q, Q N_q].

Q puts the jumps [u] in the place of the unknowns of the slave nodes, u_s = D^-1 ([u] + M u_m), and
leaves the others, so that contact laws are blocks at single nodes of y^. The columns of N_q are
rigid motions and potentials of electrodes: tied nodes, which follow q, have no y^, and at contact
nodes in front of a moving foundation y^ is the displacement relative to it.

K^ = Q^T K Q is computed by PtAP. N_q would fill the rows of all tied nodes: q borders the system
instead,

    [[K^, K^ N_q], [N_q^T K^, N_q^T K^ N_q]],

with the border B = K^ N_q and the corner E = N_q^T K^ N_q. A factorisation solves for the columns
of B together with the right-hand side; for an iterative solver q is eliminated, a low-rank update
of K^ that keeps its preconditioner. After an inexact solve q is corrected: its rows are met to
rounding.

Right-hand sides and solutions have the values of q, the same on all ranks, behind the owned ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact.history import LinearisationPoint
from contact.linear.layout import Layout, congruent, times
from contact.linear.operator import BorderedBulk, Counters, SparseOperator
from contact.mesh.owners import Halo
from contact.ranks import summed
from contact.tolerances import ROUNDING
from contact.typing import Array


@dataclass(frozen=True)
class BasisChange:
    """A change of basis, x = Q y, that makes jumps unknowns."""

    matrix: PETSc.Mat  #: Q, the identity but for the nodes that jumps take the place of
    inverse: PETSc.Mat  #: Q^-1

    @staticmethod
    def of(
        comm: MPI.Intracomm,
        halo: Halo,
        rows: NDArray[np.intp],
        jumps: sparse.csr_array,
        unknowns: tuple[Array, NDArray[np.bool_]],
    ) -> BasisChange:
        """Return the change that makes jumps the free unknowns of some nodes. Collective.

        Jumps are T x, T = S + R with the diagonal S of the replaced nodes, and R without fixed
        unknowns: Q = T^-1 = (I + S^-1 R)^-1 S^-1, a finite sum, for S^-1 R is nilpotent.

        `rows` are local numbers of replaced nodes of this rank, (r,). `jumps` are given by nodal
        values of the halo, (r, nodes): of the node itself and of others, replaced or not, without
        cycles. `unknowns` are those by jumps, (r, block size, block size), the identity on the free
        components of the node, and the mask of the free ones of this rank's nodes,
        (nodes, block size).
        """
        by_jumps, free = unknowns
        (count, size), entries = free.shape, sparse.coo_array(jumps)
        free_in_halo = halo.forward(free.astype(float)) > 0
        at = rows[entries.row]
        on_diagonal = at == entries.col
        scale = np.ones((count, size))
        scale[at[on_diagonal]] = np.where(
            free[at[on_diagonal]], entries.data[on_diagonal, None], 1.0
        )
        # Unknowns of a replaced node by the free ones of other nodes.
        blocks = (
            entries.data[:, None, None]
            * by_jumps[entries.row]
            * free_in_halo[entries.col][:, None, :]
        )
        entry, first, second = np.nonzero(np.where(on_diagonal[:, None, None], 0.0, blocks))
        row, column = at[entry] * size + first, halo.numbers[entries.col[entry]] * size + second
        value = blocks[entry, first, second]
        begin, local_rows = halo.begin * size, np.arange(count * size)
        diagonal = scale.ravel()  # S, and -S^-1 R in `follows`
        follows = _matrix(comm, size, count, row, column, -value / diagonal[row])
        inverse = _matrix(
            comm,
            size,
            count,
            np.concatenate([row, local_rows]),
            np.concatenate([column, local_rows + begin]),
            np.concatenate([value, diagonal]),
        )
        whole = _matrix(comm, size, count, local_rows, local_rows + begin, np.ones(local_rows.size))
        further = follows
        while further.getInfo(PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"] > 0:
            whole.axpy(1.0, further, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
            further = further.matMult(follows)
        vector = whole.createVecRight()
        vector.array[:] = 1 / diagonal
        whole.diagonalScale(None, vector)
        return BasisChange(whole, inverse)


def _matrix(
    comm: MPI.Intracomm,
    size: int,
    count: int,
    row: NDArray[np.intp],
    column: NDArray[np.int64],
    values: Array,
) -> PETSc.Mat:
    """Return a matrix from entries by local rows and global columns. Collective."""
    local = count * size
    width = comm.allreduce(local, op=MPI.SUM)
    csr = sparse.csr_array((values, (row, column)), shape=(local, width))
    csr.sort_indices()
    parts = (csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data)
    shape = (local, width)
    matrix = PETSc.Mat().createAIJ((shape, shape), bsize=size, csr=parts, comm=comm)
    matrix.assemble()
    return matrix


class Transformation:
    """The matrix C of a body, x = C y, by the change of basis Q and the motions N_q.

    Q is None for the identity; N_q has the shape (owned, m), with zero rows at fixed unknowns, and
    `free` is the mask of the free q, shape (m,).
    """

    def __init__(
        self,
        layout: Layout,
        change: BasisChange | None,
        motions: sparse.csr_array,
        free: NDArray[np.bool_],
    ) -> None:
        self.layout, self.change, self.motions, self.free = layout, change, motions, free
        self.owned = layout.free.size
        self.matrix = None if change is None else change.matrix
        self._inverse = None if change is None else change.inverse

    def same(self, other: Transformation) -> bool:
        """Tell whether C is that of another transformation of the same unknowns. Collective."""
        change, motions = self.change, self.motions
        if (change is None) != (other.change is None) or motions.shape != other.motions.shape:
            return False
        if change is not None and not change.matrix.equal(other.matrix):
            return False
        return float(summed(self.layout.comm, (motions != other.motions).nnz)) == 0

    def gathered(self, forces: Array) -> Array:
        """Return N_q^T f of owned forces, shape (owned,) or (owned, k). Collective."""
        return summed(self.layout.comm, self.motions.T @ forces)

    def expand(self, y: Array) -> Array:
        """Return x = C y, with q behind the nodal unknowns. Collective."""
        q = y[self.owned :]
        return np.concatenate([times(self.matrix, y[: self.owned] + self.motions @ q), q])

    def relative(self, x: Array) -> Array:
        """Return the y of x. Collective."""
        q = x[self.owned :]
        return np.concatenate([times(self._inverse, x[: self.owned]) - self.motions @ q, q])

    def restrict(self, forces: Array) -> Array:
        """Return C^T f of forces on x. Collective."""
        nodal = times(self.matrix, forces[: self.owned], transposed=True)
        return np.concatenate([nodal, forces[self.owned :] + self.gathered(nodal)])

    def forces(self, restricted: Array) -> Array:
        """Return the forces on x of forces on y, 0 on fixed q. Collective."""
        nodal = restricted[: self.owned]
        q = np.where(self.free, restricted[self.owned :] - self.gathered(nodal), 0.0)
        return np.concatenate([times(self._inverse, nodal, transposed=True), q])


class TransformedBulk:
    """The matrices C^T K C of a body; a first one at the state `rest` gives their pattern.

    `columns` and `corner` are B = K^ N_q, shape (owned, m), and E = N_q^T K^ N_q, (m, m), of the
    last matrix, with the terms of bolts.
    """

    def __init__(
        self, bulk: BorderedBulk, transformation: Transformation, rest: LinearisationPoint
    ) -> None:
        self._bulk, self.transformation, self._rest = bulk, transformation, rest
        self._plain: PETSc.Mat | None = None
        self.columns: Array = np.zeros(transformation.motions.shape)
        self.corner: Array = np.zeros((transformation.free.size, transformation.free.size))

    @property
    def layout(self) -> Layout:
        """The unknowns; fixed ones are the same in x and y."""
        return self.transformation.layout

    @property
    def linear(self) -> bool:
        """Whether the matrices of a kind are the same at all states."""
        return self._bulk.linear

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the pattern of Q^T K Q. Collective."""
        matrix = self._bulk.create_matrix()
        if self.transformation.matrix is None:
            return matrix
        self._plain = matrix
        self._bulk.assemble(matrix, "secant", self._rest)
        product = congruent(matrix, self.transformation.matrix)
        product.setLGMap(*matrix.getLGMap())
        return product

    def assemble(self, matrix: PETSc.Mat, kind: str, state: LinearisationPoint) -> None:
        """Assemble Q^T K Q, 0 at fixed and tied unknowns, and the border. Collective."""
        if self._plain is None:
            self._bulk.assemble(matrix, kind, state)
        else:
            self._bulk.assemble(self._plain, kind, state)
            congruent(self._plain, self.transformation.matrix, matrix)
        if self.transformation.free.size == 0:
            return
        for k, column in enumerate(self.transformation.motions.T.toarray()):
            self.columns[:, k] = times(matrix, column)
        self.corner = self.transformation.gathered(self.columns)
        border = self._bulk.border(kind)
        if border is not None:
            # Rows of tied nodes count by N_q alone.
            columns = [times(self.transformation.matrix, c, transposed=True) for c in border[0].T]
            added = np.stack(columns, axis=1)
            across = self.transformation.gathered(added)
            self.columns += added
            self.corner = self.corner + across + across.T + border[1]
        self.columns = np.stack([self.layout.mask(column) for column in self.columns.T], axis=1)
        kept = matrix.createVecLeft()
        kept.array[:] = self.layout.free.ravel()
        matrix.diagonalScale(kept, kept)


class BorderedSolve:
    """Block elimination of q from K^ y^ + B q = f, B^T y^ + E q = g. Collective.

    `columns` B and `responses` inv(K^) B have the shape (owned, m), the `corner` E has (m, m). The
    Schur complement S = E - B^T inv(K^) B is inverted where anything resists q; the rest of q is 0,
    and `regular` false.
    """

    def __init__(
        self, comm: MPI.Intracomm, columns: Array, corner: Array, responses: Array
    ) -> None:
        self._comm, self.columns, self.responses = comm, columns, responses
        left, size, right = np.linalg.svd(corner - summed(comm, columns.T @ responses))
        resists = size > ROUNDING * np.abs(corner).max(initial=0.0)
        self.regular = bool(resists.all())
        self.inverse = np.asarray((right[resists].T / size[resists]) @ left[:, resists].T)

    def solve(self, first: Array, forces: Array) -> tuple[Array, Array]:
        """Return y^ and q from inv(K^) f and g. Collective."""
        q = self.inverse @ (forces - summed(self._comm, self.columns.T @ first))
        return first - self.responses @ q, q


class TransformedOperator:
    """C^T K C plus blocks at nodes of y; as `operator.SparseOperator`, in x."""

    def __init__(
        self,
        bulk: TransformedBulk,
        nodes: NDArray[np.int32],
        *,
        symmetric: bool,
        counters: Counters,
        solver: str,
    ) -> None:
        self._bulk, self._transformation, self._nodes = bulk, bulk.transformation, nodes
        self._inner = SparseOperator(
            bulk, nodes, symmetric=symmetric, counters=counters, solver=solver
        )
        self._owned, self._free = bulk.layout.free.size, np.flatnonzero(bulk.transformation.free)
        #: Elimination of q by a direct solver; None for an earlier matrix.
        self._bordered: BorderedSolve | None = None
        #: Inverses of the stiffness of body and blocks against q, for an iterative solver.
        self._inverse = self._compliance_of_q = np.zeros((self._free.size, self._free.size))

    @property
    def symmetric(self) -> bool:
        """Whether the blocks are symmetric too."""
        return self._inner.symmetric

    def update(
        self, kind: str, state: LinearisationPoint, blocks: Array, *, reuse: bool = False
    ) -> bool:
        """Assemble and factorise; see `SparseOperator.update`. Collective."""
        if not self._inner.update(kind, state, blocks, reuse=reuse):
            return False
        self._bordered = None
        if self._inner.iterative and self._free.size > 0:
            self._eliminate(blocks)
        return True

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns x and q; see `SparseOperator.solve`. Collective."""
        transformation, free = self._transformation, self._free
        restricted = transformation.restrict(rhs)
        nodal, forces = restricted[: self._owned], restricted[self._owned :][free]
        columns = self._bulk.columns[:, free]
        if self._inner.iterative:
            if guess is not None:
                guess = transformation.relative(guess)[: self._owned]
            relative = self._inner.solve(nodal - columns @ (self._inverse @ forces), rtol, guess)
            moved = self._inverse @ (forces - self._on_q(columns, relative))
        elif free.size == 0:
            relative, moved = self._inner.solve(nodal), forces
        else:
            if self._bordered is None:
                first, *responses = self._inner.solve_all(np.column_stack([nodal, columns])).T
                self._bordered = self._eliminated(columns, np.column_stack(responses))
            else:
                first = self._inner.solve(nodal)
            relative, moved = self._bordered.solve(first, forces)
        solution = self._expanded(relative, moved)
        if self._inner.iterative and rtol is not None and free.size:
            residual = rhs[self._owned :] - self.multiply(solution)[self._owned :]
            solution[self._owned :][free] += self._compliance_of_q @ residual[free]
        return solution

    def multiply(self, values: Array, transposed: bool = False) -> Array:
        """Return the matrix, or its transpose, times values on x and q. Collective.

        The border is symmetric: with a non-symmetric matrix no q is free.
        """
        bulk, layout = self._bulk, self._bulk.layout
        relative = self._transformation.relative(values)
        nodal, q = relative[: self._owned], relative[self._owned :]
        if q.size == 0:
            return self._transformation.forces(self._inner.multiply(nodal, transposed))
        forces = layout.mask(
            self._inner.multiply(layout.mask(nodal), transposed) + bulk.columns @ q
        )
        on_q = self._on_q(bulk.columns, nodal) + bulk.corner @ q
        return self._transformation.forces(np.concatenate([forces, on_q]))

    def solve_transposed(self, rhs: Array, rtol: float | None = None) -> Array:
        """Solve with the transposed operator; see `SparseOperator.solve_transposed`. Collective."""
        transformation, free = self._transformation, self._free
        restricted = transformation.restrict(rhs)
        nodal, forces = restricted[: self._owned], restricted[self._owned :][free]
        columns = self._bulk.columns[:, free]
        if self._inner.iterative:
            relative = self._inner.solve_transposed(
                nodal - columns @ (self._inverse @ forces), rtol
            )
            moved = self._inverse @ (forces - self._on_q(columns, relative))
            return self._expanded(relative, moved)
        first = self._inner.solve_transposed(nodal, rtol)
        solved = [self._inner.solve_transposed(columns[:, k], rtol) for k in range(free.size)]
        responses = np.stack([*solved], axis=1) if solved else np.zeros_like(columns)
        return self._expanded(*self._eliminated(columns, responses).solve(first, forces))

    def _eliminated(self, columns: Array, responses: Array) -> BorderedSolve:
        """Return the elimination of the free q. Collective."""
        corner = self._bulk.corner[np.ix_(self._free, self._free)]
        return BorderedSolve(self._bulk.layout.comm, columns, corner, responses)

    def _expanded(self, relative: Array, moved: Array) -> Array:
        """Return x = C y of the free q. Collective."""
        q = np.zeros(self._transformation.free.size)
        q[self._free] = moved
        return self._transformation.expand(np.concatenate([relative, q]))

    def _on_q(self, columns: Array, values: Array) -> Array:
        """Return columns^T times values. Collective."""
        return summed(self._bulk.layout.comm, columns.T @ values)

    def _eliminate(self, blocks: Array) -> None:
        """Eliminate the q that anything resists, for an iterative solver. Collective."""
        bulk, inner, free = self._bulk, self._inner, self._free
        motion, pushed = self._pushed(blocks)
        resisted = self._resisted(pushed)
        resists = bulk.layout.comm.allreduce(motion.T @ pushed, op=MPI.SUM)
        self._compliance_of_q = np.linalg.pinv(resists, rcond=ROUNDING)
        stiffness, turned = np.linalg.eigh(resisted.T @ bulk.corner[np.ix_(free, free)] @ resisted)
        basis = resisted @ turned
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
        """Return N_q at the nodes with blocks, and the blocks times it, (dofs, free) both."""
        n, size, free = self._nodes.size, self._bulk.layout.block_size, self._free
        motion = self._transformation.motions[self._dofs][:, free].toarray()
        nodal = motion.reshape(n, size, free.size)
        return motion, np.einsum("nij,njk->nik", blocks, nodal).reshape(-1, free.size)

    def _resisted(self, pushed: Array) -> Array:
        """Return a basis of the q that bodies or blocks resist, (free, k). Collective."""
        bulk, free = self._bulk, self._free
        gram = bulk.layout.comm.allreduce(pushed.T @ pushed, op=MPI.SUM)
        other = np.ones(self._owned)
        other[self._dofs] = 0.0
        tied = self._transformation.motions[:, free].multiply(other[:, None]).toarray()
        parts = bulk.layout.comm.allreduce(tied.T @ tied, op=MPI.SUM)
        # A q without tied nodes, but with stiffness, is a jump within the body.
        motions = bulk.layout.comm.allreduce(
            abs(self._transformation.motions[:, free]).sum(axis=0), op=MPI.SUM
        )
        stiff = np.diag(bulk.corner)[free] > 0
        jumps = np.diag((stiff & (np.asarray(motions).ravel() == 0)).astype(float))
        grams = (gram, parts, jumps)
        gram = sum(part / max(np.abs(part).max(initial=0.0), 1e-300) for part in grams)
        resistance, directions = np.linalg.eigh(gram)
        return np.asarray(directions[:, resistance > ROUNDING * resistance.max(initial=0.0)])
