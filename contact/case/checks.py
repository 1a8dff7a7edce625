"""Checks of a case that concern several sections, with and without the mesh."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

from contact.errors import nearest, shown
from contact.mesh.domain import meet, members
from contact.model.body import Bolt, Electrode, Fixed, Load
from contact.model.fields import CONSTANT, steady
from contact.model.formula import ZERO, Expression, InTime
from contact.model.messages import listed
from contact.model.rigid import Motion
from contact.model.section import entries, walk
from contact.model.units import SYSTEMS, labels_of, other_label
from contact.settings import Words, fault

#: `contact.case.file.Case`, which calls these checks.
Case: TypeAlias = Any

#: Quantities that the constants of a material have: elastic, and piezoelectric.
ELASTIC, ELECTRIC = ("length", "stress"), ("length", "stress", "potential", "charge")

#: Values of keys that a case file has a text for.
WRITTEN = str | float | int | tuple | dict | Expression | InTime | None

#: Ends of the paths of names of parts.
PARTS = (".on", ".against")


def check_sections(case: Case) -> None:
    """Raise a fault if sections contradict each other."""
    for path, value in walk(case):
        if isinstance(value, Expression) and "t" in value.names:
            case.require(case.evolution, path, "a formula in t with [evolution] only")
        if path.endswith(".amplitude") and isinstance(value, str):
            _check_amplitude(case, path, value)
        if not (isinstance(value, WRITTEN) or value is steady or entries(value)):
            accepted = "values of a case file; functions, UFL and objects are for Problem(...)"
            raise fault(path, Words("given an object of Python"), accepted)
    _check_units(case)
    if not any(material.piezoelectric for _, material in case.materials):
        _check_mechanical(case)
    _check_contacts(case)
    for i, bolt in enumerate(case.bolt):
        fits = not any(meet(bolt.on, other.on) for other in case.bolt[:i])
        case.require(fits, f"bolt.{i}.on", "a part that no other bolt has")
    fits = case.evolution is None or not getattr(case.solver, "nested", False)
    case.require(fits, "solver.nested", "nested = false with [evolution]")


def check_mesh(case: Case, dimension: int, parts: Iterable[str]) -> None:
    """Raise a fault if a case names parts or coordinates that its mesh has not, or its axis."""
    known = sorted(parts)
    for path, value in walk(case):
        fits = dimension == 3 or not isinstance(value, Expression) or "z" not in value.names
        case.require(fits, path, "formulas in x and y in 2-D", "formula-variable")
        if path.endswith(PARTS) and isinstance(value, str):
            for name in members(value):
                if name not in known:
                    accepted = f"a part of the mesh: {listed(known)}{nearest(name, known)}"
                    raise fault(path, name, accepted, "part-name")
    fits = dimension == 3 or case.mesh is None or case.mesh.axis is None
    case.require(fits, "mesh.axis", "no axis in 2-D")


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
    """Raise a fault if a body without piezoelectric constants has a foundation that conducts."""
    accepted = "electric quantities with [material.piezo] only, or a piezoelectric material by name"
    for path, contact in case.contacts:
        key, electric = case.electric_of(path, contact)
        if electric is not None:
            raise fault(key, Words("given a table"), accepted, "piezo")
    if case.electrode:
        raise fault("electrode", Words("given"), accepted, "piezo")


def _check_contacts(case: Case) -> None:
    """Raise a fault if laws do not fit the method or the body opposite, or stand twice."""
    for path, contact in case.contacts:
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
