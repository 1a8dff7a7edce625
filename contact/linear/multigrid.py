"""Algebraic multigrid for elastic contact problems: GAMG with rigid-body near-nullspace."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from contact._compat import keeps_inverted_blocks
from contact.problem.held import rigid_motions
from contact.problem.problem import ContactProblem

#: Unknowns from which an iterative solver pays, by dimension and whether the body is piezoelectric
#: (seen in `make bench`).
LARGE = {(2, False): 2_500_000, (2, True): 2_500_000, (3, False): 10_000, (3, True): 60_000}

#: A node in contact couples its components through the large gamma of the constraint: the smoother
#: has to invert the nodal blocks. SOR does so too, but takes longer.
SMOOTHER = (
    {"mg_levels_ksp_max_it": "2", "mg_levels_pc_type": "sor"}
    if keeps_inverted_blocks()
    else {"mg_levels_ksp_max_it": "3", "mg_levels_pc_type": "pbjacobi"}
)

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
}


def is_large(problem: ContactProblem) -> bool:
    """Tell whether an iterative solver pays for a problem of this size."""
    unknowns = problem.space.dofmap.index_map.size_global * problem.block_size
    return unknowns >= LARGE[problem.dim, problem.piezoelectric]


def near_nullspace(problem: ContactProblem) -> PETSc.NullSpace:
    """Return the rigid-body motions on the free unknowns, orthonormalised. Collective."""
    d, bs = problem.dim, problem.block_size
    index_map = problem.space.dofmap.index_map
    points = problem.space.tabulate_dof_coordinates()[: index_map.size_local, :d]
    # About one centre on all ranks: about different ones these would be no rigid motions.
    total = problem.comm.allreduce(points.sum(axis=0), op=MPI.SUM)
    motions = rigid_motions((points - total / index_map.size_global) / problem.domain.size)
    vectors: list[PETSc.Vec] = []
    for k in range(motions.shape[2]):
        values = np.zeros((index_map.size_local, bs))
        values[:, :d] = motions[:, :, k]
        vector = PETSc.Vec().createMPI(
            (index_map.size_local * bs, index_map.size_global * bs), bs, problem.comm
        )
        vector.array[:] = np.where(problem.free, values, 0.0).ravel()
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=problem.comm)


def configure(ksp: PETSc.KSP, problem: ContactProblem, symmetric: bool) -> None:
    """Set up CG (GMRES where friction makes the operator non-symmetric) with GAMG.

    Options given by the user under the solver's prefix come first.
    """
    ksp.setType("cg" if symmetric else "gmres")
    if not symmetric:
        ksp.setGMRESRestart(80)
    ksp.setTolerances(rtol=1e-10, max_it=500)
    ksp.getPC().setType("gamg")
    options = PETSc.Options(ksp.getOptionsPrefix())
    for name, value in DEFAULTS.items():
        if not options.hasName(name):
            options[name] = value
