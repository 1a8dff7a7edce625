"""The system of units of a case: its names, and that library and labels agree on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

from pydantic import BeforeValidator

from contact.library import units as systems
from contact.model.messages import Words, fault, listed, shown
from contact.model.section import FromTable
from contact.model.units import NAMES
from contact.results.options import Units
from contact.settings import Accepted

#: `contact.case.file.Case`, of which the units are checked.
Case: TypeAlias = Any

#: Quantities that the constants of a material have: elastic, and piezoelectric.
ELASTIC, ELECTRIC = ("length", "stress"), ("length", "stress", "potential", "charge")


def _labels(given: Any) -> Any:
    """Return the names of the units of a system that is given by its own name."""
    if isinstance(given, str) and given in systems.SYSTEMS:
        return systems.system_named(given, {}).labels
    return given


#: `[case] units`: labels, or the name of a system, whose labels they then are.
Labels: TypeAlias = Annotated[
    Units,
    FromTable,
    BeforeValidator(_labels),
    Accepted(f"{NAMES}, or a table {{ length, stress, potential, charge }} of names"),
]


def share(given: Any) -> Any:
    """Give the system of `[case] units` to the materials by name that have none of their own."""
    about = given.get("case") if isinstance(given, Mapping) else None
    name = about.get("units") if isinstance(about, Mapping) else None
    if not isinstance(name, str) or name not in systems.SYSTEMS:
        return given
    tables = given.get("material")

    def shared(table: Any) -> Any:
        by_name = isinstance(table, Mapping) and table.get("name") is not None
        return {"units": name, **table} if by_name else table

    many = isinstance(tables, list | tuple)
    return {**given, "material": [*map(shared, tables)] if many else shared(tables)}


def check_units(case: Case) -> None:
    """Raise a fault unless the materials by name have one system, and the labels are of it."""
    labels = case.case.units.given
    first: tuple[str, Any, systems.System] | None = None
    for path, material in case.materials:
        if material.entry is None:
            continue
        own = material.system(labels)
        quantities = ELECTRIC if material.piezoelectric else ELASTIC
        for known in quantities:
            if known in labels and systems.is_unknown_unit(labels[known], known):
                words = Words(f'the unit "{labels[known]}" is not known')
                accepted = (
                    "beside materials by name those of SI with a prefix, and force/area, such as "
                    "mm, MPa, N/mm^2"
                )
                raise fault(f"case.units.{known}", words, accepted, "units")
        quantity = systems.contradicted(own, labels, quantities)
        if quantity is not None:
            words = Words(
                f"{_shown(material)} has {own.labels[quantity]} for {quantity}, and "
                f'case.units.{quantity} = "{labels[quantity]}"'
            )
            fitting = systems.systems_fitting(labels, quantities)
            accepted = listed([*map(shown, fitting)]) or (
                "labels of one system: stress = force / length^2, charge = force length / potential"
            )
            raise fault(f"{path}.units", words, accepted, "units")
        if first is None:
            first = path, material, own
        elif own != first[2]:
            words = Words(f"{_shown(material)}, and {first[0]} has {_shown(first[1])}")
            raise fault(f"{path}.units", words, "one system of units for all materials", "units")


def _shown(material: Any) -> str:
    """Return the units of a material as given."""
    given = material.units
    return shown(given if isinstance(given, str) else given.model_dump())
