"""The case file: one TOML file that says all about a problem and how to solve it.

`load_case` reads a file, `parse_case` a dictionary. Every mistake is reported as one
`contact.errors.InputError` that names the file, the key, what was given and what is accepted.
"""

from __future__ import annotations

import re
import sys
import tomllib
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import Field, PrivateAttr, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from contact.case.body import Fixed, Load, Space
from contact.case.checks import check_mesh, check_sections
from contact.case.evolution import Evolution
from contact.case.formula import Expression
from contact.case.interface import Contact, Electric, Friction, SlipLaw
from contact.case.material import Material, Piezo
from contact.case.mesh import Mesh, Piece
from contact.case.messages import describe, describe_fault
from contact.case.overrides import override
from contact.case.replaced import stand_ins
from contact.case.rigid import Electrode, RigidPart
from contact.case.shapes import Plane, Sphere
from contact.case.showing import clipped
from contact.case.solver import DEFAULT, Solver
from contact.case.types import FromTable, Section, Text, as_tuple
from contact.case.unions import entries, one_or_more
from contact.errors import InputError
from contact.output.options import OutputOptions
from contact.output.units import Units
from contact.settings import Accepted

__all__ = [
    "Case",
    "Contact",
    "Electric",
    "Evolution",
    "Expression",
    "Fixed",
    "Friction",
    "Load",
    "Material",
    "Mesh",
    "Piece",
    "Piezo",
    "Plane",
    "SlipLaw",
    "Solver",
    "Space",
    "Sphere",
    "load_case",
    "parse_case",
]


if TYPE_CHECKING:
    Materials: TypeAlias = Material | tuple[Material, ...]
    Contacts: TypeAlias = Contact | tuple[Contact, ...]
else:
    Materials = one_or_more(Material, "material")
    Contacts = one_or_more(Contact, "contact")


class About(Section):
    """`[case]`: what the numbers stand for. Nothing is computed with it."""

    units: Annotated[Units, FromTable] = Field(
        default=Units(),
        description='Names of units for labels: `{ length = "mm", stress = "MPa", potential = '
        '"V", charge = "C" }`, any of them. None is assumed.',
    )


class Case(Section):
    """A case file."""

    title: Text = Field(default="", description="Title, for reports and figures.")
    case: About = Field(default=About(), description="Names of units: `[case]`.")
    mesh: Mesh = Field(description="The body: `[mesh]`.")
    space: Space = Field(default=Space(), description="Finite elements: `[space]`.")
    material: Materials = Field(
        description="The material: `[material]`; several: `[[material]]`, each with its regions."
    )
    fixed: Annotated[tuple[Fixed, ...], as_tuple, Accepted("tables [[fixed]]")] = Field(
        default=(),
        description="Supports and electrodes: `[[fixed]]`. None where contact, with friction that "
        "is enough, or `[[rigid]]` holds the body.",
    )
    load: Annotated[tuple[Load, ...], as_tuple, Accepted("tables [[load]]")] = Field(
        default=(), description="Forces and charges: any number of `[[load]]`."
    )
    rigid: Annotated[tuple[RigidPart, ...], as_tuple, Accepted("tables [[rigid]]")] = Field(
        default=(), description="Parts that move as rigid bodies: any number of `[[rigid]]`."
    )
    electrode: Annotated[tuple[Electrode, ...], as_tuple, Accepted("tables [[electrode]]")] = Field(
        default=(), description="Electrodes of unknown potential: any number of `[[electrode]]`."
    )
    contact: Contacts = Field(
        description="The foundation: `[contact]`; several: `[[contact]]`, each with its part."
    )
    friction: Friction | None = Field(
        default=None, description="Friction: `[friction]`. Default: none."
    )
    electric: Electric | None = Field(
        default=None, description="Conductive foundation: `[electric]`. Absent: insulated."
    )
    evolution: Evolution | None = Field(
        default=None, description="Load steps: `[evolution]`. Absent: one static step."
    )
    solver: Solver = Field(default=DEFAULT, description="Method and tolerances: `[solver]`.")
    output: Annotated[OutputOptions, FromTable] = Field(
        default=OutputOptions(), description="What is written: `[output]`."
    )

    _source: str = PrivateAttr("case")
    _filled: tuple[str, ...] = PrivateAttr(())

    @property
    def source(self) -> str:
        """Name of the file that the case was read from, for messages."""
        return self._source

    @property
    def materials(self) -> tuple[tuple[str, Material], ...]:
        """The materials, each with its key in the file."""
        return entries("material", self.material)

    @property
    def contacts(self) -> tuple[tuple[str, Contact], ...]:
        """The contacts, each with its key in the file."""
        return entries("contact", self.contact)

    def friction_of(self, key: str, contact: Contact) -> tuple[str, Friction]:
        """Return the friction of a contact, with its key in the file."""
        if contact.friction is not None:
            return f"{key}.friction", contact.friction
        return "friction", self.friction or Friction()

    def electric_of(self, key: str, contact: Contact) -> tuple[str, Electric | None]:
        """Return the electric contact of a contact, likewise."""
        if contact.electric is not None:
            return f"{key}.electric", contact.electric
        return "electric", self.electric

    @property
    def filled(self) -> tuple[str, ...]:
        """Keys that were missing, for objects are to take their places."""
        return self._filled

    @model_validator(mode="after")
    def _check(self) -> Case:
        check_sections(self)
        return self

    def check_mesh(self, dimension: int, parts: Iterable[str]) -> None:
        """Check what only the mesh can tell: names of parts, lengths of vectors, use of z.

        Parameters
        ----------
        dimension
            Space dimension of the mesh, 2 or 3.
        parts
            Names of the parts of its boundary.

        Raises
        ------
        InputError
            If something does not fit, as in `load_case`.
        """
        try:
            check_mesh(self, dimension, parts)
        except PydanticCustomError as error:
            raise InputError(f"{self._source}: {describe_fault(error)}") from None


def parse_case(
    data: Mapping[str, Any],
    folder: str | Path = ".",
    source: str = "case",
    without: Collection[str] = (),
) -> Case:
    """Make a case of a dictionary with the keys of the case file.

    Parameters
    ----------
    data
        Tables of the case file; it is not changed.
    folder
        Folder that relative names of files in it belong to.
    source
        What messages call the case.
    without
        Keys that may be missing, for objects will take their places: "mesh", "material",
        "friction.mu".

    Raises
    ------
    InputError
        On the first mistake; the message is one line.
    """
    data, filled = stand_ins(data, without)
    try:
        case = Case.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise InputError(describe(error, Case, source)) from None
    file = case.mesh.file
    if file is not None and not Path(file).is_file():
        raise InputError(f"{source}: mesh.file: no file {file}; accepted: a Gmsh file (.msh)")
    case._source, case._filled = source, tuple(filled)
    return case


def load_case(
    path: str | Path,
    overrides: Mapping[str, str] | Iterable[str] = (),
    without: Collection[str] = (),
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
    without
        As `parse_case` takes it.

    Raises
    ------
    InputError
        On the first mistake; the message is one line and names the file, the key, what was
        given and what is accepted.
    """
    path = Path(path)
    text = ""
    try:
        text = path.read_bytes().decode("utf-8-sig")
        data = tomllib.loads(text)
    except OSError as error:
        reason = error.strerror or "not readable"
        raise InputError(f"{path}: {reason}; accepted: a case file (TOML)") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text in UTF-8; accepted: a case file (TOML)") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not a TOML file: {clipped(str(error), 200)}") from None
    except ValueError:
        # Python reads whole numbers up to a limit of digits only.
        digits = sys.get_int_max_str_digits()
        long = re.search(rf"[0-9_]{{{digits + 1},}}", text)
        place = f": line {text.count(chr(10), 0, long.start()) + 1}" if long else ""
        raise InputError(
            f"{path}{place}: a number of more than {digits} digits; accepted: shorter ones"
        ) from None
    override(data, overrides, str(path))
    return parse_case(data, path.parent, str(path), without)
