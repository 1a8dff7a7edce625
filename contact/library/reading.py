"""Libraries of materials, as TOML files."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from contact.errors import InputError
from contact.library.entry import Entry
from contact.typing import Array
from forms.elasticity import hexagonal, isotropic
from forms.piezo import hexagonal_voigt

#: The library of the package.
PACKAGED = Path(__file__).with_name("materials.toml")

#: Texts of every entry.
WORDS = ("class", "source", "temperature", "condition")

#: An optional text: the other places where its numbers were found.
CHECKED = "checked"

#: Keys of which an entry has one set or another.
ISOTROPIC, HEXAGONAL, FULL = ("young", "poisson"), ("c",), ("stiffness",)
NUMBERS = ("c", "stiffness", "young", "poisson", "e", "coupling", "permittivity", "d", "within")


@cache
def library(path: Path = PACKAGED) -> Mapping[str, Entry]:
    """Read a library: name -> entry, in the order of the file.

    Raises
    ------
    InputError
        If the file cannot be read, or an entry is none; the message names it.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: a library of materials") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file: {error}") from None
    return {name: _entry(path, name, table) for name, table in data.items()}


def find(name: str, path: Path = PACKAGED) -> Entry:
    """Return a material by its name.

    Raises
    ------
    InputError
        As `library`, and if there is no such material: the message names the nearest one.
    """
    known = library(path)
    if name in known:
        return known[name]
    lower = {other.lower(): other for other in known}
    near = difflib.get_close_matches(name.lower(), lower, n=1)
    hint = f" (did you mean {lower[near[0]]}?)" if near else ""
    raise InputError(f"{name}: no such material{hint}; accepted: {', '.join(known)}")


def _entry(path: Path, name: str, table: Any) -> Entry:
    """Read an entry and check it."""
    try:
        if not isinstance(table, Mapping):
            raise ValueError("it is no table")
        made = _read(name, table)
        made.check()
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        fault = f"{error} is missing" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{path}: {name}: {fault}; accepted: class, source, temperature, condition, and young "
            "and poisson, c or stiffness, with e or coupling and permittivity, as in the "
            "package's own library"
        ) from None
    return made


def _read(name: str, table: Mapping[str, Any]) -> Entry:
    unknown = [key for key in table if key not in (*WORDS, *NUMBERS, CHECKED)]
    if unknown:
        raise ValueError(f"{unknown[0]}: unknown key")
    kinds = [keys for keys in (ISOTROPIC, HEXAGONAL, FULL) if any(key in table for key in keys)]
    if len(kinds) != 1:
        raise ValueError("one of young with poisson, c, and stiffness is needed")
    elastic: tuple[float, float] | None = None
    if kinds[0] == ISOTROPIC:
        elastic = 1e9 * float(table["young"]), float(table["poisson"])
        stiffness = isotropic(*elastic)
    elif kinds[0] == HEXAGONAL:
        stiffness = 1e9 * hexagonal(**{key: float(value) for key, value in table["c"].items()})
    else:
        stiffness = 1e9 * np.array(table["stiffness"], dtype=float)
    coupling, permittivity = _electric(table)
    published = tuple(
        ((int(key[1]) - 1, int(key[2]) - 1), 1e-12 * float(value))
        for key, value in table.get("d", {}).items()
    )
    words = {key: str(table[key]) for key in WORDS}
    return Entry(
        name,
        words["source"],
        words["temperature"],
        words["condition"],
        words["class"],
        stiffness,
        elastic,
        coupling,
        permittivity,
        published,
        float(table.get("within", 0.05)),
        str(table.get(CHECKED, "")),
    )


def _electric(table: Mapping[str, Any]) -> tuple[Array | None, Array | None]:
    """Return the coupling and the permittivity, None for a material that is not piezoelectric."""
    if not {"e", "coupling", "permittivity"} & set(table):
        return None, None
    if ("e" in table) == ("coupling" in table):
        raise ValueError("one of e and coupling is needed, with permittivity")
    given = table["permittivity"]
    first, third = float(given["11"]), float(given["33"])
    permittivity = 1e-9 * np.diag([first, float(given.get("22", first)), third])
    if "coupling" in table:
        return np.array(table["coupling"], dtype=float), permittivity
    constants = {key: float(value) for key, value in table["e"].items()}
    return hexagonal_voigt(**constants, beta11=first, beta33=third)[0], permittivity
