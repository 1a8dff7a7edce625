"""The system of units of a case, by name or by three of its units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Self, TypeAlias

from annotated_types import Predicate
from pydantic import Discriminator, Tag, WithJsonSchema, model_validator

from contact.library import units as systems
from contact.model.messages import either, fault, shown
from contact.model.section import Section
from contact.model.values import Text
from contact.settings import Accepted

NAMES = either(map(shown, systems.SYSTEMS))
#: A name of these, for the JSON schema.
BY_NAME = {"enum": [*systems.SYSTEMS]}


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
