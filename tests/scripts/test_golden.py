"""The golden numbers: what differs is told, each case has its numbers, and the table is whole."""

import csv

import pytest

from scripts import golden
from scripts.cases import CASES
from scripts.gallery import EXAMPLES
from scripts.golden import Value, active_set, compare
from scripts.golden_problems import COARSE, PROBLEMS

STORED = {
    "bar": {"force": Value(2.0, 4.0), "nodes": Value(7), "set": Value("a1")},
    "block": {"force": Value(1.0, 1.0)},
}


def changed(problem, quantity, value):
    """Return the values with another one; None removes it."""
    values = {name: dict(rows) for name, rows in STORED.items()}
    values[problem][quantity] = value
    return {name: {k: v for k, v in rows.items() if v} for name, rows in values.items()}


def test_equal_values_and_rounding_are_no_difference():
    assert compare(STORED, STORED) == []
    assert compare(STORED, changed("bar", "force", Value(2.0 + 3e-9, 1.0))) == []


@pytest.mark.parametrize(
    ("quantity", "value", "told"),
    [
        ("force", Value(2.0 + 5e-9, 1e9), "1.2e-09"),  # the stored scale counts
        ("force", Value(float("nan"), 4.0), ""),
        ("nodes", Value(8), ""),
        ("set", Value("a2"), ""),
        ("set", None, ""),
        ("more", Value(1.0, 1.0), ""),
    ],
    ids=["number", "no number", "count", "digest", "missing", "not stored"],
)
def test_a_difference_is_told(quantity, value, told):
    (found,) = compare(STORED, changed("bar", quantity, value))
    assert (found.problem, found.quantity, found.relative) == ("bar", quantity, told)
    assert found.now == golden.text(value)
    assert found.now in golden.report([found])


@pytest.mark.parametrize("both", [(STORED, {}), ({}, STORED)], ids=["stored", "found"])
def test_a_problem_of_one_side_alone_is_told(both):
    assert {(row.problem, row.quantity) for row in compare(*both)} == {
        (problem, quantity) for problem, rows in STORED.items() for quantity in rows
    }


def test_an_unknown_problem_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        golden.main(["--only", "no such problem"])
    assert end.value.code == 2
    assert "no such problem; accepted: case ball-between-plates," in capsys.readouterr().err


def test_main_ends_with_1_on_a_difference_and_renews_what_differs(tmp_path, monkeypatch, capsys):
    found = {name: dict(rows) for name, rows in STORED.items()}
    monkeypatch.setattr("scripts.golden_problems.PROBLEMS", {k: v.copy for k, v in found.items()})
    monkeypatch.setattr(golden, "TABLE", tmp_path / "golden.csv")
    run = ["--processes", "1"]
    assert golden.main(run) == 1  # nothing is stored
    assert golden.main([*run, "--renew"]) == 0
    assert golden.main(run) == 0
    found["bar"] |= {"force": Value(2.1, 4.0), "nodes": Value(8)}
    found["block"]["force"] = Value(1.0 + 1e-11, 1.0)
    capsys.readouterr()
    assert golden.main(run) == 1
    assert "2.500e-02" not in (text := capsys.readouterr().out) and "2.5e-02" in text
    assert golden.main([*run, "--only", "block"]) == 0
    assert golden.main([*run, "--renew"]) == 0
    assert golden.read(tmp_path / "golden.csv") == {
        "bar": {"force": Value(2.1, 4.0), "nodes": Value(8), "set": Value("a1")},
        "block": {"force": Value(1.0, 1.0)},  # within the tolerance: as it was
    }


def test_the_active_set_depends_on_places_alone():
    points, statuses = [[0.0, 1.0], [0.5, 1.0], [1 / 128, 0.0]], ["open", "stick", "slip"]
    same = active_set([[0.5 + 1e-16, 1.0], [1 / 128 - 1e-17, 0.0], [-1e-17, 1.0]],
                      ["stick", "slip", "open"])  # fmt: skip
    assert active_set(points, statuses) == same
    assert active_set(points, ["open", "slip", "stick"]) != same


def test_every_case_and_example_is_a_problem_and_every_problem_is_stored():
    assert {path.stem for path in CASES.glob("*.toml")} == {*COARSE}
    assert {f"example {name}" for name in EXAMPLES} <= {*PROBLEMS}
    assert {*golden.read(golden.TABLE)} == {*PROBLEMS}


def test_the_table_is_sorted_and_has_each_row_once():
    with golden.TABLE.open(encoding="utf-8") as stream:
        rows = [(row["problem"], row["quantity"]) for row in csv.DictReader(stream)]
    assert rows == sorted(set(rows))
