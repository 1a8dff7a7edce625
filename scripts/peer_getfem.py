"""The peer of the benchmark: GetFEM on the bar of Example 7.2 with a linear material.

`python3 scripts/peer_getfem.py N MU [--rounds K]` prints one line of JSON: seconds of assembly
and of the whole Newton solve (the fastest of K rounds in one warm process), steps, and values
to compare with. Integral contact brick with an augmented Lagrangian, r = E, MUMPS; the mesh has
the same triangles as ours, N cells per unit length.
"""

from __future__ import annotations

import argparse
import json
import time

import getfem as gf
import numpy as np

YOUNG, POISSON, LOAD = 1.0, 0.3, -0.005


def triangles(n: int) -> np.ndarray:
    """Return the corners of the triangles, shape (2, 3, cells): squares cut to the right."""
    x, y = np.meshgrid(np.arange(4 * n) / n, np.arange(n) / n, indexing="ij")
    low = np.stack([x.ravel(), y.ravel()])
    east, north = np.array([[1 / n], [0.0]]), np.array([[0.0], [1 / n]])
    one = np.stack([low, low + east, low + east + north], axis=1)
    two = np.stack([low, low + east + north, low + north], axis=1)
    return np.concatenate([one, two], axis=2)


def model(n: int, mu: float) -> tuple[gf.Model, tuple[object, ...]]:
    """Return the contact problem as a GetFEM model, and what has to live as long as it."""
    mesh = gf.Mesh("empty", 2)
    mesh.add_convex(gf.GeoTrans("GT_PK(2,1)"), triangles(n))
    faces = mesh.outer_faces()
    normals = mesh.normal_of_faces(faces)
    # the middle of a face tells on which part it lies
    corners = np.array([mesh.pts_from_cvid([int(c)])[0].mean(axis=1) for c in faces[0]])
    left = normals[0] < -0.5
    bottom = normals[1] < -0.5
    loaded = (normals[1] > 0.5) & (corners[:, 0] > 2.0)
    for number, chosen in enumerate([left, bottom, loaded], start=1):
        mesh.set_region(number, faces[:, chosen])
    u = gf.MeshFem(mesh, 2)
    u.set_fem(gf.Fem("FEM_PK(2,1)"))
    obstacle = gf.MeshFem(mesh, 1)
    obstacle.set_fem(gf.Fem("FEM_PK(2,1)"))
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)"))
    made = gf.Model("real")
    made.add_fem_variable("u", u)
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    made.add_initialized_data("lame", [lame])
    made.add_initialized_data("shear", [YOUNG / (2 + 2 * POISSON)])
    made.add_isotropic_linearized_elasticity_brick(rule, "u", "lame", "shear")
    made.add_Dirichlet_condition_with_simplification("u", 1)
    made.add_initialized_data("load", [0.0, LOAD])
    made.add_source_term_brick(rule, "u", "load", 3)
    made.add_filtered_fem_variable("lambda", u, 2)
    made.add_initialized_data("r", [YOUNG])
    made.add_initialized_data("friction", [mu])
    made.add_initialized_fem_data("obstacle", obstacle, obstacle.eval("y"))
    made.add_integral_contact_with_rigid_obstacle_brick(
        rule, "u", "lambda", "obstacle", "r", "friction", 2, 1
    )
    return made, (mesh, u, obstacle, rule)


def main() -> None:
    """Solve, and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int)
    parser.add_argument("mu", type=float)
    parser.add_argument("--rounds", type=int, default=2)
    given = parser.parse_args()
    best: dict[str, float] = {}
    for _ in range(given.rounds):
        problem, _owners = model(given.n, given.mu)
        begin = time.perf_counter()
        problem.assembly()
        assembled = time.perf_counter()
        steps, converged = problem.solve("max_res", 1e-10, "max_iter", 60, "lsolver", "mumps")
        seconds = time.perf_counter() - assembled
        if not best or seconds < best["solve"]:
            u = problem.variable("u").reshape(-1, 2)
            best = {
                "assembly": assembled - begin,
                "solve": seconds,
                "steps": int(steps),
                "converged": bool(converged),
                "unknowns": int(problem.nbdof()),
                "max_displacement": float(np.linalg.norm(u, axis=1).max()),
            }
    print(json.dumps(best))


if __name__ == "__main__":
    main()
