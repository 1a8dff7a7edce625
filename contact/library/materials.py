"""Materials by name: constants of TOML files, and derived piezoelectric constants."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from contact.errors import InputError, nearest
from contact.typing import Array
from forms.elasticity import Anisotropic, hexagonal, isotropic
from forms.piezo import Piezo, from_voigt, hexagonal_voigt

#: The library of the package.
PACKAGED = Path(__file__).with_name("materials.toml")

#: Keys of texts, of stiffness, of coupling; all keys, with the published d and their accuracy.
WORDS = ("class", "source", "temperature", "condition")
ELASTIC, ELECTRIC = ("young", "c", "stiffness"), ("e", "coupling", "permittivity")
KEYS = (*WORDS, *ELASTIC, "poisson", *ELECTRIC, "d", "within", "checked")


@dataclass(frozen=True, eq=False)
class Entry:
    """A material.

    Attributes
    ----------
    name, source, temperature, condition
        Name, source of the constants, and their temperature and conditions.
    symmetry
        Crystal class, or "isotropic".
    stiffness
        C at constant field in Voigt's notation, shape (6, 6) (Pa).
    isotropic
        Young's modulus (Pa) and Poisson's ratio; None for crystals.
    coupling
        e, shape (3, 6) (C/m2); None if it is not piezoelectric.
    permittivity
        At constant strain, shape (3, 3) (F/m), or None.
    checked
        Other sources of the constants, and differences there; may be empty.
    """

    name: str
    source: str
    temperature: str
    condition: str
    symmetry: str
    stiffness: Array
    isotropic: tuple[float, float] | None
    coupling: Array | None
    permittivity: Array | None
    checked: str

    @staticmethod
    def of(name: str, table: Mapping[str, Any]) -> Entry:
        """Read a table of a library; raise errors of several classes if it is wrong."""
        unknown = [key for key in table if key not in KEYS]
        if unknown:
            raise ValueError(f"{unknown[0]}: unknown key")
        kinds = [key for key in ELASTIC if key in table]
        if len(kinds) != 1:
            raise ValueError("one of young with poisson, c, and stiffness is needed")
        elastic = None
        if kinds == ["young"]:
            elastic = 1e9 * float(table["young"]), float(table["poisson"])
            stiffness = isotropic(*elastic)
        elif kinds == ["c"]:
            stiffness = 1e9 * hexagonal(**_numbers(table["c"]))
        else:
            stiffness = 1e9 * np.array(table["stiffness"], dtype=float)
        symmetry, source, temperature, condition = (str(table[key]) for key in WORDS)
        coupling, permittivity = _electric(table) if {*ELECTRIC} & {*table} else (None, None)
        words, checked = (name, source, temperature, condition, symmetry), table.get("checked", "")
        return Entry(*words, stiffness, elastic, coupling, permittivity, str(checked))

    @property
    def piezo(self) -> Piezo | None:
        """The piezoelectric tensors in the axes of the crystal, in SI."""
        if self.coupling is None or self.permittivity is None:
            return None
        return from_voigt(self.coupling, self.permittivity)

    @cached_property
    def compliance(self) -> Array:
        """S = C^-1 at constant field, shape (6, 6) (1/Pa)."""
        return np.asarray(np.linalg.inv(self.stiffness))

    @cached_property
    def charge_constants(self) -> Array:
        """D = e s, Bechmann's relation, shape (3, 6) (C/N); zeros without coupling."""
        coupling = np.zeros((3, 6)) if self.coupling is None else self.coupling
        return np.asarray(coupling @ self.compliance)

    @property
    def free_permittivity(self) -> Array:
        """The permittivity at constant stress, shape (3, 3) (F/m)."""
        assert self.coupling is not None and self.permittivity is not None
        return np.asarray(self.permittivity + self.charge_constants @ self.coupling.T)

    @property
    def voltage_constants(self) -> Array:
        """g, the field of a stress at open circuit, shape (3, 6) (V m/N)."""
        return np.asarray(np.linalg.solve(self.free_permittivity, self.charge_constants))

    def bar_coupling(self, field: int, strain: int) -> float:
        """Return k = d / sqrt(s eps) of a bar: k_33 of (2, 2), k_31 of (2, 0), k_15 of (0, 4)."""
        free = self.free_permittivity[field, field] * self.compliance[strain, strain]
        return float(abs(self.charge_constants[field, strain]) / np.sqrt(free))

    def check(self) -> None:
        """Raise a ValueError unless stiffness and permittivity are positive definite."""
        Anisotropic(self.stiffness).check()
        if self.coupling is not None and self.permittivity is not None:
            from_voigt(self.coupling, self.permittivity)


def _numbers(table: Mapping[str, Any]) -> dict[str, float]:
    return {key: float(value) for key, value in table.items()}


def _electric(table: Mapping[str, Any]) -> tuple[Array, Array]:
    """Return the coupling, shape (3, 6) (C/m2), and the permittivity, shape (3, 3) (F/m)."""
    if ("e" in table) == ("coupling" in table):
        raise ValueError("one of e and coupling is needed, with permittivity")
    given = _numbers(table["permittivity"])
    permittivity = 1e-9 * np.diag([given["11"], given.get("22", given["11"]), given["33"]])
    if "coupling" in table:
        return np.array(table["coupling"], dtype=float), permittivity
    return hexagonal_voigt(**_numbers(table["e"]), beta11=1.0, beta33=1.0)[0], permittivity


@cache
def library(path: Path = PACKAGED) -> Mapping[str, Entry]:
    """Read a library: name -> entry, in the order of the file.

    InputError if the file cannot be read, or with the name of an entry that is wrong.
    """
    found = {}
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: {error.strerror}; accepted: a library of materials", "library"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}", "toml") from None
    for name, table in data.items():
        try:
            if not isinstance(table, Mapping):
                raise ValueError("it is no table")
            found[name] = Entry.of(name, table)
            found[name].check()
        except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
            fault = f"{error} is missing" if isinstance(error, KeyError) else str(error)
            raise InputError(
                f"{path}: {name}: {fault}; accepted: class, source, temperature, condition, and "
                "young and poisson, c or stiffness, with e or coupling and permittivity, as in "
                "the package's own library",
                "library",
            ) from None
    return found


def find(name: str, path: Path = PACKAGED) -> Entry:
    """Return a material by its name.

    InputError as of `library`, and if there is no such material, with the nearest name.
    """
    known = library(path)
    if name in known:
        return known[name]
    hint, names = nearest(name, known), ", ".join(known)
    raise InputError(f"{name}: no such material{hint}; accepted: {names}", "library")
