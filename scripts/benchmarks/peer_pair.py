"""GetFEM and this code side by side: a block that is pressed and pushed on another one.

python3 -m scripts.benchmarks.peer_pair [--out DIR] [--coarse]

The meshes of the generator `two_blocks` for both, P1. GetFEM integrates its augmented Lagrangian at
Gauss points of the upper block's facets, with continuous multipliers: displacements agree to the
order of the mesh, not to rounding.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import getfem as gf
import numpy as np
from scipy.spatial import cKDTree

import meshes
from contact import Case, build_problem, parse_case, solve
from scripts.reporting import Report

SIZES = {"lower_size": 0.08, "upper_size": 0.06}
YOUNG, POISSON = {"upper": 1.0, "lower": 3.0}, 0.3
TOP = [0.001, -0.012]

#: Numbers of the physical groups of the generator: bodies, then their parts.
BODIES = {"lower": 1, "upper": 2}
LOWER_BOTTOM, LOWER_TOP, UPPER_BOTTOM, UPPER_TOP = 3, 5, 7, 9


def given(mu: float, sizes: Mapping[str, float]) -> Case:
    """Return the problem for this code."""
    materials = [{"on": name, "young": e, "poisson": POISSON} for name, e in YOUNG.items()]
    return parse_case(
        {
            "mesh": {"generator": "two_blocks", **sizes},
            "material": materials,
            "fixed": [
                {"on": "lower_bottom", "displacement": [0.0, 0.0]},
                {"on": "upper_top", "displacement": TOP},
            ],
            "contact": {"on": "upper_bottom", "against": "lower_top"},
            "friction": {"law": "coulomb", "mu": mu},
            "solver": {"tolerance": 1e-10},
        }
    )


def model(path: Path, mu: float) -> tuple[gf.Model, dict[str, Any]]:
    """Return the problem as a GetFEM model, and the spaces and rules that it needs."""
    made, owned = gf.Model("real"), {}
    for (name, young), other in zip(YOUNG.items(), ("lower", "upper"), strict=True):
        mesh = gf.Mesh("import", "gmsh", str(path))
        mesh.del_convex(mesh.region(BODIES[other])[0].astype(int))
        mesh.set("optimize structure")
        space = gf.MeshFem(mesh, 2)
        space.set_fem(gf.Fem("FEM_PK(2,1)"))
        rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)"))
        made.add_fem_variable(name, space)
        lame = young * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
        made.add_initialized_data(f"lame_{name}", [lame])
        made.add_initialized_data(f"shear_{name}", [young / (2 + 2 * POISSON)])
        constants = f"lame_{name}", f"shear_{name}"
        made.add_isotropic_linearized_elasticity_brick(rule, name, *constants)
        owned[name] = mesh, space, rule
    _, space, rule = owned["upper"]
    made.add_Dirichlet_condition_with_simplification("lower", LOWER_BOTTOM)
    made.add_initialized_data("top", TOP)
    made.add_Dirichlet_condition_with_multipliers(rule, "upper", space, UPPER_TOP, "top")
    made.add_initialized_data("r", [1.0])
    made.add_initialized_data("mu", [mu])
    made.add_filtered_fem_variable("lambda", space, UPPER_BOTTOM)
    made.add_integral_contact_between_nonmatching_meshes_brick(
        rule, "upper", "lower", "lambda", "r", "mu", UPPER_BOTTOM, LOWER_TOP, 1
    )
    return made, owned


def compare(mu: float, finer: int) -> dict[str, Any]:
    """Solve with both on one mesh; return their costs, and how far apart they are."""
    sizes = {name: size / finer for name, size in SIZES.items()}
    case = given(mu, sizes)
    own_problem = build_problem(case)
    begin = time.process_time()
    solution = solve(own_problem, case.solver)
    own_seconds = time.process_time() - begin
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "blocks.msh"
        meshes.write("two_blocks", path, version=2.2, **sizes)
        problem, owned = model(path, mu)
        begin = time.process_time()
        steps, good = problem.solve("max_res", 1e-10, "max_iter", 100, "lsolver", "mumps")
        seconds = time.process_time() - begin
    assert solution.converged and good
    space = solution.displacement.function_space
    points, values = space.tabulate_dof_coordinates()[:, :2], solution.displacement.x.array
    apart = 0.0
    for name, sign in (("upper", 1.0), ("lower", -1.0)):
        # Nodes of both bodies lie on y = 0.
        own = sign * points[:, 1] > 1e-9
        theirs = owned[name][1].basic_dof_nodes()[:, ::2].T
        inside = sign * theirs[:, 1] > 1e-9
        _, nearest = cKDTree(points[own]).query(theirs[inside])
        found = problem.variable(name).reshape(-1, 2)[inside]
        difference = np.abs(values.reshape(-1, 2)[own][nearest] - found).max()
        apart = max(apart, float(difference / np.abs(values).max()))
    return {
        "mu": mu,
        "unknowns": own_problem.body.layout.free.size,
        "apart": apart,
        "GetFEM: steps": int(steps),
        "seconds": seconds,
        "ours: steps": len(solution.history),
        "seconds ": own_seconds,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the table."""
    report = Report.of(__doc__, "peer_pair", arguments)
    finer = (1, 2) if report.coarse else (1, 2, 4)
    rows = [compare(mu, n) for mu in (0.0, 0.3) for n in finer]
    report.table(
        "peer-pair",
        "A block pressed on another one and pushed along: GetFEM and this code on the same meshes",
        rows,
        "Seconds of the processor for the solve, one thread. *apart*: the largest difference of "
        "the displacements over the largest displacement.",
    )


if __name__ == "__main__":
    main()
