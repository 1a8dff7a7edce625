"""The command line: its options, exit status, outputs, signals and memory.

The example and the schema that come with the package.
What is shown of a run: a table or lines, a bar on a terminal, a log of all.
Wrong command lines, and PETSc's options.
"""

import json
import signal
import tomllib
from pathlib import Path

import pytest
from petsc4py import PETSc

from contact.case.file import load_case, parse_case
from contact.cli.arguments import parse
from contact.cli.main import main
from contact.cli.progress import HEAD
from contact.cli.solve import DEMO
from scripts.cases import CASES
from tests.cli.running import BAR, refuse, write


def test_petsc_options_are_told_from_ours():
    line = "solve a.toml --out out --set a.b=1 -ksp_type cg --quiet -mat_view -eps -1.5 --set c=2"
    options, petsc = parse(line.split())
    assert (options.case, options.out, options.quiet, options.plot) == (
        "a.toml",
        "out",
        True,
        False,
    )
    assert options.set == ["a.b=1", "c=2"]
    assert petsc == "-ksp_type cg -mat_view -eps -1.5".split()
    assert parse("check a.toml -help -history".split())[1] == ["-help", "-history"]
    assert parse("plot out --view -1,0,-.5".split())[0].view == "-1,0,-.5"


@pytest.mark.parametrize(
    ("line", "fragment"),
    [
        ("solv a.toml", "solv"),
        ("solve", "CASE.toml"),
        ("solve a.toml", "--out"),
        ("solve a.toml --out out --plto", "--plot"),
        ("solve nowhere.toml --out out", "nowhere.toml"),
        ("solve BAR --out out --set material.young=0", "material.young"),
        ("solve BAR --out /proc/self/x/out", "/out"),
        ("check BAR --set contact.on=flor", "contact.on"),
        ("solve BAR --out out --set load.3.on=top", "load.3"),
        ("solve BAR --out=", "no folder"),
    ],
)
def test_bad_command_lines_leave_with_status_2(bar, capsys, monkeypatch, line, fragment):
    monkeypatch.chdir(bar.parent)
    assert main(line.replace("BAR", str(bar)).split()) == 2
    message = capsys.readouterr().err
    assert fragment in message
    assert message.count("\n") == 1 and message.startswith("contact: ")
    assert sorted(path.name for path in bar.parent.iterdir()) == ["bar.toml"]


@pytest.mark.core
@pytest.mark.parametrize(("limit", "status"), [(100, 0), (1, 1)])
def test_exit_status_and_outputs_of_a_solve(bar, capsys, monkeypatch, limit, status):
    written = []

    def write(solution, out, figures):
        written.append((solution.converged, out.path))

    monkeypatch.setattr("contact.cli.solve.write_outputs", write)
    changes = ["--set", "solver.method=uzawa", "--set", f"solver.max_outer={limit}"]
    assert main(["solve", str(bar), "--out", str(bar.parent / "out"), *changes]) == status
    assert written == [(status == 0, bar.parent / "out")]
    shown = capsys.readouterr()
    assert shown.out.startswith("stopped: " if status else "converged: ")
    assert HEAD in shown.err


@pytest.mark.core
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_in_a_solve_keeps_what_there_is(bar, capsys, monkeypatch, number, status):
    from contact.methods.report import Recorder

    add = Recorder.add

    def press(history, record):
        signal.raise_signal(number)
        add(history, record)

    monkeypatch.setattr(Recorder, "add", press)
    out = bar.parent / "out"
    assert main(["solve", str(bar), "--out", str(out), "--quiet"]) == status
    assert json.loads((out / "summary.json").read_text())["converged"] is False
    shown = capsys.readouterr()
    assert shown.out == ""
    assert f"contact: stopped: interrupted ({number.name}); results in {out}" in shown.err


@pytest.mark.core
def test_check_prints_the_case_the_parts_and_the_unknowns(bar, capsys):
    assert main(["check", str(bar), "--set", "solver.method=uzawa"]) == 0
    text = capsys.readouterr().out
    assert parse_case(tomllib.loads(text), source=str(bar)) == load_case(
        bar, ["solver.method=uzawa"]
    )
    assert "32 cells in 2-D" in text
    assert "loaded  4" in text
    assert "unknowns: 54 (2 a node)" in text
    assert "blas: " in text


def test_the_example_is_solved_with_its_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert DEMO.resolve() == (CASES / "bar.toml").resolve()
    monkeypatch.chdir(tmp_path)
    coarse = ["demo", "--quiet", "--set"]
    assert main([*coarse, "mesh.cells=[8, 2]"]) == 0
    assert json.loads((tmp_path / "contact-demo/summary.json").read_text())["converged"]
    assert (tmp_path / "contact-demo/figure-contact.png").exists()
    assert main([*coarse, "mesh.cells=[16, 4]"]) == 2
    assert "accepted: --overwrite" in capsys.readouterr().err
    assert main([*coarse, "mesh.cells=[16, 4]", "--overwrite"]) == 0


def test_the_schema_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    assert set(json.loads(capsys.readouterr().out)["required"]) == {"mesh", "material", "contact"}


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


@pytest.mark.parametrize(
    ("option", "value", "method"),
    [
        ("contact_ksp_type", "foo", "newton"),
        ("contact_pc_factor_mat_solver_type", "foo", "uzawa"),
        ("penalty_snes_type", "foo", "penalty"),
    ],
)
def test_wrong_petsc_options(
    option: str, value: str, method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What PETSc does not know is bad input, and nothing is left in its options."""
    options = PETSc.Options()
    options[option] = value
    before = set(options.getAll())
    try:
        case = write(shared_tmp_path, BAR + f"[solver]\nmethod = '{method}'\n")
        refuse(case, ["PETSc", value, option.split("_")[0]], capfd)
        assert set(options.getAll()) == before
    finally:
        options.delValue(option)
