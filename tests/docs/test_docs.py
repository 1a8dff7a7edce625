"""Every code block of the documentation runs, links lead somewhere, the index has all pages."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import ROOT, blocks, run

DOCS = ROOT / "docs"
PAGES = sorted(
    path for path in DOCS.glob("*.md") if path.name not in ("architecture.md", "results.md")
)
#: What makes the problems of a page small.
SMALL = {'bar.toml")': 'bar.toml", ["mesh.cells=[16, 4]"])'}


def shows_code(page: Path) -> bool:
    """Tell whether there is something to run on a page."""
    return any(block.language in ("python", "sh", "toml") for block in blocks(page))


@pytest.mark.parametrize("page", filter(shows_code, PAGES), ids=lambda page: page.stem)
def test_code_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a folder of its own, as a reader would type it."""
    for module in ("gmsh", "pyvista", "meshio"):
        if re.search(rf"^import {module}|^from {module}", page.read_text(), re.M):
            pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    if page.stem == "output":  # it opens what a run has left
        assert run_bar(tmp_path) == 0
    run(page, SMALL)


def run_bar(folder: Path) -> int:
    from contact.cli.main import main

    case = str(ROOT / "scripts" / "cases" / "bar.toml")
    coarse = ["--set", "mesh.cells=[16, 4]", "--quiet"]
    return main(["solve", case, "--out", str(folder / "results"), *coarse])


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text()):
        assert (page.parent / target).exists(), target
        if target.endswith(".png"):  # a whole one
            assert (page.parent / target).read_bytes()[-8:-4] == b"IEND", target


def test_the_index_has_all_pages() -> None:
    index = (DOCS / "index.md").read_text()
    listed = set(re.findall(r"^([a-z-]+)$", index, re.M))
    assert {page.stem for page in DOCS.glob("*.md")} - {"index"} <= listed


def test_pages_build_without_warnings(tmp_path: Path) -> None:
    """All but the notebooks, which `make docs` executes first."""
    pytest.importorskip("sphinx")
    pytest.importorskip("myst_parser")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-D"]
    command += ["exclude_patterns=results/**,notebooks/**", str(DOCS), str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "Domain.from_mesh" in (tmp_path / "api.html").read_text()
    if Path("/usr/share/javascript/mathjax").is_dir():  # formulas are drawn without a network
        assert "_static/mathjax/MathJax.js" in (tmp_path / "theory.html").read_text()
        assert (tmp_path / "_static/mathjax/jax/output/SVG/jax.js").exists()
