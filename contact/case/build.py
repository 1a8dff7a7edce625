"""From a case to a contact problem."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypedDict, TypeVar

from mpi4py import MPI

from contact.arguments import check_range
from contact.case.checks import check_mesh
from contact.case.file import Case
from contact.errors import InputError
from contact.mesh.domain import Domain, revolved
from contact.model.body import Body, Bolt, Electrode, Fixed, Load
from contact.model.contact import Contact
from contact.model.foundation import Electric, Layer
from contact.model.friction import Friction
from contact.model.material import Material
from contact.model.obstacle import Obstacle
from contact.model.rigid import Motion, Rigid
from contact.problem.checks import check_problem, check_supports
from contact.problem.problem import ContactProblem
from forms.hencky import Law
from forms.laws import FrictionCoefficient, FrictionLaw

Given = TypeVar("Given", Fixed, Load, Electrode, Bolt, Motion, Rigid, Electric)


class Replacements(TypedDict, total=False):
    """Objects that take the place of parts of a case, as `build_problem` takes them by name."""

    domain: Domain | None
    law: Law | None
    coefficient: FrictionCoefficient | None
    friction: FrictionLaw | Friction | None
    foundation: Obstacle | None
    layer: Layer | None


#: Their names.
REPLACEMENTS = tuple(Replacements.__annotations__)


def build_problem(
    case: Case,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    domain: Domain | None = None,
    law: Law | None = None,
    coefficient: FrictionCoefficient | None = None,
    friction: FrictionLaw | Friction | None = None,
    foundation: Obstacle | None = None,
    layer: Layer | None = None,
    refined: bool = False,
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
        friction or its law, foundation and compliant layer (own p_nu and h_nu).
    refined
        Whether a finer mesh is to follow, as with `[mesh.adapt]`: a press of a shape within a facet
        is not refused then.

    Returns
    -------
    The problem, with the loads of time 1.

    Raises
    ------
    InputError
        If the case does not fit the mesh, a formula has no value at a node or a wrong sign,
        or a rigid-body mode is not constrained.
    """
    with naming_case(case.source):
        if domain is None:
            if case.mesh is None:
                raise _missing("mesh", "domain")
            domain = case.mesh.build(comm)
        if case.space.kinematics == "axisymmetric":
            domain = revolved(domain)
        elif domain.revolved:
            accepted = 'space.kinematics = "axisymmetric", or a mesh that is not revolved'
            raise InputError(
                f"domain: given a body of revolution; accepted: {accepted}", "axisymmetric"
            )
        check_range("mesh", domain.size)
        check_mesh(case, domain.dim, domain.names)
        body = Body(
            _materials(case, domain, law),
            [_acting(case, fixed) for fixed in case.fixed],
            [_acting(case, load) for load in case.load],
            elastic=case.elastic,
            rigid=[_acting(case, part) for part in case.rigid],
            electrodes=[_acting(case, electrode) for electrode in case.electrode],
            bolts=[_acting(case, bolt) for bolt in case.bolt],
        )
        contacts = _contacts(case, foundation, layer, coefficient, friction)
        problem = ContactProblem(
            domain, body, contacts, degree=case.space.degree, element=case.space.element
        )
        times = (1.0,) if case.evolution is None else case.evolution.times[1:]
        check_problem(problem, times, refined=refined or case.adapt is not None)
        for time in () if case.evolution is None else case.evolution.ends:
            check_supports(problem.at(time))
    return problem


@contextmanager
def naming_case(source: str) -> Iterator[None]:
    """Let messages name the case file, as those of the case itself do."""
    try:
        yield
    except InputError as error:
        own = error.words.startswith(source)
        raise error.within("" if own else f"{source}: ") from error


def _missing(key: str, argument: str) -> InputError:
    """Return the error for a section that neither the case nor an argument gives."""
    accepted = f"[{key}] in the case, or {argument}=... in Python"
    return InputError(f"{key}: missing; accepted: {accepted}", "missing")


def _materials(case: Case, domain: Domain, law: Law | None) -> list[Material]:
    """Return the materials of a case in the axes of the body."""
    if law is not None and len(case.materials) > 1:
        raise InputError(
            "law: a law given beside the case replaces one material, not several", "replaces-one"
        )
    materials, made = case.materials, []
    if not materials:
        if law is None:
            raise _missing("material", "law")
        materials = (("material", Material(law)),)
    for key, section in materials:
        if domain.revolved:
            section.check_revolved(key)
        if law is not None:
            section = Material(law, section.in_body(domain.dim).piezo, section.on or ())
        check_range(f"{key}.young", float(section.law.young))
        thin = case.space.kinematics == "plane_stress"
        try:
            made.append(section.plane_stress() if thin else section.in_body(domain.dim))
        except InputError as error:
            raise error.within(f"{key}.") from None
    return made


def _acting(case: Case, given: Given) -> Given:
    """Return a support, a load and the like with the function of its amplitude."""
    return given.model_copy(update={"amplitude": case.amplitude(given.amplitude)})


def _contacts(
    case: Case,
    foundation: Obstacle | None,
    layer: Layer | None,
    coefficient: FrictionCoefficient | None,
    law: FrictionLaw | Friction | None,
) -> list[Contact]:
    """Return the contacts of a case; objects replace those of its only one."""
    replaced = any(given is not None for given in (coefficient, law, foundation, layer))
    if len(case.contacts) > 1 and replaced:
        raise InputError(
            "contact: foundation, layer, coefficient and friction given beside the case "
            "replace those of one contact, not of several",
            "replaces-one",
        )
    made = []
    for key, contact in case.contacts:
        friction = contact.friction or case.friction or Friction()
        _, electric = case.electric_of(key, contact)
        if isinstance(law, Friction):
            friction = law
        elif coefficient is not None or law is not None:
            friction = Friction(coefficient, radius=friction.radius, law=law)
        if electric is not None and electric.amplitude is not None:
            electric = _acting(case, electric)
        rigid = None if contact.rigid is None else _acting(case, contact.rigid)
        given: dict[str, Any] = {"friction": friction, "electric": electric, "rigid": rigid}
        if foundation is not None:
            given |= {"foundation": foundation, "direction": "foundation"}
            given |= dict.fromkeys(("gap", "axis"))
        if layer is not None:
            given |= {"law": "compliance", "layer": layer}
        made.append(contact.model_copy(update=given))
    return made
