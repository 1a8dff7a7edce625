"""The notebooks run, as scripts; `make docs` runs them as notebooks."""

import logging
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "scripts" / "notebooks").glob("[a-z]*.py"))


#: Those that run in short runs too.
SHORT = ("two_bodies",)


@pytest.fixture(autouse=True)
def _warnings_afterwards() -> Iterator[None]:
    """Let no notebook that silences warnings do so for the tests after it."""
    logger = logging.getLogger("contact")
    level = logger.level
    yield
    logger.setLevel(level)


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")  # nobody sees them
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, id=path.stem, marks=() if path.stem in SHORT else pytest.mark.slow)
        for path in NOTEBOOKS
    ],
)
def test_notebook(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    for module in ("gmsh", "pyvista"):
        if f"import {module}" in path.read_text():
            pytest.importorskip(module)
    runpy.run_path(str(path))
    pyplot.close("all")
