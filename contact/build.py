"""From a case to a contact problem."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.blame import to_blame
from contact.body.description import Body, Fixed, Load, Material
from contact.case import file as sections
from contact.case.formula import Expression
from contact.errors import InputError
from contact.interface.current import Conductor
from contact.interface.friction import Friction
from contact.interface.layer import Layer
from contact.interface.obstacle import GapFunction, Obstacle
from contact.mesh.domain import Domain
from contact.meshing import make_domain
from contact.problem.held import check_held
from contact.problem.problem import Contact, ContactProblem
from contact.tolerances import HUGE
from contact.typing import Array
from forms.hencky import Hencky, Linear, Log
from forms.laws import (
    Compliance,
    Conductivity,
    ConstantCoefficient,
    FrictionCoefficient,
    FrictionLaw,
    PerfectConductivity,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)
from forms.piezo import Piezo, from_voigt


def build_problem(
    case: sections.Case,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    domain: Domain | None = None,
    law: Hencky | None = None,
    coefficient: FrictionCoefficient | None = None,
    friction: FrictionLaw | None = None,
    foundation: Obstacle | None = None,
    layer: Layer | None = None,
) -> ContactProblem:
    """Build the problem that a case describes. Collective.

    Parameters
    ----------
    case
        The case.
    comm
        Communicator of the mesh.
    domain, law, coefficient, friction, foundation, layer
        Objects that replace the case's mesh, material law, Coulomb's mu(|u_tau|) or the whole
        friction law, foundation and compliant layer (own p_nu and h_nu).

    Raises
    ------
    InputError
        If the case does not fit the mesh, a formula has no value at a node or a wrong sign,
        or the body is not held.
    """
    with named(case.source):
        domain = make_domain(case.mesh, comm) if domain is None else domain
        _check_range("mesh", domain.size)
        case.check_mesh(domain.dim, domain.names)
        _check_loads(case, domain)
        body = Body.piecewise(
            _materials(case, domain.dim, law),
            [_fixed(i, fixed, domain.comm) for i, fixed in enumerate(case.fixed)],
            [_load(i, load, domain.comm) for i, load in enumerate(case.load)],
        )
        obstacle = _foundation(case.contact, domain) if foundation is None else foundation
        problem = ContactProblem(
            domain,
            body,
            Contact(case.contact.on, obstacle, _layer(case.contact) if layer is None else layer),
            _friction(case.friction, domain.comm, coefficient, friction),
            None if case.electric is None else _conductor(case.electric, domain.size),
            case.space.degree,
        )
        loads = problem.equilibrium.external()
        finite = bool(np.isfinite(loads).all())
        if not domain.comm.allreduce(finite, op=MPI.LAND):
            key = to_blame(body.loads, domain)
            raise InputError(f"{key}: a formula is not finite everywhere on its part")
        largest = float(np.abs(loads).max(initial=0.0))
        largest = domain.comm.allreduce(largest, op=MPI.MAX)
        if largest > HUGE:
            _check_range(to_blame(body.loads, domain), largest)
        check_held(problem)
    return problem


def _check_range(key: str, value: float, least: float = 1 / HUGE) -> None:
    """Refuse a size whose square is no number any more, or nothing."""
    if not least <= value <= HUGE:
        raise InputError(
            f"{key}: a size of {value:.3g} leads to numbers that overflow; accepted: units that "
            f"keep sizes between {1 / HUGE:g} and {HUGE:g}"
        )


def _check_loads(case: sections.Case, domain: Domain) -> None:
    """Refuse loads on Gamma_3, where the foundation alone acts: Gamma_2 and Gamma_b exclude it."""
    touched = domain.facets(case.contact.on)
    for i, load in enumerate(case.load):
        if load.on is None:
            continue
        shared = bool(np.isin(domain.facets(load.on), touched).any())
        if domain.comm.allreduce(shared, op=MPI.LOR):
            raise InputError(
                f"load.{i}.on: {load.on} shares facets with the contact part {case.contact.on}; "
                "accepted: parts beside it, or body forces"
            )


@contextmanager
def named(source: str) -> Iterator[None]:
    """Let messages name the case file, as those of the case itself do."""
    try:
        yield
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(source) else f"{source}: {text}") from error


@dataclass(frozen=True)
class NodalField:
    """A formula of the case file, evaluated on all ranks together; messages name its key."""

    key: str
    expression: Expression
    comm: MPI.Intracomm
    minimum: float = -np.inf

    def ufl(self, x: Expr) -> Expr:
        """Return the formula as a UFL expression of the coordinates."""
        return self.expression.ufl(x)

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d). Collective."""
        try:
            values = self.expression.numpy(points, self.comm)
        except InputError as error:
            raise InputError(f"{self.key}: {error}") from None
        largest = float(np.abs(values).max(initial=0.0))
        _check_range(self.key, self.comm.allreduce(largest, op=MPI.MAX), least=0.0)
        least = self.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
        if least < self.minimum:
            raise InputError(
                f"{self.key}: {self.expression} is {least:g} at a node; accepted: values >= 0"
            )
        return values


def _materials(case: sections.Case, dim: int, law: Hencky | None) -> list[Material]:
    if law is not None and len(case.materials) > 1:
        raise InputError("law: a law given beside the case replaces one material, not several")
    made = []
    for key, section in case.materials:
        this = material_law(section) if law is None else law
        _check_range(f"{key}.young", float(this.young))
        tensors = None if section.piezo is None else piezo(section.piezo, dim)
        made.append(Material(this, tensors, section.on or ()))
    return made


def material_law(section: sections.Material) -> Hencky:
    """Return the material law of `[material]`."""
    if section.law == "linear":
        return Linear(section.young, section.poisson)
    assert section.yield_strain is not None  # demanded by the section
    return Log(
        section.young,
        section.poisson,
        yield_strain=section.yield_strain,
        argument=section.argument,
        g_min=section.g_min,
    )


def piezo(section: sections.Piezo, dim: int) -> Piezo:
    """Return the piezoelectric tensors of `[material.piezo]` in the axes of the body."""
    material = from_voigt(*section.voigt)
    if dim == 2:
        angle = 90.0 if section.poling is None else float(section.poling)  # type: ignore[arg-type]
        turn = np.deg2rad(angle - 90.0)
        c, s = np.cos(turn), np.sin(turn)
        return material.in_plane().rotated([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    if section.poling is None:
        return material
    return material.poled_along(section.poling)


def _fixed(i: int, section: sections.Fixed, comm: MPI.Intracomm) -> Fixed:
    key = f"fixed.{i}"
    displacement = None
    if section.displacement is not None:
        displacement = [
            NodalField(f"{key}.displacement.{k}", c, comm) if isinstance(c, Expression) else None
            for k, c in enumerate(section.displacement)
        ]
    return Fixed(section.on, displacement, _field(f"{key}.potential", section.potential, comm))


def _load(i: int, section: sections.Load, comm: MPI.Intracomm) -> Load:
    key = f"load.{i}"
    force = section.body_force if section.everywhere else section.traction
    charge = section.body_charge if section.everywhere else section.charge
    names = ("body_force", "body_charge") if section.everywhere else ("traction", "charge")
    along = [NodalField(f"{key}.{names[0]}.{k}", f, comm) for k, f in enumerate(force or ())]
    return Load(
        None if section.everywhere else section.on,
        along or None,
        _field(f"{key}.pressure", section.pressure, comm),
        _field(f"{key}.{names[1]}", charge, comm),
    )


def _field(
    key: str, expression: Expression | None, comm: MPI.Intracomm, minimum: float = -np.inf
) -> NodalField | None:
    return None if expression is None else NodalField(key, expression, comm, minimum)


def _foundation(section: sections.Contact, domain: Domain) -> Obstacle:
    if section.foundation is not None:
        return section.foundation.obstacle(section.direction)
    assert section.gap is not None  # filled in by the section
    rounding = -1e-12 * domain.size
    return GapFunction(NodalField("contact.gap", section.gap, domain.comm, rounding).numpy)


def _layer(section: sections.Contact) -> Layer | None:
    if section.law == "signorini":
        return None
    # Filled in by the section.
    assert section.layer is not None
    assert section.limit is not None
    assert section.stiffness is not None
    assert section.potential_factor is not None
    assert section.potential_range is not None
    factor = PotentialFactor(section.stiffness, section.potential_factor, section.potential_range)
    return Layer(section.layer, Compliance(section.limit), factor, section.lagged)


def _friction(
    section: sections.Friction,
    comm: MPI.Intracomm,
    coefficient: FrictionCoefficient | None,
    law: FrictionLaw | None,
) -> Friction:
    if law is not None:
        return Friction(law=law, radius=section.radius)
    if coefficient is not None:
        return Friction(coefficient, radius=section.radius)
    if section.law == "none":
        return Friction()
    if section.law == "tresca":
        return Friction(tresca=_field("friction.bound", section.bound, comm, 0.0))
    mu = section.mu
    assert mu is not None  # demanded by the section
    if not isinstance(mu, Expression):
        return Friction(law=mu.friction(), radius=section.radius)
    if mu.is_constant:
        return Friction(ConstantCoefficient(mu.value), radius=section.radius)
    field = NodalField("friction.mu", mu, comm, 0.0)
    return Friction(mu=field, radius=section.radius)


def _conductor(section: sections.Electric, size: float) -> Conductor:
    delta = 1e3 / size if section.delta is None else section.delta
    psi: Conductivity
    if section.law == "shifted":
        psi = ShiftedConductivity(section.k_e, delta)
    elif section.law == "ramp":
        psi = RampConductivity(section.k_e, delta)
    else:
        psi = PerfectConductivity(section.k_e)
    limit = np.inf if section.limit is None else section.limit
    return Conductor(psi, section.phi_f, Truncation(limit), section.lagged)
