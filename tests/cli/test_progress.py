"""What is shown of a run: lines of what leads, a bar over steps on a terminal, a log of all."""

import contextlib
import json
import logging
import os
import pty
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from contact.cli.main import main
from contact.cli.progress import HEAD, Console, shown
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
    assert HEAD not in shown and "iteration 1:" in log.read_text()


def test_a_static_solve_has_a_line_an_iteration(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = str(CASES / "bar.toml")
    changes = ["--set", "mesh.cells=[8,2]", "--set", "solver.method=newton"]
    assert main(["solve", case, "--out", str(tmp_path), *changes]) == 0
    shown = capsys.readouterr()
    head, *rows = [line for line in shown.err.splitlines() if not line.startswith("warning")]
    assert head == HEAD
    summary = json.loads((tmp_path / "summary.json").read_text())
    steps = [row.split()[0] for row in rows]
    assert steps[:2] == ["1.1", "1.2"]
    assert [step for step in steps if "." not in step] == [
        str(i + 1) for i in range(summary["outer_iterations"])
    ]
    counts = [int(count) for count in rows[-1].split()[5:8]]
    assert counts[1:] == [summary["stick_nodes"], summary["slip_nodes"]]
    assert sum(counts) == 8
    assert float(rows[-1].split()[2]) > 0  # raw, not less its rounding
    force, _, pressure = (line.split() for line in shown.out.splitlines()[1:4])
    assert float(force[-1].strip("()")) == pytest.approx(summary["contact_force"][1], rel=1e-5)
    assert float(pressure[2]) == pytest.approx(summary["max_pressure"], rel=1e-5)


def test_verbose_shows_all_lines_with_the_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["solve", str(CASES / "fretting.toml"), "--out", str(tmp_path / "out"), *STEPS]
    assert main([*arguments, "-v"]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert lines and all(re.match(r"\d\d:\d\d:\d\d ", line) for line in lines)
    said = [line.split(" ", 1)[1] for line in lines]
    assert sum(line.startswith("t = ") for line in said) == 5
    assert sum(line.startswith("iteration ") for line in said) > 5


def test_long_tables_are_thinned() -> None:
    assert [i for i in range(1000) if shown(i)] == [*range(31), *range(40, 100, 10),
                                                    *range(100, 1000, 100)]  # fmt: skip


def test_a_sweep_has_a_line_a_case(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = str(CASES / "bar.toml")
    arguments = ["--over", "friction.mu=0.1,0.3", "--set", "mesh.cells=[8,2]"]
    assert main(["sweep", case, "--out", str(tmp_path), *arguments]) == 0
    shown = capsys.readouterr().err
    assert re.findall(r"^friction.mu=(\S+): all residuals", shown, re.M) == ["0.1", "0.3"]
    assert HEAD not in shown


def test_a_terminal_of_unknown_width(tmp_path: Path) -> None:
    """Numbers are short there, and nothing of the bar is left."""
    out, master, slave = tmp_path / "out", *pty.openpty()
    command = [sys.executable, "-m", "contact", "solve", str(CASES / "fretting.toml"), *STEPS]
    done = subprocess.run([*command, "--out", str(out)], stderr=slave, stdout=slave, check=True)
    os.close(slave)
    shown = b""
    with contextlib.suppress(OSError):  # at the end of what was written
        while part := os.read(master, 65536):
            shown += part
    os.close(master)
    bar, *_ = re.split(rb"converged: ", shown)
    assert done.returncode == 0 and b"100%|" in bar and re.search(rb"\r +\r$", bar)
    assert not re.search(rb"\d\.\d{6}", bar)


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
    bar = Console(bar=shown)
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
