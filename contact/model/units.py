"""Systems of units: constants of the library are converted from SI into that of a case."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

from annotated_types import Predicate
from pydantic import Tag, WithJsonSchema

from contact.errors import shown
from contact.model.messages import either
from contact.model.section import Section, by_kind
from contact.settings import Accepted

#: Prefixes of SI; the first one of a factor makes the names of units that follow.
PREFIXES = {
    **{"T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9},
    **{"p": 1e-12, "f": 1e-15, "a": 1e-18, "da": 10.0, "d": 0.1, "c": 0.01, "µ": 1e-6, "μ": 1e-6},
}
BASES = ("length", "force", "potential")

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

#: Systems by name: length, force, potential; and stress and charge, which follow.
SYSTEMS = {
    "SI": ("m", "N", "V", "Pa", "C"),
    "N-mm-MPa": ("mm", "N", "V", "MPa", "mC"),
    "kN-mm-GPa": ("mm", "kN", "V", "GPa", "C"),
    "kN-m-kPa": ("m", "kN", "V", "kPa", "kC"),
    "MN-m-MPa": ("m", "MN", "V", "MPa", "MC"),
    "uN-um-MPa": ("µm", "µN", "V", "MPa", "pC"),
    "mN-um-GPa": ("µm", "mN", "V", "GPa", "nC"),
    "nN-nm-GPa": ("nm", "nN", "V", "GPa", "aC"),
    "GPa": ("m", "GN", "GV", "GPa", "C"),
}

#: The system without a unit of length: stress in GPa, field in GV/m, charge per area in C/m2.
ANY_LENGTH = "GPa"


def labels_of(name: str) -> dict[str, str]:
    """Return the names of the units of length, stress, potential and charge of a system."""
    length, _, potential, stress, charge = SYSTEMS[name]
    return {"length": length, "stress": stress, "potential": potential, "charge": charge}


def other_label(name: str, labels: Mapping[str, str]) -> str | None:
    """Return the first quantity whose label is not that of a system; None if all are."""
    own = {"stress": "GPa"} if name == ANY_LENGTH else labels_of(name)
    length, force, *_ = map(plain, SYSTEMS[name])
    for key in (key for key in own if key in labels):
        label = plain(labels[key])
        if label != plain(own[key]) and not (key == "stress" and label == f"{force}/{length}2"):
            return key
    return None


def force_of(stress: str, length: str) -> str | None:
    """Return the unit of force of a named system, or of a stress F/L^2; None of others."""
    asked = (plain(length), plain(stress))
    if asked[1].endswith(f"/{asked[0]}2"):
        return stress.partition("/")[0].strip()
    systems = ((plain(s[0]), plain(s[3]), s[1]) for s in SYSTEMS.values())
    return next((force for *units, force in systems if tuple(units) == asked), None)


def plain(label: str) -> str:
    """Return a label with u for micro, which has three letters, and 2 for a square."""
    return label.strip().replace("µ", "u").replace("μ", "u").replace("²", "2")


NAMES = either(map(shown, SYSTEMS))
#: A name of these, for the JSON schema.
BY_NAME = {"enum": [*SYSTEMS]}


def prefixed(base: str) -> Any:
    """Return the kind of a unit with a prefix of SI."""
    fits = Predicate(lambda given: given[-1:] == base and given[:-1] in PREFIXES)
    accepted = f'{base} with a prefix of SI, such as "m{base}" or "k{base}"'
    return Annotated[str, fits, Accepted(accepted)]


class UnitSystem(Section):
    """`[material.units]`: the system of units of a case, by three of its units.

    The others follow: stress = force / length^2, charge = force length / potential.
    """

    length: prefixed("m") = "m"  # type: ignore[valid-type]
    """Unit of length: m with a prefix of SI."""
    force: prefixed("N") = "N"  # type: ignore[valid-type]
    """Unit of force: N with a prefix."""
    potential: prefixed("V") = "V"  # type: ignore[valid-type]
    """Unit of potential: V with a prefix."""

    def unit(self, quantity: str) -> float:
        """Return the unit of a quantity, in SI."""
        units = (PREFIXES[getattr(self, key)[:-1]] for key in BASES)
        return math.prod(map(pow, units, EXPONENTS[quantity]))


def unit_system(name: str) -> UnitSystem:
    """Return a system by its name."""
    return UnitSystem.model_validate(dict(zip(BASES, SYSTEMS[name], strict=False)))


SystemOfUnits: TypeAlias = Annotated[
    Annotated[str, Predicate(SYSTEMS.__contains__), WithJsonSchema(BY_NAME), Tag(":one")]
    | Annotated[UnitSystem, Tag(":table")],
    by_kind,
    Accepted(f"{NAMES}, or a table {{ length, force, potential }}"),
]
