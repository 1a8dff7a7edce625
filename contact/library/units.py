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

#: The system without a unit of length: stress in GPa, field in GV/m, charge per area in C/m2.
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
        units = {name: _unit_name(getattr(self, name), BASES[name]) for name in quantities}
        return {name: re.sub("^u(?=.)", "µ", unit) for name, unit in units.items()}


def unit_in_si(name: str, quantity: str) -> float | None:
    """Return the value in SI of a unit of a quantity, None if it is unknown.

    Known are m, N, Pa, V and C with the prefixes of SI, and force/area, such as ``daN/mm2``.
    """
    area = re.fullmatch(r"(.+)/(.+?)(?:\^?2|²)", name.strip())
    if quantity == "stress" and area is not None:
        force, length = unit_in_si(area[1], "force"), unit_in_si(area[2], "length")
        return None if force is None or length is None else force / length**2
    base = BASES[quantity]
    text = name.strip()
    return PREFIXES.get(text.removesuffix(base)) if text.endswith(base) else None


#: Units, in lower case, without a conversion. Other words are labels of dimensionless numbers.
FOREIGN = frozenset(
    "in inch inches ft foot feet mil micron microns psi ksi msi bar kbar atm".split()
)


def is_unknown_unit(name: str, quantity: str) -> bool:
    """Tell whether a name is that of a unit, but unknown, such as ``psi`` or ``MM``."""
    lower = name.strip().lower()
    known = (prefix + BASES[quantity] for prefix in PREFIXES)
    alike = lower in FOREIGN or any(lower == unit.lower() for unit in known)
    return alike and unit_in_si(name, quantity) is None


def system(units: tuple[str, str, str]) -> System:
    """Return a system by the names of its units of length, force and potential.

    Raises
    ------
    KeyError
        With the quantity, if one is not known.
    """
    found = {}
    for quantity, name in zip(("length", "force", "potential"), units, strict=True):
        unit = unit_in_si(name, quantity)
        if unit is None:
            raise KeyError(quantity)
        found[quantity] = unit
    return System(**found)


def system_named(name: str, labels: Mapping[str, str]) -> System:
    """Return a system by its name; that of any length with the length of the labels."""
    length = unit_in_si(labels.get("length", "m"), "length") if name == ANY_LENGTH else None
    found = system(SYSTEMS[name])
    if length is None:
        return found
    return System(length, found.stress * length**2, found.potential * length)


def contradicted(
    given: System, labels: Mapping[str, str], quantities: Collection[str]
) -> str | None:
    """Return the first of some quantities whose label is another unit, or None."""
    for quantity in quantities:
        unit = unit_in_si(labels[quantity], quantity) if quantity in labels else None
        if unit is not None and not isclose(unit, getattr(given, quantity), rel_tol=1e-9):
            return quantity
    return None


def systems_fitting(labels: Mapping[str, str], quantities: Collection[str]) -> list[str]:
    """Return the names of the systems that agree with labels."""
    return [k for k in SYSTEMS if contradicted(system_named(k, labels), labels, quantities) is None]


def force_of(stress: str, length: str) -> str | None:
    """Return the unit of force, stress times length^2, by its name; None for unknown units."""
    pressure, side = unit_in_si(stress, "stress"), unit_in_si(length, "length")
    return None if pressure is None or side is None else _unit_name(pressure * side**2, "N")


def _unit_name(value: float, base: str) -> str:
    """Return the name of a unit: a value in SI and its base."""
    prefix = next((p for p, factor in PREFIXES.items() if isclose(factor, value)), None)
    return f"{value:g} {base}" if prefix is None else f"{prefix}{base}"
