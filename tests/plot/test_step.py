"""Figures of one step of an evolution."""

from pathlib import Path

import numpy as np
import pytest

from contact.cli.main import main
from contact.plot.run import read_run, read_step
from scripts.cases import CASES

SMALL = ["--set", "mesh.cells=[8,4]", "--set", "evolution.steps=[1,2,1,1]", "--quiet"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fretting")
    assert main(["solve", str(CASES / "fretting.toml"), "--out", str(folder), *SMALL]) == 0
    return folder


def test_a_step_is_drawn(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Contact and body of the step, in files that end with its number."""
    assert main(["plot", str(run), "--step", "2"]) == 0
    drawn = {path.name for path in run.glob("figure-*-step-2.png")}
    assert drawn == {"figure-contact-step-2.png", "figure-deformed-step-2.png"}
    step, last = read_step(run, 2), read_run(run)
    tables = last.tables
    assert abs(step.table["moved"]).max() < 1e-12  # the foundation is at rest
    np.testing.assert_array_equal(step.table["pressure"], tables[1]["pressure"])
    assert abs(step.table["tau"] - last.table["tau"]).max() > 0
    own = step.surface["row"] >= 0
    pressure = tables[1]["pressure"][step.surface["row"][own].astype(int)]
    np.testing.assert_allclose(step.surface["pressure"][own], pressure, rtol=1e-6)
    assert step.title.endswith("t = 1.5")
    assert main(["plot", str(run), "--step", "6"]) == 2
    assert "--step 6: no fields of such a step; accepted: 1, 2, 3, 4, 5" in capsys.readouterr().err
