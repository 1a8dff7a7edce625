"""Memory of ranks in one linear solve by dolfinx and PETSc alone, on the meshes of `ranks`.

``mpirun -n P python3 -m scripts.benchmarks.library DIM N``: linear elasticity, in the plane by
MUMPS, in 3-D by GAMG with the options of this code. Nothing else of this code is on the way: the
memory that its own solves hold beyond that is its own.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.multigrid import DEFAULTS
from scripts.benchmarks.bench_one import memory

COMM = MPI.COMM_WORLD

#: Options of PETSc, by dimension.
OPTIONS = {
    2: {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
    3: {"ksp_type": "cg", "pc_type": "gamg", "ksp_rtol": "1e-8", **DEFAULTS},
}


def made(dimension: int, n: int) -> mesh.Mesh:
    """Return the mesh of Example 7.2, or of the block."""
    if dimension == 2:
        return mesh.create_rectangle(COMM, [[0.0, 0.0], [4.0, 1.0]], [4 * n, n])
    return mesh.create_box(COMM, [[0.0, 0.0, 0.0], [2.0, 1.0, 1.0]], [2 * n, n, n])


def solve(dimension: int, n: int) -> int:
    """Solve, and return the number of unknowns. Collective."""
    domain = made(dimension, n)
    space = fem.functionspace(domain, ("Lagrange", 1, (dimension,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(u))
    stress = 0.8 * strain + 0.6 * ufl.tr(strain) * ufl.Identity(dimension)
    left = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[0], 0.0))
    fixed = fem.dirichletbc(np.zeros(dimension), left, space)
    form = fem.form(ufl.inner(stress, ufl.grad(v)) * ufl.dx)
    matrix = petsc.assemble_matrix(form, [fixed])
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    rhs, solution = matrix.createVecs()
    rhs.set(1.0)
    points = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local, :dimension]
    places = PETSc.Vec().createWithArray(points.ravel().copy(), bsize=dimension, comm=COMM)
    matrix.setNearNullSpace(PETSc.NullSpace().createRigidBody(places))
    options = PETSc.Options()
    for name, value in OPTIONS[dimension].items():
        options[name] = value
    ksp = PETSc.KSP().create(COMM)
    ksp.setOperators(matrix)
    ksp.setFromOptions()
    ksp.solve(rhs, solution)
    assert ksp.getConvergedReason() > 0
    return int(matrix.getSize()[0])


def costs(dimension: int, n: int) -> dict[str, Any]:
    """Measure a solve, after one on a small mesh."""
    solve(dimension, 4)
    libraries = memory()
    size = solve(dimension, n)
    return {
        "ranks": COMM.size,
        "unknowns": size,
        "bytes an unknown": (memory() - libraries) / size,
        "libraries (MB)": libraries / 1e6,
    }


if __name__ == "__main__":
    found = costs(int(sys.argv[1]), int(sys.argv[2]))
    if COMM.rank == 0:
        print(json.dumps(found))
