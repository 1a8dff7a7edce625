"""The JSON schema takes what the program takes, and refuses wrong keys, kinds and bounds."""

import tomllib
from dataclasses import is_dataclass
from pathlib import Path
from typing import Annotated, Any

import pytest
from pydantic import ValidationError

import meshes
from contact.case.file import Case, load_case, parse_case, to_toml
from contact.case.schema import below, schema
from contact.errors import InputError
from contact.model.messages import keys_of
from contact.model.section import FromTable, Section
from scripts.cases import CASES

jsonschema = pytest.importorskip("jsonschema")
SCHEMA = schema()
TABLES = {**SCHEMA["$defs"], "Case": SCHEMA}
SECTIONS = {**below(Case), "Case": Case}
BAR = tomllib.loads((CASES / "bar.toml").read_text())

#: Values of all kinds: of each, some that some key takes. Texts are formulas in the time.
PROBES: list[Any] = [
    *(True, 1, 3, -1, 0, 0.5, -0.5, 2.5, "t", "left", "free", "auto", "", "x", "mm"),
    *([], [0.5], [0.25, 0.5], [1, 2], [1, 2, 3], [0.25] * 4, ["t"], ["t", "t"], [["t"]]),
    *([[1.0] * 3] * 3, [[1.0] * 6] * 3, [[1.0] * 6] * 6, [[0.0, 1.0], [1.0, 2.0]]),
    *({}, {"a": 1}, {"side": "top"}, {"law": "slip", "rho": 2.0}, [{}]),
]


def valid(part: dict[str, Any], given: Any) -> bool:
    validator = jsonschema.Draft202012Validator({"$defs": SCHEMA["$defs"], **part})
    return bool(validator.is_valid(given))


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_it_takes_the_case_files(path: Path) -> None:
    assert valid(SCHEMA, tomllib.loads(path.read_text()))
    assert valid(SCHEMA, tomllib.loads(to_toml(load_case(path))))  # with all defaults


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("mesh", "cell_count", 3),
        ("mesh", "cells", "many"),
        ("mesh", "generator", "rectangel"),
        ("mesh", "radius", 1.0),  # of another generator
        ("contact", "law", "sticky"),
        ("contact", "on", 3),
        ("contact", "foundation", {"point": [0, 0], "normal": [0, 1]}),  # of no shape
        ("friction", "radius", -1.0),
        ("friction", "bound", 1.0),  # of Tresca's law
        ("solver", "tolerance", "small"),
        ("solver", "tolerence", 1e-8),
        ("solver", "nested", True),  # of another method
    ],
)
def test_it_refuses(table: str, key: str, value: object) -> None:
    case = {**BAR, table: {**BAR[table], key: value}}
    assert valid(SCHEMA, BAR) and not valid(SCHEMA, case)
    with pytest.raises(InputError):
        parse_case(case)


def _refused(section: Any, key: str, value: Any) -> bool:
    """Tell whether the program refuses a value of a key, whatever the other keys are."""
    place: tuple[str, ...] = ()
    if is_dataclass(section):
        place = ("table",)

        class Above(Section):
            """Reads the table as the case file does."""

            table: Annotated[section, FromTable]

    try:
        if place:
            Above.model_validate({"table": {key: value}})
        else:
            section.model_validate({key: value})
    except ValidationError as error:
        return any(e["loc"][: len(place) + 1] == (*place, key) for e in error.errors())
    return False


@pytest.mark.parametrize("name", SECTIONS)
def test_keys_and_kinds_are_those_of_the_program(name: str) -> None:
    section, said = SECTIONS[name], TABLES[name]["properties"]
    generators = {key for generator in meshes.GENERATORS for key in meshes.parameters(generator)}
    assert {*said} - (generators if name == "Mesh" else set()) <= {*keys_of(section)} <= {*said}
    assert TABLES[name]["additionalProperties"] is False
    assert "allOf" not in TABLES[name]  # Taplo completes no keys beside it
    for key in keys_of(section):
        numbers = valid(said[key], 0.5)
        for value in PROBES:
            if (name, key) == ("Mesh", "generator") or (name, key, type(value)) in (
                ("Mesh", "size", int),
                ("Mesh", "size", float),  # of generators, which are read elsewhere
                ("Mesh", "inside", dict),  # of formulas
                ("Mesh", "regions", dict),
                ("Material", "piezo", dict),  # its keys depend on each other
                ("Case", "load", list),  # likewise
            ):
                continue
            if isinstance(value, str) and numbers and valid(said[key], "t"):
                continue  # a formula, which the schema does not read
            assert valid(said[key], value) != _refused(section, key, value), (key, value)
