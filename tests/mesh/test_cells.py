"""Shapes of cells: facets, rules, sizes and VTK's order, against what is known without them."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from vtkmodules import vtkCommonDataModel

from contact.errors import InputError
from contact.mesh.cells import SHAPES, Shape, rule, shape_of
from contact.mesh.domain import compiled, revolved
from contact.mesh.geometry import (
    area,
    geometry_nodes,
    integration_weights,
    inverse,
    jacobians,
    volume,
    volume_factors,
    volumes,
)
from contact.mesh.grid import box, rectangle
from scripts.studies.lame_rings import rings
from tests.problems.quadrilaterals import unit_block

COMM = MPI.COMM_WORLD
NAMES = [shape.name for shape in SHAPES]


@pytest.mark.core
@pytest.mark.parametrize("shape", SHAPES, ids=NAMES)
@pytest.mark.parametrize("degree", [1, 2])
def test_facets_have_the_nodes_of_dolfinx(shape, degree):
    mesh = unit_block(MPI.COMM_SELF, shape.name, 1).mesh
    layout = fem.functionspace(mesh, ("Lagrange", degree)).dofmap.dof_layout
    assert shape_of(mesh) == shape
    for facet, nodes in enumerate(shape.facet_nodes(degree)):
        assert sorted(nodes) == sorted(layout.entity_closure_dofs(shape.dim - 1, facet))
        # On a facet its own functions are those of the cell.
        at, _ = rule(shape.facet, 4)
        whole = shape.lagrange(degree, shape.on_facet(facet, at))
        np.testing.assert_allclose(whole[:, nodes], shape.facet.lagrange(degree, at), atol=1e-14)
        np.testing.assert_allclose(np.delete(whole, nodes, axis=1), 0, atol=1e-14)


@pytest.mark.core
@pytest.mark.parametrize(
    ("name", "degree", "known"),
    [
        ("interval", 1, "vtkLine"),
        ("interval", 2, "vtkQuadraticEdge"),
        ("triangle", 1, "vtkTriangle"),
        ("triangle", 2, "vtkQuadraticTriangle"),
        ("quadrilateral", 1, "vtkQuad"),
        ("quadrilateral", 2, "vtkBiQuadraticQuad"),
        ("tetrahedron", 1, "vtkTetra"),
        ("tetrahedron", 2, "vtkQuadraticTetra"),
        ("hexahedron", 1, "vtkHexahedron"),
        ("hexahedron", 2, "vtkTriQuadraticHexahedron"),
    ],
)
def test_numbers_and_order_are_those_of_vtk(name, degree, known):
    shape = Shape(name)
    number, order = shape.vtk(degree)
    cell = getattr(vtkCommonDataModel, known)()
    assert number == cell.GetCellType()
    places = np.array(cell.GetParametricCoords()).reshape(-1, 3)
    np.testing.assert_allclose(shape.nodes(degree)[list(order)], places[:, : shape.dim], atol=1e-9)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("name", NAMES)
def test_volumes_are_those_of_dolfinx(name):
    domain = unit_block(COMM, name)
    one = ufl.as_ufl(1.0)
    found = [volume(domain), *(area(domain, name) for name in ("left", "top"))]
    forms = map(compiled, (one * domain.dx, one * domain.ds("left"), one * domain.ds("top")))
    assert found == pytest.approx([1.0] * 3, rel=1e-13)
    known = [COMM.allreduce(fem.assemble_scalar(form)) for form in forms]
    assert known == pytest.approx([1.0] * 3, rel=1e-13)
    if domain.dim == 2:
        ring = revolved(domain)
        assert COMM.allreduce(volumes(ring).sum()) == pytest.approx(np.pi, rel=1e-13)
        found = integration_weights(
            True, shape_of(ring.mesh), geometry_nodes(ring), *rule(shape_of(ring.mesh), 4)
        )
        assert COMM.allreduce(found.sum()) == pytest.approx(np.pi, rel=1e-13)


@pytest.mark.core
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", SHAPES, ids=NAMES)
def test_sizes_of_facets_and_their_normals_close_the_cell(shape, order):
    """The integral of n over the boundary is 0, and that of x.n is dim times the volume."""
    if order == 1:
        domain = unit_block(MPI.COMM_SELF, shape.name, 2)
    else:
        domain = rings(MPI.COMM_SELF, shape.name, 2, (1.0, 2.0), (2,))
    of = geometry_nodes(domain)
    total, through = np.zeros((len(of), shape.dim)), np.zeros(len(of))
    points, weights = rule(shape.facet, 8)
    for facet, nodes in enumerate(shape.facet_nodes(order)):
        on_cell = shape.on_facet(facet, points)
        normal = shape.facet_normals[facet] @ inverse(jacobians(shape, of, on_cell))
        normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
        area = (volume_factors(shape.facet, of[:, nodes], points) * weights)[..., None]
        x = shape.lagrange(order, on_cell) @ of
        total += (area * normal).sum(axis=1)
        through += (area * normal * x).sum(axis=(1, 2))
    np.testing.assert_allclose(total, 0, atol=1e-14 if order == 1 else 1e-13)
    close = 1e-12 if order == 1 else 1e-10
    np.testing.assert_allclose(through, shape.dim * volumes(domain), rtol=close)


@pytest.mark.parametrize("shape", SHAPES, ids=NAMES)
def test_serendipity_cells_are_cells_of_degree_2(shape):
    """The nodes in the middle of faces and cells have the values of serendipity functions."""
    nodes, axes = shape.nodes(2), range(shape.dim)
    powers = [np.array(p) for p in np.ndindex(*(3,) * shape.dim)]
    # Superlinear degree: factors of degree 1 do not count.
    kept = [p for p in powers if p[p > 1].sum() <= 2 and p.sum() - max(p.max(), 1) <= 2]
    found = 0
    for own, corners, weights in shape.serendipity:
        assert np.abs(weights[:, own]).max() == 0 and corners.shape[0] == len(own)
        for power in kept:
            values = np.prod([nodes[:, k] ** power[k] for k in axes], axis=0)
            np.testing.assert_allclose(weights @ values, values[own], atol=1e-14)
        found += len(own)
    assert found == {"quadrilateral": 1, "hexahedron": 7}.get(shape.name, 0)


def test_cells_of_the_other_dimension_are_refused():
    with pytest.raises(InputError, match=r"mesh.cell.*\[value\]"):
        rectangle(MPI.COMM_SELF, (0, 0), (1, 1), (2, 2), cell="hexahedron")
    with pytest.raises(InputError, match=r"mesh.cell.*\[value\]"):
        box(MPI.COMM_SELF, (0, 0, 0), (1, 1, 1), (2, 2, 2), cell="quadrilateral")
