"""The weak forms of the stresses in one body."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from ufl.core.expr import Expr

from contact._compat import lasting
from contact.body.cuts import Cuts
from contact.body.description import Body
from contact.body.elements import MEAN_DILATATION, kinematics_of
from contact.body.internal_variables import QuadratureLaws
from contact.body.loads import assembled, expression
from contact.body.materials import in_parts, material_measures
from contact.body.pointwise import Pointwise
from contact.errors import InputError
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain, Measure
from contact.mesh.entities import Indices
from contact.mesh.integrals import compiled
from contact.model.fields import constant
from contact.model.formula import Expression
from contact.ranks import on_all_ranks
from contact.typing import Array
from forms.hencky import is_linear, secant_form
from forms.history import HistoryLaw, QuadratureLaw
from forms.kinematics import CellMean, Isochoric
from forms.piezo import symmetrised_form


def _elastic(domain: Domain, body: Body) -> Iterator[tuple[list[Expr], Expr, Measure]]:
    """Yield the elastic supports in UFL. Collective."""
    x = ufl.SpatialCoordinate(domain.mesh)
    for number, support in enumerate(body.elastic):
        given = support.stiffness or ()
        if given and len(given) != domain.dim:
            raise InputError(
                f"elastic on {support.on!r}: the stiffness has {len(given)} components, the body "
                f"has {domain.dim}",
                "elastic",
            )
        key = f"elastic.{number}"
        normal = Expression(0.0) if support.normal is None else support.normal
        for name, value in (
            *((f"stiffness.{i}", k) for i, k in enumerate(given)),
            ("normal", normal),
        ):
            _check_stiffness(domain, support.on, value, f"{key}.{name}")
        parts = [expression(domain, k, x, 0.0, f"{key}.stiffness.{i}") for i, k in enumerate(given)]
        yield parts, expression(domain, normal, x, 0.0, f"{key}.normal"), domain.ds(support.on)


def _check_stiffness(domain: Domain, on: str, value: Any, key: str) -> None:
    """Refuse a stiffness that is negative, or no number, somewhere on a part. Collective."""
    mesh, facets = domain.mesh, domain.facets(on)
    points = compute_midpoints(mesh, domain.dim - 1, facets)
    if facets.size > 0:  # dolfinx divides by their number
        corners = np.unique(entities_to_geometry(mesh, domain.dim - 1, facets))
        points = np.concatenate([points, mesh.geometry.x[corners]])
    with on_all_ranks(domain.comm), np.errstate(all="ignore"):
        values = np.asarray(value.numpy(points[:, : domain.dim]))
    wrong = ~(np.isfinite(values) & (values >= 0))
    found = domain.comm.allgather(values[wrong][:1].tolist())
    worst = [one for own in found for one in own]
    if worst:
        raise InputError(
            f"{key}: given {worst[0]:g} on {on!r}; accepted: numbers >= 0 everywhere",
            "negative-stiffness",
        )


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
    pointwise
        Evaluates expressions of the unknowns.

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
        pointwise: Pointwise,
        cuts: Cuts | None = None,
    ) -> None:
        self._body, self._dim, self._cuts = body, domain.dim, cuts
        self.at, self.secant_at = fem.Function(space), fem.Function(space)
        self._mesh = domain.mesh
        self._phi_scale = None if body.piezo is None else constant(domain.mesh, body.phi_scale)
        self._trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)
        self._test = self.split(test)
        # Stresses at points are no function that more of them would integrate more exactly.
        smooth = all(is_linear(m.law) or isinstance(m.law, HistoryLaw) for m in body.materials)
        simplex = shape_of(domain.mesh).simplex
        # Strains of straight simplices are of one degree less than displacements, of others of the
        # same.
        exact = max(2 * degree - 2, 1) if simplex and domain.order == 1 else 2 * degree
        exact += 2 * (degree == 2 and not smooth)
        exact += domain.kinematics.added_degree
        base, seen = domain.kinematics, kinematics_of(domain, element)
        #: The laws with internal variables.
        self.laws = QuadratureLaws(
            domain, body.materials, cells, exact, seen, pointwise, degree - 1
        )
        rules: list[Any] = [(exact, ((1, base),))]
        if element == MEAN_DILATATION and not simplex:
            rules = [(exact, ((1, seen),))]
        elif element == MEAN_DILATATION:
            # P2-P0: all that changes of volume do is taken at the centroid, the rest in full.
            mean = CellMean(base)
            rules = [(exact, ((1, Isochoric(base)),)), (1, ((1, mean), (-1, Isochoric(mean))))]
        #: Elastic supports: the stiffness of each component, that along the normal, the measure.
        self._elastic = [*_elastic(domain, body)]
        self._normal = ufl.FacetNormal(domain.mesh)
        parts = in_parts(domain, cells)
        #: Integrals by quadrature rule, part of the body and material: law, piezoelectric tensors,
        #: measure, and the terms, each a sign and the kinematics.
        self._integrals = [
            (self.laws.law(law), piezo, dx, ((1, seen),) if at_points else terms)
            for points, terms in rules
            for part in parts
            for law, piezo, dx in material_measures(domain, body.materials, part, points)
            for at_points in [isinstance(law, HistoryLaw)]
            # Stresses at points are those of the whole strain there.
            if points == exact or not at_points
        ]

    def split(self, x: Expr) -> tuple[Expr, Expr | None]:
        """Split a function or argument into displacement and scaled-back potential."""
        u = ufl.as_vector([x[i] for i in range(self._dim)])
        return u, (None if self._body.piezo is None else self._phi_scale * x[self._dim])

    def work(self, along: fem.Function, functions: ufl.Argument) -> list[fem.Form]:
        """Compile the work of the stresses at `at` along unknowns, divided among functions.

        Parameters
        ----------
        along
            The unknowns.
        functions
            The test function of a scalar space, whose functions add up to 1.
        """
        return _compiled(self._internal(self.at, self.at, self.split(along), functions))

    def _internal(
        self,
        secant_at: fem.Function,
        history_at: fem.Function,
        test: tuple[Expr, Expr | None] | None = None,
        functions: Expr | int = 1,
    ) -> list[ufl.Form]:
        """Return the forces at `at`, secants and the stiffness at points being those elsewhere.

        They are the forms of all quadrature rules and materials, which add up: in one form FFCx
        would take values of a rule of one point for those of the others, and forms of one material
        are compiled once for all bodies with such a material.
        """
        u, phi, (v, xi) = self._displacement(self.at), self.split(self.at)[1], test or self._test
        frozen = {False: self._displacement(secant_at), True: self._displacement(history_at)}
        stresses = [
            sum(
                (sign * functions) * secant_form(law, u_0, u, v, kinematics) * dx
                if piezo is None
                else (sign * functions)
                * symmetrised_form(law, piezo, u_0, u, phi, v, xi, kinematics)
                * dx
                for sign, kinematics in terms
            )
            for law, piezo, dx, terms in self._integrals
            for u_0 in [frozen[isinstance(law, QuadratureLaw)]]
        ]
        return stresses + [functions * form for form in self._supported(u, v)]

    def _displacement(self, at: fem.Function) -> Expr:
        """Return the displacement of unknowns `at` or `secant_at`, with the jumps across cuts."""
        u = self.split(at)[0]
        if self._cuts is None:
            return u
        return u + (self._cuts.jump if at is self.at else self._cuts.secant_jump)

    # Of cuts: the section forces, and the derivatives of all forces by shortenings.

    def _across(self, k: int) -> tuple[Expr, Expr | None]:
        """Return the test function of a shortening."""
        assert self._cuts is not None
        none = None if self._body.piezo is None else fem.Constant(self._mesh, 0.0)
        return self._cuts.directions[k], none

    def put(self, nodal: Array, q: Array, secant: bool = False) -> None:
        """Put unknowns of the nodes, and the global ones, into `at` or `secant_at`."""
        (self.secant_at if secant else self.at).x.array[:] = nodal.ravel()
        if self._cuts is not None:
            self._cuts.set(self._cuts.secant_jump if secant else self._cuts.jump, q)

    def on_global(self, size: int, secant: bool = False) -> Array:
        """Return the forces of the stresses on the global unknowns, shape (m,). Collective.

        Those of elastic supports are among them.
        """
        found = np.zeros(size)
        if self._cuts is not None:
            forms = self._secant_section_forces if secant else self._section_forces
            found[self._cuts.places] = [self._sum(own) for own in forms]
        return found

    def border(self, kind: str, owned: int, size: int) -> tuple[Array, Array] | None:
        """Return the derivatives by global unknowns; None without cuts. Collective.

        Parameters
        ----------
        kind
            "secant", or of the law itself.
        owned, size
            Numbers of owned unknowns of the nodes, and of global ones.

        Returns
        -------
        Those of the forces on the nodes, shape (owned, m), and on the global unknowns, (m, m).
        """
        if self._cuts is None:
            return None
        frozen = kind == "secant" or self._body.linear
        own, across = self._secant_border if frozen else self._border
        columns, corner = np.zeros((owned, size)), np.zeros((size, size))
        for k, place in enumerate(self._cuts.places):
            columns[:, place] = sum(assembled(form, owned) for form in own[k])
            corner[self._cuts.places, place] = [self._sum(row[k]) for row in across]
        return columns, corner

    def _sum(self, forms: list[fem.Form]) -> float:
        """Return the sum of functionals over all ranks. Collective."""
        own = sum(fem.assemble_scalar(form) for form in forms)
        return float(lasting(self._mesh.comm).allreduce(own, op=MPI.SUM))

    @cached_property
    def _section_forces(self) -> list[list[fem.Form]]:
        return self._forces_across(self.at)

    @cached_property
    def _secant_section_forces(self) -> list[list[fem.Form]]:
        return self._forces_across(self.secant_at)

    def _forces_across(self, at: fem.Function) -> list[list[fem.Form]]:
        assert self._cuts is not None
        count = range(len(self._cuts.places))
        return [_compiled(self._internal(at, at, self._across(k))) for k in count]

    @cached_property
    def _secant_border(self) -> Any:
        return self._derivatives_by_jumps(self.secant_at)

    @cached_property
    def _border(self) -> Any:
        return self._derivatives_by_jumps(self.at)

    def _derivatives_by_jumps(self, secant_at: fem.Function) -> Any:
        cuts = self._cuts
        assert cuts is not None

        def along(forms: list[ufl.Form], k: int) -> list[fem.Form]:
            return _compiled(
                [ufl.derivative(form, cuts.jump, cuts.directions[k]) for form in forms]
            )

        count = range(len(cuts.places))
        own = self._internal(secant_at, secant_at)
        return [along(own, k) for k in count], [
            [along(self._internal(secant_at, secant_at, self._across(j)), k) for k in count]
            for j in count
        ]

    def _supported(self, u: Expr, v: Expr) -> list[Any]:
        """Return the work of each elastic support, against the displacement u, along v."""
        return [
            sum((k * u[i] * v[i] for i, k in enumerate(parts)), normal * along) * ds
            for parts, normal, ds in self._elastic
            for along in [ufl.dot(u, self._normal) * ufl.dot(v, self._normal)]
        ]

    @cached_property
    def elastic_forces(self) -> list[fem.Form]:
        """Forces of each elastic support against the displacement `at`."""
        u, (v, _) = self._displacement(self.at), self._test
        return [compiled(form) for form in self._supported(u, v)]

    # For each function of a form dolfinx packs the values in all cells: with the law itself those
    # of one.

    @cached_property
    def law_forces(self) -> list[fem.Form]:
        """Forces at `at`, as those below by quadrature rule."""
        return _compiled(self._internal(self.at, self.at))

    @cached_property
    def secant_forces(self) -> list[fem.Form]:
        """Forces at `at` with the secant modulus at `secant_at`."""
        return _compiled(self._internal(self.secant_at, self.secant_at))

    @cached_property
    def secant(self) -> list[fem.Form]:
        """Kacanov's matrix at `secant_at`."""
        # The derivative, for with a history the forces are affine.
        return self._derivative(self._internal(self.secant_at, self.secant_at))

    @cached_property
    def pattern(self) -> fem.Form:
        """A form over all cells, with the pattern of the matrices."""
        if len(self._integrals) == 1:
            return self.secant[0]
        return fem.form(ufl.inner(self._trial, ufl.TestFunction(self.at.function_space)) * ufl.dx)

    @cached_property
    def tangent(self) -> list[fem.Form]:
        """Newton's matrix at `at`."""
        if self._body.linear:
            return self.secant
        return self._derivative(self._internal(self.at, self.secant_at))

    def _derivative(self, forces: list[ufl.Form]) -> list[fem.Form]:
        """Compile the derivative of forces by `at`, all else being frozen."""
        return _compiled([ufl.derivative(form, self.at, self._trial) for form in forces])


def _compiled(forms: Sequence[ufl.Form]) -> list[fem.Form]:
    """Compile forms that add up."""
    return [compiled(form) for form in forms]
