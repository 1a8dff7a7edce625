"""The notebook of the forms runs, as a script and as a notebook."""

import runpy
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).parents[2] / "scripts" / "examples" / "explore_forms.py"


def test_as_a_script(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    names = runpy.run_path(str(NOTEBOOK))
    assert len(pyplot.get_fignums()) == 1
    pyplot.close("all")
    assert names["asymmetry"](names["secant"]) < 1e-14


@pytest.mark.slow
def test_as_a_notebook(monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel shows figures in the notebook
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = jupytext.read(NOTEBOOK)
    place = {"metadata": {"path": str(NOTEBOOK.parents[2])}}
    client = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources=place)
    client.execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("saddle form" in output.get("text", "") for output in outputs)
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 1
