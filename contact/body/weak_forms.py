"""The weak forms of the stresses in one body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import ufl
from dolfinx import fem
from ufl.core.expr import Expr

from contact.body.description import Body
from contact.body.elements import MEAN_DILATATION
from contact.body.internal_variables import QuadratureVariables
from contact.body.materials import material_measures
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices
from forms.hencky import secant_form
from forms.kinematics import CellMean, Isochoric
from forms.piezo import symmetrised_form


class WeakForms:
    """Forces of the stresses, and their derivatives.

    Parameters
    ----------
    domain, body
        Mesh, and the materials.
    degree, element
        Degree of the elements, and which of `contact.body.elements`.
    space
        Of the unknowns.
    cells
        The owned cells of each material.

    Attributes
    ----------
    at, secant_at
        The unknowns, and those at which the secant modulus is taken where that is done elsewhere.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        space: fem.FunctionSpace,
        cells: Sequence[Indices],
        degree: int,
        element: str,
    ) -> None:
        self._body, self._dim = body, domain.dim
        self.at, self.secant_at = fem.Function(space), fem.Function(space)
        self._trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
        self._test = self.split(test)
        exact = 1 if degree == 1 else (2 if body.linear else 4)
        exact += domain.kinematics.added_degree
        #: The internal variables of the materials.
        self.variables = QuadratureVariables(domain, body.materials, cells, exact, element)
        base, full, means = domain.kinematics, self.variables.law, self.variables.law_of_means
        rules: list[Any] = [(exact, full, ((1, base),))]
        if element == MEAN_DILATATION:
            # P2-P0: all that changes of volume do is taken at the centroid, the rest in full.
            mean = CellMean(base)
            rules = [
                (exact, full, ((1, Isochoric(base)),)),
                (1, means, ((1, mean), (-1, Isochoric(mean)))),
            ]
        #: Integrals by quadrature rule: sign, kinematics, law, piezoelectric tensors, measure.
        self._rules = [
            [
                (sign, kinematics, since(law), piezo, dx)
                for law, piezo, dx in material_measures(domain, body.materials, cells, points)
                for sign, kinematics in terms
            ]
            for points, since, terms in rules
        ]

    def split(self, x: Any) -> tuple[Expr, Expr | None]:
        """Split a function or argument into displacement and scaled-back potential."""
        u = ufl.as_vector([x[i] for i in range(self._dim)])
        return u, (None if self._body.piezo is None else self._body.phi_scale * x[self._dim])

    def _internal(self, secant_at: Any, x: Any) -> list[ufl.Form]:
        """Return the forms of all quadrature rules, which add up.

        In one form FFCx would take values of a rule of one point for those of the others.
        """
        u, phi = self.split(x)
        u_0, _ = self.split(secant_at)
        v, xi = self._test
        return [
            sum(
                sign * secant_form(law, u_0, u, v, kinematics) * dx
                if piezo is None
                else sign * symmetrised_form(law, piezo, u_0, u, phi, v, xi, kinematics) * dx
                for sign, kinematics, law, piezo, dx in integrals
            )
            for integrals in self._rules
        ]

    # For each function of a form dolfinx packs the values in all cells: with the law itself those
    # of one.

    @cached_property
    def law_forces(self) -> list[fem.Form]:
        """Forces at `at`, as those below by quadrature rule."""
        return fem.form(self._internal(self.at, self.at))

    @cached_property
    def secant_forces(self) -> list[fem.Form]:
        """Forces at `at` with the secant modulus at `secant_at`."""
        return fem.form(self._internal(self.secant_at, self.at))

    @cached_property
    def secant(self) -> list[fem.Form]:
        """Kacanov's matrix at `secant_at`."""
        return fem.form(self._internal(self.secant_at, self._trial))

    @cached_property
    def tangent(self) -> list[fem.Form]:
        """Newton's matrix at `at`."""
        if self._body.linear:
            return self.secant
        laws = self._internal(self.at, self.at)
        return fem.form([ufl.derivative(law, self.at, self._trial) for law in laws])
