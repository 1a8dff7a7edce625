"""Checks of a case that concern several sections, with and without the mesh."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeAlias

from pydantic import BaseModel

from contact.case.evolution import check_evolution, check_time
from contact.case.formula import Expression
from contact.case.rigid import check_moving, moving
from contact.case.showing import listed
from contact.case.types import Words, as_given, fault
from contact.mesh.together import members
from contact.tolerances import HUGE

#: `contact.case.file.Case`, which calls these checks.
Case: TypeAlias = Any


def check_sections(case: Case) -> None:
    """Raise a fault if sections contradict each other."""
    check_sizes(case)
    if any(material.piezoelectric for _, material in case.materials):
        _check_potential(case)
    else:
        _check_mechanical(case)
    _check_regions(case)
    _check_lagged(case)
    check_evolution(case)
    for path, formula in _formulas(case):
        check_time(case, path, formula)
    _check_contacts(case)
    check_moving(case)
    if case.mesh.dimension is not None:
        _check_vectors(case, case.mesh.dimension)
        _check_parts(case, [*case.mesh.sides, *case.mesh.parts])


def check_sizes(case: Case) -> None:
    """Raise a fault if a number is so large or so small that its square is none any more."""
    for path, value in _values((), case):
        if isinstance(value, Expression):
            number = value.value if value.is_constant else 0.0
        else:
            number = value
        if number != 0 and math.isfinite(number) and not 1 / HUGE <= abs(number) <= HUGE:
            accepted = f"0, or sizes from {1 / HUGE:g} to {HUGE:g}, whose squares do not overflow"
            raise fault(path, number, accepted)


def _values(path: tuple[str, ...], value: Any) -> Iterator[tuple[str, float | Expression]]:
    """Give all numbers and formulas below a value of the case, with their paths."""
    match value:
        case Expression() | int() | float():
            yield ".".join(path), value
        case tuple():
            for i, entry in enumerate(value):
                yield from _values((*path, str(i)), entry)
        case Mapping():
            for key, entry in value.items():
                yield from _values((*path, key), entry)
        case BaseModel():
            for name, field in type(value).model_fields.items():
                yield from _values((*path, field.alias or name), getattr(value, name))
        case _ if is_dataclass(value):
            for entry in fields(value):
                yield from _values((*path, entry.name), getattr(value, entry.name))


def _formulas(case: Case) -> Iterator[tuple[str, Expression]]:
    found = _values((), case)
    return ((path, value) for path, value in found if isinstance(value, Expression))


def check_mesh(case: Case, dimension: int, parts: Iterable[str]) -> None:
    """Raise a fault if a case does not fit its mesh."""
    _check_vectors(case, dimension)
    _check_parts(case, list(parts))


def _check_mechanical(case: Case) -> None:
    """Nothing electric without piezoelectric constants."""
    accepted = "electric quantities with [material.piezo] only, or a piezoelectric material by name"
    for i, fixed in enumerate(case.fixed):
        if fixed.potential is not None:
            raise fault(f"fixed.{i}.potential", fixed.potential.source, accepted)
    for i, load in enumerate(case.load):
        for key in ("charge", "body_charge"):
            if getattr(load, key) is not None:
                raise fault(f"load.{i}.{key}", getattr(load, key).source, accepted)
    for path, contact in case.contacts:
        key, electric = case.electric_of(path, contact)
        if electric is not None:
            raise fault(key, Words("given a table"), accepted)


def _check_contacts(case: Case) -> None:
    """Each contact is of a part of its own, which can move."""
    seen: dict[str, str] = {}
    for path, contact in case.contacts:
        for i, fixed in enumerate(case.fixed):
            if fixed.is_clamped and {*members(contact.on)} <= {*members(fixed.on)}:
                accepted = f"a part that fixed.{i} does not fix wholly"
                raise fault(f"{path}.on", contact.on, accepted)
        key, electric = case.electric_of(path, contact)
        if contact.against is not None and electric is not None:
            if electric.phi_f != Expression(0.0):
                accepted = "0, or none, with against: the other body has a potential of its own"
                raise fault(f"{key}.phi_f", electric.phi_f.source, accepted)
        for part in members(contact.on):
            if seen.setdefault(part, path) != path:
                raise fault(f"{path}.on", part, f"a part that {seen[part]} does not have")
    for key in ("friction", "electric"):
        own = [getattr(contact, key) is not None for _, contact in case.contacts]
        if all(own) and getattr(case, key) is not None:
            raise fault(key, Words(f"beside {key} of every contact"), "one of them")


def _check_regions(case: Case) -> None:
    """Several materials need regions, each region one of them."""
    seen: dict[str, str] = {}
    for path, material in case.materials:
        if material.on is None and len(case.materials) > 1:
            raise fault(f"{path}.on", Words("missing"), "regions for each of several materials")
        for name in material.on or ():
            if seen.setdefault(name, path) != path:
                raise fault(f"{path}.on", name, f"regions that {seen[name]} does not have")


def _check_lagged(case: Case) -> None:
    """Newton's method linearises layer and current; it has no previous outer iteration."""
    sections = [*case.contacts, *(case.electric_of(*entry) for entry in case.contacts)]
    for key, section in sections:
        if section is not None and section.lagged and case.solver.method == "newton":
            accepted = 'lagged with solver.method = "uzawa" or "penalty"'
            raise fault(f"{key}.lagged", section.lagged, accepted)


def _check_potential(case: Case) -> None:
    """Without a fixed value the potential is known but for a constant."""
    grounded = any(fixed.potential is not None for fixed in case.fixed)
    electric = [case.electric_of(*entry)[1] for entry in case.contacts]
    conductive = any(section is not None and section.k_e > 0 for section in electric)
    if not grounded and not conductive:
        raise fault(
            "fixed",
            Words("no potential fixed"),
            "a potential on at least one part, or [electric] with k_e > 0",
        )


def _vectors(case: Case) -> Iterator[tuple[str, tuple[Any, ...] | None]]:
    for i, fixed in enumerate(case.fixed):
        yield f"fixed.{i}.displacement", fixed.displacement
    for i, load in enumerate(case.load):
        yield f"load.{i}.traction", load.traction
        yield f"load.{i}.body_force", load.body_force
    for path, contact in case.contacts:
        yield f"{path}.axis", contact.axis
        if contact.foundation is not None:
            for key, vector in contact.foundation.vectors.items():
                yield f"{path}.foundation.{key}", vector
    for path, section in moving(case):
        yield from ((f"{path}.{key}", vector) for key, vector in section.vectors())


def _check_vectors(case: Case, dimension: int) -> None:
    """Vectors have as many components as space, and the plane has no z."""
    for path, section in moving(case):
        section.check_dimension(path, dimension)
    for path, vector in _vectors(case):
        if vector is not None and len(vector) != dimension:
            raise fault(path, as_given(vector), f"{dimension} components in {dimension}-D")
    for path, formula in _formulas(case):
        if dimension == 2 and "z" in formula.names:
            raise fault(path, formula.source, "formulas in x and y in the plane")
    for path, contact in case.contacts:
        only = None if contact.foundation is None else contact.foundation.only
        if only is not None and only != dimension:
            words = Words(f'given "{contact.foundation.shape}" in {dimension}-D')
            raise fault(f"{path}.foundation.shape", words, f"this shape in {only}-D only")
    if dimension == 3 and case.space.kinematics == "axisymmetric":
        accepted = '"plane_strain" with a mesh in space, where it has no effect'
        raise fault("space.kinematics", case.space.kinematics, accepted)
    if dimension == 2 and case.mesh.axis is not None:
        raise fault("mesh.axis", case.mesh.axis, "no axis in the plane")
    for path, material in case.materials:
        key, poling = material.axis
        if poling is not None and isinstance(poling, tuple) != (dimension == 3):
            accepted = "an angle in the plane" if dimension == 2 else "3 numbers in space"
            raise fault(f"{path}.{key}", poling, accepted)


def _check_parts(case: Case, parts: list[str]) -> None:
    used = [(f"fixed.{i}.on", fixed.on) for i, fixed in enumerate(case.fixed)]
    used += [(f"load.{i}.on", load.on) for i, load in enumerate(case.load) if load.on is not None]
    used += [(f"{path}.on", contact.on) for path, contact in case.contacts]
    used += [(f"rigid.{i}.on", part.on) for i, part in enumerate(case.rigid)]
    used += [(f"electrode.{i}.on", part.on) for i, part in enumerate(case.electrode)]
    against = [(f"{path}.against", contact.against) for path, contact in case.contacts]
    used += [(path, name) for path, name in against if name is not None]
    for path, name in ((path, name) for path, on in used for name in members(on)):
        if name not in parts:
            near = difflib.get_close_matches(name, parts, n=1)
            hint = f" (did you mean {listed(near)}?)" if near else ""
            raise fault(path, name, f"a part of the mesh: {listed(sorted(parts))}{hint}")
