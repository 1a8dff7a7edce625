"""Crystals in contact: isotropic constants, and material, mesh and foundation turned together."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, NewtonOptions, Plane, solve
from contact.library.materials import find
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from forms.crystal import PLANE, about_z
from forms.elasticity import Anisotropic, isotropic
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import affine_vector, constant, turn


def pressed(dim, law, piezo=None, degrees=0.0, axis=(0.0, 1.0, 0.0), degree=1):
    """Return a block that is pressed and pushed aside on a rough plate, all of it turned."""
    q = turn(dim, degrees, axis)
    normal = tuple(q @ np.eye(dim)[-1])
    sizes = ([0.0] * dim, [1.0] * dim, [6 - dim] * dim)
    if dim == 2:
        domain = rectangle(MPI.COMM_SELF, *sizes, rotation=degrees)
    else:
        domain = box(MPI.COMM_SELF, *sizes, rotation=degrees, axis=axis)
    push = q @ np.array([0.004, *[0.002] * (dim - 2), -0.01])
    top = affine_vector(np.zeros((dim, dim)), push)
    grounded = constant(0.0, dim) if piezo is not None else None
    body = Body(law, [Fixed("top", top, grounded)], (), piezo)
    plate = Plane((0.0,) * dim, normal)
    friction = Friction(ConstantCoefficient(0.25))
    problem = ContactProblem(domain, body, Contact("bottom", plate), friction, degree=degree)
    solution = solve(problem, NewtonOptions(tolerance=1e-12))
    assert solution.converged
    nodes = problem.nodes
    back = nodes.points @ q
    order = np.lexsort(np.round(back, 9).T)
    return solution.pressure[order], (solution.friction @ q)[order], set(solution.status)


@pytest.mark.parametrize("dim", [2, 3])
def test_isotropic_constants_give_the_isotropic_solution(dim):
    one = pressed(dim, Linear(7.0, 0.3))
    two = pressed(dim, Anisotropic(isotropic(7.0, 0.3)))
    for a, b in zip(one[:2], two[:2], strict=True):
        assert np.abs(a - b).max() < 1e-12 * np.abs(one[0]).max()
    assert {"stick", "slip"} <= one[2]


def crystal(name, dim, q):
    entry = find(name)
    law = Anisotropic(entry.stiffness / 1e9).rotated(q)
    piezo = entry.piezo
    if piezo is None:
        return law, None
    scaled = type(piezo)(piezo.e, np.asarray(piezo.beta) * 1e9)
    return law, scaled.rotated(q)


@pytest.mark.parametrize("name", ["PZT-5H", "sapphire", "LiNbO3"])
def test_turned_with_its_crystal_in_space(name):
    axis = (1.0, -2.0, 0.5)
    q = turn(3, 40.0, axis)
    straight = pressed(3, *crystal(name, 3, np.eye(3)))
    turned = pressed(3, *crystal(name, 3, q), degrees=40.0, axis=axis)
    scale = np.abs(straight[0]).max()
    for a, b in zip(straight[:2], turned[:2], strict=True):
        assert np.abs(a - b).max() < 1e-8 * scale
    # The crystal alone, turned about the normal of the plate, is another one.
    other = pressed(3, *crystal(name, 3, turn(3, 40.0, axis)))
    assert np.abs(other[0] - straight[0]).max() > 1e-3 * scale


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_turned_with_its_crystal_in_the_plane(degree):
    straight = pressed(2, *crystal("PZT-4", 2, PLANE), degree=degree)
    turned = pressed(2, *crystal("PZT-4", 2, about_z(30.0) @ PLANE), degrees=30.0, degree=degree)
    scale = np.abs(straight[0]).max()
    for a, b in zip(straight[:2], turned[:2], strict=True):
        assert np.abs(a - b).max() < 1e-9 * scale
