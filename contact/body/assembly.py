"""Compiled forms of the residual of one body, and of its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.core.expr import Expr

from contact._compat import lasting
from contact.body.elements import Pointwise, kinematics_of, quadrature_degree, rules_of
from contact.body.global_unknowns import Cuts
from contact.body.internal_variables import QuadratureLaws
from contact.body.loads import Loads, assembled, given_loads
from contact.body.materials import solids_of
from contact.body.supports import elastic_supports_of
from contact.body.weak_form import Fields, Term, WeakForm
from contact.mesh.domain import Domain, compiled
from contact.mesh.entities import Indices
from contact.model.body import Body
from contact.model.fields import constant
from contact.ranks import summed
from contact.typing import Array


class Assembly:
    """The terms of a body's weak form, compiled: forces, matrices, loads.

    `cells` are the owned cells of each material, `cuts` the jumps across cuts of bolts, None
    without any. The weak form is that at the unknowns `at`, its secant modulus that at `secant_at`
    where these differ, and its loads are those at `time`.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        space: fem.FunctionSpace,
        cells: Sequence[Indices],
        element: str,
        pointwise: Pointwise,
        cuts: Cuts | None,
    ) -> None:
        self._domain, self._body, self._cuts = domain, body, cuts
        self.at, self.secant_at = fem.Function(space), fem.Function(space)
        self._phi_scale = None if body.piezo is None else constant(domain.mesh, body.phi_scale)
        self._test = self.split(ufl.TestFunction(space))
        self.time = constant(domain.mesh, 0.0)
        degree = space.ufl_element().embedded_superdegree
        exact = quadrature_degree(domain, body.materials, degree)
        seen = kinematics_of(domain, element)
        self.laws = QuadratureLaws(
            domain, body.materials, cells, exact, seen, pointwise, degree - 1
        )
        rules = rules_of(domain, element, exact, seen)
        self.weak_form = WeakForm(
            ufl.FacetNormal(domain.mesh),
            solids_of(domain, body.materials, cells, rules, self.laws),
            elastic_supports_of(domain, body),
            given_loads(domain, body, self.time),
        )

    def split(self, x: Expr) -> Fields:
        """Split a function or argument into displacement and scaled-back potential."""
        u = ufl.as_vector([x[i] for i in range(self._domain.dim)])
        return Fields(u, None if self._body.piezo is None else self._phi_scale * x[len(u)])

    def put(self, nodal: Array, q: Array, secant: bool = False) -> None:
        """Put unknowns of the nodes, and the global ones, into `at` or `secant_at`."""
        (self.secant_at if secant else self.at).x.array[:] = nodal.ravel()
        if self._cuts is not None:
            self._cuts.set(self._cuts.secant_jump if secant else self._cuts.jump, q)

    def residual(
        self,
        z: Fields,
        secant_at: fem.Function | None = None,
        history_at: fem.Function | None = None,
    ) -> list[Term]:
        """Return the terms of the residual at `at`; see `WeakForm.residual`."""
        frozen = [None if f is None else self._fields(f).u for f in (secant_at, history_at)]
        return self.weak_form.residual(self._fields(self.at), z, *frozen)

    def _fields(self, at: fem.Function) -> Fields:
        """Return the fields of `at` or `secant_at`, with the jumps across cuts."""
        u, phi = self.split(at)
        if self._cuts is not None:
            u += self._cuts.jump if at is self.at else self._cuts.secant_jump
        return Fields(u, phi)

    def loads(self, z: Fields, owned: int, on: Sequence[str | None] | None = None) -> Loads:
        """Return the loads along test functions, of some parts alone if these are named."""
        terms = self.residual(z)
        if on is not None:
            terms = [term for term in terms if term.load is not None and term.load.on in on]
        return Loads(terms, owned, self.time)

    def work(self, along: fem.Function, functions: ufl.Argument) -> list[fem.Form]:
        """Compile the internal forces' work along unknowns, divided among functions of sum 1."""
        forces = [form.integrals() for form in self._forces(self.split(along))]
        return _compiled(
            [
                ufl.Form([one.reconstruct(functions * one.integrand()) for one in integrals])
                for integrals in forces
            ]
        )

    def _forces(self, z: Fields, *frozen: fem.Function) -> list[ufl.Form]:
        """Return the terms of the unknowns, of stresses and elastic supports.

        Each material and quadrature rule has its own form: FFCx confuses the values of a rule of
        one point with those of others, and a form of one material is compiled once for all bodies.
        """
        return [term.form for term in self.residual(z, *frozen) if term.load is None]

    # dolfinx packs the values of each function of a form in all cells: with the law itself of one.

    @cached_property
    def law_forces(self) -> list[fem.Form]:
        """Forces at `at`, by material and quadrature rule."""
        return _compiled(self._forces(self._test))

    @cached_property
    def secant_forces(self) -> list[fem.Form]:
        """Forces at `at` with the secant modulus at `secant_at`."""
        return _compiled(self._forces(self._test, self.secant_at, self.secant_at))

    @cached_property
    def elastic_forces(self) -> list[fem.Form]:
        """Forces of each elastic support against the displacement `at`."""
        terms = self.weak_form.elastic_supports(self._fields(self.at), self._test)
        return _compiled([term.form for term in terms])

    @cached_property
    def secant(self) -> list[fem.Form]:
        """Kacanov's matrix at `secant_at`."""
        # The derivative, for with a history the forces are affine.
        return self._derivative(self._forces(self._test, self.secant_at, self.secant_at))

    @cached_property
    def tangent(self) -> list[fem.Form]:
        """Newton's matrix at `at`."""
        if self._body.linear:
            return self.secant
        return self._derivative(self._forces(self._test, self.at, self.secant_at))

    def _derivative(self, forces: list[ufl.Form]) -> list[fem.Form]:
        """Compile the derivative of forces by `at`, all else being frozen."""
        trial = ufl.TrialFunction(self.at.function_space)
        return _compiled([ufl.derivative(form, self.at, trial) for form in forces])

    @cached_property
    def pattern(self) -> fem.Form:
        """A form over all cells, with the pattern of the matrices."""
        if len(self.weak_form.solids) == 1:
            return self.secant[0]
        space = self.at.function_space
        return fem.form(ufl.inner(ufl.TrialFunction(space), ufl.TestFunction(space)) * ufl.dx)

    # Cuts: the section forces, and the derivatives of all forces by shortenings.

    def on_global(self, size: int, secant: bool = False) -> Array:
        """Return the internal forces on the global unknowns, shape (m,). Collective."""
        forces = np.zeros(size)
        if self._cuts is not None:
            forms = self._secant_section_forces if secant else self._section_forces
            forces[self._cuts.places] = [self._sum(terms) for terms in forms]
        return forces

    def loads_on_global(self, time: float, size: int) -> Array:
        """Return the work of the loads at a time by unit shortenings, shape (m,). Collective."""
        work = np.zeros(size)
        if self._cuts is not None:
            local_work = [loads.at(time)[0] for loads in self._section_loads]
            work[self._cuts.places] = summed(self._domain.comm, local_work)
        return work

    def border(self, kind: str, owned: int, size: int) -> tuple[Array, Array] | None:
        """Return the derivatives by the m = `size` global unknowns; None without cuts. Collective.

        These are those of the forces on the nodes, shape (owned, m), and on the global unknowns,
        (m, m), by the secant modulus if `kind` is "secant", else by the law itself.
        """
        if self._cuts is None:
            return None
        frozen = kind == "secant" or self._body.linear
        nodal_forms, cut_forms = self._secant_border if frozen else self._border
        columns, corner = np.zeros((owned, size)), np.zeros((size, size))
        for k, place in enumerate(self._cuts.places):
            columns[:, place] = sum(assembled(form, owned) for form in nodal_forms[k])
            corner[self._cuts.places, place] = [self._sum(row[k]) for row in cut_forms]
        return columns, corner

    def _sum(self, forms: list[fem.Form]) -> float:
        """Return the sum of functionals over all ranks. Collective."""
        local_sum = sum(fem.assemble_scalar(form) for form in forms)
        return float(lasting(self._domain.mesh.comm).allreduce(local_sum, op=MPI.SUM))

    @property
    def _shortenings(self) -> list[Fields]:
        """The test functions of unit shortenings."""
        assert self._cuts is not None
        none = None if self._body.piezo is None else constant(self._domain.mesh, 0.0)
        return [Fields(direction, none) for direction in self._cuts.directions]

    @cached_property
    def _section_loads(self) -> list[Loads]:
        return [self.loads(z, 1) for z in self._shortenings]

    @cached_property
    def _section_forces(self) -> list[list[fem.Form]]:
        return [_compiled(self._forces(z)) for z in self._shortenings]

    @cached_property
    def _secant_section_forces(self) -> list[list[fem.Form]]:
        frozen = self.secant_at, self.secant_at
        return [_compiled(self._forces(z, *frozen)) for z in self._shortenings]

    @cached_property
    def _border(self) -> Any:
        return self._by_shortenings(self.at)

    @cached_property
    def _secant_border(self) -> Any:
        return self._by_shortenings(self.secant_at)

    def _by_shortenings(self, secant_at: fem.Function) -> Any:
        """Compile the derivatives of forces on nodes, and across cuts, by each shortening."""
        cuts = self._cuts
        assert cuts is not None
        nodal_forms, *cut_forms = (
            [
                _compiled([ufl.derivative(form, cuts.jump, direction) for form in forces])
                for direction in cuts.directions
            ]
            for z in (self._test, *self._shortenings)
            for forces in [self._forces(z, secant_at, secant_at)]
        )
        return nodal_forms, cut_forms


def _compiled(forms: Sequence[ufl.Form]) -> list[fem.Form]:
    """Compile forms that add up."""
    return [compiled(form) for form in forms]
