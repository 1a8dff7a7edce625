"""Checks of a case that concern several sections, with and without the mesh."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, TypeAlias

from contact.body.elements import needed
from contact.errors import nearest, shown
from contact.mesh.domain import meet, members
from contact.model.body import ZERO
from contact.model.fields import CONSTANT
from contact.model.formula import Expression
from contact.model.messages import listed
from contact.model.section import AMPLITUDE, PART, as_given, walk
from contact.model.units import SYSTEMS, labels_of, other_label
from contact.settings import MISSING, SPATIAL, Words, fault

#: `contact.case.file.Case`, which calls these checks.
Case: TypeAlias = Any

#: Quantities that the constants of a material have: elastic, and piezoelectric.
ELASTIC, ELECTRIC = ("length", "stress"), ("length", "stress", "potential", "charge")

#: Beginnings of the keys that may depend on the time.
TIMED = ("fixed.", "load.", "rigid.", "electrode.", "bolt.")


def check_sections(case: Case) -> None:
    """Raise a fault if sections contradict each other."""
    for path, value, marks in walk(case):
        if isinstance(value, Expression) and "t" in value.names:
            _check_time(case, path, value)
        if AMPLITUDE in marks and value is not None:
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
    if case.evolution is not None and getattr(case.solver, "nested", False):
        raise fault("solver.nested", True, "nested = false with [evolution]")
    mesh = case.mesh
    if mesh is not None and mesh.shape is not None:
        accepted = needed(case.space.element, case.space.degree, mesh.shape)
        if accepted is not None:
            raise fault("space.element", case.space.element, accepted)
    if case.space.kinematics == "plane_stress":
        _check_plane_stress(case)
    if mesh is not None and mesh.dimension is not None:
        check_mesh(case, mesh.dimension, [*mesh.sides, *mesh.parts, *mesh.inside])


def _check_plane_stress(case: Case) -> None:
    """Raise a fault if no stress acts across the body, and an element or a law does not fit."""
    if case.space.element != "standard":
        accepted = '"standard" in plane stress, where nothing locks'
        raise fault("space.element", case.space.element, accepted, "plane-stress")
    for key, material in case.materials:
        if material.piezoelectric and material.kind not in ("linear", "anisotropic"):
            accepted = '"linear" or "anisotropic" in plane stress with piezoelectric constants'
            raise fault(f"{key}.law", material.kind, accepted, "plane-stress")


def check_mesh(case: Case, dimension: int, parts: Iterable[str]) -> None:
    """Raise a fault if a case does not fit its mesh."""
    known = sorted(parts)
    for path, section in case.moving:
        section.check_dimension(dimension, f"{path}.")
    for path, value, marks in walk(case):
        if SPATIAL in marks and isinstance(value, tuple) and len(value) != dimension:
            raise fault(path, as_given(value), f"{dimension} components in {dimension}-D")
        if isinstance(value, Expression) and dimension == 2 and "z" in value.names:
            raise fault(path, value.source, "formulas in x and y in 2-D", "formula-variable")
        if PART in marks and value is not None:
            for name in members(value):
                if name not in known:
                    accepted = f"a part of the mesh: {listed(known)}{nearest(name, known)}"
                    raise fault(path, name, accepted, "part-name")
    for path, contact in case.contacts:
        only = None if contact.foundation is None else contact.foundation.only
        if only is not None and only != dimension:
            words = Words(f'given "{contact.foundation.shape}" in {dimension}-D')
            raise fault(f"{path}.foundation.shape", words, f"this shape in {only}-D only")
    if dimension == 3 and case.space.kinematics != "plane_strain":
        accepted = '"plane_strain" with a mesh in 3-D, where it has no effect'
        raise fault("space.kinematics", case.space.kinematics, accepted)
    if dimension == 2 and case.mesh is not None and case.mesh.axis is not None:
        raise fault("mesh.axis", case.mesh.axis, "no axis in 2-D")
    for path, material in case.materials:
        key, poling = material.axis
        if poling is not None and isinstance(poling, tuple) != (dimension == 3):
            accepted = "an angle in 2-D" if dimension == 2 else "3 numbers in 3-D"
            raise fault(f"{path}.{key}", poling, accepted)


def growing(case: Case) -> list[str]:
    """Return the keys of sections whose values grow over the first stage, having no amplitude."""
    if case.evolution is None:
        return []
    sections = [
        (f"{k}.{i}", s)
        for k in ("fixed", "load", "electrode", "bolt")
        for i, s in enumerate(getattr(case, k))
    ]
    found = []
    for path, section in (*sections, *case.moving):
        values = [v for _, v, _ in walk(section) if isinstance(v, Expression)]
        moves = any("t" in value.names for value in values)
        if section.amplitude is None and not moves and any(value != ZERO for value in values):
            found.append(path)
    return found


def _check_time(case: Case, path: str, formula: Expression) -> None:
    """Raise a fault if a formula uses t where it has no meaning."""
    if not (path.startswith(TIMED) or ".rigid." in path or path.endswith(".phi_f")):
        raise fault(path, formula.source, "a formula without t")
    if case.evolution is None:
        raise fault(path, formula.source, "a formula in t with [evolution] only")


def _check_amplitude(case: Case, path: str, name: str) -> None:
    """Raise a fault if there is no amplitude of a name."""
    if case.evolution is None:
        raise fault(path, name, "an amplitude with [evolution] only")
    known = sorted({*case.evolution.amplitudes, CONSTANT})
    if name not in known:
        names = f"{listed(known)}{nearest(name, known)}"
        raise fault(path, name, f"a name below evolution.amplitudes: {names}")


def _check_mechanical(case: Case) -> None:
    """Raise a fault if a body without piezoelectric constants is given electric quantities."""
    accepted = "electric quantities with [material.piezo] only, or a piezoelectric material by name"
    for key, names in (("fixed", ("potential",)), ("load", ("charge", "body_charge"))):
        for i, section in enumerate(getattr(case, key)):
            for name in names:
                if getattr(section, name) is not None:
                    raise fault(
                        f"{key}.{i}.{name}", as_given(getattr(section, name)), accepted, "piezo"
                    )
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
        if any(meet(section.on, other) for other in grounded):
            raise fault(f"electrode.{i}.on", section.on, "a part whose potential is not fixed")


def _check_contacts(case: Case) -> None:
    """Raise a fault unless each contact is of a part of its own, which can move."""
    seen: dict[str, str] = {}
    for path, contact in case.contacts:
        for i, fixed in enumerate(case.fixed):
            if fixed.is_clamped and {*members(contact.on)} <= {*members(fixed.on)}:
                accepted = f"a part that fixed.{i} does not fix wholly"
                raise fault(f"{path}.on", contact.on, accepted)
        key, electric = case.electric_of(path, contact)
        if contact.against is not None and electric is not None and electric.phi_f != ZERO:
            accepted = "0, or none, with against: the other body has a potential of its own"
            raise fault(f"{key}.phi_f", electric.phi_f.source, accepted)
        # Newton's method linearises layer and charge; it has no previous outer iteration.
        for place, section in ((path, contact), (key, electric)):
            if section is not None and section.lagged and case.solver.method == "newton":
                accepted = 'lagged with solver.method = "uzawa" or "penalty"'
                raise fault(f"{place}.lagged", section.lagged, accepted)
        for part in members(contact.on):
            if seen.setdefault(part, path) != path:
                raise fault(f"{path}.on", part, f"a part that {seen[part]} does not have")
    for key in ("friction", "electric"):
        own = [getattr(contact, key) is not None for _, contact in case.contacts]
        if all(own) and getattr(case, key) is not None:
            raise fault(
                key, Words(f"beside {key} of every contact"), "one of them", "exclusive-keys"
            )


def _check_regions(case: Case) -> None:
    """Raise a fault unless each of several materials has regions of its own."""
    seen: dict[str, str] = {}
    for path, material in case.materials:
        if material.on is None and len(case.materials) > 1:
            raise fault(f"{path}.on", MISSING, "regions for each of several materials")
        for name in material.on or ():
            if seen.setdefault(name, path) != path:
                raise fault(f"{path}.on", name, f"regions that {seen[name]} does not have")


def _check_rigid(case: Case) -> None:
    """Raise a fault if a part is rigid or an electrode twice, or leaves the axis of revolution."""
    for i, part in enumerate(case.rigid):
        if any(meet(part.on, contact.on) for _, contact in case.contacts):
            raise fault(f"rigid.{i}.on", part.on, "a part beside the contact part")
    for path, motion in case.moving:
        if case.space.kinematics == "axisymmetric" and (key := motion.off_axis) is not None:
            accepted = "0 across the axis of a body of revolution, and no rotation"
            raise fault(f"{path}.{key}", Words("given"), accepted, "rigid-part")
    for key in ("rigid", "electrode", "bolt"):
        parts = [section.on for section in getattr(case, key)]
        for i, on in enumerate(parts):
            if any(meet(on, other) for other in parts[:i]):
                raise fault(f"{key}.{i}.on", on, f"a part that no other [[{key}]] has")


def _check_units(case: Case) -> None:
    """Raise a fault unless the materials by name have one system, and the labels are of it."""
    by_name = [entry for entry in case.materials if entry[1].name is not None]
    for path, material in by_name:
        first, other = by_name[0]
        if material.system != other.system:
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
