"""docs/output.md: every key, column and field that is written is described, and no other."""

import csv
import json
import re
from pathlib import Path

import pytest

from contact.output.described import BODY, SUMMARY, SURFACE, TABLES
from contact.output.files import write_outputs
from contact.output.reference import PAGE, files_help, page
from contact.output.vtu import read_vtu
from contact.solving import solve
from tests.problems.rigid import column, indented, plate
from tests.problems.written import block, electric

#: Derived fields have a companion cell by cell.
PLAIN = ("displacement", "potential")


def two_contacts():
    parts = {"piece": {"side": "bottom", "from": 0.5, "to": 1.5}}
    return block(
        2,
        mesh={"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4], "parts": parts},
        contact=[{"on": "piece"}, {"on": "right"}],
        friction={},
    )


def rigid():
    return indented(n=4), plate(), column()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return folders with the results of all kinds of problems."""
    folders = []
    for case in (block(2), block(3), electric(2), electric(3), two_contacts(), *rigid()):
        folders.append(tmp_path_factory.mktemp("out"))
        write_outputs(solve(case), folders[-1])
    return folders


def agree(found: list[list[str]], described: list[str]) -> None:
    """All that is found is described, in its order, and all that is described is found."""
    for names in found:
        assert set(names) <= set(described)
    assert set(described) == {name for names in found for name in names}


def test_summary(written: list[Path]) -> None:
    agree([list(json.loads((f / "summary.json").read_text())) for f in written], list(SUMMARY))


@pytest.mark.parametrize("name", ["contact.csv", "history.csv"])
def test_tables(name: str, written: list[Path]) -> None:
    found = [next(csv.reader((folder / name).open())) for folder in written]
    agree(found, list(TABLES[name]))
    for names in found:
        assert names == [column for column in TABLES[name] if column in names]


def test_fields(written: list[Path]) -> None:
    bodies = [read_vtu(folder / "fields.vtu") for folder in written]
    agree([list(body.at_points) for body in bodies], list(BODY))
    cells = [f"{name}_cell" for name in BODY if name not in PLAIN]
    agree([list(body.in_cells) for body in bodies], cells)
    agree([list(read_vtu(f / "contact.vtu").at_points) for f in written], list(SURFACE))


def test_the_page_is_made_from_this() -> None:
    assert PAGE.read_text() == page(), "python3 -m contact.output.reference"


def test_help_names_every_key() -> None:
    for name, items in {"summary.json": SUMMARY, **TABLES}.items():
        lines = files_help(name).splitlines()
        assert all(len(line) <= 100 for line in lines)
        assert [line.split()[0] for line in lines if re.match(r"  \S", line)] == list(items)
