"""The README shows the commands and the output that there are."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from contact.cli.main import main
from tests.docs.pages import ROOT, blocks, run

README = ROOT / "README.md"


def test_the_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = tmp_path / "README.md"
    page.write_text(re.sub(r"```sh\n.*?```", "", README.read_text(), flags=re.DOTALL))
    assert run(page)["solution"].converged


def rows(text: str) -> list[list[str]]:
    """Return the rows of the table of Newton's steps."""
    return [line.split() for line in text.splitlines() if re.match(r" +1(\.\d+)? ", line)]


def test_the_run_prints_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts and zones to the digit; results and residuals in front of rounding to theirs."""
    pytest.importorskip("gmsh")
    pytest.importorskip("pyvista")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scripts").symlink_to(ROOT / "scripts")
    (command,) = (block.text for block in blocks(README) if block.language == "sh")
    (shown,) = (block.text for block in blocks(README) if block.language == "text")
    words = shlex.split(command.replace("\\\n", " "))
    assert main(words[words.index("contact") + 1 :]) == 0
    printed = capsys.readouterr()
    ours, theirs = rows(printed.err), rows(shown)
    assert [row[:2] + row[5:] for row in ours] == [row[:2] + row[5:] for row in theirs]
    for row, other in zip(ours[1:8], theirs[1:8], strict=True):
        assert np.allclose([*map(float, row[3:5])], [*map(float, other[3:5])], rtol=0.1)
    numbers = [
        [float(x) for x in re.findall(r"-?\d+\.?\d*", text.partition("seconds")[0])]
        for text in (printed.out, shown[shown.index("converged") :])
    ]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-3)
    errors = [float(re.findall(r"error ([\d.]+) %", text)[0]) for text in (printed.out, shown)]
    assert errors[0] == pytest.approx(errors[1], rel=0.05)
