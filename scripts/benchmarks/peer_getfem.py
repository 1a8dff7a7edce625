"""The peer of the benchmark: GetFEM on the bar of Example 7.2, Hertz's cylinder, a block in 3-D.

Start it as `python3 -m scripts.benchmarks.peer_getfem` with `bar N MU`, linear material, N cells
per unit length, the same triangles as ours; or with `hertz DISC.msh MU`, Example 7.1 on a mesh file
of format 2.2; or with `block N MU`, that of `bench_one` with a linear material, the same
tetrahedra as ours. Prints one line of JSON: seconds of assembly and of the whole Newton solve,
steps, and values to compare with. Integral contact brick with an augmented Lagrangian, r = E; in
3-D its unsymmetric version with De Saxce's projection (option 4), as the first one does not
converge there.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass

import getfem as gf
import numpy as np
from mpi4py import MPI

from contact.mesh.grid import box

#: Regions of the boundary.
CONSTRAINED, CONTACT, LOADED = 1, 2, 3


@dataclass(frozen=True)
class Setting:
    """A mesh with its regions, and its material and loads."""

    mesh: gf.Mesh
    young: float
    #: Diagonal of the matrix that picks the components constrained on CONSTRAINED.
    constrained: tuple[float, ...]
    #: On LOADED.
    traction: tuple[float, ...]


def triangles(n: int) -> np.ndarray:
    """Return the corners of the triangles, shape (2, 3, cells): squares cut to the right."""
    x, y = np.meshgrid(np.arange(4 * n) / n, np.arange(n) / n, indexing="ij")
    low = np.stack([x.ravel(), y.ravel()])
    east, north = np.array([[1 / n], [0.0]]), np.array([[0.0], [1 / n]])
    one = np.stack([low, low + east, low + east + north], axis=1)
    two = np.stack([low, low + east + north, low + north], axis=1)
    return np.concatenate([one, two], axis=2)


def outer_faces(mesh: gf.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the faces of the boundary, their normals and their middles."""
    faces = mesh.outer_faces()
    points = [mesh.pts_from_cvid([int(cell)])[0] for cell in faces[0]]
    # Face k of a triangle lies opposite its point k.
    middles = [
        np.delete(p, face, axis=1).mean(axis=1) for p, face in zip(points, faces[1], strict=True)
    ]
    return faces, mesh.normal_of_faces(faces), np.array(middles).T


def bar(cells: str) -> Setting:
    """Return the bar of Example 7.2 with a linear material."""
    mesh = gf.Mesh("empty", 2)
    mesh.add_convex(gf.GeoTrans("GT_PK(2,1)"), triangles(int(cells)))
    faces, normals, middles = outer_faces(mesh)
    mesh.set_region(CONSTRAINED, faces[:, normals[0] < -0.5])
    mesh.set_region(CONTACT, faces[:, normals[1] < -0.5])
    mesh.set_region(LOADED, faces[:, (normals[1] > 0.5) & (middles[0] > 2.0)])
    return Setting(mesh, 1.0, (1.0, 1.0), (0.0, -0.005))


def hertz(path: str) -> Setting:
    """Return the quarter cylinder of Example 7.1, radius 8, traction 100 on the cut."""
    mesh = gf.Mesh("import", "gmsh", path)
    mesh.set("optimize structure")
    faces, _, middles = outer_faces(mesh)
    symmetry, top = middles[0] < 1e-9, middles[1] > 8 - 1e-9
    mesh.set_region(CONSTRAINED, faces[:, symmetry])
    mesh.set_region(CONTACT, faces[:, ~symmetry & ~top])
    mesh.set_region(LOADED, faces[:, top])
    return Setting(mesh, 2000.0, (1.0, 0.0), (0.0, -100.0))


def block(cells: str) -> Setting:
    """Return the block in 3-D of `bench_one`, with a linear material."""
    n = int(cells)
    ours = box(MPI.COMM_SELF, (0.0, 0.0, 0.0), (2.0, 1.0, 1.0), (2 * n, n, n)).mesh.geometry
    mesh = gf.Mesh("empty", 3)
    mesh.add_convex(
        gf.GeoTrans("GT_PK(3,1)"), np.moveaxis(ours.x[ours.dofmap], 2, 0).swapaxes(1, 2)
    )
    faces, normals, _ = outer_faces(mesh)
    mesh.set_region(CONSTRAINED, faces[:, normals[0] < -0.5])
    mesh.set_region(CONTACT, faces[:, normals[2] < -0.5])
    mesh.set_region(LOADED, faces[:, normals[2] > 0.5])
    return Setting(mesh, 1.0, (1.0, 1.0, 1.0), (0.0, 0.005, -0.02))


def model(setting: Setting, mu: float) -> tuple[gf.Model, tuple[object, ...]]:
    """Return the contact problem as a GetFEM model, and the objects that it needs."""
    mesh, young, poisson, dim = setting.mesh, setting.young, 0.3, len(setting.traction)
    u, obstacle = gf.MeshFem(mesh, dim), gf.MeshFem(mesh, 1)
    for space in (u, obstacle):
        space.set_fem(gf.Fem(f"FEM_PK({dim},1)"))
    rule = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(4)" if dim == 2 else "IM_TETRAHEDRON(5)"))
    made = gf.Model("real")
    made.add_fem_variable("u", u)
    made.add_initialized_data("lame", [young * poisson / ((1 + poisson) * (1 - 2 * poisson))])
    made.add_initialized_data("shear", [young / (2 + 2 * poisson)])
    made.add_isotropic_linearized_elasticity_brick(rule, "u", "lame", "shear")
    if all(setting.constrained):
        made.add_Dirichlet_condition_with_simplification("u", CONSTRAINED)
    else:
        made.add_initialized_data("zero", [0.0, 0.0])
        made.add_initialized_data("constrained", np.diag(setting.constrained))
        made.add_generalized_Dirichlet_condition_with_multipliers(
            rule, "u", u, CONSTRAINED, "zero", "constrained"
        )
    made.add_initialized_data("load", list(setting.traction))
    made.add_source_term_brick(rule, "u", "load", LOADED)
    made.add_filtered_fem_variable("lambda", u, CONTACT)
    made.add_initialized_data("r", [young])
    made.add_initialized_data("friction", [mu])
    made.add_initialized_fem_data("obstacle", obstacle, obstacle.eval("y" if dim == 2 else "z"))
    made.add_integral_contact_with_rigid_obstacle_brick(
        rule, "u", "lambda", "obstacle", "r", "friction", CONTACT, 1 if dim == 2 else 4
    )
    return made, (u, obstacle, rule)


def main() -> None:
    """Solve, and print the costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("problem", choices=("bar", "hertz", "block"))
    parser.add_argument("mesh", help="cells per unit length, or the mesh file")
    parser.add_argument("mu", type=float)
    given = parser.parse_args()
    setting = {"bar": bar, "hertz": hertz, "block": block}[given.problem](given.mesh)
    problem, _owners = model(setting, given.mu)
    begin = time.perf_counter()
    problem.assembly()
    assembled = time.perf_counter()
    steps, converged = problem.solve("max_res", 1e-10, "max_iter", 60, "lsolver", "mumps")
    solved = time.perf_counter()
    u = problem.variable("u").reshape(-1, len(setting.traction))
    found = {
        "assembly": assembled - begin,
        "solve": solved - assembled,
        "steps": int(steps),
        "converged": bool(converged),
        "unknowns": int(problem.nbdof()),
        "max_displacement": float(np.linalg.norm(u, axis=1).max()),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main()
