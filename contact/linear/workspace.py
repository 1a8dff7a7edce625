"""Factorisations of MUMPS with as much workspace as they take."""

from __future__ import annotations

from petsc4py import PETSc

#: MUMPS's INFOG(1) where its workspace was too small: that of integers, and that of numbers.
TOO_SMALL = (-8, -9)

#: MUMPS's ICNTL(14): by how many percent its workspace exceeds the estimate, at first and at most.
WORKSPACE, MOST_WORKSPACE = 10, 50_000


def is_mumps(pc: PETSc.PC) -> bool:
    """Tell whether a preconditioner is a factorisation of MUMPS."""
    return pc.getType() in ("lu", "cholesky") and pc.getFactorSolverType() == "mumps"


def set_up_with_workspace(ksp: PETSc.KSP) -> None:
    """Set up a direct solver again and again until its workspace does. Collective.

    What ranks exchange, and when, decides how much it takes: MUMPS's estimate may be too low for
    one run on some ranks and not for the next.
    """
    ksp.setUp()
    pc, workspace = ksp.getPC(), WORKSPACE
    while is_mumps(pc) and pc.getFactorMatrix().getMumpsInfog(1) in TOO_SMALL:
        workspace = 4 * max(workspace, pc.getFactorMatrix().getMumpsIcntl(14))
        if workspace > MOST_WORKSPACE:
            return
        # PETSc does not factorise again with one that has failed for want of memory.
        operators = ksp.getOperators()
        pc.reset()
        ksp.setOperators(*operators)
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(14, workspace)
        ksp.setUp()
