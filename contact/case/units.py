"""The system of units of a case: its names, and that library and labels agree on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeAlias

from annotated_types import Predicate
from pydantic import BeforeValidator, Discriminator, Tag, WithJsonSchema, model_validator

from contact.library import units as systems
from contact.model.messages import Words, either, fault, listed, shown
from contact.model.section import FromTable, Section, Text
from contact.results.options import Units
from contact.settings import Accepted

#: `contact.case.file.Case`, of which the units are checked.
Case: TypeAlias = Any

NAMES = either(map(shown, systems.SYSTEMS))
#: A name of these, for the JSON schema.
BY_NAME = {"enum": [*systems.SYSTEMS]}

#: Quantities that the constants of a material have: elastic, and piezoelectric.
ELASTIC, ELECTRIC = ("length", "stress"), ("length", "stress", "potential", "charge")


class UnitSystem(Section):
    """`[material.units]`: the system of units of a case, by three of its units.

    The others follow: stress = force / length^2, charge = force length / potential.
    """

    length: Text = "m"
    """Unit of length: m with a prefix of SI."""
    force: Text = "N"
    """Unit of force: N with a prefix."""
    potential: Text = "V"
    """Unit of potential: V with a prefix."""

    @property
    def system(self) -> systems.System:
        """The system itself."""
        return systems.system((self.length, self.force, self.potential))

    @model_validator(mode="after")
    def _check(self) -> Self:
        for quantity, base in (("length", "m"), ("force", "N"), ("potential", "V")):
            given = getattr(self, quantity)
            if systems.unit_in_si(given, quantity) is None:
                accepted = f'{base} with a prefix of SI, such as "m{base}" or "k{base}"'
                raise fault(quantity, given, accepted)
        return self


SystemOfUnits: TypeAlias = Annotated[
    Annotated[str, Predicate(systems.SYSTEMS.__contains__), WithJsonSchema(BY_NAME), Tag("name")]
    | Annotated[UnitSystem, Tag("table")],
    Discriminator(lambda given: "table" if isinstance(given, Mapping | Section) else "name"),
    Accepted(f"{NAMES}, or a table {{ length, force, potential }}"),
]


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
