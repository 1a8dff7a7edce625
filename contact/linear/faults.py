"""Why a linear system has no solution."""

from __future__ import annotations

from petsc4py import PETSc

from contact.errors import InputError

#: MUMPS's INFOG(1) where its workspace, its memory or what ICNTL(23) allows was too small.
OUT_OF_MEMORY = (-8, -9, -11, -12, -13, -17, -19, -20)


def no_solution(pc: PETSc.PC, prefix: str) -> InputError:
    """Say why a system whose numbers do not overflow has no solution.

    Parameters
    ----------
    pc
        The preconditioner that failed.
    prefix
        Prefix of its PETSc options.
    """
    if _out_of_memory(pc):
        return InputError(
            "out of memory in the factorisation; accepted: a smaller mesh, more memory or "
            f"ranks, a larger -{prefix}mat_mumps_icntl_23 where that limits it (MB a "
            f"rank), a larger -{prefix}mat_mumps_icntl_14 (percent of workspace beyond "
            'the estimate), or linear = "iterative" in [solver]'
        )
    return InputError(
        "the linear system is singular: the body can move freely; fix enough "
        "displacement components (or, for a piezoelectric body, a potential)"
    )


def _out_of_memory(pc: PETSc.PC) -> bool:
    """Whether the factorisation had too little memory. PETSc knows of some cases only."""
    if pc.getFailedReason() == PETSc.PC.FailedReason.FACTOR_OUTMEMORY:
        return True
    direct = pc.getType() in ("lu", "cholesky") and pc.getFactorSolverType() == "mumps"
    return bool(direct and pc.getFactorMatrix().getMumpsInfog(1) in OUT_OF_MEMORY)
