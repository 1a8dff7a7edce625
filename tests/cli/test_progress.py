"""What is shown of a run: a table or lines, a bar on a terminal, a log of all."""

import json
from pathlib import Path

import pytest

from contact.cli.main import main
from contact.cli.progress import HEAD
from scripts.cases import CASES


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
