"""Other unknowns for a linear system: at some nodes the distance to a mixture of other ones.

With x = Q y the matrix is Q^T K Q. Its blocks at single nodes act on single nodes of y: what
couples two bodies is in Q, and contact laws remain nodal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse
from scipy.sparse import csgraph

from contact.history import Evaluated
from contact.linear.bordered import BorderedOperator
from contact.linear.layout import Layout
from contact.linear.operator import Bulk, SparseOperator
from contact.linear.products import quick_products
from contact.mesh.entities import owned_among
from contact.typing import Array


@dataclass(frozen=True)
class Change:
    """A change of unknowns; the same on all ranks.

    Attributes
    ----------
    nodes
        Global numbers of the nodes that take part, shape (c,).
    matrix
        Q at their unknowns, node by node, shape (c block size, c block size); at all others it is
        the identity.
    inverse
        Its inverse.
    unrestrained
        The inverse if nothing were fixed: what it is made of is the same for all unknowns of a
        node.
    """

    nodes: NDArray[np.int64]
    matrix: sparse.csr_array
    inverse: sparse.csr_array
    unrestrained: sparse.csr_array

    @staticmethod
    def of(
        nodes: NDArray[np.int64],
        rows: NDArray[np.intp],
        jumps: sparse.csr_array,
        free: NDArray[np.bool_],
    ) -> Change:
        """Return the change that makes jumps unknowns, in place of those of some nodes.

        Where an unknown is fixed it remains itself; the others lose what depends on it, for it
        does not change.

        Parameters
        ----------
        nodes
            Global numbers of the nodes that take part, shape (c,).
        rows
            Which of them are replaced, shape (r,).
        jumps
            The jumps by the unknowns, shape (r, c). One is made of the node itself, of nodes that
            are not replaced, and of replaced ones, but in no circle: see `in_circles`.
        free
            Which unknowns are not fixed, shape (c, block size).
        """
        made = [_of_component(rows, jumps, component) for component in free.T]
        _, unrestrained = _of_component(rows, jumps, np.ones(free.shape[0], dtype=bool))
        return Change(
            nodes,
            _interleaved([matrix for matrix, _ in made]),
            _interleaved([inverse for _, inverse in made]),
            _interleaved([unrestrained] * free.shape[1]),
        )

    def petsc(self, matrix: sparse.csr_array, layout: Layout) -> PETSc.Mat:
        """Return Q, or its inverse, as a parallel matrix. Collective."""
        size, index_map = layout.block_size, layout.index_map
        begin, end = index_map.local_range
        columns = self.nodes[:, None] * size + np.arange(size)
        here, _ = owned_among(index_map, self.nodes)
        local = (columns[here] - begin * size).ravel()
        own = (here[:, None] * size + np.arange(size)).ravel()
        entries = matrix[own].tocoo()
        rest = np.setdiff1d(np.arange((end - begin) * size), local)
        rows = np.concatenate([local[entries.row], rest])
        across = np.concatenate([columns.ravel()[entries.col], rest + begin * size])
        values = np.concatenate([entries.data, np.ones(rest.size)])
        shape = ((end - begin) * size, index_map.size_global * size)
        csr = sparse.csr_array((values, (rows, across)), shape=shape)
        csr.sort_indices()
        sizes = (shape, shape)
        parts = (csr.indptr.astype(PETSc.IntType), csr.indices.astype(PETSc.IntType), csr.data)
        made = PETSc.Mat().createAIJ(sizes, bsize=size, csr=parts, comm=layout.comm)
        made.assemble()
        return made


def in_circles(rows: NDArray[np.intp], jumps: sparse.csr_array) -> NDArray[np.intp]:
    """Return the replaced nodes that follow each other in circles; none, or there is no change.

    Parameters
    ----------
    rows, jumps
        As in `Change.of`.

    Returns
    -------
    Places among the nodes that take part.
    """
    among = sparse.coo_array(jumps[:, rows])
    edges = sparse.csr_array((among.data != 0, among.coords), shape=among.shape)
    count, member = csgraph.connected_components(edges, connection="strong")
    return rows[np.bincount(member, minlength=count)[member] > 1]


def _of_component(
    rows: NDArray[np.intp], jumps: sparse.csr_array, free: NDArray[np.bool_]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Return the change and its inverse for one unknown of each node, given which are free."""
    count = free.size
    own = np.asarray(jumps[np.arange(rows.size), rows]).ravel()
    replaced = np.flatnonzero(free[rows])
    scale = np.ones(count)
    scale[rows[replaced]] = own[replaced]
    place = sparse.csr_array(
        (np.ones(replaced.size), (rows[replaced], replaced)), shape=(count, rows.size)
    )
    others = place @ jumps @ sparse.diags_array(free.astype(float))
    others = others - sparse.diags_array(others.diagonal())
    identity = sparse.eye_array(count)
    follows = -(sparse.diags_array(1 / scale) @ others)
    # What follows replaced nodes follows what these follow; without circles there is an end.
    whole, further = identity, follows
    while further.count_nonzero():
        whole = whole + further
        further = further @ follows
    whole = whole @ sparse.diags_array(1 / scale)
    inverse = sparse.diags_array(scale) @ (identity - follows)
    return sparse.csr_array(whole), sparse.csr_array(inverse)


def _interleaved(components: list[sparse.csr_array]) -> sparse.csr_array:
    """Return a matrix of blocks, node by node, given that of each component."""
    size, total = len(components), None
    for k, matrix in enumerate(components):
        unit = sparse.csr_array(([1.0], ([k], [k])), shape=(size, size))
        part = sparse.kron(matrix, unit, format="csr")
        total = part if total is None else total + part
    return sparse.csr_array(total)


class ChangedBulk:
    """The matrices of a body in other unknowns.

    Parameters
    ----------
    bulk
        Assembles the matrices in its own.
    change
        The change.
    rest
        A state at which a first matrix is assembled, for its pattern.
    """

    def __init__(self, bulk: Bulk, change: Change, rest: Evaluated) -> None:
        self._bulk, self._change, self._rest = bulk, change, rest
        self.matrix = change.petsc(change.matrix, bulk.layout)
        self.inverse = change.petsc(change.inverse, bulk.layout)
        self._plain = bulk.create_matrix()

    @property
    def layout(self) -> Layout:
        """The unknowns: fixed ones are the same in both."""
        return self._bulk.layout

    def create_matrix(self) -> PETSc.Mat:
        """Return a matrix with the pattern of Q^T K Q. Collective."""
        self._bulk.assemble(self._plain, "secant", self._rest)
        with quick_products(self._plain):
            made = self._plain.ptap(self.matrix)
        made.setLGMap(*self._plain.getLGMap())
        return made

    def times(self, matrix: PETSc.Mat, values: Array, transposed: bool = False) -> Array:
        """Return Q, or its inverse, times owned values; others behind them remain. Collective."""
        vector, image = matrix.createVecs()
        owned = vector.array.size
        vector.array[:] = values[:owned]
        (matrix.multTranspose if transposed else matrix.mult)(vector, image)
        return np.concatenate([image.array, values[owned:]])

    def take_apart(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Fill a matrix with K as it was assembled last; see `operator.Bulk`. Collective."""
        matrix.zeroEntries()
        matrix.axpy(1.0, self._plain, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        return self._change.petsc(self._change.unrestrained, self.layout)

    def assemble(self, matrix: PETSc.Mat, kind: str, state: Evaluated) -> None:
        """Assemble Q^T K Q at a state. Collective."""
        self._bulk.assemble(self._plain, kind, state)
        self._plain.ptap(self.matrix, result=matrix)


class ChangedOperator:
    """Bulk matrix plus blocks that act on changed unknowns; as `operator.SparseOperator`.

    Parameters
    ----------
    bulk
        The body in these unknowns.
    inner
        Its operator.
    """

    def __init__(self, bulk: ChangedBulk, inner: SparseOperator | BorderedOperator) -> None:
        self._bulk, self._inner = bulk, inner

    @property
    def symmetric(self) -> bool:
        """Whether the blocks are symmetric too."""
        return self._inner.symmetric

    def update(self, kind: str, state: Evaluated, blocks: Array, *, constant: bool = False) -> bool:
        """Assemble and factorise; see `SparseOperator.update`. Collective."""
        return self._inner.update(kind, state, blocks, constant=constant)

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns x; see `SparseOperator.solve`. Collective."""
        bulk = self._bulk
        start = None if guess is None else bulk.times(bulk.inverse, guess)
        solved = self._inner.solve(bulk.times(bulk.matrix, rhs, transposed=True), rtol, start)
        return bulk.times(bulk.matrix, solved)

    def multiply(self, values: Array) -> Array:
        """Return the matrix times owned values and global ones, as forces. Collective."""
        bulk = self._bulk
        forces = self._inner.multiply(bulk.times(bulk.inverse, values))
        return bulk.times(bulk.inverse, forces, transposed=True)
