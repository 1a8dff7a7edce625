"""Gradients of results by fields: the gap along a surface, a constant of a material in the body.

One adjoint gives the derivatives by all values of a field, as dG/dm of each is local: that of a gap
is known node by node, that of a constant of a material is the central difference of the work of the
stresses along the adjoint, tested with the functions of the field.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import ufl
from dolfinx import fem

from contact.arguments import expect
from contact.body.equilibrium import BodyEquilibrium
from contact.body.internal_variables import VARIABLES
from contact.body.loads import assembled
from contact.derivatives.by_parameters import (
    LoadPath,
    Parameter,
    backwards,
    family_of,
    parameters_of,
    quantities_of,
)
from contact.errors import InputError
from contact.history import InternalVariables, LinearisationPoint
from contact.results.functionals import Differentiable, Functional
from contact.solution import Solution
from contact.typing import Array

#: Section of a case whose constants may be fields.
MATERIAL = "material"


def gap_gradient(solution: Solution, quantity: str | Functional) -> Array:
    """Return the derivatives of a result by the gap at each contact node. Collective.

    One adjoint gives them all: the gradient for the shape of a foundation.

    Parameters
    ----------
    solution
        A converged solution; of an evolution the gap is that of all steps.
    quantity
        A name as of `sensitivity`, or a quantity with a `gradient`; no layer or conductive
        foundation may depend on the gap.

    Returns
    -------
    Those of the nodes of this rank, in the order of ``solution.problem.nodes``, shape (n,).

    Raises
    ------
    InputError
        As `sensitivity`, and where a layer or a charge depends on the gap.

    Examples
    --------
    >>> gradient = gap_gradient(solution, "max_pressure")  # doctest: +SKIP
    >>> points = solution.problem.nodes.points  # doctest: +SKIP
    """
    path, functionals = LoadPath(solution), _one(solution, quantity)
    law = solution.problem.interface.foundation
    if law.layer is not None or law.follows_gap:
        raise InputError(
            "gap_gradient: the layer or charge depends on the gap; accepted: neither",
            "no-derivative",
        )
    gradient = np.zeros_like(solution.problem.nodes.gap)
    for jacobian, adjoints in backwards(path, functionals):
        for one in adjoints.values():
            gradient += jacobian.by_gap(one.x, one.conditions)
    return gradient


def field_gradient(
    solution: Solution,
    quantity: str | Functional,
    parameter: str | Parameter = "material.young",
    degree: int = 0,
) -> fem.Function:
    """Return the derivatives of a result by a constant of a material as a field. Collective.

    One adjoint gives them all, whatever the number of cells: the gradient for the identification
    or the design of a modulus in the body.

    Parameters
    ----------
    solution
        A converged solution.
    quantity
        A name as of `sensitivity`, or a quantity with a `gradient`.
    parameter
        Key of a constant of a material: ``material.young``, ``material.1.poisson``,
        ``material.piezo.e33``. Or a `Parameter`, for a problem that was built in Python.
    degree
        0: one value a cell. 1: one a vertex, linear between them.

    Returns
    -------
    Coefficient i is the derivative by the coefficient m_i of the field sum m_i phi_i (DG0 or P1),
    of the unit of the result over that of the constant. They add up to the derivative by the
    constant itself; cells of other materials have none.

    Raises
    ------
    InputError
        As `sensitivity`, and where the parameter is none of a material, the degree neither, or the
        body has bolts.

    Examples
    --------
    >>> gradient = field_gradient(solution, "max_pressure")  # doctest: +SKIP
    >>> gradient.x.array  # doctest: +SKIP
    """
    whole = not solution.problem.description.bolts
    expect("field_gradient: problem", "bolts", "a body without bolts", whole)
    expect("field_gradient: degree", degree, "0 (cells) or 1 (vertices)", degree in (0, 1))
    key = parameter if isinstance(parameter, str) else "parameter"
    inside = not isinstance(parameter, str) or key.split(".")[0] == MATERIAL
    expect("field_gradient: parameter", key, "a constant of a material: material.young", inside)
    path, functionals = LoadPath(solution), _one(solution, quantity)
    parameters = [parameter] if isinstance(parameter, str) else {key: parameter}
    ((_, constant),) = parameters_of(solution, parameters)
    family, element = family_of(key, constant, path.steps), ("Lagrange" if degree else "DG", degree)
    gradient = fem.Function(fem.functionspace(path.base.domain.mesh, element), name="gradient")
    space = gradient.function_space
    works = [_FieldWork(problem.body, space) for problem in family.problems]
    values = np.zeros(space.dofmap.index_map.size_local)
    for jacobian, adjoints in backwards(path, functionals):
        state, scale = jacobian.state, jacobian.problem.body.phi_scale
        for one in adjoints.values():
            weights = None if one.after is None else one.after.get(VARIABLES)
            assert weights is None or isinstance(weights, InternalVariables)
            values += family.slope([work(state, one.along, scale, weights) for work in works])
    gradient.x.array[: values.size] = values
    gradient.x.scatter_forward()
    return gradient


def _one(solution: Solution, quantity: str | Functional) -> Mapping[str, Differentiable]:
    """Return a quantity with a gradient, by its name. Collective."""
    quantities = [quantity] if isinstance(quantity, str) else {"quantity": quantity}
    ((name, functional),) = quantities_of(solution, quantities).items()
    words = "a quantity with a gradient"
    expect("quantity", functional, words, isinstance(functional, Differentiable))
    return {name: functional}  # type: ignore[dict-item]


class _FieldWork:
    """Work of the stresses along given unknowns, by the functions phi_i of a DG0 or P1 field.

    With a constant m = sum m_i phi_i, sum phi_i = 1, the derivative of value i by m is that of the
    work by m_i.
    """

    def __init__(self, body: BodyEquilibrium, space: fem.FunctionSpace) -> None:
        self._body, functions = body, ufl.TestFunction(space)
        self._along = fem.Function(body.space)
        self._owned = space.dofmap.index_map.size_local
        self._forms = body.forms.work(self._along, functions)
        self._weighted = body.laws.divided(functions)

    def __call__(
        self,
        state: LinearisationPoint,
        along: Array,
        phi_scale: float,
        after: InternalVariables | None,
    ) -> Array:
        """Return the values of the functions of this rank. Collective.

        `phi_scale`: unit of the potential in the state and the unknowns along which stresses work.
        `after`: weights of the internal variables at the end of the step, added to the work.
        """
        body = self._body
        for into, values in ((body.forms.at, state.x), (self._along, body.local(along))):
            nodal = body.nodal(values).copy()
            nodal[:, body.dim :] *= phi_scale / body.phi_scale
            into.x.array[:] = nodal.ravel()
        body.laws.set(state)
        work = sum(assembled(form, self._owned) for form in self._forms)
        if after is not None:
            body.laws.weigh(state, after)
            work = work + assembled(self._weighted, self._owned)
        return np.asarray(work)
