"""The command line: its options, exit status, outputs, signals and memory."""

import json
import signal
import tomllib

import pytest

from contact.case.file import load_case, parse_case
from contact.cli.arguments import parse
from contact.cli.main import main
from contact.cli.progress import HEAD


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
