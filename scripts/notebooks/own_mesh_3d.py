# ---
# jupyter:
#   jupytext:
#     formats: py:percent
# ---

# %% [markdown]
# # A part of one's own in 3-D
#
# A bracket with a fillet and a bolt hole, made by Gmsh's OpenCASCADE kernel, is screwed down on a
# rigid table. The washer presses on it, and a load pulls at its upright. This notebook finds the
# parts of the foot that lift off.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import gmsh
import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Linear, Load, Plane, Problem, from_msh, solve

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
foot, upright = occ.addBox(0, 0, 0, 40, 20, 6), occ.addBox(0, 0, 6, 6, 20, 24)
occ.fuse([(3, foot)], [(3, upright)])
occ.synchronize()
edges = [tag for _, tag in gmsh.model.getEntities(1)]
inner = [tag for tag in edges if np.allclose(occ.getCenterOfMass(1, tag), (6, 10, 6))]
(body,) = [t for _, t in gmsh.model.getEntities(3)]
occ.fillet([body], inner, [4.0])
hole = occ.addCylinder(27, 10, -1, 0, 0, 8, 3.5)
((_, part),), _ = occ.cut(gmsh.model.occ.getEntities(3)[:1], [(3, hole)])
washer = occ.addDisk(27, 10, 6, 7, 7)
occ.fragment([(3, part)], [(2, washer)])
occ.synchronize()

# %% [markdown]
# Faces get their names by their positions. The disk cuts the washer's seat out of the foot's top.

# %%
faces = {"bottom": [], "washer": [], "tip": []}
for dim, tag in gmsh.model.getEntities(2):
    if len(gmsh.model.getAdjacencies(2, tag)[0]) != 1:
        continue  # no face of the body
    x, y, z = occ.getCenterOfMass(dim, tag)
    low, high = np.array(gmsh.model.getBoundingBox(dim, tag)).reshape(2, 3)
    if high[2] < 1e-3:
        faces["bottom"].append(tag)
    elif abs(z - 6) < 1e-3 and np.ptp([low[0], high[0]]) < 14.1 and x > 20:
        faces["washer"].append(tag)
    elif low[2] > 30 - 1e-3:
        faces["tip"].append(tag)
for name, tags in faces.items():
    gmsh.model.addPhysicalGroup(2, tags, name=name)
gmsh.model.addPhysicalGroup(3, [t for _, t in gmsh.model.getEntities(3)], name="bracket")
gmsh.option.setNumber("Mesh.MeshSizeMax", 3.0)
gmsh.model.mesh.generate(3)
with TemporaryDirectory() as folder:
    file = Path(folder, "bracket.msh")
    gmsh.write(str(file))
    gmsh.finalize()
    domain = from_msh(MPI.COMM_WORLD, file)
print({name: len(domain.facets(name)) for name in domain.parts}, "facets")

# %% [markdown]
# The screw's force, 5 kN, is distributed over the washer, which is also fixed sideways. The tip is
# pulled by 5 MPa, away from the foot.

# %%
steel = Linear(210e3, 0.3)
area = np.pi * (7**2 - 3.5**2)
supports = [Fixed("washer", [0.0, 0.0, "free"])]
loads = [Load("washer", traction=[0, 0, -5000 / area]), Load("tip", traction=[-5.0, 0, 0])]
table = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
problem = Problem(domain, Body(steel, supports, loads), Contact("bottom", table), Friction(mu=0.2))
solution = solve(problem)
print(solution.outcome.reason)
contact = solution.contact
print(
    f"pressure up to {contact.pressure.max():.0f} MPa, von Mises {solution.max_von_mises:.0f} MPa"
)
print(f"{solution.contact_area:.0f} of {contact.weight.sum():.0f} mm2 touch")

# %%
solution.plot()

# %% [markdown]
# Heel and washer press; in between the foot lifts off. The table bears the screw's force, up to the
# error of polygons in place of circles:

# %%
table_force = solution.contact_force
print("force on the table", table_force)
assert solution.converged
assert abs(table_force[2] + 5000) < 0.05 * 5000
