"""The command line: its options, exit status, outputs, signals and memory."""

import contextlib
import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from contact._compat import blas_among
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


@pytest.mark.parametrize(
    ("line", "fragment"),
    [
        ("", "accepted: as contact --help shows"),
        ("solve --restart", "--restart: expected one argument; accepted: as contact solve --help"),
        ("solv a.toml", "solv"),
        ("solve", "CASE.toml"),
        ("solve a.toml", "--out"),
        ("solve a.toml b.toml --out out", "b.toml: one argument too many; accepted: one case file"),
        ("materials PZT-4 Clevite", "Clevite: one argument too many; accepted: one name of a mat"),
        ("plot a b", "b: one argument too many; accepted: one folder with results"),
        ("solve a.toml --out out --plto", "did you mean --plot?"),
        ("solve nowhere.toml --out out", "nowhere.toml: No such file"),
        ("solve BAR --out out --set material.young=0", "material.young: given 0"),
        ("solve BAR --out BAR/out", "Not a directory; accepted: a folder to write to"),
        ("solve BAR --out /proc/self/x/out", "/out: No such file or directory; accepted: a folder"),
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


@pytest.mark.parametrize("stage", ["setup", "nested"])
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_before_the_solve_ends_the_run_in_words(
    bar, capsys, monkeypatch, stage, number, status
):
    import contact.refining
    import contact.solving

    before = [signal.getsignal(ending) for ending in (signal.SIGINT, signal.SIGTERM)]
    where = contact.solving if stage == "setup" else contact.refining
    monkeypatch.setattr(where, "build_problem", lambda *_, **__: signal.raise_signal(number))
    out = bar.parent / "out"
    nested = ["--set", "solver.nested=true", "--set", "mesh.cells=[32, 8]"]
    assert main(["solve", str(bar), "--out", str(out), *nested]) == status
    assert capsys.readouterr().err == f"contact: interrupted ({number.name})\n"
    assert not out.exists()
    assert before == [signal.getsignal(ending) for ending in (signal.SIGINT, signal.SIGTERM)]


@pytest.mark.parametrize("place", ["swallowed", "held"])
def test_no_signal_is_lost(bar, capsys, monkeypatch, place):
    """Libraries may swallow an exception, and those that are being loaded would not survive one."""
    import contact.cli.solve
    import contact.solving

    load, build = contact.cli.solve.load_case, contact.solving.build_problem

    def swallow(*args, **options):
        with contextlib.suppress(BaseException):
            signal.raise_signal(signal.SIGTERM)
        return build(*args, **options)

    def hold(*args):
        signal.raise_signal(signal.SIGTERM)
        return load(*args)

    if place == "swallowed":
        monkeypatch.setattr(contact.solving, "build_problem", swallow)
    else:
        monkeypatch.setattr(contact.cli.solve, "load_case", hold)
    out = bar.parent / "out"
    assert main(["solve", str(bar), "--out", str(out), "--quiet"]) == 143
    assert out.exists() == (place == "swallowed")
    assert "interrupted (SIGTERM)" in capsys.readouterr().err


def test_too_little_memory_is_said_in_words(bar, capsys, monkeypatch):
    import contact.solving

    def build(*_, **__):
        raise MemoryError("std::bad_alloc")

    monkeypatch.setattr(contact.solving, "build_problem", build)
    assert main(["solve", str(bar), "--out", str(bar.parent / "out")]) == 2
    shown = capsys.readouterr().err
    assert shown.startswith("contact: not enough memory; accepted: fewer cells")
    assert shown.count("\n") == 1


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


@pytest.mark.parametrize(
    ("paths", "name"),
    [
        (["/usr/lib/x86_64-linux-gnu/blas/libblas.so.3.12.1"], "reference"),
        (["/usr/lib/x86_64-linux-gnu/openblas-pthread/libblas.so.3"], "OpenBLAS"),
        (["/opt/conda/lib/libopenblasp-r0.3.29.so"], "OpenBLAS"),
        (["/opt/mkl/libmkl_core.so.2", "/opt/mkl/libmkl_rt.so"], "MKL"),
        (["/usr/lib64/libflexiblas.so.3.4"], "FlexiBLAS"),
        (
            [
                "/x/numpy.libs/libscipy_openblas64_.so",
                "/usr/lib/x86_64-linux-gnu/blas/libblas.so.3",
            ],
            "reference",
        ),
        (["/lib/libc.so.6"], "unknown"),
    ],
)
def test_the_blas_is_told_from_the_loaded_libraries(paths, name):
    assert blas_among(paths)[0] == name


@pytest.mark.parametrize("name", ["meshes.py", "forms/__init__.py"])
def test_files_with_the_names_of_our_packages(name: str, tmp_path: Path) -> None:
    """The working folder comes first in Python's path, and hides nothing."""
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("")
    command = [sys.executable, "-m", "contact", "check", "case.toml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "case.toml: No such file" in done.stderr


def test_a_reader_that_has_seen_enough() -> None:
    """`contact materials | head -1` ends in silence."""
    line = f"set -o pipefail; {sys.executable} -m contact materials | head -1"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert done.returncode in (0, 141)
    assert done.stdout.count("\n") == 1
    assert done.stderr == ""
