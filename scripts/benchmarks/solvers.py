"""The linear solver beside others of PETSc and hypre, on the same matrix: iterations and time.

``python3 -m scripts.benchmarks.solvers [--out DIR] [--coarse]``: the block of the benchmarks in 3-D
with 48 x 24 x 24 cells, linear elasticity, as the benchmarks divide by it. Each iterative one is CG
to a residual of 1e-8 over the right-hand side in the same norm, and has the rigid-body modes.
Seconds are those of the processor, of the set-up and of the solve.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from petsc4py import PETSc

from contact import build_problem
from contact.linear.layout import balance
from contact.linear.multigrid import DEFAULTS, masked_motions, rigid_motions
from contact.problem.problem import ContactProblem
from scripts.benchmarks.bench_one import LINEAR, block
from scripts.reporting import Report, append, empty

GAMG = {"pc_type": "gamg", "pc_gamg_agg_nsmooths": "1"}
BOOMER = "pc_hypre_boomeramg_"
HYPRE = {"pc_type": "hypre", "pc_hypre_type": "boomeramg", f"{BOOMER}coarsen_type": "HMIS",
         f"{BOOMER}interp_type": "ext+i"}  # fmt: skip
NODAL = HYPRE | {f"{BOOMER}nodal_coarsen": "4", f"{BOOMER}vec_interp_variant": "2"}
SHORT = HYPRE | {f"{BOOMER}P_max": "4"}

#: Options by the name of the row.
SOLVERS: Mapping[str, Mapping[str, str]] = {
    "this code": {"pc_type": "gamg", **DEFAULTS},
    "GAMG, PETSc's defaults": {"pc_type": "gamg"},
    "GAMG, threshold 0.02, SOR": GAMG | {
        "pc_gamg_threshold": "0.02", "mg_levels_pc_type": "sor",
        "mg_levels_ksp_type": "chebyshev",
    },
    "GAMG, no aggressive coarsening": GAMG | {
        "pc_gamg_threshold": "0.01", "pc_gamg_aggressive_coarsening": "0",
    },
    "GAMG, Richardson with SOR": GAMG | {
        "pc_gamg_threshold": "0.01", "mg_levels_pc_type": "sor",
        "mg_levels_ksp_type": "richardson",
    },
    "BoomerAMG, threshold 0.5": SHORT | {f"{BOOMER}strong_threshold": "0.5"},
    "BoomerAMG, threshold 0.7": SHORT | {f"{BOOMER}strong_threshold": "0.7"},
    "BoomerAMG, nodal, rigid modes": NODAL | {f"{BOOMER}strong_threshold": "0.25"},
    "BoomerAMG, nodal, rigid modes, threshold 0.5": NODAL | {f"{BOOMER}strong_threshold": "0.5"},
    "MUMPS, LDL^T": {
        "ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps",
    },
}  # fmt: skip


def measured(problem: ContactProblem, options: Mapping[str, str]) -> dict[str, Any]:
    """Solve with some options, and return the costs. Collective."""
    body, layout = problem.body, problem.body.layout
    matrix = body.create_matrix()
    body.assemble(matrix, "secant", problem.start())
    balance(matrix, layout)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    ours = options is SOLVERS["this code"]
    matrix.setNearNullSpace(masked_motions(layout) if ours else rigid_motions(layout))
    prefix, database = "beside_", PETSc.Options("beside_")
    given = {
        "ksp_type": "cg",
        "ksp_norm_type": "unpreconditioned",
        "ksp_rtol": "1e-8",
        "ksp_max_it": "300",
        **options,
    }
    if given["ksp_type"] == "preonly":
        del given["ksp_norm_type"]
    for name, value in given.items():
        database[name] = value
    rhs, solution = matrix.createVecs()
    rhs.array[:] = layout.mask(body.external()[: rhs.array.size])
    ksp = PETSc.KSP().create(layout.comm)
    ksp.setOptionsPrefix(prefix)
    ksp.setOperators(matrix)
    ksp.setFromOptions()
    begin = time.process_time()
    ksp.setUp()
    ready = time.process_time()
    ksp.solve(rhs, solution)
    done = time.process_time()
    residual = (rhs - matrix * solution).norm() / rhs.norm()
    for name in given:
        database.delValue(name)
    found = {
        "iterations": ksp.getIterationNumber(),
        "residual": residual,
        "set-up": ready - begin,
        "solve": done - ready,
    }
    ksp.destroy()
    matrix.destroy()
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve with each of them, and write the table."""
    report = Report.of(__doc__, "solvers", arguments)
    problem = build_problem(block(6 if report.coarse else 24, LINEAR))
    unknowns = problem.body.layout.unknowns
    columns = empty(
        "solver", "iterations", "residual", "set-up", "solve", "in all", "over this code",
    )  # fmt: skip
    first = np.nan
    for name, options in SOLVERS.items():
        found = measured(problem, options)
        total = found["set-up"] + found["solve"]
        first = total if name == "this code" else first
        append(columns, name, *found.values(), total, total / first)
        print(name, found, flush=True)
    report.table(
        "solvers",
        f"Linear elasticity in 3-D, {unknowns:,} unknowns: the solver beside others",
        columns,
        "CG to 1e-8 in the norm of the residual; seconds of the processor.",
    )


if __name__ == "__main__":
    main()
