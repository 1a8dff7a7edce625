"""The results pages and the runner of tables and figures."""

from __future__ import annotations

import ast
import importlib.util
import re
from collections.abc import Iterator

import pytest

from scripts.reporting import Report, subplots, text
from scripts.studies import agreement
from scripts.thesis import chapters, hertz, results_page, tables
from tests.test_architecture import ROOT


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


def remarks(node: ast.AST) -> Iterator[list[str | None]]:
    """Give the sentences of a script, without docstrings, with None for each inserted value."""
    inner = list(ast.iter_child_nodes(node))
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
        inner.remove(node.body[0])
    if isinstance(node, ast.JoinedStr | ast.Constant):
        values = node.values if isinstance(node, ast.JoinedStr) else [node]
        parts = [part.value if isinstance(part, ast.Constant) else None for part in values]
        said = "".join(part for part in parts if isinstance(part, str))
        if len(said) > 60 and said.rstrip().endswith("."):
            yield parts
    else:
        for child in inner:
            yield from remarks(child)


#: Remarks on tables and figures of which pages show the picture or the numbers alone.
UNSHOWN = (
    "inner and 6 outer iterations",
    "In a box of 20 contact radii",
    "Pressure beneath indenters",
    "half balls' deformation elsewhere",
    "A block of 2 x 1 mm",
    "is found with nodes",
)


def test_remarks_on_pages_are_those_of_the_scripts():
    shown = [ROOT / "docs" / f"{name}.md" for name in chapters.PAGES]
    shown += sorted((ROOT / "docs" / "results").glob("*/*.md"))
    pages, found, missing = "".join(path.read_text() for path in shown), 0, []
    scripts = [
        path for name in ("thesis", "studies") for path in (ROOT / "scripts" / name).iterdir()
    ]
    for path in scripts:
        if path.suffix != ".py" or path.name == "results_page.py":  # that is compared as a whole
            continue
        for parts in remarks(ast.parse(path.read_text())):
            words = "".join(part or "\0" for part in parts).split()
            said = r"\s+".join(".+?".join(map(re.escape, word.split("\0"))) for word in words)
            found += 1
            if not re.search(said, pages):
                missing.append(" ".join(words))
    assert found > 90
    assert [text for text in missing if not any(part in text for part in UNSHOWN)] == []


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
