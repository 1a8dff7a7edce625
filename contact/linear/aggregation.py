"""Smoothed aggregation with a coarse operator from sequential products of each rank.

On several ranks PETSc keeps K P, P, its transpose and all summands of P^T K P: more memory than K.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact.linear.layout import hidden
from contact.ranks import exchanged

Integers = NDArray[np.integer[Any]]

#: Parts in which a rank copies its rows, to save memory.
PARTS = 8

#: Options of the GAMG that finds aggregates, without smoothing or solving.
AGGREGATES = {
    "pc_gamg_agg_nsmooths": "0",
    "pc_gamg_parallel_coarse_grid_solver": "true",
    "mg_levels_ksp_type": "richardson",
    "mg_levels_pc_type": "none",
    "mg_coarse_ksp_type": "preonly",
    "mg_coarse_pc_type": "none",
}


def tentative(matrix: PETSc.Mat, prefix: str) -> PETSc.Mat | None:
    """Return the tentative interpolation P0 of GAMG's aggregates; None without a coarse level.

    Its columns are the near null space on each aggregate, orthonormal. Collective.
    """
    pc = PETSc.PC().create(matrix.comm)
    pc.setOptionsPrefix(prefix)
    pc.setOperators(matrix)
    pc.setType("gamg")
    pc.setGAMGLevels(2)
    pc.setFromOptions()
    # GAMG takes the graph of such a matrix for symmetric, and deadlocks where an entry is rounding
    # and its transpose 0.
    told = all(matrix.isSymmetricKnown())
    if told:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, False)
    pc.setUp()
    if told:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    found = pc.getMGInterpolation(1) if pc.getMGLevels() > 1 else None
    pc.destroy()
    return found


class Aggregation:
    """The first coarse level of an operator K: the interpolation P, and P^T K P.

    Smoothed aggregation (Vanek, Mandel and Brezina 1996). Each rank has its rows of P in a
    sequential matrix. P^T K P is the sum of two products of each rank: with its own columns of K,
    and with those of other ranks, which send their rows of P.

    Parameters
    ----------
    matrix
        The operator K.
    tentative
        P0, which is destroyed.
    steps
        Number of smoothing steps.
    """

    def __init__(self, matrix: PETSc.Mat, tentative: PETSc.Mat, steps: int = 1) -> None:
        self._matrix, self._comm = matrix, matrix.comm.tompi4py()
        self._bs = tentative.getBlockSizes()[1]
        self._modes = _restricted(matrix.getNearNullSpace(), tentative)
        sizes, self._range = tentative.getSizes(), tentative.getOwnershipRangeColumn()
        self._find_others()
        starts, columns, values = _smoothed(matrix, tentative, steps)
        #: Scale of P, a power of two.
        self.unit = self._unit()
        values *= self.unit
        #: Lengths of the rows sent to other ranks.
        self._counts = np.diff(starts)[self._asked]
        sent = columns[_places(starts, self._asked)].astype(np.int64)
        _, there = exchanged(self._comm, np.repeat(self._asking, self._counts), sent)
        _, counts = exchanged(self._comm, self._asking, self._counts)
        low, high = (number // self._bs for number in self._range)
        aside = [part[self._aside(part)] // self._bs for part in (columns, there)]
        # Ascending, so that rows stay sorted.
        self._blocks = np.unique(np.concatenate([np.arange(low, high), *aside]))
        csr = starts, self._local(columns).astype(PETSc.IntType), values
        #: This rank's rows of P.
        self.rows = PETSc.Mat().createAIJWithArrays(
            (starts.size - 1, self._width), csr, comm=PETSc.COMM_SELF
        )
        self.rows.setBlockSizes(matrix.getBlockSize(), self._bs)
        pattern = np.append(0, np.cumsum(counts)), self._local(there)
        #: Starts and columns of rows of P of other ranks.
        self._theirs = tuple(part.astype(PETSc.IntType) for part in pattern)
        here = np.arange(*matrix.getOwnershipRange(), dtype=PETSc.IntType)
        blocks = self._blocks.astype(PETSc.IntType)
        self._map = PETSc.LGMap().create(blocks, bsize=self._bs, comm=matrix.comm)
        maps = PETSc.LGMap().create(here, comm=matrix.comm), self._map
        #: P as it multiplies vectors.
        self.interpolation = PETSc.Mat().createIS(sizes, None, *maps, matrix.comm)
        self.interpolation.setISLocalMat(self.rows)
        self.interpolation.assemble()
        self._product: PETSc.Mat | None = None
        #: The coarse operator of the last update.
        self.coarse: Any = None

    def _unit(self) -> float:
        """Return the factor that scales P^T K P to about 1. Collective."""
        # From 3.25 on PETSc takes pivots of coarse levels below 2e-14 for zero.
        diagonal = self._matrix.getDiagonal()
        size = diagonal.norm(PETSc.NormType.NORM_1) / diagonal.getSize()
        return 2.0 ** round(-np.log2(size) / 2) if 0 < size < np.inf else 1.0

    @property
    def _width(self) -> int:
        """Number of columns of `rows`."""
        return int(self._blocks.size * self._bs)

    def _find_others(self) -> None:
        """Find columns of K of other ranks, their rows here, and requests for own rows."""
        first, last = self._matrix.getOwnershipRange()
        columns, beside = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        alone = self._comm.size == 1
        for rows in () if alone else np.array_split(np.arange(first, last), PARTS):
            chosen = PETSc.IS().createGeneral(rows.astype(PETSc.IntType), self._comm)
            part = self._matrix.createSubMatrix(chosen, None)
            starts, found, _ = part.getValuesCSR()
            part.destroy()
            chosen.destroy()
            beyond = (found < first) | (found >= last)
            columns.append(np.unique(found[beyond]))
            beside.append(rows[np.diff(np.append(0, np.cumsum(beyond))[starts]) > 0] - first)
        self._others, self._beside = np.unique(np.concatenate(columns)), np.concatenate(beside)
        owners = np.searchsorted(self._matrix.getOwnershipRanges()[1:], self._others, side="right")
        self._asking, asked = exchanged(self._comm, owners, self._others.astype(np.int64))
        self._asked = asked - first

    def _aside(self, columns: Integers) -> NDArray[np.bool_]:
        """Return which columns of P are of other ranks."""
        low, high = self._range
        return (columns < low) | (columns >= high)

    def _local(self, columns: Integers) -> Integers:
        """Return the columns' numbers on this rank."""
        low, aside = self._range[0], self._aside(columns)
        before = np.searchsorted(self._blocks, low // self._bs) * self._bs
        found = columns + columns.dtype.type(before - low)
        others = columns[aside]
        places = np.searchsorted(self._blocks, others // self._bs)
        found[aside] = places * self._bs + others % self._bs
        return found

    def _chosen(self, rows: Integers) -> sparse.csr_array:
        """Return some of this rank's rows of P."""
        return _scipy(rows_of(self.rows, rows))

    def _thin(self, pattern: bool = False) -> Iterator[sparse.csr_array]:
        """Yield the product with columns of K of other ranks, in parts. Collective.

        With all entries 1 for the pattern: SciPy drops sums that are zero.
        """
        to, sent = np.repeat(self._asking, self._counts), self._chosen(self._asked).data
        _, values = exchanged(self._comm, to, sent)
        starts, columns = self._theirs
        size = self._others.size, self._width
        theirs = sparse.csr_array((values, columns, starts), shape=size)
        del to, sent
        first = self._matrix.getOwnershipRange()[0]
        index = _index(self._beside + first), _index(self._others)
        beside = _scipy(*self._matrix.createSubMatrices(*index))
        for part in np.array_split(np.arange(self._beside.size), PARTS):
            own = self._chosen(self._beside[part])
            for factor in (own, beside, theirs) if pattern else ():
                factor.data[:] = 1.0
            yield sparse.csr_array(own.T @ (beside[part] @ theirs))

    def update(self) -> PETSc.Mat:
        """Return P^T K P of the present K and P. Collective."""
        # The option has other values for sequential matrices.
        with hidden("", ["matptap_via"]):
            own = self._matrix.getDiagonalBlock().ptap(self.rows, result=self._product)
        self._product = own
        if self._comm.size == 1:
            self.coarse = own
        else:
            if self.coarse is None:
                self.coarse = self._empty()
            self.coarse.zeroEntries()
            for rows in np.array_split(np.arange(self._width), PARTS):
                self._add(rows, _scipy(rows_of(own, rows)))
            for part in self._thin():
                self._add(np.arange(self._width), part)
            self.coarse.assemble()
        self.coarse.setNearNullSpace(self._modes)
        return self.coarse

    def _add(self, rows: Integers, part: sparse.csr_array) -> None:
        """Add values in some rows to the coarse operator."""
        self.coarse.setValuesLocalIJV(
            part.indptr.astype(PETSc.IntType),
            part.indices.astype(PETSc.IntType),
            part.data,
            addv=PETSc.InsertMode.ADD_VALUES,
            rowmap=rows.astype(PETSc.IntType),
        )

    def _empty(self) -> PETSc.Mat:
        """Return a matrix with the pattern of the coarse operator. Collective."""
        thin = sum(self._thin(pattern=True), sparse.csr_array((self._width, self._width)))
        thin.sort_indices()
        csr = thin.indptr.astype(PETSc.IntType), thin.indices.astype(PETSc.IntType), thin.data
        own = PETSc.Mat().createAIJ(thin.shape, bsize=self._bs, csr=csr, comm=PETSc.COMM_SELF)
        own.axpy(1.0, self._product)
        size = self._range[1] - self._range[0]
        whole = PETSc.Mat().createIS(
            ((size, None), (size, None)), self._bs, self._map, self._map, self._comm
        )
        whole.setISLocalMat(own)
        whole.assemble()
        # Out of place.
        made = whole.convert("aij", PETSc.Mat())
        whole.destroy()
        made.setLGMap(self._map, self._map)
        return made


def _restricted(modes: PETSc.NullSpace, tentative: PETSc.Mat) -> PETSc.NullSpace:
    """Return the near null space on the coarse level, by P0^T. Collective."""
    found = []
    for mode in modes.getVecs():
        found.append(tentative.createVecRight())
        tentative.multTranspose(mode, found[-1])
    return PETSc.NullSpace().create(vectors=found, comm=tentative.comm)


def _smoothed(
    matrix: PETSc.Mat, tentative: PETSc.Mat, steps: int
) -> tuple[Integers, Integers, Any]:
    """Return the owned rows of P = (I - w D^-1 K)^steps P0 in CSR, w = 4/(3 lambda_max).

    P0 is destroyed. Collective.
    """
    diagonal = matrix.getDiagonal()
    diagonal.reciprocal()
    factor, made = -4 / (3 * _largest_eigenvalue(matrix)), tentative
    for _ in range(steps):
        product = matrix.matMult(made)
        product.diagonalScale(L=diagonal)
        product.aypx(factor, made, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        # Collective: Python would free it at different times on the ranks.
        made.destroy()
        made = product
    rows = made.getValuesCSR()
    for each in (made, diagonal):
        each.destroy()
    return rows  # type: ignore[no-any-return]


def _largest_eigenvalue(matrix: PETSc.Mat) -> float:
    """Estimate lambda_max of D^-1 K by CG (Lanczos); infinity at overflow. Collective."""
    ksp = PETSc.KSP().create(matrix.comm)
    ksp.setType("cg")
    ksp.getPC().setType("jacobi")
    ksp.setOperators(matrix)
    # As many steps as GAMG takes.
    ksp.setTolerances(rtol=1e-12, max_it=10)
    ksp.setComputeEigenvalues(True)
    solution, rhs = matrix.createVecs()
    rhs.setRandom()
    ksp.solve(rhs, solution)
    found = float(ksp.computeEigenvalues().real.max(initial=0.0))
    for each in (ksp, solution, rhs):
        each.destroy()
    return found if found > 0 else np.inf


def _places(starts: Integers, rows: Integers) -> Integers:
    """Return the positions of all entries of some rows of a sparse matrix."""
    counts = np.diff(starts)[rows]
    ends = np.cumsum(counts)
    return np.repeat(starts[rows] - (ends - counts), counts) + np.arange(counts.sum())


def rows_of(matrix: PETSc.Mat, rows: Integers) -> PETSc.Mat:
    """Return rows of a sequential matrix."""
    every = PETSc.IS().createStride(matrix.getSize()[1], step=1, comm=PETSc.COMM_SELF)
    return matrix.createSubMatrix(_index(rows), every)


def _index(numbers: Integers) -> PETSc.IS:
    return PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=PETSc.COMM_SELF)


def _scipy(matrix: PETSc.Mat) -> sparse.csr_array:
    starts, columns, values = matrix.getValuesCSR()
    return sparse.csr_array((values, columns, starts), shape=matrix.getSize())
