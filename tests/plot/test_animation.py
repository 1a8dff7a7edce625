"""Animations of evolutions: one frame a step, with the same axes and colours."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from contact.cli.main import main
from contact.plot.run import read_run, read_step, read_steps
from scripts.cases import CASES

SMALL = ["--set", "mesh.cells=[8,4]", "--set", "evolution.steps=[1,2,1,1]", "--quiet"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fretting")
    assert main(["solve", str(CASES / "fretting.toml"), "--out", str(folder), *SMALL]) == 0
    return folder


def test_one_frame_a_step(run: Path) -> None:
    assert main(["plot", str(run), "--animate", "--width", "80mm"]) == 0
    image = Image.open(run / "animation-deformed.gif")
    assert image.n_frames == 5
    frames = []
    for k in range(image.n_frames):
        image.seek(k)
        frames.append(np.asarray(image.convert("RGB"), dtype=int))
    # All have one size and one bar of colours, at the bottom; the body in the middle changes.
    height = frames[0].shape[0]
    assert len({frame.shape for frame in frames}) == 1
    assert abs(frames[0][-height // 5 :] - frames[-1][-height // 5 :]).max() < 8
    assert abs(frames[0] - frames[-1]).max() > 100


def test_frames_are_the_steps(run: Path) -> None:
    frames = read_steps(run)
    assert [time for time, _ in frames] == pytest.approx([1.0, 1.5, 2.0, 4.0, 6.0])
    # The foundation is at rest: what is opposite of the nodes has not moved.
    for _, step in frames:
        assert abs(step.table["moved"]).max() < 1e-12


def test_a_step_is_drawn(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Contact and body of the step, in files that end with its number."""
    assert main(["plot", str(run), "--step", "2"]) == 0
    drawn = {path.name for path in run.glob("figure-*-step-2.png")}
    assert drawn == {"figure-contact-step-2.png", "figure-deformed-step-2.png"}
    step, last = read_step(run, 2), read_run(run)
    tables = last.tables
    np.testing.assert_array_equal(step.table["pressure"], tables[1]["pressure"])
    assert abs(step.table["tau"] - last.table["tau"]).max() > 0
    own = step.surface["row"] >= 0
    pressure = tables[1]["pressure"][step.surface["row"][own].astype(int)]
    np.testing.assert_allclose(step.surface["pressure"][own], pressure, rtol=1e-6)
    assert step.title.endswith("t = 1.5")
    assert main(["plot", str(run), "--step", "6"]) == 2
    assert "--step 6: no fields of such a step; accepted: 1, 2, 3, 4, 5" in capsys.readouterr().err
    assert main(["plot", str(run), "--step", "2", "--animate"]) == 2
    assert "an animation shows all steps" in capsys.readouterr().err
