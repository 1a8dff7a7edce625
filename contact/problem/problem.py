"""A contact problem: body, loads, foundation and friction put together, and its weak forms.

Unknowns are held in one blocked Lagrange space: d displacement components a node and, for a
piezoelectric body, the potential divided by `phi_scale` = sqrt(mu1/beta). In these units both
blocks of the operator have the same size, whatever the unit system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from mpi4py import MPI
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact.errors import InputError
from contact.interface.held_current import HeldCurrent, held_current
from contact.interface.nodes import build_trace, candidates, free_components
from contact.interface.obstacle import Foundation
from contact.interface.response import Conductor, FoundationResponse, Layer
from contact.interface.smoothing import Smoothing
from contact.mesh.make import Domain
from contact.typing import Array
from forms.hencky import Hencky, Linear, secant_form
from forms.laws import ConstantCoefficient, FrictionCoefficient
from forms.piezo import Piezo, electric_load, symmetrised_form


class Field(Protocol):
    """A given function of position, for instance `contact.case.formula.Expression`."""

    def ufl(self, x: Expr) -> Expr:
        """Return the function as a UFL expression of the coordinates."""

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""


@dataclass(frozen=True)
class Fixed:
    """Prescribed values on a part; None leaves a component free."""

    on: str
    displacement: Sequence[Field | None] | None = None
    potential: Field | None = None


@dataclass(frozen=True)
class Load:
    """Given forces and charges: on a part, or in the whole body where `on` is None.

    Attributes
    ----------
    force
        Traction (force/area) on a part, body force (force/volume) in the body.
    pressure
        Pressure against the outward normal of the part (force/area).
    charge
        Surface charge q_2 = D.nu on a part, body charge q_0 in the body.
    """

    on: str | None
    force: Sequence[Field] | None = None
    pressure: Field | None = None
    charge: Field | None = None


@dataclass(frozen=True)
class Contact:
    """The part that may touch, the obstacle, and the compliant layer in front of it."""

    on: str
    foundation: Foundation
    layer: Layer | None = None


@dataclass(frozen=True)
class Friction:
    """Friction on the contact part, (1.36)-(1.38).

    Attributes
    ----------
    coefficient
        Coulomb's mu(|u_tau|); None without Coulomb friction.
    tresca
        A fixed bound S (stress), used instead of mu times the pressure.
    radius
        Radius of the smoothing operator R; 0 for R = identity.
    mu
        Coulomb's mu as a function of position, instead of `coefficient`.
    """

    coefficient: FrictionCoefficient | None = None
    tresca: Field | None = None
    radius: float = 0.0
    mu: Field | None = None


@dataclass(frozen=True)
class Body:
    """Material and supports.

    Attributes
    ----------
    law
        Hencky law of the stress.
    piezo
        Piezoelectric tensors in the body's axes, or None.
    """

    law: Hencky
    fixed: Sequence[Fixed]
    loads: Sequence[Load] = field(default_factory=tuple)
    piezo: Piezo | None = None


class ContactProblem:
    """Weak forms, boundary conditions and contact trace of one problem.

    Parameters
    ----------
    domain
        Mesh and named parts.
    body
        Material, supports and loads.
    contact
        Contact part and foundation.
    friction
        Friction law; none by default.
    conductor
        Electric contact; None for an insulated foundation.
    degree
        Degree of the Lagrange elements, 1 or 2.

    Attributes
    ----------
    x
        The current iterate: displacement, and potential / phi_scale.
    secant, tangent
        Compiled bilinear forms at the iterate: Kacanov's and Newton's.

    Raises
    ------
    InputError
        If a part is missing, a vector has the wrong length, nothing can touch, or the laws of
        the layer are none.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        contact: Contact,
        friction: Friction | None = None,
        conductor: Conductor | None = None,
        degree: int = 1,
    ) -> None:
        self.domain, self.body, self.contact = domain, body, contact
        self.friction, self.degree = friction or Friction(), degree
        self.dim = domain.dim
        self.piezoelectric = body.piezo is not None
        self.block_size = self.dim + self.piezoelectric
        mesh = domain.mesh
        self.space = fem.functionspace(mesh, ("Lagrange", degree, (self.block_size,)))
        self.x = fem.Function(self.space, name="x")
        self._frozen = fem.Function(self.space, name="frozen")
        self.phi_scale = 1.0
        if body.piezo is not None:
            _check_piezo(body.piezo, self.dim)
            permittivity = float(np.trace(np.asarray(body.piezo.beta))) / 3
            self.phi_scale = float(np.sqrt(body.law.shear / permittivity))
        self.bcs = self._dirichlet()
        self.free = free_components(self.space, self.bcs)
        self._compile()

        if contact.layer is not None:
            contact.layer.check(domain.size)
        trace = build_trace(domain, self.space, self.bcs, contact.on, contact.foundation)
        scale = float(body.law.young) / domain.size
        self.response = FoundationResponse(trace, contact.layer, conductor, self.phi_scale, scale)
        self.trace = self.response.constrained_trace
        if self.friction.mu is not None:
            nodal = ConstantCoefficient(np.asarray(self.friction.mu.numpy(self.trace.points)))
            self.friction = replace(self.friction, coefficient=nodal)
        self.smoothing = Smoothing(self.trace, self.friction.radius)
        self.held: HeldCurrent | None = None
        if conductor is not None and self.piezoelectric:
            self.held = held_current(
                candidates(domain, self.space, contact.on),
                contact.foundation,
                self.free,
                self.trace,
                conductor,
                self.phi_scale,
            )
        self.tresca = None
        if self.friction.tresca is not None:
            self.tresca = np.asarray(self.friction.tresca.numpy(self.trace.points), dtype=float)

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.domain.comm

    @property
    def linear_material(self) -> bool:
        """Whether the bulk operator is constant."""
        return isinstance(self.body.law, Linear)

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""
        return float(np.sqrt(self.comm.allreduce(np.dot(values, values), op=MPI.SUM)))

    @property
    def frictional(self) -> bool:
        """Whether a tangential force can act."""
        return self.friction.coefficient is not None or self.tresca is not None

    @property
    def unknowns(self) -> Array:
        """The iterate: nodal unknowns of this rank, those of the ghosts behind its own."""
        return self.x.x.array

    @property
    def load_size(self) -> float:
        """Euclidean norm of the nodal loads. Collective."""
        return self.norm(self.external)

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""
        return self.free.size

    @property
    def largest_prescribed(self) -> float:
        """Largest component of a prescribed displacement, at the whole load. Collective."""
        values = np.zeros_like(self.x.x.array)
        for bc in self.bcs:
            bc.set(values)
        displacements = values.reshape(-1, self.block_size)[:, : self.dim]
        largest = float(np.abs(displacements).max(initial=0.0))
        return float(self.comm.allreduce(largest, op=MPI.MAX))

    def parts_of(self, x: Any) -> tuple[Expr, Expr | None]:
        """Split a function or argument into displacement and scaled-back potential."""
        u = ufl.as_vector([x[i] for i in range(self.dim)])
        return u, (self.phi_scale * x[self.dim] if self.piezoelectric else None)

    def _dirichlet(self) -> list[fem.DirichletBC]:
        bcs, mesh = [], self.domain.mesh
        mesh.topology.create_connectivity(self.dim - 1, self.dim)
        for fixed in self.body.fixed:
            given: list[Field | None] = [None] * self.dim
            if fixed.displacement is not None:
                if len(fixed.displacement) != self.dim:
                    raise InputError(
                        f"fixed on {fixed.on!r}: displacement has {len(fixed.displacement)} "
                        f"components, the body has {self.dim}"
                    )
                given = list(fixed.displacement)
            if fixed.potential is not None:
                if not self.piezoelectric:
                    raise InputError(
                        f"fixed on {fixed.on!r}: a potential needs a piezoelectric material"
                    )
                given.append(fixed.potential)
            facets = self.domain.facets(fixed.on)
            for component, value in enumerate(given):
                if value is not None:
                    bcs.append(self._component_bc(component, facets, value))
        return bcs

    def _component_bc(
        self, component: int, facets: NDArray[np.int32], value: Field
    ) -> fem.DirichletBC:
        scale = self.phi_scale if component == self.dim else 1.0
        subspace = self.space.sub(component)
        scalar, _ = subspace.collapse()
        data = fem.Function(scalar)
        dofs = fem.locate_dofs_topological((subspace, scalar), self.dim - 1, facets)
        # On the part alone: a formula need not make sense elsewhere.
        points = scalar.tabulate_dof_coordinates()[dofs[1], : self.dim]
        data.x.array[dofs[1]] = np.asarray(value.numpy(points)) / scale
        return fem.dirichletbc(data, dofs, subspace)

    def constant(self, value: float) -> fem.Constant:
        """Return a number as a form constant, so that its value is not compiled in."""
        return fem.Constant(self.domain.mesh, np.float64(value))

    def _compile(self) -> None:
        mesh, d = self.domain.mesh, self.dim
        law = with_constants(self.body.law, self.constant)
        trial, test = ufl.TrialFunction(self.space), ufl.TestFunction(self.space)
        degree = 1 if self.degree == 1 else (2 if self.linear_material else 4)
        dx = self.domain.dx(metadata={"quadrature_degree": degree})
        v, xi = self.parts_of(test)

        def internal(frozen: Any, x: Any) -> ufl.Form:
            u, phi = self.parts_of(x)
            u_0, _ = self.parts_of(frozen)
            if self.body.piezo is None:
                return secant_form(law, u_0, u, v) * dx
            piezo = Piezo(
                fem.Constant(mesh, np.asarray(self.body.piezo.e, dtype=float)),
                fem.Constant(mesh, np.asarray(self.body.piezo.beta, dtype=float)),
            )
            return symmetrised_form(law, piezo, u_0, u, phi, v, xi) * dx

        external = self._external(v, xi, d)
        self._internal = fem.form(internal(self._frozen, self.x))
        self._external_form = fem.form(external) if external is not None else None
        self.secant = fem.form(internal(self._frozen, trial))
        if self.linear_material:
            self.tangent = self.secant
        else:
            self.tangent = fem.form(ufl.derivative(internal(self.x, self.x), self.x, trial))
        self._full_external = self._assemble(self._external_form)
        self.external = self._full_external

    def _external(self, v: Expr, xi: Expr | None, d: int) -> ufl.Form | None:
        """Return the work of loads and charges, equation (5.29), or None without any."""
        x = ufl.SpatialCoordinate(self.domain.mesh)
        total: ufl.Form | None = None
        for load in self.body.loads:
            measure = self.domain.dx if load.on is None else self.domain.ds(load.on)
            terms = []
            if load.force is not None:
                if len(load.force) != d:
                    raise InputError(
                        f"load on {load.on or 'the body'!r}: the force has {len(load.force)} "
                        f"components, the body has {d}"
                    )
                terms += [self.expression(f, x) * v[i] for i, f in enumerate(load.force)]
            if load.pressure is not None:
                nu = ufl.FacetNormal(self.domain.mesh)
                terms.append(-self.expression(load.pressure, x) * ufl.dot(nu, v))
            if load.charge is not None:
                if xi is None:
                    raise InputError(
                        f"load on {load.on or 'the body'!r}: a charge needs a piezoelectric "
                        "material"
                    )
                charge = self.expression(load.charge, x)
                if load.on is None:
                    terms.append(electric_load(xi, body=charge))
                else:
                    terms.append(electric_load(xi, surface=charge))
            for term in terms:
                total = term * measure if total is None else total + term * measure
        return total

    def expression(self, value: Field, x: Expr) -> Expr:
        """Return a given function as UFL; a number becomes a form constant."""
        expression = value.ufl(x)
        if isinstance(expression, int | float | ufl.constantvalue.ScalarValue | ufl.classes.Zero):
            return self.constant(float(expression))
        return expression

    def _assemble(self, form: fem.Form | None) -> Array:
        """Return the owned part of an assembled vector."""
        if form is None:
            return np.zeros(self.owned)
        vector = fem.assemble_vector(form)
        vector.scatter_reverse(InsertMode.add)
        return vector.array[: self.owned].copy()

    def reset(self) -> None:
        """Set the iterate to zero, with the prescribed values.

        Where no potential is prescribed, it starts from that of the conductive foundation, which
        alone determines it: far from phi_F a truncated charge has no derivative.
        """
        self.x.x.array[:] = 0.0
        conductor = self.response.conductor
        if self.piezoelectric and conductor is not None:
            if all(fixed.potential is None for fixed in self.body.fixed):
                potential = self.x.x.array.reshape(-1, self.block_size)[:, -1]
                potential[:] = conductor.phi_f / self.phi_scale
        self._frozen.x.array[:] = 0.0
        self.apply_load(1.0)

    def apply_load(self, factor: float) -> None:
        """Scale loads and prescribed values, and put the latter into the iterate."""
        self.external = factor * self._full_external
        for bc in self.bcs:
            bc.set(self.x.x.array, None, factor)
        self.x.x.scatter_forward()

    def freeze(self) -> None:
        """Take the secant modulus at the current iterate from now on."""
        self._frozen.x.array[:] = self.x.x.array

    def internal_forces(self) -> Array:
        """Return the nodal internal forces of the iterate, with the frozen secant modulus.

        After `freeze` they are those of the material law itself.
        """
        return self._assemble(self._internal)

    def add(self, increment: Array) -> None:
        """Add an increment of the owned unknowns to the iterate. Collective."""
        self.x.x.array[: self.owned] += increment
        self.x.x.scatter_forward()

    def friction_bound(self, pressure: Array, slip: Array) -> Array:
        """Return s = mu(|u_tau|) |R p|, Tresca's S, or 0, at the owned contact nodes."""
        if self.tresca is not None:
            return np.broadcast_to(self.tresca, slip.shape)
        if self.friction.coefficient is None:
            return np.zeros_like(slip)
        smooth = np.maximum(self.smoothing(pressure), 0.0)
        return self.friction.coefficient(slip) * smooth


def _check_piezo(piezo: Piezo, dim: int) -> None:
    try:
        piezo.check()
        if dim == 2:
            piezo.check_plane()
    except ValueError as error:
        raise InputError(f"piezoelectric material: {error}") from error


def with_constants(law: Hencky, constant: Any) -> Hencky:
    """Return a law with form constants for its numbers, so that forms compile once a law."""
    if not is_dataclass(law) or getattr(law, "g_min", 0.0) > 0:
        return law
    numbers = {
        f.name: constant(getattr(law, f.name))
        for f in fields(law)
        if f.name != "g_min" and isinstance(getattr(law, f.name), int | float)
    }
    return replace(law, **numbers)
