"""The finite elements of a body: Lagrange elements, as they are or with the mean dilatation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import fem

from contact.errors import InputError
from contact.mesh.domain import Domain
from forms.kinematics import Axisymmetric, MeanDilatation, Strained

#: Elements by the names that the case file has for them.
STANDARD, MEAN_DILATATION = ELEMENTS = ("standard", "mean_dilatation")

#: The degree that the mean dilatation asks for, and why.
NEEDS = (
    "degree = 2, or 'standard': the strain of triangles and tetrahedra of degree 1 is constant in "
    "the cell, is its own mean, and locks with it or without"
)


def check_element(element: str, degree: int) -> None:
    """Refuse elements that are none.

    Raises
    ------
    InputError
        If the degree is none, the element has no such name, or not this degree.
    """
    if degree not in (1, 2):
        raise InputError(f"degree: given {degree!r}; accepted: 1 or 2")
    if element not in ELEMENTS:
        raise InputError(f"element: given {element!r}; accepted: {', '.join(map(repr, ELEMENTS))}")
    if element == MEAN_DILATATION and degree != 2:
        raise InputError(f"element: given {element!r} of degree {degree}; accepted: {NEEDS}")


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
    centroid = fem.Function(fem.functionspace(domain.mesh, ("DG", 0, (domain.dim,))))
    centroid.interpolate(lambda x: np.asarray(x[: domain.dim]))
    return MeanDilatation(kinematics, centroid)
