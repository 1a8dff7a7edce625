"""Algebraic multigrid for elastic contact problems: GAMG with rigid-body near-nullspace."""

from __future__ import annotations

from collections.abc import Mapping

from petsc4py import PETSc

from contact._compat import keeps_inverted_blocks
from contact.linear.layout import Layout

#: Unknowns from which an iterative solver pays, by dimension and whether the body is piezoelectric
#: (seen in `make bench`).
LARGE = {(2, False): 2_500_000, (2, True): 2_500_000, (3, False): 10_000, (3, True): 60_000}

#: Unknowns up to which a direct solver is thought of in space: it then takes some gigabytes.
DIRECT = 150_000

#: A node in contact couples its components through the large gamma of the constraint: the smoother
#: has to invert the nodal blocks. SOR does so too, but takes longer.
SMOOTHER = (
    {"mg_levels_ksp_max_it": "2", "mg_levels_pc_type": "sor"}
    if keeps_inverted_blocks()
    else {"mg_levels_ksp_max_it": "3", "mg_levels_pc_type": "pbjacobi"}
)

#: Relative tolerance of a linear solve, in the norm of the preconditioner.
TOLERANCE = 1e-10

#: Options of MINRES. PETSc's own radius is a size, at which it ends as if it had converged; and the
#: norm of a right-hand side, to which it compares its residual, is in other units than that.
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
    # PETSc's own is a size, and would call a body singular in units in which it is soft and small.
    "mg_coarse_redundant_pc_factor_zeropivot": "1e-300",
}


def is_large(layout: Layout) -> bool:
    """Tell whether an iterative solver pays for a system of this size."""
    return layout.unknowns >= LARGE[layout.dim, layout.coupled]


def is_chosen(kind: str, layout: Layout) -> bool:
    """Tell whether to solve by iterations; `kind` as of `operator.SparseOperator`.

    A factorisation is worth hundreds of solves by multigrid, but costs more than a few of them.
    """
    if kind == "many":
        return is_large(layout) and layout.unknowns > DIRECT
    return kind == "iterative" or (kind == "auto" and is_large(layout))


def configure(ksp: PETSc.KSP, symmetric: bool) -> None:
    """Set up CG (GMRES where friction makes the operator non-symmetric) with GAMG.

    Options given by the user under the solver's prefix come first.
    """
    iterate(ksp, "cg" if symmetric else "gmres")
    ksp.getPC().setType("gamg")
    set_defaults(ksp.getOptionsPrefix() or "", DEFAULTS)


def iterate(ksp: PETSc.KSP, method: str) -> None:
    """Let a Krylov method solve, with the tolerance and the limit of all of them."""
    ksp.setType(method)
    if method == "gmres":
        ksp.setGMRESRestart(80)
    if method == "minres":
        set_defaults(ksp.getOptionsPrefix() or "", MINRES)
    ksp.setTolerances(rtol=TOLERANCE, max_it=500)


def set_defaults(prefix: str, values: Mapping[str, str]) -> None:
    """Set options of PETSc under a prefix where the user gives none."""
    options = PETSc.Options(prefix)
    for name, value in values.items():
        if not options.hasName(name):
            options[name] = value
