"""Cook's membrane: a tapered panel, clamped at one end and sheared at the other."""

from dataclasses import replace

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import assemble_vector
from mpi4py import MPI
from petsc4py import PETSc

from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState
from contact.mesh.grid import rectangle
from contact.model.body import Body, Fixed
from forms.hencky import Linear


def membrane(cells, cell="triangle"):
    """Return the trapezoid of corners (0, 0), (48, 44), (48, 60) and (0, 44). Collective."""
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (1.0, 1.0), (cells, cells), cell=cell)
    x = domain.mesh.geometry.x
    x[:, 1] = 44 * x[:, 0] + x[:, 1] * (44 - 28 * x[:, 0])
    x[:, 0] *= 48
    return replace(domain, size=60.0)


def cook(cells, degree, element="standard", cell="triangle", poisson=0.4999):
    """Return the rise of the upper corner of Cook's membrane, E = 1, traction 1/16 up."""
    domain = membrane(cells, cell)
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
