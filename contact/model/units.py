"""Systems of units: constants of the library are converted from SI into that of a case."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from math import isclose
from typing import Annotated, Self, TypeAlias

from annotated_types import Predicate
from pydantic import Discriminator, Tag, WithJsonSchema, model_validator

from contact.model.messages import either, shown
from contact.model.section import Section, Text
from contact.settings import Accepted, fault

#: Prefixes of SI; the first one of a factor makes the names of units that follow.
PREFIXES = {
    **{"T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9},
    **{"p": 1e-12, "f": 1e-15, "a": 1e-18, "da": 10.0, "d": 0.1, "c": 0.01, "µ": 1e-6, "μ": 1e-6},
}
BASES = {"length": "m", "force": "N", "stress": "Pa", "potential": "V", "charge": "C"}

#: Exponents of the units of length, force and potential in the other ones. They follow from one
#: energy, force times length or charge times potential.
EXPONENTS = {
    "length": (1, 0, 0),
    "force": (0, 1, 0),
    "potential": (0, 0, 1),
    "stress": (-2, 1, 0),
    "charge": (1, 1, -1),
    "coupling": (-1, 1, -1),
    "permittivity": (0, 1, -2),
}

#: Systems by name: length, force, potential.
SYSTEMS = {
    "SI": ("m", "N", "V"),
    "N-mm-MPa": ("mm", "N", "V"),
    "kN-mm-GPa": ("mm", "kN", "V"),
    "kN-m-kPa": ("m", "kN", "V"),
    "MN-m-MPa": ("m", "MN", "V"),
    "uN-um-MPa": ("um", "uN", "V"),
    "mN-um-GPa": ("um", "mN", "V"),
    "nN-nm-GPa": ("nm", "nN", "V"),
    "GPa": ("m", "GN", "GV"),
}

#: The system without a unit of length: stress in GPa, field in GV/m, charge per area in C/m2.
ANY_LENGTH = "GPa"


@dataclass(frozen=True)
class System:
    """Units of length, force and potential, in m, N and V."""

    length: float = 1.0
    force: float = 1.0
    potential: float = 1.0

    def unit(self, quantity: str) -> float:
        """Return the unit of a quantity, in SI."""
        length, force, potential = EXPONENTS[quantity]
        return self.length**length * self.force**force * self.potential**potential

    @property
    def labels(self) -> dict[str, str]:
        """Names of the units of length, stress, potential and charge, as they are printed."""
        quantities = ("length", "stress", "potential", "charge")
        units = {name: _unit_name(self.unit(name), BASES[name]) for name in quantities}
        return {name: re.sub("^u(?=.)", "µ", unit) for name, unit in units.items()}

    def contradicted(self, labels: Mapping[str, str]) -> str | None:
        """Return the first quantity whose label is another unit, or none at all."""
        for quantity, label in labels.items():
            if not isclose(unit_in_si(label, quantity) or 0.0, self.unit(quantity), rel_tol=1e-9):
                return quantity
        return None


def unit_in_si(name: str, quantity: str) -> float | None:
    """Return the value in SI of a unit of a quantity, None if it is unknown.

    Known are m, N, Pa, V and C with the prefixes of SI, and force/area, such as ``daN/mm2``.
    """
    name, base = name.strip(), BASES[quantity]
    area = re.fullmatch(r"(.+)/(.+?)(?:\^?2|²)", name)
    if quantity == "stress" and area is not None:
        force, length = unit_in_si(area[1], "force"), unit_in_si(area[2], "length")
        return None if force is None or length is None else force / length**2
    return PREFIXES.get(name.removesuffix(base)) if name.endswith(base) else None


def system_named(name: str, labels: Mapping[str, str]) -> System:
    """Return a system by its name; that of any length with the length of the labels."""
    length, force, potential = (
        PREFIXES[unit[:-1]] for unit in SYSTEMS[name]
    )  # of m, N and V with a prefix
    if name == ANY_LENGTH:
        length = unit_in_si(labels.get("length", "m"), "length") or length
        force, potential = force * length**2, potential * length
    return System(length, force, potential)


def force_of(stress: str, length: str) -> str | None:
    """Return the unit of force, stress times length^2, by its name; None for unknown units."""
    pressure, side = unit_in_si(stress, "stress"), unit_in_si(length, "length")
    return None if pressure is None or side is None else _unit_name(pressure * side**2, "N")


def _unit_name(value: float, base: str) -> str:
    """Return the name of a unit: a value in SI and its base."""
    prefix = next((p for p, factor in PREFIXES.items() if isclose(factor, value)), None)
    return f"{value:g} {base}" if prefix is None else f"{prefix}{base}"


NAMES = either(map(shown, SYSTEMS))
#: A name of these, for the JSON schema.
BY_NAME = {"enum": [*SYSTEMS]}


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
    def system(self) -> System:
        """The system itself."""
        units = (unit_in_si(getattr(self, key), key) for key in ("length", "force", "potential"))
        return System(*(unit for unit in units if unit is not None))  # all, as checked

    @model_validator(mode="after")
    def _check(self) -> Self:
        for quantity in ("length", "force", "potential"):
            given, base = getattr(self, quantity), BASES[quantity]
            if unit_in_si(given, quantity) is None:
                accepted = f'{base} with a prefix of SI, such as "m{base}" or "k{base}"'
                raise fault(quantity, given, accepted)
        return self


SystemOfUnits: TypeAlias = Annotated[
    Annotated[str, Predicate(SYSTEMS.__contains__), WithJsonSchema(BY_NAME), Tag(":name")]
    | Annotated[UnitSystem, Tag(":table")],
    Discriminator(lambda given: ":table" if isinstance(given, Mapping | Section) else ":name"),
    Accepted(f"{NAMES}, or a table {{ length, force, potential }}"),
]
