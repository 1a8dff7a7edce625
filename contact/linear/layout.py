"""Unknowns of a linear system by nodes, some fixed; options and products of PETSc."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact.typing import Array


@dataclass(frozen=True)
class Inclined:
    """Fixed directions that are not axes: rollers on inclined faces.

    Attributes
    ----------
    nodes
        The nodes, shape (n,).
    across
        Projectors onto the fixed directions, shape (n, block size, block size), across the fixed
        unknowns.
    """

    nodes: NDArray[np.int32]
    across: Array

    def at(self, nodes: NDArray[np.int32]) -> Inclined:
        """Return the directions of some nodes, by positions among these."""
        _, places, rows = np.intersect1d(nodes, self.nodes, return_indices=True)
        return Inclined(places.astype(np.int32), self.across[rows])

    def along(self, values: Array) -> Array:
        """Return flat nodal values projected onto the fixed directions."""
        nodal = values.reshape(-1, self.across.shape[1])
        projected = np.zeros_like(nodal)
        projected[self.nodes] = np.einsum("nij,nj->ni", self.across, nodal[self.nodes])
        return projected.reshape(values.shape)

    def projection(self, layout: Layout) -> PETSc.Mat:
        """Return the projector onto the free directions, a matrix. Collective."""
        size, owned = layout.block_size, layout.free.shape[0]
        rows = size * self.nodes[:, None] + np.arange(size)
        grid = np.broadcast_arrays(rows[:, :, None], rows[:, None, :])
        square = (owned * size, owned * size)
        taken = sparse.coo_array((self.across.ravel(), [g.ravel() for g in grid]), shape=square)
        projector = sparse.csr_array(sparse.eye_array(owned * size) - taken)
        projector.sort_indices()
        shape = ((owned * size, None), (owned * size, None))
        begin = layout.index_map.local_range[0] * size
        starts = projector.indptr.astype(PETSc.IntType)
        columns = (projector.indices + begin).astype(PETSc.IntType)
        csr = starts, columns, projector.data
        matrix = PETSc.Mat().createAIJ(shape, bsize=size, csr=csr, comm=layout.comm)
        matrix.assemble()
        return matrix

    def add(self, matrix: PETSc.Mat, scale: float) -> None:
        """Add multiples of the projectors to a matrix. Collective."""
        insert_blocks(matrix, self.nodes, scale * self.across, PETSc.InsertMode.ADD_VALUES)


def masked(free: NDArray[np.bool_], inclined: Inclined | None, values: Array) -> Array:
    """Return flat nodal values, 0 at fixed unknowns and along fixed directions."""
    free_values = np.where(free.ravel(), values, 0.0)
    return free_values if inclined is None else free_values - inclined.along(free_values)


def projectors(free: NDArray[np.bool_], inclined: Inclined | None) -> Array:
    """Return the projectors onto the free directions of nodes, (n, block size, block size)."""
    matrices = np.eye(free.shape[1]) * free[:, None, :]
    if inclined is not None:
        matrices[inclined.nodes] -= inclined.across
    return matrices


def masked_blocks(free: NDArray[np.bool_], inclined: Inclined | None, blocks: Array) -> Array:
    """Return nodal blocks, 0 at fixed unknowns and along fixed directions."""
    if inclined is None:
        mask = free.astype(float)
        return blocks * mask[:, :, None] * mask[:, None, :]
    along = projectors(free, inclined)
    return np.asarray(along @ blocks @ along)


@dataclass(frozen=True)
class Layout:
    """Unknowns of the nodes: d displacement components, then a potential or none.

    Attributes
    ----------
    comm
        Communicator.
    index_map
        Of the nodes.
    points
        Coordinates of the owned nodes, shape (nodes, d) (length).
    free
        Which unknowns of the owned nodes are free, shape (nodes, block size).
    size
        Largest extent of the body (length).
    stiffness
        Young's modulus, the unit of the operator (stress).
    revolved
        Whether the nodes are those of the half plane of a body of revolution.
    inclined
        Fixed directions that are not axes; None without any on all ranks.
    """

    comm: MPI.Intracomm
    index_map: IndexMap
    points: Array
    free: NDArray[np.bool_]
    size: float
    stiffness: float
    revolved: bool = False
    inclined: Inclined | None = None

    @property
    def dim(self) -> int:
        """Number d of displacement components of a node."""
        return self.points.shape[1]

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""
        return self.free.shape[1]

    @property
    def piezoelectric(self) -> bool:
        """Whether there is a potential."""
        return self.block_size > self.dim

    @property
    def unknowns(self) -> int:
        """Number of unknowns over all ranks."""
        return int(self.index_map.size_global) * self.block_size

    @property
    def restrained(self) -> NDArray[np.int32]:
        """Owned nodes with supports, ascending."""
        restrained = np.asarray(~self.free.all(axis=1))
        if self.inclined is not None:
            restrained[self.inclined.nodes] = True
        return np.flatnonzero(restrained).astype(np.int32)

    def mask(self, values: Array) -> Array:
        """Return owned values, 0 at fixed unknowns and along fixed directions."""
        return masked(self.free, self.inclined, values)

    def at(self, nodes: NDArray[np.int32]) -> tuple[NDArray[np.bool_], Inclined | None]:
        """Return free unknowns and inclined directions of some owned nodes."""
        return self.free[nodes], None if self.inclined is None else self.inclined.at(nodes)


def times(matrix: PETSc.Mat | None, values: Array, transposed: bool = False) -> Array:
    """Return a matrix times owned values; None is the identity. Collective."""
    if matrix is None:
        return values
    vector, image = matrix.createVecs()
    if transposed:
        vector, image = image, vector
    vector.array[:] = values
    (matrix.multTranspose if transposed else matrix.mult)(vector, image)
    return np.asarray(image.array)


def congruent(matrix: PETSc.Mat, basis: PETSc.Mat, result: PETSc.Mat | None = None) -> PETSc.Mat:
    """Return Q^T K Q of a basis Q with few entries per row, into an earlier result if given.

    On several ranks summed row by row, unless the user's options say how: PETSc's default keeps K Q
    and all summands, twice the size of K. Collective.
    """
    via = {"matptap_via": "allatonce_merged"} if matrix.comm.size > 1 else {}
    with options("", via):
        return matrix.ptap(basis, result=result)


def set_defaults(prefix: str, values: Mapping[str, str]) -> None:
    """Set options of PETSc under a prefix where the user gives none."""
    options = PETSc.Options(prefix)
    for name, value in values.items():
        if not options.hasName(name):
            options[name] = value


@contextmanager
def options(prefix: str, values: Mapping[str, str]) -> Iterator[None]:
    """Set options of PETSc under a prefix temporarily, where the user gives none."""
    database = PETSc.Options(prefix)
    defaults = [name for name in values if not database.hasName(name)]
    set_defaults(prefix, values)
    try:
        yield
    finally:
        for name in defaults:
            database.delValue(name)


@contextmanager
def hidden(prefix: str, names: Iterable[str]) -> Iterator[None]:
    """Hide options of the user under a prefix temporarily."""
    database = PETSc.Options(prefix)
    user_options = {name: database.getString(name) for name in names if database.hasName(name)}
    for name in user_options:
        database.delValue(name)
    try:
        yield
    finally:
        for name, value in user_options.items():
            database[name] = value
            # Mark it as read: PETSc warns of unread options.
            database.hasName(name)


def balance(matrix: PETSc.Mat, layout: Layout) -> None:
    """Scale the diagonal at fixed unknowns and directions to the mean diagonal. Collective.

    Ones there would depend on the units: multigrid would see nothing else, or no support.
    """
    diagonal, free = matrix.getDiagonal(), layout.free.ravel()
    sizes = np.array([np.abs(diagonal.array[free]).sum(), np.count_nonzero(free)])
    layout.comm.Allreduce(MPI.IN_PLACE, sizes, op=MPI.SUM)
    if sizes[0] > 0 and np.isfinite(sizes[0]):
        diagonal.array[~free] = sizes[0] / sizes[1]
        matrix.setDiagonal(diagonal)
        if layout.inclined is not None:
            layout.inclined.add(matrix, sizes[0] / sizes[1] - 1)


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


def insert_blocks(
    matrix: PETSc.Mat,
    nodes: NDArray[np.int32],
    blocks: Array,
    mode: PETSc.InsertMode = PETSc.InsertMode.INSERT_VALUES,
) -> None:
    """Insert or add blocks at owned nodes. Collective."""
    rows, at = np.arange(nodes.size + 1, dtype=PETSc.IntType), nodes.astype(PETSc.IntType)
    matrix.setValuesBlockedLocalIJV(rows, at, blocks, addv=mode, rowmap=at)
    matrix.assemble()
