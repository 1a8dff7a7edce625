"""The finite elements of a body: Lagrange elements, as they are or with the mean dilatation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import fem

from contact.errors import InputError
from contact.mesh.cells import Shape, rule, shape_of
from contact.mesh.domain import Domain
from contact.mesh.geometry import geometry_nodes, integration_weights, inverse, jacobians
from contact.typing import Array
from forms.kinematics import (
    Axisymmetric,
    Kinematics,
    MeanDilatation,
    MultilinearMean,
    Strained,
    axes_of,
)

#: Elements by the names that the case file has for them.
STANDARD, MEAN_DILATATION = ELEMENTS = ("standard", "mean_dilatation")

#: Why the mean dilatation asks for a degree.
CONSTANT = (
    "the strain of triangles and tetrahedra of degree 1 is constant in the cell, is its own mean, "
    "and locks with it or without"
)
ENOUGH = "quadrilaterals and hexahedra of degree 2 hardly lock"


def check_element(element: str, degree: int, shape: Shape, order: int = 1) -> None:
    """Refuse elements that are none on cells of a shape.

    Raises
    ------
    InputError
        If the degree is none, the element has no such name, or not this degree, or these cells.
    """
    if degree not in (1, 2):
        raise InputError(f"degree: given {degree!r}; accepted: 1 or 2", "value")
    if element not in ELEMENTS:
        raise InputError(
            f"element: given {element!r}; accepted: {', '.join(map(repr, ELEMENTS))}", "value"
        )
    accepted = needed(element, degree, shape, order)
    if accepted is not None:
        raise InputError(
            f"element: given {element!r} of degree {degree}; accepted: {accepted}", "value"
        )


def needed(element: str, degree: int, shape: Shape, order: int = 1) -> str | None:
    """Return the degree and cells that an element asks for; None where it has them."""
    if element != MEAN_DILATATION:
        return None
    if order > 1:
        return "'standard' on curved cells"
    if shape.simplex:
        return None if degree == 2 else f"degree = 2, or 'standard': {CONSTANT}"
    return None if degree == 1 else f"degree = 1 on {shape.plural}, or 'standard': {ENOUGH}"


def unlocked(element: str, degree: int, shape: Shape) -> str | None:
    """Return the remedy for elements that lock where volumes hardly change; None if none do."""
    if degree > 1 or element == MEAN_DILATATION:
        return None
    if not shape.simplex:
        return 'element = "mean_dilatation", or space.degree = 2, does not lock'
    return 'space.degree = 2 does not lock, least of all with element = "mean_dilatation"'


def kinematics_of(domain: Domain, element: str, on_axis: bool = False) -> Strained:
    """Return how displacements of an element deform the body. Collective.

    Parameters
    ----------
    domain
        The mesh.
    element
        One of `ELEMENTS`.
    on_axis
        Whether strains are asked for on the axis of a body of revolution.
    """
    kinematics = domain.kinematics
    if isinstance(kinematics, Axisymmetric):
        kinematics = replace(kinematics, on_axis=on_axis)
    if element == STANDARD:
        return kinematics
    if not shape_of(domain.mesh).simplex:
        return _multilinear_mean(domain, kinematics)
    centroid = fem.Function(fem.functionspace(domain.mesh, ("DG", 0, (domain.dim,))))
    centroid.interpolate(lambda x: np.asarray(x[: domain.dim]))
    return MeanDilatation(kinematics, centroid)


def _multilinear_mean(domain: Domain, kinematics: Kinematics) -> MultilinearMean:
    """Return the mean dilatation on quadrilaterals or hexahedra. Collective."""
    shape, of = shape_of(domain.mesh), geometry_nodes(domain)
    corners = shape.nodes(1)
    # Volumes and derivatives of the corners' functions are quadratic along each axis at most.
    at, weights = rule(shape, 3)
    extent = integration_weights(domain.revolved, shape, of, at, weights)
    slopes = shape.gradients(1, at) @ inverse(jacobians(shape, of, at))
    mean = np.einsum("cq,cqkd->ckd", extent, slopes)
    if domain.revolved:
        functions = shape.lagrange(1, at)
        mean[..., 0] += (extent / (of[..., 0] @ functions.T)) @ functions
    mean /= extent.sum(axis=1)[:, None, None]
    ways = corners - corners[:, None]
    along = np.array([ways[..., axes].prod(axis=-1) for axes in axes_of(domain.dim)])
    return MultilinearMean(
        kinematics,
        _in_cells(domain, jacobians(shape, of, corners)),
        _in_cells(domain, np.einsum("spk,ckd->cpsd", along, mean)),
    )


def _in_cells(domain: Domain, values: Array) -> fem.Function:
    """Return a function that is linear along each axis of a cell by its corners. Collective.

    Parameters
    ----------
    domain
        The mesh.
    values
        At the corners, shape (cells, corners, ...).
    """
    space = fem.functionspace(domain.mesh, ("DG", 1, values.shape[2:]))
    made, dofs = fem.Function(space), space.dofmap.list[: len(values)]
    made.x.array.reshape(-1, space.dofmap.index_map_bs)[dofs] = values.reshape(*dofs.shape, -1)
    made.x.scatter_forward()
    return made
