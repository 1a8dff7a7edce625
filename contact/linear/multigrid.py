"""Algebraic multigrid for contact problems: GAMG with the rigid-body modes as near null space.

With a first coarse level from sequential products of each rank's own rows (`Aggregation`: on
several ranks PETSc keeps K P, P, its transpose and all summands of P^T K P, more memory than K),
interpolation adapted to contact nodes (`StiffNodes`), and coarse levels that are renewed when that
pays (`Hierarchy`).
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, log10
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse

from contact._compat import keeps_inverted_blocks
from contact.linear.layout import Layout, hidden, options, set_defaults
from contact.linear.petsc import Subsystems, petsc_options, refine
from contact.ranks import exchanged
from contact.typing import Array

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
    symmetric = all(matrix.isSymmetricKnown())
    if symmetric:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, False)
    pc.setUp()
    if symmetric:
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    interpolation = pc.getMGInterpolation(1) if pc.getMGLevels() > 1 else None
    pc.destroy()
    return interpolation


class Aggregation:
    """The first coarse level of an operator K: the interpolation P, and P^T K P.

    Smoothed aggregation (Vanek, Mandel and Brezina 1996); the tentative P0 is destroyed. Each rank
    has its rows of P in a sequential matrix. P^T K P is the sum of two products of each rank: with
    its own columns of K, and with those of other ranks, which send their rows of P.
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
        _, other_columns = exchanged(self._comm, np.repeat(self._asking, self._counts), sent)
        _, counts = exchanged(self._comm, self._asking, self._counts)
        low, high = (number // self._bs for number in self._range)
        aside = [part[self._aside(part)] // self._bs for part in (columns, other_columns)]
        # Ascending, so that rows stay sorted.
        self._blocks = np.unique(np.concatenate([np.arange(low, high), *aside]))
        csr = starts, self._local(columns).astype(PETSc.IntType), values
        #: This rank's rows of P.
        self.rows = PETSc.Mat().createAIJWithArrays(
            (starts.size - 1, self._width), csr, comm=PETSc.COMM_SELF
        )
        self.rows.setBlockSizes(matrix.getBlockSize(), self._bs)
        pattern = np.append(0, np.cumsum(counts)), self._local(other_columns)
        #: Starts and columns of rows of P of other ranks.
        self._theirs = tuple(part.astype(PETSc.IntType) for part in pattern)
        owned_rows = np.arange(*matrix.getOwnershipRange(), dtype=PETSc.IntType)
        blocks = self._blocks.astype(PETSc.IntType)
        self._map = PETSc.LGMap().create(blocks, bsize=self._bs, comm=matrix.comm)
        maps = PETSc.LGMap().create(owned_rows, comm=matrix.comm), self._map
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
            starts, numbers, _ = part.getValuesCSR()
            part.destroy()
            chosen.destroy()
            beyond = (numbers < first) | (numbers >= last)
            columns.append(np.unique(numbers[beyond]))
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
        local_columns = columns + columns.dtype.type(before - low)
        others = columns[aside]
        places = np.searchsorted(self._blocks, others // self._bs)
        local_columns[aside] = places * self._bs + others % self._bs
        return local_columns

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
            owned = self._chosen(self._beside[part])
            for factor in (owned, beside, theirs) if pattern else ():
                factor.data[:] = 1.0
            yield sparse.csr_array(owned.T @ (beside[part] @ theirs))

    def update(self) -> PETSc.Mat:
        """Return P^T K P of the present K and P. Collective."""
        # The option has other values for sequential matrices.
        with hidden("", ["matptap_via"]):
            product = self._matrix.getDiagonalBlock().ptap(self.rows, result=self._product)
        self._product = product
        if self._comm.size == 1:
            self.coarse = product
        else:
            if self.coarse is None:
                self.coarse = self._empty()
            self.coarse.zeroEntries()
            for rows in np.array_split(np.arange(self._width), PARTS):
                self._add(rows, _scipy(rows_of(product, rows)))
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
        local = PETSc.Mat().createAIJ(thin.shape, bsize=self._bs, csr=csr, comm=PETSc.COMM_SELF)
        local.axpy(1.0, self._product)
        size = self._range[1] - self._range[0]
        whole = PETSc.Mat().createIS(
            ((size, None), (size, None)), self._bs, self._map, self._map, self._comm
        )
        whole.setISLocalMat(local)
        whole.assemble()
        # Out of place.
        coarse = whole.convert("aij", PETSc.Mat())
        whole.destroy()
        coarse.setLGMap(self._map, self._map)
        return coarse


def _restricted(modes: PETSc.NullSpace, tentative: PETSc.Mat) -> PETSc.NullSpace:
    """Return the near null space on the coarse level, by P0^T. Collective."""
    restricted = []
    for mode in modes.getVecs():
        restricted.append(tentative.createVecRight())
        tentative.multTranspose(mode, restricted[-1])
    return PETSc.NullSpace().create(vectors=restricted, comm=tentative.comm)


def _smoothed(
    matrix: PETSc.Mat, tentative: PETSc.Mat, steps: int
) -> tuple[Integers, Integers, Any]:
    """Return the owned rows of P = (I - w D^-1 K)^steps P0 in CSR, w = 4/(3 lambda_max).

    P0 is destroyed. Collective.
    """
    diagonal = matrix.getDiagonal()
    diagonal.reciprocal()
    factor, interpolation = -4 / (3 * _largest_eigenvalue(matrix)), tentative
    for _ in range(steps):
        product = matrix.matMult(interpolation)
        product.diagonalScale(L=diagonal)
        product.aypx(factor, interpolation, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        # Collective: Python would free it at different times on the ranks.
        interpolation.destroy()
        interpolation = product
    rows = interpolation.getValuesCSR()
    for each in (interpolation, diagonal):
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
    eigenvalue = float(ksp.computeEigenvalues().real.max(initial=0.0))
    for each in (ksp, solution, rhs):
        each.destroy()
    return eigenvalue if eigenvalue > 0 else np.inf


def _places(starts: Integers, rows: Integers) -> Integers:
    """Return the positions of all entries of some rows of a sparse matrix."""
    counts = np.diff(starts)[rows]
    ends = np.cumsum(counts)
    return np.repeat(starts[rows] - (ends - counts), counts) + np.arange(counts.sum())


def rows_of(matrix: PETSc.Mat, rows: Integers) -> PETSc.Mat:
    """Return rows of a sequential matrix."""
    columns = PETSc.IS().createStride(matrix.getSize()[1], step=1, comm=PETSc.COMM_SELF)
    return matrix.createSubMatrix(_index(rows), columns)


def _index(numbers: Integers) -> PETSc.IS:
    return PETSc.IS().createGeneral(numbers.astype(PETSc.IntType), comm=PETSc.COMM_SELF)


def _scipy(matrix: PETSc.Mat) -> sparse.csr_array:
    starts, columns, values = matrix.getValuesCSR()
    return sparse.csr_array((values, columns, starts), shape=matrix.getSize())


#: Unknowns from which an iterative solver pays, by dimension and whether there is a potential
#: (`make bench`).
LARGE = {(2, False): 2_500_000, (2, True): 2_500_000, (3, False): 10_000, (3, True): 60_000}

#: Most unknowns of a direct solver in 3-D: some gigabytes.
DIRECT = 150_000

#: gamma couples the components of a node in contact: the smoother has to invert nodal blocks.
SMOOTHER = (
    {"mg_levels_ksp_max_it": "2", "mg_levels_pc_type": "sor"}
    if keeps_inverted_blocks()
    else {"mg_levels_ksp_max_it": "3", "mg_levels_pc_type": "pbjacobi"}
)

#: Relative tolerance of a linear solve, of the preconditioned residual.
TOLERANCE = 1e-10

#: Options of MINRES. PETSc's default radius is an absolute norm, at which it ends as if converged;
#: its reference norm of the right-hand side is not that of the preconditioner.
MINRES = {"ksp_minres_radius": "1e300", "ksp_converged_use_initial_residual_norm": "true"}

#: Options of GAMG where the user gives none.
DEFAULTS = {
    "pc_gamg_type": "agg",
    "pc_gamg_agg_nsmooths": "1",
    "pc_gamg_threshold": "0.01",
    "pc_gamg_reuse_interpolation": "true",
    "pc_gamg_coarse_eq_limit": "2000",
    "pc_gamg_aggressive_coarsening": "1",
    "mg_levels_ksp_type": "chebyshev",
    **SMOOTHER,
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "lu",
    # PETSc's default is an absolute pivot, which depends on the units.
    "mg_coarse_redundant_pc_factor_zeropivot": "1e-300",
}


def is_large(layout: Layout) -> bool:
    """Tell whether an iterative solver pays for a system of this size."""
    return layout.unknowns >= LARGE[layout.dim, layout.piezoelectric]


def is_chosen(solver: str, layout: Layout) -> bool:
    """Tell whether to solve by iterations; `solver` as of `operator.SparseOperator`."""
    if solver == "many":
        return is_large(layout) and layout.unknowns > DIRECT
    return solver == "iterative" or (solver == "auto" and is_large(layout))


def configure(ksp: PETSc.KSP, symmetric: bool) -> None:
    """Set up CG, or GMRES for non-symmetric operators, with GAMG, under the user's options."""
    iterate(ksp, "cg" if symmetric else "gmres")
    ksp.getPC().setType("gamg")
    set_defaults(ksp.getOptionsPrefix() or "", DEFAULTS)


def iterate(ksp: PETSc.KSP, method: str) -> None:
    """Choose a Krylov method, with tolerance and limit."""
    ksp.setType(method)
    if method == "gmres":
        ksp.setGMRESRestart(80)
    if method == "minres":
        set_defaults(ksp.getOptionsPrefix() or "", MINRES)
    ksp.setTolerances(rtol=TOLERANCE, max_it=500)


def rigid_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions of the displacement, orthonormalised. Collective."""
    d, index_map = layout.dim, layout.index_map
    if layout.revolved:
        return _along_axis(layout)
    size = (index_map.size_local * d, index_map.size_global * d)
    coordinates = PETSc.Vec().createMPI(size, d, layout.comm)
    # Rotations about the centre: well scaled.
    total = layout.comm.allreduce(layout.points.sum(axis=0), op=MPI.SUM)
    middle = total / index_map.size_global
    coordinates.array[:] = ((layout.points - middle) / layout.size).ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)


def _along_axis(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motion of a body of revolution."""
    size = (layout.index_map.size_local * 2, layout.index_map.size_global * 2)
    motion = PETSc.Vec().createMPI(size, 2, layout.comm)
    motion.array[1::2] = 1.0
    motion.normalize()
    return PETSc.NullSpace().create(vectors=[motion], comm=layout.comm)


def masked_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions, 0 at fixed unknowns, orthonormalised. Collective."""
    vectors: list[PETSc.Vec] = []
    for motion in rigid_motions(layout).getVecs():
        vector = motion.copy()  # PETSc locks those of a null space
        vector.array[:] = layout.mask(vector.array)
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=layout.comm)


#: Part of the contact blocks in the operator of the interpolation: without it the coarsest operator
#: is singular where contact alone constrains the body.
TOUCH = 1e-8


class StiffNodes:
    """Interpolation of GAMG at contact nodes.

    gamma outweighs all couplings of a node in contact: GAMG would leave its sliding out of the
    coarse spaces, and coarse functions that move it against gamma are lost. The interpolation is
    therefore made once, for the body alone, and multiplied by (K + |B|)^-1 K at contact nodes, K
    the nodal block of the body and B that of contact: equilibrium with the same neighbours. With
    |B| = (B^T B)^(1/2) the factor is bounded where friction falls with the slip. `interpolation`
    has this rank's rows for the body's operator; None without one.
    """

    def __init__(
        self, interpolation: PETSc.Mat | None, block_size: int, nodes: NDArray[np.int32]
    ) -> None:
        self._nodes, self._interpolation = nodes, interpolation
        if interpolation is None:
            return
        rows = block_size * nodes[:, None] + np.arange(block_size)
        self._rows = rows.astype(PETSc.IntType).ravel()
        of_body = rows_of(interpolation, self._rows)
        self._starts, self._columns, self._values = of_body.getValuesCSR()

    def follow(self, body_blocks: Array, blocks: Array) -> None:
        """Adapt the interpolation to blocks of body and contact, (n, bs, bs). Collective."""
        # The diagonal of K suffices.
        root = np.sqrt(np.abs(np.einsum("nii->ni", body_blocks)))
        scaled = blocks / root[:, :, None] / root[:, None, :]
        # The solver refuses numbers that overflow.
        left, size, right = np.linalg.svd(np.where(np.isfinite(scaled), scaled, 0.0))
        # (K + |B|)^-1 K, with K scaled to the identity.
        share_of_body = np.einsum("nki,nk,nkj->nij", right, 1 / (1 + size), right)
        self._inverse = np.einsum("nki,nk,njk->nij", right, size / (1 + size**2), left)
        self._inverse /= root[:, :, None] * root[:, None, :]
        if self._interpolation is not None:
            values = self._mixed(share_of_body * root[:, None, :] / root[:, :, None])
            self._interpolation.setValuesIJV(self._starts, self._columns, values, rowmap=self._rows)
            self._interpolation.assemble()

    def _mixed(self, factor: Array) -> Array:
        """Return the values of the rows, multiplied by a matrix at each node."""
        bs = factor.shape[1]
        row = np.repeat(np.arange(self._rows.size), np.diff(self._starts))
        within = np.arange(row.size) - self._starts[row]
        values = np.zeros_like(self._values)
        for k in range(bs):
            # All rows of a node have the same columns.
            same = self._starts[row // bs * bs + k] + within
            values += factor[row // bs, row % bs, k] * self._values[same]
        return values

    def local_correction(self, rhs: PETSc.Vec) -> PETSc.Vec:
        """Return (I + B^T B)^-1 B^T b at the contact nodes, with K scaled to I: damped B^-1 b.

        A block of friction, such as gamma mu e nu^T, is stiff along nu and exerts forces along e,
        which nothing resists in the coarse levels. Without this correction such forces in b make
        the first preconditioned residual so large that a tolerance relative to it says nothing.
        """
        vector = rhs.duplicate()
        values = vector.array.reshape(-1, self._inverse.shape[1])
        values[self._nodes] = np.einsum(
            "nij,nj->ni", self._inverse, rhs.array.reshape(values.shape)[self._nodes]
        )
        return vector


#: Options of GAMG that do not apply to the first coarse level.
NOT_ABOVE = ("pc_type", "pc_mg_galerkin")

#: W-cycle: PETSc visits a coarsest level once.
TWICE = {"ksp_type": "richardson", "ksp_max_it": "2", "ksp_norm_type": "none"}


def _go_down(named: dict[str, str]) -> None:
    """Turn options of GAMG into those of the next level."""
    squared = int(named["pc_gamg_aggressive_coarsening"])
    named["pc_gamg_aggressive_coarsening"] = str(max(squared - 1, 0))
    first, *others = named["pc_gamg_threshold"].split(",")
    factor = float(named.get("pc_gamg_threshold_scale", 1))
    named["pc_gamg_threshold"] = ",".join(others) or str(factor * float(first))


#: Cost of renewing the coarse levels, in iterations (`scripts.benchmarks.phases`).
PRICE = 8


class Hierarchy:
    """The levels of GAMG for a sequence of operators.

    The smoother of the finest level and the interpolation at the owned nodes with contact blocks
    follow each operator. The coarse operators, whose renewal costs `PRICE` iterations, are renewed
    once their age has cost as many (ski rental), within a solve too. `ksp_max_it` holds for the
    whole solve. `ksp` has GAMG and the body's operator, and is not set up.
    """

    def __init__(
        self, ksp: PETSc.KSP, nodes: NDArray[np.int32], subsystems: Subsystems | None = None
    ) -> None:
        self._ksp, self._subsystems = ksp, subsystems
        #: Options of PETSc for the levels below the first coarse one.
        self._below: dict[str, str] = {}
        self._levels: list[Aggregation] = []
        self._make_levels()
        rows = self._levels[0].rows if self._levels else None
        self._stiff = StiffNodes(rows, ksp.getOperators()[0].getBlockSize(), nodes)
        self._most = ksp.getTolerances()[3]
        self._lost = np.inf
        #: Iterations per digit with renewed coarse levels, and whether they are renewed.
        self._rate, self._fresh = 0.0, False
        self._taken, self._renewed = 0, False

    def _make_levels(self) -> None:
        """Aggregate while ranks have many unknowns; GAMG makes the levels below. Collective."""
        pc, prefix = self._ksp.getPC(), self._ksp.getOptionsPrefix() or ""
        matrix = self._ksp.getOperators()[0]
        database, kinds = PETSc.Options(prefix), ("pc_gamg_", "pc_mg_", "mg_")
        # Read one by one: PETSc warns of unread options.
        named = {
            name: database.getString(name) for name in database.getAll() if name.startswith(kinds)
        }
        steps = int(named["pc_gamg_agg_nsmooths"])
        while named["pc_gamg_type"] == "agg":
            gamg_options = {
                name: value for name, value in named.items() if name.startswith("pc_gamg_")
            }
            with petsc_options(prefix), options(f"{prefix}aggregates_", gamg_options | AGGREGATES):
                interpolation = tentative(matrix, f"{prefix}aggregates_")
            if interpolation is None:
                break
            self._levels.append(Aggregation(matrix, interpolation, steps))
            _go_down(named)
            # GAMG leaves ranks without rows of small matrices.
            if self._levels[-1].interpolation.getSize()[1] <= LARGE[3, False] * matrix.comm.size:
                break
            matrix = self._levels[-1].update()
        if not self._levels:
            return
        # The whole cycle is repeated, not its lower part.
        named.pop("pc_mg_multiplicative_cycles", None)
        visits = TWICE if named.get("pc_mg_cycle_type") == "w" else {"ksp_type": "preonly"}
        self._below = named | visits | {"pc_type": "gamg"}
        pc.setType("mg")
        pc.setMGLevels(1 + len(self._levels))
        with petsc_options(prefix), hidden(prefix, NOT_ABOVE):
            pc.setFromOptions()
        for k, level in enumerate(reversed(self._levels), start=1):
            pc.setMGInterpolation(k, level.interpolation)
        pc.getMGCoarseSolve().setOptionsPrefix(f"{prefix}coarse_")

    def follow(self, body_blocks: Array, blocks: Array) -> bool:
        """Follow the operator, given blocks of body and contact; True if renewed. Collective."""
        self._stiff.follow(body_blocks, blocks)
        if self._lost >= PRICE:
            self._renew()
            return True
        self._fresh = False
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(True)
        self._set_up()
        pc.getMGSmoother(pc.getMGLevels() - 1).getPC().setUp()
        return False

    def _renew(self) -> None:
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(False)
        for k, level in enumerate(self._levels, start=1):
            operator = level.update()
            pc.getMGSmoother(len(self._levels) - k).setOperators(operator, operator)
        self._set_up()
        self._lost, self._rate, self._fresh, self._renewed = 0.0, 0.0, True, True

    def _set_up(self) -> None:
        self._ksp.setOperators(*self._ksp.getOperators())
        prefix = self._ksp.getOptionsPrefix() or ""
        with petsc_options(prefix), options(f"{prefix}coarse_", self._below):
            self._ksp.setUp()

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> tuple[int, bool]:
        """Solve; return the number of iterations and whether levels were renewed. Collective."""
        self._taken, self._renewed = 0, False
        self._solve(rhs.copy(), solution)
        refine(self._ksp, rhs, solution, self._correct, self._subsystems)
        return self._taken, self._renewed

    def _correct(self, rhs: PETSc.Vec, correction: PETSc.Vec) -> None:
        """Solve for a residual, with renewed coarse levels."""
        if self._taken >= self._most:
            return
        if not self._fresh:
            self._renew()
        self._solve(rhs, correction)

    def _solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        local = self._stiff.local_correction(rhs)
        rhs.axpy(-1.0, self._ksp.getOperators()[0] * local)
        solution.axpy(-1.0, local)
        self._taken += self._iterate(rhs, solution, self._most - self._taken)
        solution.axpy(1.0, local)

    def _iterate(self, rhs: PETSc.Vec, solution: PETSc.Vec, most: int) -> int:
        ksp, digits = self._ksp, -log10(self._ksp.getTolerances()[0])
        if self._fresh:
            ksp.setTolerances(max_it=most)
            ksp.setConvergenceHistory(length=most + 1, reset=True)
            ksp.solve(rhs, solution)
            taken, norms = ksp.getIterationNumber(), ksp.getConvergenceHistory()
            # By the digits gained, not those asked for.
            if not self._rate and taken > 0 and norms.size > 0 and norms[-1] > 0:
                self._rate = taken / max(log10(norms[0] / norms[-1]), 1.0)
            return taken
        fresh = self._rate * digits
        ksp.setTolerances(max_it=min(ceil(fresh) + PRICE, most))
        ksp.solve(rhs, solution)
        taken = ksp.getIterationNumber()
        if ksp.getConvergedReason() > 0 or taken >= most:
            self._lost += max(taken - fresh, 0.0)
            return taken
        begun = ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
        self._renew()
        ksp.setInitialGuessNonzero(begun)
        return taken + self._iterate(rhs, solution, most - taken)
