"""The weak forms of the stresses in one body."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import ufl
from dolfinx import fem
from ufl.core.expr import Expr

from contact.body.description import Body
from contact.body.internal_variables import QuadratureVariables
from contact.body.materials import material_measures
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices
from forms.hencky import secant_form
from forms.piezo import symmetrised_form


class WeakForms:
    """Forces of the stresses, and their derivatives.

    Parameters
    ----------
    domain, body
        Mesh, and the materials.
    space
        Of the unknowns.
    cells
        The owned cells of each material.
    degree
        Degree of the elements.

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
    ) -> None:
        self._body, self._dim, self._kinematics = body, domain.dim, domain.kinematics
        self.at, self.secant_at = fem.Function(space), fem.Function(space)
        self._trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
        self._test = self.split(test)
        exact = 1 if degree == 1 else (2 if body.linear else 4)
        exact += self._kinematics.added_degree
        #: The internal variables of the materials.
        self.variables = QuadratureVariables(domain, body.materials, cells, exact)
        self._materials = [
            (self.variables.law(law), piezo, dx)
            for law, piezo, dx in material_measures(domain, body.materials, cells, exact)
        ]

    def split(self, x: Any) -> tuple[Expr, Expr | None]:
        """Split a function or argument into displacement and scaled-back potential."""
        u = ufl.as_vector([x[i] for i in range(self._dim)])
        return u, (None if self._body.piezo is None else self._body.phi_scale * x[self._dim])

    def _internal(self, secant_at: Any, x: Any) -> ufl.Form:
        u, phi = self.split(x)
        u_0, _ = self.split(secant_at)
        v, xi = self._test
        return sum(
            secant_form(law, u_0, u, v, self._kinematics) * dx
            if piezo is None
            else symmetrised_form(law, piezo, u_0, u, phi, v, xi, self._kinematics) * dx
            for law, piezo, dx in self._materials
        )

    # For each function of a form dolfinx packs the values in all cells: with the law itself those
    # of one.

    @cached_property
    def law_forces(self) -> fem.Form:
        """Forces at `at`."""
        return fem.form(self._internal(self.at, self.at))

    @cached_property
    def secant_forces(self) -> fem.Form:
        """Forces at `at` with the secant modulus at `secant_at`."""
        return fem.form(self._internal(self.secant_at, self.at))

    @cached_property
    def secant(self) -> fem.Form:
        """Kacanov's matrix at `secant_at`."""
        return fem.form(self._internal(self.secant_at, self._trial))

    @cached_property
    def tangent(self) -> fem.Form:
        """Newton's matrix at `at`."""
        if self._body.linear:
            return self.secant
        law = self._internal(self.at, self.at)
        return fem.form(ufl.derivative(law, self.at, self._trial))
