"""The tables of the gallery are those of the program, and its references are met."""

import re
from pathlib import Path

import pytest

from scripts.gallery import EXAMPLES, FOLDER, on_meshes, solved
from tests.docs.pages import ROOT


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_has_the_values_of_its_table(name: str, tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    example = EXAMPLES[name]
    shown = (FOLDER / f"{name}.md").read_text()
    rows = re.findall(r"^\| (.+) \| (\S+) \| (\S+) \| .+ \|$", shown, re.M)
    run = solved(example, tmp_path, figures=False)
    found = list(example.compare(run))
    assert [row[0] for row in rows] == [quantity for quantity, _, _ in found]
    for row, (_, computed, reference) in zip(rows, found, strict=True):
        assert float(row[1]) == pytest.approx(computed, rel=1e-3)
        assert float(row[2]) == pytest.approx(reference, rel=1e-3)
        assert computed == pytest.approx(reference, rel=example.within)
    if example.meshes:
        # The first of its meshes is that of the case; the page shows the numbers of the file.
        kept = on_meshes(name)
        assert float(kept[0]["estimated error"]) == pytest.approx(
            run.summary["error"]["energy"], 1e-3
        )
        text = (FOLDER / f"{name}-meshes.md").read_text()
        for row in kept:
            shares = f"{100 * float(row['estimated error']):.2g} %"
            assert f"| {row['cells']} | {row['unknowns']} | " in text and f"| {shares} |" in text


def test_every_example_has_its_page() -> None:
    pages = {path.stem.removeprefix("example-") for path in (ROOT / "docs").glob("example-*.md")}
    assert pages == set(EXAMPLES)
    for name, example in EXAMPLES.items():
        text = (ROOT / "docs" / f"example-{name}.md").read_text()
        assert f"scripts/cases/{example.case}.toml" in text
        assert all(change in text for change in example.changes)
