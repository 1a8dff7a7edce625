"""The case file: one TOML file that says all about a problem and how to solve it.

`load_case` reads a file, `parse_case` a dictionary; `to_toml` writes one that says the same, with
the defaults. Every mistake is reported as one
`contact.errors.InputError` that names the file, the key, the given and the accepted values.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias, TypeVar

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    model_validator,
)

from contact.case.checks import check_sections
from contact.case.mesh import Adapt, Mesh, cut_about_axis
from contact.errors import InputError, clipped, shown
from contact.methods.options import OPTIONS, NewtonOptions, Options
from contact.model.body import Bolt, Elastic, Electrode, Fixed, Load
from contact.model.contact import Contact
from contact.model.evolution import Evolution
from contact.model.fields import CONSTANT, Factor, Ramp, steady
from contact.model.foundation import Electric
from contact.model.friction import Friction
from contact.model.material import Material
from contact.model.messages import describe, either
from contact.model.rigid import Rigid
from contact.model.section import OneOrSome, Section, Text, as_tuple, walk
from contact.model.units import NAMES, SYSTEMS, labels_of
from contact.results.options import OutputOptions, Units
from contact.settings import Accepted

Kind = TypeVar("Kind")
Materials: TypeAlias = Annotated[
    OneOrSome[Material], Accepted("a table [material], or tables [[material]]")
]
Contacts: TypeAlias = Annotated[
    OneOrSome[Contact], Accepted("a table [contact], or tables [[contact]]")
]


#: The options where the case file names no method.
DEFAULT = NewtonOptions()


def _method_of(given: Any) -> str:
    method = given.get("method", DEFAULT.method) if isinstance(given, Mapping) else None
    return f":{getattr(given, 'method', method)}"


#: `[solver]`: the options of one method, by its name: one of those that `OPTIONS` lists.
if TYPE_CHECKING:
    Solver: TypeAlias = Options
else:
    Solver = Annotated[
        reduce(or_, (Annotated[kind, Tag(f":{name}")] for name, kind in OPTIONS.items())),
        Discriminator(_method_of),
        Accepted(f"a table with method = {either(map(shown, OPTIONS))}", "method"),
    ]


class Space(Section):
    """`[space]`: finite elements, and the kinematics of the body."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = 1
    """Degree of the Lagrange elements of the displacement and the potential."""
    element: Literal["standard", "mean_dilatation"] = "standard"
    """`"mean_dilatation"`: volumetric strains are averaged over each cell, so that nearly
    incompressible bodies, and yielding ones, do not lock. On triangles and tetrahedra with
    `degree = 2` (P2-P0), on quadrilaterals and hexahedra with `degree = 1` (Q1-P0)."""
    kinematics: Literal["plane_strain", "plane_stress", "axisymmetric"] = "plane_strain"
    """The body of a mesh in 2-D: in plane strain; in plane stress, a sheet of unit thickness that
    is free to grow thinner; or a body of revolution, of which the mesh is the half plane x = r, y
    along the axis. Displacements across the axis are then 0 without a support, and loads, forces
    and charges are those of the full turn."""


def _labels(given: Any) -> Any:
    """Return the names of the units of a system that is given by its own name."""
    by_name = isinstance(given, str) and given in SYSTEMS
    return labels_of(given) if by_name else given


#: `[case] units`: labels, or the name of a system, whose labels they then are.
Labels: TypeAlias = Annotated[
    Units,
    BeforeValidator(_labels),
    Accepted(f"{NAMES}, or a table {{ length, stress, potential, charge }} of names"),
]


class About(Section):
    """`[case]`: the names of its units, for labels; materials of the library have to fit them."""

    units: Labels = Units()
    """Names of units for labels: `{ length = "mm", stress = "MPa", potential = "V", charge = "mC"
    }`, any of them, or a system by name, such as `"N-mm-MPa"`: that of all materials by name, too.
    None is assumed. Numbers of the case are not converted."""


class Case(Section):
    """A case file."""

    title: Text = ""
    """Title, for reports and figures."""
    case: About = About()
    """Names of units: `[case]`."""
    mesh: Mesh | None = None
    """The body: `[mesh]`. Required, but where Python gives a domain."""
    space: Space = Space()
    """Finite elements: `[space]`."""
    material: Materials | None = None
    """The material: `[material]`; several: `[[material]]`, each with its regions. Required, but
    where Python gives a law."""
    fixed: Annotated[tuple[Fixed, ...], as_tuple, Accepted("tables [[fixed]]")] = ()
    """Supports and electrodes: `[[fixed]]`. Not required where contact and friction, or
    `[[rigid]]`, constrain the body."""
    elastic: Annotated[tuple[Elastic, ...], as_tuple, Accepted("tables [[elastic]]")] = ()
    """Elastic supports: any number of `[[elastic]]`."""
    load: Annotated[tuple[Load, ...], as_tuple, Accepted("tables [[load]]")] = ()
    """Forces and charges: any number of `[[load]]`."""
    rigid: Annotated[tuple[Rigid, ...], as_tuple, Accepted("tables [[rigid]]")] = ()
    """Parts that move as rigid bodies: any number of `[[rigid]]`."""
    electrode: Annotated[tuple[Electrode, ...], as_tuple, Accepted("tables [[electrode]]")] = ()
    """Electrodes of unknown potential: any number of `[[electrode]]`."""
    bolt: Annotated[tuple[Bolt, ...], as_tuple, Accepted("tables [[bolt]]")] = ()
    """Bolts that are tightened: any number of `[[bolt]]`."""
    contact: Contacts
    """The foundation: `[contact]`; several: `[[contact]]`, each with its part."""
    friction: Friction | None = None
    """Friction: `[friction]`. Default: none."""
    electric: Electric | None = None
    """Conductive foundation: `[electric]`. Absent: insulated."""
    evolution: Evolution | None = None
    """Load steps: `[evolution]`. Absent: one static step."""
    solver: Solver = DEFAULT
    """Method and tolerances: `[solver]`."""
    output: OutputOptions = OutputOptions()
    """Files of results: `[output]`."""

    _source: str = PrivateAttr("case")

    @property
    def source(self) -> str:
        """Name of the file that the case was read from, for messages."""
        return self._source

    @property
    def _called(self) -> str:
        return self._source

    @property
    def adapt(self) -> Adapt | None:
        """The adaptive refinement of the mesh, `[mesh.adapt]`; None without."""
        return None if self.mesh is None else self.mesh.adapt

    @property
    def materials(self) -> tuple[tuple[str, Material], ...]:
        """The materials, each with its key in the file."""
        return self.sections(Material)

    @property
    def contacts(self) -> tuple[tuple[str, Contact], ...]:
        """The contacts, each with its key in the file."""
        return self.sections(Contact)

    def sections(self, *kinds: type[Kind]) -> tuple[tuple[str, Kind], ...]:
        """Return the sections of some kinds, each with its key in the file."""
        return tuple(entry for entry in walk(self) if isinstance(entry[1], kinds))

    def electric_of(self, key: str, contact: Contact) -> tuple[str, Electric | None]:
        """Return the electric contact of a contact, with its key in the file."""
        if isinstance(contact.electric, Electric):
            return f"{key}.electric", contact.electric
        return "electric", self.electric

    def amplitude(self, name: Factor | str | None) -> Factor | None:
        """Return a factor of time by its name; for none growth over the first stage."""
        if callable(name):
            return name
        if self.evolution is None:
            return None
        if name is None:
            return Ramp(*self.evolution.times[:2])
        if name == CONSTANT and name not in self.evolution.amplitudes:
            return steady
        return self.evolution.amplitudes[name]

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        return cut_about_axis(_share_units(given))

    @model_validator(mode="after")
    def _check(self) -> Self:
        check_sections(self)
        return self


def _share_units(given: Any) -> Any:
    """Give the system of `[case] units` to the materials by name that have none of their own."""
    about = given.get("case") if isinstance(given, Mapping) else None
    name = about.get("units") if isinstance(about, Mapping) else None
    if not isinstance(name, str) or name not in SYSTEMS:
        return given
    tables = given.get("material")

    def shared(table: Any) -> Any:
        by_name = isinstance(table, Mapping) and table.get("name") is not None
        return {"units": name, **table} if by_name else table

    many = isinstance(tables, list | tuple)
    return {**given, "material": [*map(shared, tables)] if many else shared(tables)}


def load_case(
    path: str | Path,
    overrides: Mapping[str, str] | Iterable[str] = (),
    folder: str | Path | None = None,
) -> Case:
    """Read a case file.

    Parameters
    ----------
    path
        TOML file.
    overrides
        Values that replace those of the file: ``"material.young=2.0"``, or a mapping of keys
        to texts. Keys are dotted paths, with numbers for list entries (``load.0.traction``);
        values are TOML, bare words are texts.
    folder
        As `parse_case` takes it; by default the folder of the file.

    Returns
    -------
    The case, checked as far as is possible without its mesh.

    Raises
    ------
    InputError
        On the first mistake; the message is one line and names the file, the key, the
        given and the accepted values.
    """
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8-sig")
        data = tomllib.loads(text)
    except OSError as error:
        reason = error.strerror or "not readable"
        raise InputError(f"{path}: {reason}; accepted: a case file (TOML)", "toml") from None
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: not a text in UTF-8; accepted: a case file (TOML)", "toml"
        ) from None
    except (ValueError, RecursionError) as error:  # of a whole number with too many digits, too
        raise InputError(f"{path}: not a TOML file: {clipped(str(error), 200)}", "toml") from None
    if isinstance(overrides, Mapping):
        overrides = [f"{key}={value}" for key, value in overrides.items()]
    for given in overrides:
        override(data, given, str(path))
    return parse_case(data, path.parent if folder is None else folder, str(path))


def parse_case(
    data: Mapping[str, object],
    folder: str | Path = ".",
    source: str = "case",
) -> Case:
    """Make a case of a dictionary with the keys of the case file.

    Parameters
    ----------
    data
        Tables of the case file, as `tomllib` reads them; it is not changed. Each value is checked.
    folder
        Folder that relative names of files in it belong to.
    source
        The name of the case in messages.

    Returns
    -------
    The case; see `load_case`.

    Raises
    ------
    InputError
        On the first mistake; the message is one line.
    """
    try:
        given = dict(data) if isinstance(data, Mapping) else data
        case = Case.model_validate(given, context={"folder": folder})
    except ValidationError as error:
        raise describe(error, source) from None
    file = None if case.mesh is None else case.mesh.file
    if file is not None and not Path(file).is_file():
        raise InputError(
            f"{source}: mesh.file: no file {file}; accepted: a mesh file (.msh, .inp, ...)",
            "file-name",
        )
    case._source = source
    return case


def override(data: dict[str, Any], text: str, source: str) -> None:
    """Set a value of a case, ``"path.to.key=value"``, in its tables."""
    path, equals, given = (part.strip() for part in text.partition("="))
    if not equals or not path:
        raise _refusal(source, text, "no assignment; accepted: path.to.key=value")
    value = _read_value(path, given, source)
    try:
        _enter(data, path, value)
    except (IndexError, TypeError, ValueError):
        words = "no such key; accepted: keys of tables, of a list the number of an entry"
        raise _refusal(source, path, words) from None


def _enter(data: dict[str, Any], path: str, value: Any) -> None:
    """Set a value at a path of tables and lists; missing tables are made."""
    *parents, last = path.split(".")
    place: Any = data
    for key in parents:
        place = place.setdefault(key, {}) if isinstance(place, dict) else place[_number(key)]
    place[last if isinstance(place, dict) else _number(last)] = value


def _number(text: str) -> int:
    """Return the number of an entry of a list, from 0; ValueError if it is none."""
    if not text.isdecimal():
        raise ValueError
    return int(text)


def _read_value(path: str, text: str, source: str) -> Any:
    """Read a TOML value; anything that does not look like one is a text."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError) as error:
        if not isinstance(error, tomllib.TOMLDecodeError) or text[:1] in "[{\"'":
            words = f"{shown(text)} is broken ({clipped(str(error))}); accepted: a TOML value"
            raise _refusal(source, path, words) from None
        return text


def _refusal(source: str, path: str, words: str) -> InputError:
    return InputError(f"{source}: --set {clipped(path)}: {words}", "set")


_BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(case: Case, dimension: int | None = None, anchored: bool = False) -> str:
    """Return a file of the same case, without keys of no effect; `anchored`: with whole paths."""
    ignored = {"space": {"kinematics"}} if dimension == 3 else None
    context = {"path": os.path.abspath} if anchored else None
    data = case.model_dump(by_alias=True, exclude_none=True, exclude=ignored, context=context)
    return "\n".join(_table(data, ())).strip() + "\n"


def number_at(case: Case, key: str) -> float:
    """Return the number at a key of a case, ``load.0.traction.1``; InputError if there is none."""
    place: Any = _tables(case)
    try:
        for name in key.split("."):
            if isinstance(place, dict):  # parameters of a mesh generator may stand in [mesh] itself
                place = {**place.get("parameters", {}), **place}[name]
            else:
                place = place[_number(name)]
    except (KeyError, IndexError, TypeError, ValueError):
        place = None
    if isinstance(place, bool) or not isinstance(place, int | float):
        words = "nothing" if place is None else f"{place!r}"
        raise InputError(
            f"{case.source}: {key}: {words} stands there; accepted: a key with a number",
            "no-number",
        )
    return float(place)


def with_number(case: Case, key: str, value: float) -> Case:
    """Return a case with another number at a key; see `number_at`."""
    number_at(case, key)
    data = _tables(case)
    _enter(data, key, float(value))
    return parse_case(data, ".", case.source)


def _tables(case: Case) -> dict[str, Any]:
    """Return a case as the tables of its file, with the whole paths of files."""
    context = {"path": os.path.abspath}
    return case.model_dump(mode="json", by_alias=True, exclude_none=True, context=context)


def _table(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Write the values of a table, then the tables in it."""
    inner = {key: value for key, value in table.items() if _holds_tables(value)}
    for key, value in table.items():
        if key not in inner and not (value == () and not path):
            yield f"{_key(key)} = {literal(value)}"
    for key, value in inner.items():
        place = (*path, key)
        name = ".".join(_key(part) for part in place)
        many = not isinstance(value, Mapping)
        for entry in value if many else (value,):
            # A table that holds nothing but tables needs no heading of its own.
            if many or not all(_holds_tables(item) for item in entry.values()):
                yield f"\n[[{name}]]" if many else f"\n[{name}]"
            yield from _table(entry, place)


def _holds_tables(value: Any) -> bool:
    if isinstance(value, Mapping):
        return bool(value)
    return isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else literal(key)


def literal(value: Any) -> str:
    """Return a number, text, switch, or a list or table of these as TOML."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(literal(item) for item in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {literal(item)}' for key, item in value.items())} }}"
    return str(value)
