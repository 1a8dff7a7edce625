"""From a case to a contact problem."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from contact.body.description import Body, Fixed, Load
from contact.building.contacts import make_contacts
from contact.building.given import amplitude, loading_field
from contact.building.materials import make_materials
from contact.building.meshing import make_domain
from contact.building.moving import make_electrodes, make_rigid
from contact.case import file as sections
from contact.case.replaced import check_replaced
from contact.errors import InputError
from contact.interface.layer import Layer
from contact.interface.obstacle import Obstacle
from contact.kinds import check_range
from contact.mesh.domain import Domain
from contact.mesh.revolution import revolved
from contact.problem.consistent import check_problem, check_supports
from contact.problem.problem import ContactProblem
from forms.hencky import Law
from forms.laws import FrictionCoefficient, FrictionLaw

#: Arguments of `build_problem` that replace parts of a case.
REPLACEMENTS = ("domain", "law", "coefficient", "friction", "foundation", "layer")


def build_problem(
    case: sections.Case,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    domain: Domain | None = None,
    law: Law | None = None,
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
        given = {"domain": domain, "law": law, "coefficient": coefficient, "friction": friction}
        check_replaced(case.filled, given)
        domain = make_domain(case.mesh, comm) if domain is None else domain
        if case.space.kinematics == "axisymmetric":
            domain = revolved(domain)
        check_range("mesh", domain.size)
        case.check_mesh(domain.dim, domain.names)
        body = Body(
            make_materials(case, domain, law),
            [_fixed(case, i, domain.comm) for i in range(len(case.fixed))],
            [_load(case, i, domain.comm) for i in range(len(case.load))],
            rigid=make_rigid(case, domain.dim),
            electrodes=make_electrodes(case),
        )
        contacts = make_contacts(case, domain, coefficient, friction, foundation, layer)
        problem = ContactProblem(domain, body, contacts, degree=case.space.degree)
        for time in (1.0,) if case.evolution is None else case.evolution.times[1:]:
            check_problem(problem.at(time))
        for time in () if case.evolution is None else case.evolution.ends:
            check_supports(problem.at(time))
    return problem


@contextmanager
def named(source: str) -> Iterator[None]:
    """Let messages name the case file, as those of the case itself do."""
    try:
        yield
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(source) else f"{source}: {text}") from error


def _fixed(case: sections.Case, i: int, comm: MPI.Intracomm) -> Fixed:
    key, section = f"fixed.{i}", case.fixed[i]
    displacement = None
    if section.displacement is not None:
        displacement = [
            loading_field(f"{key}.displacement.{k}", component, comm)
            for k, component in enumerate(section.displacement)
        ]
    potential = loading_field(f"{key}.potential", section.potential, comm)
    return Fixed(section.on, displacement, potential, amplitude(case, section.amplitude))


def _load(case: sections.Case, i: int, comm: MPI.Intracomm) -> Load:
    key, section = f"load.{i}", case.load[i]
    force = section.body_force if section.everywhere else section.traction
    charge = section.body_charge if section.everywhere else section.charge
    names = ("body_force", "body_charge") if section.everywhere else ("traction", "charge")
    along = [loading_field(f"{key}.{names[0]}.{k}", f, comm) for k, f in enumerate(force or ())]
    return Load(
        None if section.everywhere else section.on,
        [component for component in along if component is not None] or None,
        loading_field(f"{key}.pressure", section.pressure, comm),
        loading_field(f"{key}.{names[1]}", charge, comm),
        amplitude(case, section.amplitude),
    )
