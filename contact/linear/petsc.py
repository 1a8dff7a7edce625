"""Solvers of PETSc: setting up, iterative refinement, and messages where they fail.

Preconditioned residuals, by which Krylov solvers end, are blind where the preconditioner is nearly
singular: for a weakly constrained body the first correction is a huge rigid motion, beside which
all else is small. `refine` corrects their solutions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.errors import InputError, SingularError
from contact.linear.layout import Layout
from contact.mesh.entities import component_sums
from contact.tolerances import EPS, HUGE
from contact.typing import Array

#: MUMPS's INFOG(1) for too little workspace, of integers and of numbers.
TOO_SMALL = (-8, -9)

#: MUMPS's INFOG(1) for too little workspace, memory or limit ICNTL(23).
OUT_OF_MEMORY = (*TOO_SMALL, -11, -12, -13, -17, -19, -20)

#: MUMPS's ICNTL(14): workspace beyond the estimate, first and largest (percent).
WORKSPACE, MOST_WORKSPACE = 10, 50_000

#: Ratio of diagonal entries of a coarse operator that is rounding.
VANISHES = 50 * EPS

#: Most corrections of a solution.
CORRECTIONS = 3


def is_mumps(pc: PETSc.PC) -> bool:
    """Tell whether a preconditioner is a factorisation of MUMPS."""
    return pc.getType() in ("lu", "cholesky") and pc.getFactorSolverType() == "mumps"


def set_up_with_workspace(
    ksp: PETSc.KSP, prepare: Callable[[PETSc.PC], None] = PETSc.PC.setFactorSetUpSolverType
) -> None:
    """Set up a direct solver, with more workspace until it suffices. Collective.

    MUMPS's estimate may be too low, by the order of messages, or with a Schur complement;
    `prepare` configures each new factorisation.
    """
    ksp.setUp()
    pc, workspace = ksp.getPC(), WORKSPACE
    while is_mumps(pc) and pc.getFactorMatrix().getMumpsInfog(1) in TOO_SMALL:
        workspace = 4 * max(workspace, pc.getFactorMatrix().getMumpsIcntl(14))
        if workspace > MOST_WORKSPACE:
            return
        # PETSc does not reuse a factorisation that has failed.
        operators = ksp.getOperators()
        pc.reset()
        ksp.setOperators(*operators)
        prepare(pc)
        pc.getFactorMatrix().setMumpsIcntl(14, workspace)
        ksp.setUp()


def mat_solve(solver: PETSc.Mat | PETSc.KSP, sides: Array) -> Array:
    """Solve for several right-hand sides, shape (owned, k). Collective."""
    size = ((sides.shape[0], None), (None, sides.shape[1]))
    rhs, solution = (PETSc.Mat().createDense(size, comm=solver.comm) for _ in "bx")
    for matrix in (rhs, solution):
        matrix.setUp()
    rhs.getDenseArray()[:] = sides
    rhs.assemble()
    solution.assemble()
    solver.matSolve(rhs, solution)
    return np.array(solution.getDenseArray())


@contextmanager
def petsc_options(prefix: str) -> Iterator[None]:
    """Raise InputError for an error of PETSc about options."""
    try:
        yield
    except PETSc.Error as error:
        words = str(error).strip().splitlines()[-1].removeprefix("[0] ")
        raise InputError(
            f"PETSc cannot set up its solver: {words}; accepted: options of PETSc with the prefix "
            f"-{prefix} that it knows, or none",
            "petsc-options",
        ) from error


def check_overflow(layout: Layout, operator: float, rhs: float) -> None:
    """Raise InputError if the norms of operator or right-hand side overflow."""
    young = layout.stiffness
    if not (operator < HUGE and rhs < HUGE and rhs < HUGE * young):
        lost = np.isnan(operator) or np.isnan(rhs)
        law = ", or a law that is given has no value at these strains and jumps" if lost else ""
        raise InputError(
            f"numbers overflow{law}: Young's modulus is {young:.3g}, the linear operator of the "
            f"size {operator:.3g}, its right-hand side {rhs:.3g}; accepted: constants, loads "
            "and prescribed values in units that bring them nearer to 1",
            "overflow",
        )


def no_solution(pc: PETSc.PC, prefix: str) -> InputError:
    """Return the error of a failed preconditioner with a prefix of options."""
    if out_of_memory(pc):
        return InputError(
            "out of memory in the factorisation; accepted: a smaller mesh, more memory or "
            f"ranks, a larger -{prefix}mat_mumps_icntl_23 where that limits it (MB a "
            f"rank), a larger -{prefix}mat_mumps_icntl_14 (percent of workspace beyond "
            'the estimate), or linear = "iterative" in [solver]',
            "memory",
        )
    if _functions_vanish(pc):
        return InputError(
            "multigrid fails: some of its aggregates of nodes are too small to tell rigid motions "
            f"apart; accepted: options of PETSc with the prefix -{prefix}pc_gamg_ that make "
            'larger ones, none of these options, or linear = "lu" in [solver]',
            "multigrid",
        )
    return SingularError(
        "the linear system is singular: the body can move freely; fix enough "
        "displacement components (or, for a piezoelectric body, a potential)",
        "unsupported",
    )


def _functions_vanish(pc: PETSc.PC) -> bool:
    """Tell whether coarse functions vanish. Collective."""
    if pc.getType() not in ("gamg", "mg"):
        return False
    for level in range(pc.getMGLevels() - 1):
        diagonal = pc.getMGSmoother(level).getOperators()[0].getDiagonal()
        diagonal.abs()
        if diagonal.min()[1] <= VANISHES * diagonal.max()[1]:
            return True
    return pc.getType() == "mg" and _functions_vanish(pc.getMGCoarseSolve().getPC())


def out_of_memory(pc: PETSc.PC) -> bool:
    """Tell whether the factorisation had too little memory; PETSc misses some cases."""
    if pc.getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY:
        return True
    return is_mumps(pc) and bool(pc.getFactorMatrix().getMumpsInfog(1) in OUT_OF_MEMORY)


#: Connected components: that of each owned unknown, and their number.
Subsystems: TypeAlias = tuple[NDArray[np.intp], int]


def refine(
    ksp: PETSc.KSP,
    rhs: PETSc.Vec,
    solution: PETSc.Vec,
    solve: Callable[[PETSc.Vec, PETSc.Vec], None],
    subsystems: Subsystems | None = None,
) -> None:
    """Correct a solution until |b - A x| <= sqrt(rtol) |b|, in each subsystem. Collective.

    The norms of the preconditioner and of the residual differ by about sqrt(rtol); beside a far
    larger right-hand side a small subsystem is not seen. `solve` is a solver for other right-hand
    sides, from a zero guess; `subsystems` are uncoupled ones, None for one alone.
    """

    def norms(vector: PETSc.Vec) -> Array:
        if subsystems is None:
            return np.array([vector.norm()])
        return np.sqrt(component_sums(vector.comm.tompi4py(), component, vector.array_r**2, count))

    component, count = subsystems or (np.zeros(0, dtype=np.intp), 1)
    matrix, asked_for = ksp.getOperators()[0], ksp.getTolerances()[0]
    allowed = asked_for**0.5 * norms(rhs)
    residual = rhs - matrix * solution
    for _ in range(CORRECTIONS):
        before = norms(residual)
        beyond = before > allowed
        if not beyond.any():
            return
        correction, asked = residual.duplicate(), residual.copy()
        if subsystems is not None:
            asked.array[~beyond[component]] = 0.0
        ksp.setInitialGuessNonzero(False)
        # No more digits than are missing.
        missing = float(allowed[beyond].min() / np.linalg.norm(before[beyond]))
        ksp.setTolerances(rtol=max(asked_for, missing**2))
        try:
            solve(asked, correction)
        finally:
            ksp.setTolerances(rtol=asked_for)
        corrected = residual - matrix * correction
        gained = norms(corrected) < before
        if not np.any(gained & beyond):
            return
        if subsystems is not None:
            lost = ~gained[component]
            correction.array[lost], corrected.array[lost] = 0.0, residual.array_r[lost]
        solution.axpy(1.0, correction)
        residual = corrected
