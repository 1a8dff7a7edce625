"""Pages of the benchmarks, from the files of a run that has measured a part."""

from pathlib import Path

import pytest

import contact
from scripts.benchmarks import bench
from scripts.benchmarks.by_method import measured
from scripts.benchmarks.pages import summary, write_memory, write_page
from scripts.benchmarks.phases import PHASES
from scripts.cases import bar
from scripts.reporting import Report

DOCS = Path(__file__).parents[2] / "docs"
SCALING, MEASURED = DOCS / "scaling.md", DOCS / "benchmarks"


def test_tables_of_pages_are_those_of_the_measured_files(tmp_path):
    assert (MEASURED / "summary.md").read_text() == summary(MEASURED)
    page = tmp_path / "scaling.md"
    page.write_text(SCALING.read_text())
    write_memory(MEASURED, page)
    assert page.read_text() == SCALING.read_text()


def test_the_table_of_ranks_is_replaced_where_memory_has_been_measured(tmp_path):
    page = tmp_path / "scaling.md"
    page.write_text(SCALING.read_text())
    write_memory(tmp_path, page)
    assert page.read_text() == SCALING.read_text()
    row = {"dimension": 3, "unknowns": 1234567, "ranks": 2, "bytes an unknown": 99.6}
    row |= {"over one rank": 1.234, "linear solve": 50.2, "its over one rank": 1.119}
    Report(tmp_path).table("bench-memory", "", {key: [value] for key, value in row.items()})
    write_memory(tmp_path, page)
    text = page.read_text()
    assert "| 3-D | 1,234,567 | 2 | 100 | 1.23 | 50 | 1.12 |\n\n" in text
    assert text.count("| 2-D |") == 0
    assert text.endswith(SCALING.read_text()[-500:])


@pytest.mark.parametrize(("place", "name"), [where for where in PHASES.values() if where[0] != "~"])
def test_what_a_phase_is_measured_by_is_there(place, name):
    """A function that has moved would be a phase of no seconds."""
    assert f"def {name}(" in (Path(contact.__file__).parent / place).read_text()


def test_the_other_parts_are_measured_where_one_fails(tmp_path, monkeypatch, capsys):
    def fails(_: bench.Bench) -> None:
        raise RuntimeError("no such peer")

    def works(made: bench.Bench) -> None:
        made.report.table("peer-plain", "Plain", {"value": [1]})

    parts = {"d": (fails, ("bench-getfem",)), "e": (works, ("peer-plain",))}
    monkeypatch.setattr(bench, "PARTS", parts)
    monkeypatch.setattr(bench, "ORDER", "de")
    pages = [tmp_path / name for name in ("page.md", "scaling.md")]
    where = zip(("--page", "--scaling"), map(str, pages), strict=True)
    given = ["--out", str(tmp_path / "out"), *(word for pair in where for word in pair)]
    with pytest.raises(SystemExit, match="not measured: d"):
        bench.main([*given, "--parts", "d", "e"])
    assert "no such peer" in capsys.readouterr().err
    assert "**Plain**" in pages[0].read_text()


def test_tables_that_are_not_measured_stay_on_the_page(tmp_path):
    """`--parts` in a fresh clone left the tables that it made alone."""
    page, old, new = tmp_path / "page.md", tmp_path / "old", tmp_path / "new"
    names = "peer-pair", "peer-plain", "solvers"
    for name in names[:2]:
        Report(old).table(name, f"First {name}", {"value": [1]})
    write_page(old, names, page)
    for name in names[1:]:
        Report(new).table(name, f"Second {name}", {"value": [2]})
    write_page(new, names, page)
    once = page.read_text()
    titles = [line for line in once.splitlines() if line.startswith("**")]
    assert titles == ["**First peer-pair**", "**Second peer-plain**", "**Second solvers**"]
    assert once.count("Measured on ") == 3
    write_page(tmp_path / "nothing", names, page)
    assert page.read_text() == once


def test_a_case_may_ask_for_a_nested_start():
    """The benchmark handed a problem on with it, which `solve` refuses."""
    row = measured(bar(8, -0.005, 1e5, "solver.nested=true"))
    assert row["converged"]
