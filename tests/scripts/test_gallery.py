"""The tables of the gallery are those of the program, and its references are met."""

import re
from pathlib import Path

import pytest

from contact import load_case
from scripts.cases import CASES
from scripts.gallery import EXAMPLES, FOLDER, on_meshes, row, solved
from tests.docs.pages import ROOT

#: Examples that take less than half a second.
SHORT = ("hertz", "press-fit", "column", "layer")


def shown(name: str) -> list[tuple[str, str, str]]:
    """Return the rows of a table: quantity, computed, reference."""
    text = (FOLDER / f"{name}.md").read_text()
    return re.findall(r"^\| (.+) \| (\S+) \| (\S+) \| .+ \|$", text, re.M)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in SHORT else pytest.mark.slow)
        for name, one in EXAMPLES.items()
        if not one.meshes
    ],
)
def test_an_example_has_the_values_of_its_table(name: str, tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    example = EXAMPLES[name]
    found = list(example.compare(solved(example, tmp_path, figures=False)))
    rows = shown(name)
    assert [name for name, *_ in rows] == [quantity for quantity, _, _ in found]
    for (_, *texts), (_, computed, reference) in zip(rows, found, strict=True):
        assert float(texts[0]) == pytest.approx(computed, rel=1e-3)
        assert float(texts[1]) == pytest.approx(reference, rel=1e-3)
        assert computed == pytest.approx(reference, rel=example.within)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, one in EXAMPLES.items() if one.meshes])
def test_a_coarse_mesh_has_the_values_of_its_table(name: str, tmp_path: Path) -> None:
    """That of the example and the finest one take minutes: their rows are those of its page."""
    pytest.importorskip("gmsh")
    example, kept = EXAMPLES[name], on_meshes(name)
    run = solved(example, tmp_path, figures=False, changes=example.meshes[0][1])
    case = load_case(CASES / f"{example.case}.toml")
    assert case.title and max(run.summary["kkt"].values()) <= case.solver.tolerance
    for quantity, computed in row(run).items():
        assert float(kept[0][quantity]) == pytest.approx(computed, rel=1e-3)
    assert [words for words, _ in example.meshes] == [one["cells"] for one in kept]
    for quantity, computed, reference in shown(name):
        assert float(computed) == pytest.approx(float(kept[1][quantity]), rel=1e-3)
        assert float(reference) == pytest.approx(float(kept[-1][quantity]), rel=1e-3)
        assert float(computed) == pytest.approx(float(reference), rel=example.within)
    text = (FOLDER / f"{name}-meshes.md").read_text()
    for one in kept:
        error = f"{100 * float(one['estimated error']):.2g} %"
        assert f"| {one['cells']} | {one['unknowns']} | " in text and f"| {error} |" in text


def test_every_example_has_its_page() -> None:
    pages = {path.stem.removeprefix("example-") for path in (ROOT / "docs").glob("example-*.md")}
    assert pages == set(EXAMPLES)
    for name, example in EXAMPLES.items():
        text = (ROOT / "docs" / f"example-{name}.md").read_text()
        assert f"scripts/cases/{example.case}.toml" in text
        assert all(change in text for change in example.changes)
