"""The JSON schema takes all case files, and refuses wrong keys, kinds and bounds."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from contact.case.file import Case, load_case, parse_case, to_toml
from contact.case.schema import schema, sections
from contact.errors import InputError
from contact.model.messages import keys_of
from scripts.cases import CASES

jsonschema = pytest.importorskip("jsonschema")
SCHEMA = schema()
BAR = tomllib.loads((CASES / "bar.toml").read_text())


def valid(given: Any) -> bool:
    return bool(jsonschema.Draft202012Validator(SCHEMA).is_valid(given))


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    assert json.loads(json.dumps(SCHEMA)) == SCHEMA


@pytest.mark.core("bar", "bracket", "indent-pzt4-conducting")
@pytest.mark.parametrize("name", sorted(path.stem for path in CASES.glob("*.toml")))
def test_it_takes_the_case_files(name: str) -> None:
    path = CASES / f"{name}.toml"
    assert valid(tomllib.loads(path.read_text()))
    assert valid(tomllib.loads(to_toml(load_case(path))))  # with all defaults


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_it_refuses_an_unknown_key_in_any_section(path: Path) -> None:
    data = tomllib.loads(path.read_text())
    data["unknown"] = 1
    assert not valid(data)
    del data["unknown"]
    for key, section in data.items():
        for table in section if isinstance(section, list) else [section]:
            if isinstance(table, dict):
                table["unknown"] = 1
                assert not valid(data), key
                del table["unknown"]
    assert valid(data)


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("mesh", "cells", "many"),
        ("mesh", "generator", "rectangel"),
        ("contact", "law", "sticky"),
        ("contact", "on", 3),
        ("contact", "foundation", {"shape": "plane", "point": 1}),
        ("material", "poisson", "0.3"),
        ("friction", "radius", -1.0),
        ("solver", "tolerance", "small"),
        ("solver", "tolerence", 1e-8),
        ("solver", "nested", True),  # of another method
    ],
)
def test_it_refuses(table: str, key: str, value: object) -> None:
    case = {**BAR, table: {**BAR[table], key: value}}
    assert valid(BAR) and not valid(case)
    with pytest.raises(InputError):
        parse_case(case)


def test_every_key_is_described() -> None:
    for name, section in sections(Case).items():
        keys = SCHEMA["$defs"][name]["properties"]
        assert {*keys_of(section)} <= {*keys}
        assert all(keys[key]["description"] for key in keys_of(section) if key != "generator")
