"""Internal variables of materials at quadrature points: the history of a body.

A law of the stress that has some (`forms.hencky.HistoryLaw`) is given those at the beginning of a
step, and returns those at its end. Nothing else in the program knows of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, partial

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import ArrayLike
from ufl.core.expr import Expr

from contact.body.description import Material
from contact.body.elements import kinematics_of
from contact.body.materials import law_with_constants
from contact.body.pointwise import Pointwise
from contact.errors import InputError
from contact.history import QUADRATURE_POINTS, Evaluated, InternalVariables
from contact.mesh.domain import Domain, Indices
from contact.typing import Array
from forms.hencky import HistoryLaw, Law
from forms.kinematics import strain

#: Name of the part of the history.
VARIABLES = "material"


class QuadratureVariables:
    """The internal variables of all materials of a body. Materials share those of one name.

    Parameters
    ----------
    domain, materials
        The mesh, and the materials.
    cells
        The owned cells of each.
    degree
        Of the quadrature.
    element
        Which of `contact.body.elements`.

    Attributes
    ----------
    initial
        Their values in the reference configuration; None without any.
    means
        The means in the cells of those that `set` was given last, for fields between the
        quadrature points.

    Raises
    ------
    InputError
        If materials give different shapes to a variable of one name.
    """

    def __init__(
        self,
        domain: Domain,
        materials: Sequence[Material],
        cells: Sequence[Indices],
        degree: int,
        element: str,
    ) -> None:
        self._domain, self._materials, self._cells = domain, materials, cells
        self._degree, self._kind = degree, element
        mesh = domain.mesh
        self._owned = mesh.topology.index_map(mesh.topology.dim).size_local
        self._functions: dict[str, fem.Function] = {}
        self.means: dict[str, fem.Function] = {}
        values: dict[str, Array] = {}
        for law, own in zip((material.law for material in materials), cells, strict=True):
            for name, value in variables_of(law).items():
                first = np.asarray(value, dtype=float)
                if name not in values:
                    values[name] = np.zeros((self._owned, self.points.shape[0], *first.shape))
                    space = fem.functionspace(mesh, self._element(first.shape))
                    self._functions[name] = fem.Function(space, name=name)
                    constant = fem.functionspace(mesh, ("DG", 0, first.shape))
                    self.means[name] = fem.Function(constant, name=name)
                elif values[name].shape[2:] != first.shape:
                    raise InputError(
                        f"material: the variable {name!r} has the shapes {values[name].shape[2:]} "
                        f"and {first.shape} in two materials; accepted: one, or two names"
                    )
                values[name][own] = first
        self.initial: InternalVariables | None = None
        if values:
            flat = {name: self._flat(array) for name, array in values.items()}
            self.initial = InternalVariables(QUADRATURE_POINTS, flat)

    def _element(self, shape: tuple[int, ...]) -> basix.ufl._ElementBase:
        cell = self._domain.mesh.topology.cell_name()
        return basix.ufl.quadrature_element(cell, shape, degree=self._degree)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shapes of the variables by name."""
        return {name: function.ufl_shape for name, function in self._functions.items()}

    @cached_property
    def points(self) -> Array:
        """The quadrature points of the reference cell, shape (q, d)."""
        return np.asarray(self._element(()).custom_quadrature()[0])

    @cached_property
    def places(self) -> Array:
        """The quadrature points of the owned cells, one cell after the other, (places, d)."""
        coordinate = fem.functionspace(self._domain.mesh, self._element(()))
        at = coordinate.tabulate_dof_coordinates()[coordinate.dofmap.list[: self._owned]]
        return np.asarray(at.reshape(-1, at.shape[-1])[:, : self._domain.dim])

    def _flat(self, array: Array) -> Array:
        """Return values by cell and point as values by place."""
        return array.reshape(-1, *array.shape[2:])

    def law(self, law: Law) -> Law:
        """Return a law in a step that begins with the values which `set` is given."""
        return _since(law, self._functions)

    def law_of_means(self, law: Law) -> Law:
        """Return a law likewise, with the means in the cells, for any points."""
        return _since(law, self.means)

    def of(self, state: Evaluated) -> InternalVariables | None:
        """Return the values that the step of a state began with; None without any."""
        part = state.history.get(VARIABLES, self.initial)
        assert part is None or isinstance(part, InternalVariables)
        return part

    def set(self, values: InternalVariables | None) -> None:
        """Let the forms of the laws look at values from now on."""
        for name, function in self._functions.items():
            assert values is not None
            array, mean = values.arrays[name], self.means[name]
            shape = self._owned, self.points.shape[0], -1
            _fill(function, array.reshape(self._owned, -1))
            _fill(mean, array.reshape(shape).mean(axis=1))

    def commit(self, pointwise: Pointwise, state: Evaluated, x: Array) -> InternalVariables | None:
        """Return the values at the end of the step that led to a state. Collective.

        Parameters
        ----------
        pointwise
            Evaluates expressions of the unknowns.
        state, x
            The state, and its local unknowns of the nodes.
        """
        before = self.of(state)
        if before is None:
            return None
        self.set(before)
        arrays = {name: array.copy() for name, array in before.arrays.items()}
        for index, own in enumerate(self._cells):
            if not variables_of(self._materials[index].law):
                continue
            asked = "internal variables", index
            found = pointwise.values(asked, partial(self._updated, index), self.points, x, own)
            for cells, values in found:
                begin = 0
                for array in arrays.values():
                    by_cell = array.reshape(self._owned, self.points.shape[0], -1)
                    end = begin + by_cell.shape[2]
                    by_cell[cells] = values[..., begin:end]
                    begin = end
        return before.replaced(arrays)

    def _updated(self, index: int, at: fem.Function) -> Expr:
        """Return the variables at the end of a step in a material, one after the other."""
        law = self.law(law_with_constants(self._materials[index].law, self._domain.mesh))
        u = ufl.as_vector([at[i] for i in range(self._domain.dim)])
        return ufl.as_vector(self.updated(law, strain(u, kinematics_of(self._domain, self._kind))))

    def updated(self, law: Law, eps: Expr) -> list[Expr]:
        """Return the components of all variables at the end of a step; 0 if a law has them not."""
        values = law.updated(eps) if isinstance(law, HistoryLaw) else {}
        return [
            (values[name][index] if index else values[name]) if name in values else ufl.as_ufl(0.0)
            for name, shape in self.shapes.items()
            for index in np.ndindex(shape)
        ]


def variables_of(law: Law) -> Mapping[str, ArrayLike]:
    """Return the internal variables of a law and their initial values."""
    return law.variables if isinstance(law, HistoryLaw) else {}


def _since(law: Law, variables: Mapping[str, fem.Function]) -> Law:
    if not isinstance(law, HistoryLaw):
        return law
    return law.since({name: variables[name] for name in law.variables})


def _fill(function: fem.Function, values: Array) -> None:
    """Write values of the owned cells, shape (cells, values)."""
    dofmap = function.function_space.dofmap
    blocks = function.x.array.reshape(-1, dofmap.index_map_bs)
    own = dofmap.list[: values.shape[0]]
    blocks[own] = values.reshape(*own.shape, -1)
    function.x.scatter_forward()
