"""The finite elements of a body: Lagrange elements, as they are or with the mean dilatation.

`Pointwise` evaluates expressions of the unknowns in their cells.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact.errors import InputError
from contact.mesh.cells import Shape, rule, shape_of
from contact.mesh.domain import Domain
from contact.mesh.geometry import geometry_nodes, integration_weights, inverse, jacobians
from contact.model.material import Material
from contact.typing import Array
from forms.hencky import is_linear
from forms.history import HistoryLaw
from forms.kinematics import (
    Axisymmetric,
    CellMean,
    Isochoric,
    Kinematics,
    MeanDilatation,
    MultilinearMean,
    Strained,
    axes_of,
)

#: Elements by the names that the case file has for them.
STANDARD, MEAN_DILATATION = ELEMENTS = ("standard", "mean_dilatation")

#: A quadrature rule: its degree, and the kinematics of its strains with their signs.
Rule: TypeAlias = tuple[int, tuple[tuple[int, Strained], ...]]

#: Reasons for the degree of the mean dilatation.
CONSTANT = (
    "the strain of triangles and tetrahedra of degree 1 is constant in the cell, is its own mean, "
    "and locks with it or without"
)
ENOUGH = "quadrilaterals and hexahedra of degree 2 hardly lock"

#: Cells, or pairs of facets, that are evaluated at once: bounds the memory.
CHUNK = 100_000


def check_element(element: str, degree: int, shape: Shape, order: int = 1) -> None:
    """Refuse an unknown element, or one without this degree on cells of a shape."""
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
    """Return the accepted degree or cells of an element; None if these are."""
    if element != MEAN_DILATATION:
        return None
    if order > 1:
        return "'standard' on curved cells"
    if shape.simplex:
        return None if degree == 2 else f"degree = 2, or 'standard': {CONSTANT}"
    return None if degree == 1 else f"degree = 1 on {shape.plural}, or 'standard': {ENOUGH}"


def unlocked(element: str, degree: int, shape: Shape) -> str | None:
    """Return the remedy for volumetric locking of an element; None without locking."""
    if degree > 1 or element == MEAN_DILATATION:
        return None
    if not shape.simplex:
        return 'element = "mean_dilatation", or space.degree = 2, does not lock'
    return 'space.degree = 2 does not lock, least of all with element = "mean_dilatation"'


def kinematics_of(domain: Domain, element: str, on_axis: bool = False) -> Strained:
    """Return the kinematics of an element, of rings also valid at r = 0 if on_axis. Collective."""
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


def quadrature_degree(domain: Domain, materials: Sequence[Material], degree: int) -> int:
    """Return the degree of the quadrature of stresses, exact for linear laws on straight cells."""
    # Stresses at points are no function that more of them would integrate more exactly.
    smooth = all(is_linear(m.law) or isinstance(m.law, HistoryLaw) for m in materials)
    # Strains of straight simplices are of one degree less than displacements, of others of the
    # same.
    straight = shape_of(domain.mesh).simplex and domain.order == 1
    exact = max(2 * degree - 2, 1) if straight else 2 * degree
    return exact + 2 * (degree == 2 and not smooth) + domain.kinematics.added_degree


def rules_of(domain: Domain, element: str, exact: int, kinematics: Strained) -> list[Rule]:
    """Return the quadrature rules whose sum has the kinematics of an element.

    Stresses of laws with internal variables are at the points of the first rule.
    """
    if element == STANDARD or not shape_of(domain.mesh).simplex:
        return [(exact, ((1, kinematics),))]
    # P2-P0: all that changes of volume do is taken at the centroid, the rest in full.
    base, mean = domain.kinematics, CellMean(domain.kinematics)
    return [(exact, ((1, Isochoric(base)),)), (1, ((1, mean), (-1, Isochoric(mean))))]


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
    edges = corners - corners[:, None]
    along = np.array([edges[..., axes].prod(axis=-1) for axes in axes_of(domain.dim)])
    return MultilinearMean(
        kinematics,
        _in_cells(domain, jacobians(shape, of, corners)),
        _in_cells(domain, np.einsum("spk,ckd->cpsd", along, mean)),
    )


def _in_cells(domain: Domain, values: Array) -> fem.Function:
    """Return the multilinear function of corner values (cells, corners, ...). Collective."""
    space = fem.functionspace(domain.mesh, ("DG", 1, values.shape[2:]))
    function, dofs = fem.Function(space), space.dofmap.list[: len(values)]
    function.x.array.reshape(-1, space.dofmap.index_map_bs)[dofs] = values.reshape(*dofs.shape, -1)
    function.x.scatter_forward()
    return function


def in_chunks(cells: NDArray[np.integer[Any]]) -> list[NDArray[Any]]:
    """Return cells, or their places, part by part; an empty part where there are none."""
    return np.array_split(cells, cells.size // CHUNK + 1)


class Pointwise:
    """Expressions of the unknowns in a space, compiled once, evaluated at points of cells."""

    def __init__(self, space: fem.FunctionSpace) -> None:
        self._space = space
        self._at: fem.Function | None = None
        self._compiled: dict[Hashable, fem.Expression] = {}
        #: The last caller, whose unknowns are in the function.
        self._reader = object()

    def values(
        self,
        name: Hashable,
        expression: Callable[[fem.Function], Expr],
        points: Array,
        x: Array,
        cells: NDArray[np.int32],
    ) -> Iterator[tuple[NDArray[np.int32], Array]]:
        """Yield some cells after others, and a vector there, shape (cells, points, components).

        The expression of the unknowns is made when its name is asked for the first time, which is
        collective. The points are those of the reference cell, shape (points, d), the cells local
        numbers; of the local unknowns x the global ones are ignored.
        """
        at = self._at = self._at or fem.Function(self._space)
        if name not in self._compiled:
            self._compiled[name] = fem.Expression(expression(at), points)
        compiled, reader = self._compiled[name], object()
        for chosen in in_chunks(cells):
            if self._reader is not reader:
                self._reader, at.x.array[:] = reader, x[: at.x.array.size]
            vectors = np.asarray(compiled.eval(self._space.mesh, chosen))
            yield chosen, vectors.reshape(chosen.size, len(points), compiled.value_size)
