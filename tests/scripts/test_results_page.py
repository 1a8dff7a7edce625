"""The results pages and the runner of tables and figures."""

from __future__ import annotations

import importlib.util

import pytest

from scripts.reporting import Report, subplots
from scripts.thesis import chapters, hertz, results_page


def test_page(tmp_path):
    report = Report(tmp_path / "results" / "hertz")
    report.table("one", "A table", {"|a|": [1, 2.5, float("nan")], "b": ["x", True, None]}, "Why.")
    figure, axes = subplots()
    axes.plot([0, 1], [0, 1])
    link = "See [two](thesis-studies.md#two)."
    report.figure("two", "A figure", figure, {"x": [0, 1], "y": [0]}, link)
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
    assert "](page/hertz/two.png)" in words and link in words
    assert (tmp_path / "docs" / "page" / "hertz" / "two.png").is_file()
    assert (tmp_path / "docs" / "page" / "hertz" / "one.csv").read_text().startswith("|a|,b")
    assert "Not computed yet: `make table_7_2`" in words


@pytest.mark.parametrize("part", chapters.PARTS, ids=lambda part: part.script)
def test_all_scripts_are_there(part):
    assert importlib.util.find_spec(part.module) is not None


def test_hertz(tmp_path):
    hertz.main(["--coarse", "--out", str(tmp_path)])
    for name in ("hertz-cylinder.csv", "hertz-sphere.md", "figure-7-2a.png", "figure-7-2b.png"):
        assert (tmp_path / name).is_file()
