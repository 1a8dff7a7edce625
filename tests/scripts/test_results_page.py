"""The results pages and the runner of tables and figures."""

from __future__ import annotations

import importlib.util

import pytest

from scripts.reporting import Report, subplots, text
from scripts.studies import agreement
from scripts.thesis import chapters, hertz, results_page, tables


def test_page(tmp_path):
    report = Report(tmp_path / "results" / "hertz")
    report.table("one", "A table", {"|a|": [1, 2.5, float("nan")], "b": ["x", True, None]}, "Why.")
    figure, axes = subplots()
    axes.plot([0, 1], [0, 1])
    report.figure("two", "A figure", figure, {"x": [0, 1], "y": [0]})
    (tmp_path / "results" / "hertz" / "three.csv").write_text("a,b\n1,2\n")
    page = tmp_path / "docs" / "page.md"
    results_page.gather(tmp_path / "results", page)
    assert "hertz" in page.read_text()
    words = page.with_name("thesis-mechanics.md").read_text()
    assert "| \\|a\\| | b |" in words
    assert "| 2.5 | yes |" in words
    assert "| — | — |" in words
    assert "Why." in words
    assert words.index("A table") < words.index("A figure") < words.index("three")
    assert "](page/hertz/two.png)" in words
    assert (tmp_path / "docs" / "page" / "hertz" / "two.png").is_file()
    assert (tmp_path / "docs" / "page" / "hertz" / "one.csv").read_text().startswith("|a|,b")
    assert "Not computed yet: `make table_7_2`" in words


def test_one_section_is_renewed_and_the_others_stay(tmp_path):
    page = tmp_path / "docs" / "page.md"
    for words in ("before", "after"):
        for script in ("hertz", "corner"):
            Report(tmp_path / words / script).table("one", f"{script}, {words}", {"a": [1]})
    results_page.gather(tmp_path / "before", page)
    chapter = page.with_name("thesis-mechanics.md")
    whole = chapter.read_text()
    results_page.main(
        ["--gather", "--only", "corner", "--page", str(page), "--out", str(tmp_path / "after")]
    )
    assert chapter.read_text() == whole.replace("corner, before", "corner, after")
    results_page.gather(tmp_path / "nothing", page)
    assert chapter.read_text() == whole.replace("corner, before", "corner, after")


def test_values_in_tables():
    assert text(3) == "3"
    assert text(1e-9) == "1e-09"
    assert text(False) == "no"


@pytest.mark.parametrize("main", [tables.main, results_page.main, agreement.main])
def test_unknown_script(main, capsys):
    with pytest.raises(SystemExit):
        main(["--only", "hurtz"])
    said = capsys.readouterr().err
    assert "'hurtz'" in said and "hertz" in said.partition("choose from")[2]


@pytest.mark.parametrize("part", chapters.PARTS, ids=lambda part: part.script)
def test_all_scripts_are_there(part):
    assert importlib.util.find_spec(part.module) is not None


def test_hertz(tmp_path):
    hertz.main(["--coarse", "--out", str(tmp_path)])
    for name in ("hertz-cylinder.csv", "hertz-sphere.md", "figure-7-2a.png", "figure-7-2b.png"):
        assert (tmp_path / name).is_file()
