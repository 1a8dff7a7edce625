"""Systems of units, into which the constants of the library are converted from SI."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import isclose

#: Prefixes of SI; those in steps of 1000 make the names of units that follow.
PREFIXES = {
    **{"T": 1e12, "G": 1e9, "M": 1e6, "k": 1e3, "": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9},
    **{"p": 1e-12, "f": 1e-15, "a": 1e-18, "da": 10.0, "d": 0.1, "c": 0.01, "µ": 1e-6, "μ": 1e-6},
}
BASES = {"length": "m", "force": "N", "stress": "Pa", "potential": "V", "charge": "C"}

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

#: Its numbers are those of any length: stresses in GPa, fields in GV/m, charges an area in C/m2.
ANY_LENGTH = "GPa"


@dataclass(frozen=True)
class System:
    """Units of length, force and potential, in m, N and V.

    The others follow from one energy, force times length or charge times potential, so that
    piezoelectric constants go with stresses and fields.
    """

    length: float = 1.0
    force: float = 1.0
    potential: float = 1.0

    @property
    def stress(self) -> float:
        """Unit of stress (Pa)."""
        return self.force / self.length**2

    @property
    def charge(self) -> float:
        """Unit of charge (C)."""
        return self.force * self.length / self.potential

    @property
    def coupling(self) -> float:
        """Unit of charge an area (C/m2)."""
        return self.force / self.length / self.potential

    @property
    def permittivity(self) -> float:
        """Unit of permittivity (F/m)."""
        return self.force / self.potential**2

    @property
    def labels(self) -> dict[str, str]:
        """Names of the units of length, stress, potential and charge, as they are printed."""
        quantities = ("length", "stress", "potential", "charge")
        named = {name: _named(getattr(self, name), BASES[name]) for name in quantities}
        return {name: re.sub("^u(?=.)", "µ", unit) for name, unit in named.items()}


def size(name: str, quantity: str) -> float | None:
    """Return a unit of a quantity in SI by its name; None for one that is not known.

    Known are m, N, Pa, V and C with the prefixes of SI, and force/area, such as ``daN/mm2``.
    """
    area = re.fullmatch(r"(.+)/(.+?)(?:\^?2|²)", name.strip())
    if quantity == "stress" and area is not None:
        force, length = size(area[1], "force"), size(area[2], "length")
        return None if force is None or length is None else force / length**2
    base = BASES[quantity]
    text = name.strip()
    return PREFIXES.get(text.removesuffix(base)) if text.endswith(base) else None


#: Units, in small letters, that nothing is converted to. Other words name numbers without units.
FOREIGN = frozenset(
    "in inch inches ft foot feet mil micron microns psi ksi msi bar kbar atm".split()
)


def foreign(name: str, quantity: str) -> bool:
    """Tell whether a name is a unit that is not known, such as ``psi`` or ``MM``."""
    lower = name.strip().lower()
    known = (prefix + BASES[quantity] for prefix in PREFIXES)
    alike = lower in FOREIGN or any(lower == unit.lower() for unit in known)
    return alike and size(name, quantity) is None


def system(units: tuple[str, str, str]) -> System:
    """Return a system by the names of its units of length, force and potential.

    Raises
    ------
    KeyError
        With the quantity, if one is not known.
    """
    found = {}
    for quantity, name in zip(("length", "force", "potential"), units, strict=True):
        unit = size(name, quantity)
        if unit is None:
            raise KeyError(quantity)
        found[quantity] = unit
    return System(**found)


def named(name: str, labels: Mapping[str, str]) -> System:
    """Return a system by its name; that of any length has the one of the labels."""
    length = size(labels.get("length", "m"), "length") if name == ANY_LENGTH else None
    found = system(SYSTEMS[name])
    if length is None:
        return found
    return System(length, found.stress * length**2, found.potential * length)


def contradiction(
    given: System, labels: Mapping[str, str], quantities: Collection[str]
) -> str | None:
    """Return the first of some quantities whose label is of another unit; None where all fit."""
    for quantity in quantities:
        unit = size(labels[quantity], quantity) if quantity in labels else None
        if unit is not None and not isclose(unit, getattr(given, quantity), rel_tol=1e-9):
            return quantity
    return None


def fitting(labels: Mapping[str, str], quantities: Collection[str]) -> list[str]:
    """Return the names of the systems that do not contradict labels."""
    return [k for k in SYSTEMS if contradiction(named(k, labels), labels, quantities) is None]


def table(labels: Mapping[str, str], quantities: Collection[str]) -> dict[str, str] | None:
    """Return the units of length, force and potential that labels ask for; None if none do."""
    length, potential = labels.get("length", "m"), labels.get("potential", "V")
    force = force_of(labels.get("stress", "Pa"), length)
    if force is None or size(force, "force") is None or size(potential, "potential") is None:
        return None
    found = {"length": length, "force": force, "potential": potential}
    fits = contradiction(system((length, force, potential)), labels, quantities) is None
    return found if fits else None


def force_of(stress: str, length: str) -> str | None:
    """Return the name of the unit of force that goes with two units; None where it has none."""
    pressure, side = size(stress, "stress"), size(length, "length")
    return None if pressure is None or side is None else _named(pressure * side**2, "N")


def _named(value: float, base: str) -> str:
    """Return the name of a unit of SI's."""
    prefix = next((p for p, factor in PREFIXES.items() if isclose(factor, value)), None)
    return f"{value:g} {base}" if prefix is None else f"{prefix}{base}"
