"""The golden numbers: what differs is told, each case has its numbers, and the table is whole.

The mutants that the core tests have to find fit the sources as they are.
"""

import csv
from pathlib import Path

import pytest

from contact.errors import InputError
from scripts import golden
from scripts.cases import CASES
from scripts.gallery import EXAMPLES
from scripts.golden import compare, on_other_meshes
from scripts.golden_problems import COARSE, PROBLEMS
from scripts.golden_values import Value, digest
from scripts.studies.mutants import MUTANTS, ROOT, Mutant

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


def test_the_digest_depends_on_places_and_status_alone():
    points, statuses = [[0.0, 1.0], [0.5, 1.0], [1 / 128, 0.0]], ["open", "stick", "slip"]
    same = digest([[0.5 + 1e-16, 1.0], [1 / 128 - 1e-17, 0.0], [-1e-17, 1.0]],
                      ["stick", "slip", "open"])  # fmt: skip
    assert digest(points, statuses) == same
    assert digest(points, ["open", "slip", "stick"]) != same


@pytest.mark.parametrize(("version", "named"), [("4.13.1", set()), ("4.15.2", {"bar"})])
def test_meshes_of_another_gmsh_are_not_compared(monkeypatch, version: str, named: set[str]):
    pytest.importorskip("gmsh")
    monkeypatch.setattr("gmsh.__version__", version)
    one, other = ({"bar": {"mesh": Value(name)}, "block": {"mesh": Value("b")}} for name in "ac")
    assert on_other_meshes(one, other) == named
    assert on_other_meshes(one, one) == set()


def test_every_case_and_example_is_a_problem_and_every_problem_is_stored():
    assert {path.stem for path in CASES.glob("*.toml")} == {*COARSE}
    assert {f"example {name}" for name in EXAMPLES} <= {*PROBLEMS}
    assert {*golden.read(golden.TABLE)} == {*PROBLEMS}


@pytest.mark.parametrize("wrong", [["--processes", "0"], ["--processes=-2"], ["--only", "nothing"]])
def test_wrong_arguments_are_told_without_a_traceback(capsys, wrong: list[str]):
    with pytest.raises(SystemExit, match="2"):
        golden.main(wrong)
    assert "accepted: " in capsys.readouterr().err


def test_the_table_is_sorted_and_has_each_row_once():
    with golden.TABLE.open(encoding="utf-8") as stream:
        rows = [(row["problem"], row["quantity"]) for row in csv.DictReader(stream)]
    assert rows == sorted(set(rows))


def test_each_changes_one_line_of_the_sources():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)
    for mutant in MUTANTS:
        assert (ROOT / mutant.file).read_text().count(mutant.old) == 1, mutant.name
        assert all((ROOT / file).exists() for file in mutant.near), mutant.name


@pytest.mark.parametrize("text", ["", "a = 1\nb = a = 1\n"])
def test_a_text_that_does_not_stand_there_once_is_refused(tmp_path: Path, text: str):
    (tmp_path / "one.py").write_text(text)
    mutant = Mutant("sign", "a sign", "one.py", "a = 1", "a = -1", ())
    with pytest.raises(InputError, match=r"\[value\]"):
        mutant.apply(tmp_path)
    (tmp_path / "one.py").write_text("a = 1\n")
    mutant.apply(tmp_path)
    assert (tmp_path / "one.py").read_text() == "a = -1\n"
