"""Checks of a case that concern several sections, with and without the mesh."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

from contact.body.elements import needed
from contact.errors import nearest, shown
from contact.mesh.domain import meet, members
from contact.model.body import ZERO, Bolt, Electrode, Fixed, Load
from contact.model.fields import CONSTANT
from contact.model.formula import Expression
from contact.model.messages import listed
from contact.model.rigid import Motion
from contact.model.section import Spatial, walk
from contact.model.units import SYSTEMS, labels_of, other_label
from contact.settings import Words, fault

#: `contact.case.file.Case`, which calls these checks.
Case: TypeAlias = Any

#: Quantities that the constants of a material have: elastic, and piezoelectric.
ELASTIC, ELECTRIC = ("length", "stress"), ("length", "stress", "potential", "charge")

#: Ends of the paths of names of parts.
PARTS = (".on", ".against")


def check_sections(case: Case) -> None:
    """Raise a fault if sections contradict each other."""
    for path, value in walk(case):
        if isinstance(value, Expression) and "t" in value.names:
            case.require(case.evolution, path, "a formula in t with [evolution] only")
        if path.endswith(".amplitude") and isinstance(value, str):
            _check_amplitude(case, path, value)
    _check_regions(case)
    _check_units(case)
    piezoelectric = any(material.piezoelectric for _, material in case.materials)
    if piezoelectric:
        _check_potential(case)
    else:
        _check_mechanical(case)
    _check_contacts(case)
    _check_rigid(case)
    fits = case.evolution is None or not getattr(case.solver, "nested", False)
    case.require(fits, "solver.nested", "nested = false with [evolution]")
    mesh = case.mesh
    if mesh is not None and mesh.shape is not None:
        accepted = needed(case.space.element, case.space.degree, mesh.shape)
        case.require(accepted is None, "space.element", accepted)
    if case.space.kinematics == "plane_stress":
        _check_plane_stress(case)
    if mesh is not None and mesh.dimension is not None:
        check_mesh(case, mesh.dimension, [*mesh.sides, *mesh.parts, *mesh.inside])


def _check_plane_stress(case: Case) -> None:
    """Raise a fault if no stress acts across the body, and an element or a law does not fit."""
    accepted = '"standard" in plane stress, where nothing locks'
    case.require(case.space.element == "standard", "space.element", accepted, "plane-stress")
    for key, material in case.materials:
        fits = material.kind in ("linear", "anisotropic") or not material.piezoelectric
        accepted = '"linear" or "anisotropic" in plane stress with piezoelectric constants'
        case.require(fits, f"{key}.law", accepted, "plane-stress")


def check_mesh(case: Case, dimension: int, parts: Iterable[str]) -> None:
    """Raise a fault if a case does not fit its mesh."""
    known = sorted(parts)
    for path, section in case.sections(Motion):
        section.check_dimension(dimension, f"{path}.")
    for path, value in walk(case):
        fits = not isinstance(value, Spatial) or len(value) == dimension
        case.require(fits, path, f"{dimension} components in {dimension}-D")
        fits = dimension == 3 or not isinstance(value, Expression) or "z" not in value.names
        case.require(fits, path, "formulas in x and y in 2-D", "formula-variable")
        if path.endswith(PARTS) and isinstance(value, str):
            for name in members(value):
                if name not in known:
                    accepted = f"a part of the mesh: {listed(known)}{nearest(name, known)}"
                    raise fault(path, name, accepted, "part-name")
    for path, contact in case.contacts:
        only = None if contact.foundation is None else contact.foundation.only
        if only is not None and only != dimension:
            words = Words(f'given "{contact.foundation.shape}" in {dimension}-D')
            raise fault(f"{path}.foundation.shape", words, f"this shape in {only}-D only")
    fits = dimension == 2 or case.space.kinematics == "plane_strain"
    accepted = '"plane_strain" with a mesh in 3-D, where it has no effect'
    case.require(fits, "space.kinematics", accepted)
    fits = dimension == 3 or case.mesh is None or case.mesh.axis is None
    case.require(fits, "mesh.axis", "no axis in 2-D")
    for path, material in case.materials:
        key, poling = material.axis
        fits = poling is None or isinstance(poling, tuple) == (dimension == 3)
        accepted = "an angle in 2-D" if dimension == 2 else "3 numbers in 3-D"
        case.require(fits, f"{path}.{key}", accepted)


def growing(case: Case) -> list[str]:
    """Return the keys of sections whose values grow over the first stage, having no amplitude."""
    if case.evolution is None:
        return []
    found = []
    for path, section in case.sections(Fixed, Load, Electrode, Bolt, Motion):
        values = [v for _, v in walk(section) if isinstance(v, Expression)]
        moves = any("t" in value.names for value in values)
        if section.amplitude is None and not moves and any(value != ZERO for value in values):
            found.append(path)
    return found


def _check_amplitude(case: Case, path: str, name: str) -> None:
    """Raise a fault if there is no amplitude of a name."""
    case.require(case.evolution, path, "an amplitude with [evolution] only")
    known = sorted({*case.evolution.amplitudes, CONSTANT})
    names = f"{listed(known)}{nearest(name, known)}"
    case.require(name in known, path, f"a name below evolution.amplitudes: {names}")


def _check_mechanical(case: Case) -> None:
    """Raise a fault if a body without piezoelectric constants is given electric quantities."""
    accepted = "electric quantities with [material.piezo] only, or a piezoelectric material by name"
    for key, names in (("fixed", ("potential",)), ("load", ("charge", "body_charge"))):
        for i, section in enumerate(getattr(case, key)):
            for name in names:
                fits = getattr(section, name) is None
                case.require(fits, f"{key}.{i}.{name}", accepted, "piezo")
    for path, contact in case.contacts:
        key, electric = case.electric_of(path, contact)
        if electric is not None:
            raise fault(key, Words("given a table"), accepted, "piezo")
    if case.electrode:
        raise fault("electrode", Words("given"), accepted, "piezo")


def _check_potential(case: Case) -> None:
    """Raise a fault if the potential is known but for a constant, or prescribed twice."""
    grounded = [fixed.on for fixed in case.fixed if fixed.potential is not None]
    electric = [case.electric_of(*entry)[1] for entry in case.contacts]
    if not grounded and not any(section is not None and section.k_e > 0 for section in electric):
        accepted = "a potential on at least one part, or [electric] with k_e > 0"
        raise fault("fixed", Words("no potential fixed"), accepted, "ungrounded")
    for i, section in enumerate(case.electrode):
        fits = not any(meet(section.on, other) for other in grounded)
        case.require(fits, f"electrode.{i}.on", "a part whose potential is not fixed")


def _check_contacts(case: Case) -> None:
    """Raise a fault unless each contact is of a part of its own, which can move."""
    _check_once((path, part) for path, one in case.contacts for part in members(one.on))
    for path, contact in case.contacts:
        for i, fixed in enumerate(case.fixed):
            fits = not fixed.is_clamped or {*members(contact.on)} - {*members(fixed.on)}
            case.require(fits, f"{path}.on", f"a part that fixed.{i} does not fix wholly")
        key, electric = case.electric_of(path, contact)
        fits = contact.against is None or electric is None or electric.phi_f == ZERO
        accepted = "0, or none, with against: the other body has a potential of its own"
        case.require(fits, f"{key}.phi_f", accepted)
        # Newton's method linearises layer and charge; it has no previous outer iteration.
        for place, section in ((path, contact), (key, electric)):
            fits = section is None or not section.lagged or case.solver.method != "newton"
            accepted = 'lagged with solver.method = "uzawa" or "penalty"'
            case.require(fits, f"{place}.lagged", accepted)
    for key in ("friction", "electric"):
        own = [getattr(contact, key) is not None for _, contact in case.contacts]
        if all(own) and getattr(case, key) is not None:
            raise fault(
                key, Words(f"beside {key} of every contact"), "one of them", "exclusive-keys"
            )


def _check_regions(case: Case) -> None:
    """Raise a fault unless each of several materials has regions of its own."""
    for path, material in case.materials:
        fits = material.on is not None or len(case.materials) == 1
        case.require(fits, f"{path}.on", "regions for each of several materials")
    _check_once((path, name) for path, one in case.materials for name in one.on or ())


def _check_once(named: Iterable[tuple[str, str]]) -> None:
    """Raise a fault if a part or region, with the path of its section, has two of these."""
    seen: dict[str, str] = {}
    for path, name in named:
        if seen.setdefault(name, path) != path:
            raise fault(f"{path}.on", name, f"one that {seen[name]} does not have")


def _check_rigid(case: Case) -> None:
    """Raise a fault if a part is rigid or an electrode twice, or leaves the axis of revolution."""
    for i, part in enumerate(case.rigid):
        fits = not any(meet(part.on, contact.on) for _, contact in case.contacts)
        case.require(fits, f"rigid.{i}.on", "a part beside the contact part")
    for path, motion in case.sections(Motion):
        if case.space.kinematics == "axisymmetric" and (key := motion.off_axis) is not None:
            accepted = "0 across the axis of a body of revolution, and no rotation"
            raise fault(f"{path}.{key}", Words("given"), accepted, "rigid-part")
    for key in ("rigid", "electrode", "bolt"):
        sections = enumerate(getattr(case, key))
        _check_once((f"{key}.{i}", part) for i, one in sections for part in members(one.on))


def _check_units(case: Case) -> None:
    """Raise a fault unless the materials by name have one system, and the labels are of it."""
    by_name = [entry for entry in case.materials if entry[1].name is not None]
    for path, material in by_name:
        first, other = by_name[0]
        if any(material.system.unit(key) != other.system.unit(key) for key in ELECTRIC):
            words = Words(f"{_units_of(material)}, and {first} has {_units_of(other)}")
            raise fault(f"{path}.units", words, "one system of units for all materials", "units")
        if not isinstance(material.units, str):
            continue
        kinds = ELECTRIC if material.piezoelectric else ELASTIC
        labels = {key: label for key, label in case.case.units.given.items() if key in kinds}
        quantity = other_label(material.units, labels)
        if quantity is not None:
            own = labels_of(material.units)[quantity]
            words = Words(
                f"{_units_of(material)} has {own} for {quantity}, and "
                f'case.units.{quantity} = "{labels[quantity]}"'
            )
            fitting = [name for name in SYSTEMS if other_label(name, labels) is None]
            accepted = listed(map(shown, fitting)) or "labels of one system"
            raise fault(f"{path}.units", words, accepted, "units")


def _units_of(material: Any) -> str:
    """Return the units of a material as given."""
    given = material.units
    return shown(given if isinstance(given, str) else given.model_dump())
