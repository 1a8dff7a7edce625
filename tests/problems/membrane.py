"""Cook's membrane: a tapered panel, clamped at one end and sheared at the other."""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_vector
from mpi4py import MPI
from petsc4py import PETSc

from contact.body.description import Body
from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.model.body import Fixed
from forms.hencky import Linear


def cook(cells, degree, element="standard", cell="triangle", poisson=0.4999):
    """Return the rise of the upper corner of Cook's membrane, E = 1, traction 1/16 up."""
    plane = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (1.0, 1.0), (cells, cells), cell=cell)
    x = plane.mesh.geometry.x
    x[:, 1] = 44 * x[:, 0] + x[:, 1] * (44 - 28 * x[:, 0])
    x[:, 0] *= 48
    domain = from_mesh(plane.mesh, plane.parts)
    described = Body(Linear(1.0, poisson), Fixed("left", [0, 0]))
    body = BodyEquilibrium(domain, described, degree, element)
    matrix = body.create_matrix()
    body.assemble(matrix, "secant", BodyState(body.zero_displacement()))
    test = ufl.TestFunction(body.space)
    right = assemble_vector(fem.form(test[1] / 16 * domain.ds("right")))
    fem.petsc.set_bc(right, [s.condition for s in body.supports])
    solver = PETSc.KSP().create(MPI.COMM_WORLD)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("lu")
    found = right.duplicate()
    solver.solve(right, found)
    corner = np.argmax(body.space.tabulate_dof_coordinates()[:, :2].sum(axis=1))
    return found.array[2 * corner + 1]
