"""From the sections about contact to obstacles, friction, layers and conductors."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.body.amplitude import steady
from contact.body.norms import volume
from contact.building.given import NodalField, amplitude, given_field
from contact.case import file as sections
from contact.case.formula import Expression
from contact.errors import InputError
from contact.interface.current import Conductor
from contact.interface.friction import Friction
from contact.interface.layer import Layer
from contact.interface.obstacle import GapFunction, Obstacle
from contact.mesh.domain import Domain
from contact.problem.contact import Contact
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

#: Width of the ramp of psi over the height of the body.
RAMP = 0.1


def make_contacts(
    case: sections.Case,
    domain: Domain,
    coefficient: FrictionCoefficient | None = None,
    friction: FrictionLaw | None = None,
    foundation: Obstacle | None = None,
    layer: Layer | None = None,
) -> list[Contact]:
    """Return the contacts of a case.

    Parameters
    ----------
    case, domain
        The case and its mesh.
    coefficient, friction, foundation, layer
        Objects that replace those of the case, where it has one contact.

    Raises
    ------
    InputError
        If there are replacements for one of several contacts.
    """
    given = foundation, layer, coefficient, friction
    if len(case.contacts) > 1 and any(replacement is not None for replacement in given):
        raise InputError(
            "contact: foundation, layer, coefficient and friction given beside the case "
            "replace those of one contact, not of several"
        )
    return [
        Contact(
            contact.on,
            _foundation(key, contact, domain) if foundation is None else foundation,
            _layer(contact) if layer is None else layer,
            _friction(*case.friction_of(key, contact), domain.comm, coefficient, friction),
            _conductor(case, case.electric_of(key, contact)[1], domain, contact.on),
            contact.overlap == "press",
            contact.against,
        )
        for key, contact in case.contacts
    ]


def _foundation(key: str, section: sections.Contact, domain: Domain) -> Obstacle:
    if section.foundation is not None:
        return section.foundation.obstacle(section.direction, section.axis or ())
    assert section.gap is not None  # filled in by the section
    return GapFunction(NodalField(f"{key}.gap", section.gap, domain.comm).numpy)


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
    key: str,
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
        return Friction(tresca=given_field(f"{key}.bound", section.bound, comm, 0.0))
    mu = section.mu
    assert mu is not None  # demanded by the section
    if not isinstance(mu, Expression):
        return Friction(law=mu.friction(), radius=section.radius)
    if mu.is_constant:
        return Friction(ConstantCoefficient(mu.value), radius=section.radius)
    field = NodalField(f"{key}.mu", mu, comm, 0.0)
    return Friction(mu=field, radius=section.radius)


def conduction_ramp(domain: Domain, part: str) -> float:
    """Return how far in front of a foundation it conducts by default (length). Collective.

    A tenth of the body's height over its contact part: of a length of the problem, so that
    refined meshes resolve it and solutions have a limit. A fixed small number of the thesis's
    delta means a wide ramp too.
    """
    height = volume(domain, domain.dx) / volume(domain, domain.ds(part))
    return RAMP * min(height, domain.size)


def _conductor(
    case: sections.Case, section: sections.Electric | None, domain: Domain, part: str
) -> Conductor | None:
    if section is None:
        return None
    delta = section.delta or 1 / conduction_ramp(domain, part)
    psi: Conductivity
    if section.law == "shifted":
        psi = ShiftedConductivity(section.k_e, delta)
    elif section.law == "ramp":
        psi = RampConductivity(section.k_e, delta)
    else:
        psi = PerfectConductivity(section.k_e)
    limit = np.inf if section.limit is None else section.limit
    phi_f, truncation = section.phi_f, Truncation(limit)
    if phi_f.is_constant and section.amplitude is None:
        return Conductor(psi, phi_f.value, truncation, section.lagged)
    factor = amplitude(case, section.amplitude) or steady

    def phi_f_at(time: float) -> float:
        """Return the potential of the foundation at a time."""
        return factor(time) * phi_f.number(time)

    return Conductor(psi, phi_f_at(0.0), truncation, section.lagged, phi_f_at)
