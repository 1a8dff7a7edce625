"""The JSON schema takes all case files, and refuses wrong keys, kinds and bounds.

Every key described, methods with their options, the page on the case file.
"""

import json
import tomllib
from typing import Any

import pytest

from contact.case.file import Case, load_case, parse_case, to_toml
from contact.case.schema import schema, sections
from contact.errors import InputError
from contact.methods.options import OPTIONS, NewtonOptions, with_method
from contact.model.messages import keys_of
from scripts import case_page
from scripts.cases import CASES
from tests.problems.bar import changed

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


def test_it_refuses_an_unknown_key_in_any_section() -> None:
    """Of any case file: `test_it_takes_the_case_files` says that they are right without it."""
    for path in sorted(CASES.glob("*.toml")):
        data = tomllib.loads(path.read_text())
        assert not valid(data | {"unknown": 1})
        for key, section in data.items():
            for table in section if isinstance(section, list) else [section]:
                if isinstance(table, dict):
                    table["unknown"] = 1
                    assert not valid(data), (path.stem, key)
                    del table["unknown"]


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
    found = {"": Case, **sections(Case)}
    assert len(found) > 25  # all were found
    for name, section in found.items():
        keys = (SCHEMA["$defs"][name] if name else SCHEMA)["properties"]
        assert {*keys_of(section)} <= {*keys}
        assert all(keys[key]["description"] for key in keys_of(section) if key != "generator")


@pytest.mark.parametrize("method", OPTIONS)
def test_the_settings_of_a_method_are_its_options(method):
    solver = parse_case(changed(solver={"method": method})).solver
    assert solver == OPTIONS[method]()
    given = OPTIONS[method](tolerance=1e-12)
    assert parse_case(changed(solver=given)).solver is given
    assert with_method(given, NewtonOptions) == NewtonOptions(tolerance=1e-12)


def test_the_resolved_case_holds_what_the_method_reads():
    keys = "method", "tolerance", "max_outer", "linear"
    table = tomllib.loads(to_toml(parse_case(changed())))["solver"]
    assert tuple(table) == keys
    table = tomllib.loads(to_toml(parse_case(changed(solver={"method": "penalty"}))))["solver"]
    assert tuple(table) == (*keys, "stopping", "max_inner", "material_step")


def test_the_reference_page_is_up_to_date():
    assert case_page.PAGE.read_text() == case_page.page(), "run python3 -m scripts.case_page"
