"""What the README shows is what there is."""

import re
import tomllib
from pathlib import Path

from scripts.cases import CASES
from tests.docs.pages import ROOT, blocks, run

README = ROOT / "README.md"


def test_it_is_short():
    assert len(README.read_text().splitlines()) < 200


def test_the_case_is_that_of_the_file():
    (shown,) = (block.text for block in blocks(README) if block.language == "toml")
    assert tomllib.loads(shown) == tomllib.loads((CASES / "bar.toml").read_text())


def test_links_lead_somewhere():
    text = README.read_text()
    targets = re.findall(r"\]\(([^)#:]+)\)", text) + re.findall(r'src="([^"]+)"', text)
    for target in targets:
        assert (ROOT / target).exists(), target


def test_it_runs(tmp_path: Path, monkeypatch):
    """On coarse meshes, commands and Python."""
    monkeypatch.chdir(tmp_path)
    coarse = "cases/bar.toml --set mesh.cells='[16, 4]' --quiet"
    small = {
        'bar.toml")': 'bar.toml", ["mesh.cells=[16, 4]"])',
        "solve scripts/cases/bar.toml": f"solve scripts/{coarse}",
    }
    assert run(README, small)["solution"].converged
    assert (tmp_path / "results" / "bar" / "figure-stress_xy.pdf").exists()
