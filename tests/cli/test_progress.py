"""What is shown of a run: lines of what leads, a bar over steps on a terminal, a log of all."""

import logging
import re
from pathlib import Path
from typing import Any

import pytest

from contact.cli.main import main
from contact.cli.progress import _Bar
from contact.methods.report import tell
from scripts.cases import CASES

STEPS = ["--set", "mesh.cells=[8,4]", "--set", "evolution.steps=[1,2,1,1]"]


def test_an_evolution_has_a_line_a_step(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "run.log"
    arguments = ["solve", str(CASES / "fretting.toml"), "--out", str(tmp_path / "out"), *STEPS]
    assert main([*arguments, "--log", str(log)]) == 0
    shown = capsys.readouterr().err
    found = re.findall(r"^t = ([\d.]+) of 6: iterations \d+, residual \S+e-\d+$", shown, re.M)
    assert [float(time) for time in found] == [1.0, 1.5, 2.0, 4.0, 6.0]
    assert "iteration 1:" not in shown and "iteration 1:" in log.read_text()


def test_a_static_solve_has_a_line_an_iteration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = str(CASES / "bar.toml")
    assert main(["solve", case, "--out", str(tmp_path), "--set", "mesh.cells=[8,2]"]) == 0
    assert "iteration 1:" in capsys.readouterr().err


def test_a_sweep_has_a_line_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(CASES / "bar.toml")
    arguments = ["--over", "friction.mu=0.1,0.3", "--set", "mesh.cells=[8,2]"]
    assert main(["sweep", case, "--out", str(tmp_path), *arguments]) == 0
    shown = capsys.readouterr().err
    assert re.findall(r"^friction.mu=(\S+): all residuals", shown, re.M) == ["0.1", "0.3"]
    assert "iteration 1:" not in shown


class Tqdm:
    """Keeps what tqdm would show."""

    n, total, bar_format = 0.0, None, None

    def __init__(self) -> None:
        self.words: list[str] = []
        self.above: list[str] = []

    def set_postfix_str(self, text: str, refresh: bool = True) -> None:
        self.words.append(text)

    def update(self, count: int) -> None:
        self.n += count

    def write(self, text: str, file: Any) -> None:
        self.above.append(text)

    def close(self) -> None:
        pass


def test_the_bar_is_over_what_leads() -> None:
    shown = Tqdm()
    bar = _Bar(shown)
    logger = logging.getLogger("contact")
    logger.addHandler(bar)
    level = logger.level
    logger.setLevel(logging.DEBUG)
    try:
        steps, sweep = (logging.getLogger(f"contact.{name}") for name in ("steps", "sweep"))
        tell(steps, 0.25, "t = %g of %g", 0.5, 2.0)
        assert (shown.n, shown.total, shown.words[-1]) == (0.25, 1.0, "t = 0.5 of 2")
        tell(sweep, 0.5, "friction.mu=0.1")
        tell(steps, 0.75, "t = 1.5 of 2")  # of the next case, whose share is that of the sweep
        assert shown.n == 0.5
        logging.getLogger("contact.solve").warning("several solutions may exist")
        assert shown.above == ["warning: several solutions may exist"]
    finally:
        logger.setLevel(level)
        logger.removeHandler(bar)
