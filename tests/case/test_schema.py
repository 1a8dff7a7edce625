"""The JSON schema takes every case file, and refuses wrong keys, kinds and bounds."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from contact.case.schema import schema
from scripts.cases import CASES

jsonschema = pytest.importorskip("jsonschema")
SCHEMA = schema()
BAR = tomllib.loads((CASES / "bar.toml").read_text())


def faults(case: dict[str, Any]) -> int:
    return len(list(jsonschema.Draft202012Validator(SCHEMA).iter_errors(case)))


def test_it_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize("path", sorted(CASES.glob("*.toml")), ids=lambda path: path.stem)
def test_it_takes_the_case_files(path: Path) -> None:
    assert faults(tomllib.loads(path.read_text())) == 0


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [
        ("mesh", "cell_count", 3),
        ("mesh", "cells", "many"),
        ("contact", "law", "sticky"),
        ("friction", "radius", -1.0),
        ("solver", "tolerance", "small"),
    ],
)
def test_it_refuses(table: str, key: str, value: object) -> None:
    assert faults(BAR) == 0
    assert faults({**BAR, table: {**BAR[table], key: value}}) > 0
