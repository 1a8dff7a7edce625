"""A folder of results: old or new ones at any moment, one run at a time, nothing of a user's."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from contact.case.file import to_toml
from contact.cli.main import main
from contact.errors import InputError
from contact.io.folder import LOCK, STAGE, ResultFolder, result_folder, settle
from contact.ranks import on_root
from tests.problems.processes import CLONE
from tests.problems.written import block
from tests.results.test_steps import case_of as steps_case

SELF = MPI.COMM_SELF
EARLIER = ("contact.csv", "fields.bp", "cells.bp", "checkpoint.npz", "figure-contact.png")
LATER = ("contact.csv", "fields.bp", "cells.bp", "figure-deformed.png")


class Killed(BaseException):
    """Stands for SIGKILL."""


def write(folder: Path, run: str, names: tuple[str, ...]) -> None:
    """Replace the results in a folder."""

    def files(new: Path) -> dict[str, object]:
        for name in names:
            path = new / name / "data.0" if name.endswith(".bp") else new / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(run)
        return {"run": run, "versions": {}}

    ResultFolder(folder, SELF).replace(files)


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder, by their names."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def mine(folder: Path, *names: str) -> dict[str, bytes]:
    """Write files of a user's own; return all."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"mine: {name}")
    return contents(folder)


def two_runs(folder: Path) -> tuple[dict[str, bytes], dict[str, bytes]]:
    """Write one run; return what it left and what a second one has to leave."""
    wanted = []
    for run, names in (("earlier", EARLIER), ("later", LATER)):
        mine(folder / run, "notes.txt")
        write(folder / run, run, names)
        wanted.append(contents(folder / run))
    return wanted[0], wanted[1]


@pytest.mark.core
def test_killed_at_any_step_one_of_the_runs_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And if it is killed while it goes on, at any step again; no summary is beside other files."""
    earlier, later = two_runs(tmp_path)
    folder, steps, outcomes = tmp_path / "folder", 0, []

    def counted(function: Callable[..., object], last: int) -> Callable[..., object]:
        def step(*args: object, **options: object) -> object:
            nonlocal steps
            steps += 1
            if steps == last:
                raise Killed
            return function(*args, **options)

        return step

    def run(action: Callable[[], None], last: int) -> bool:
        nonlocal steps
        steps = 0
        with monkeypatch.context() as patched:
            for module, name in ((os, "replace"), (os, "unlink"), (Path, "unlink"), (os, "rmdir")):
                patched.setattr(module, name, counted(getattr(module, name), last))
            try:
                action()
            except Killed:
                return False
        return True

    for last in range(1, 100):
        for again in (0, 1, 2, 3, 5, 8):
            shutil.copytree(tmp_path / "earlier", folder)
            finished = run(lambda: write(folder, "later", LATER), last)
            run(lambda: settle(folder), again)
            there = {k: v for k, v in contents(folder).items() if STAGE not in k}
            if "summary.json" in there:
                assert there in (earlier, later), (last, again)
            settle(folder)
            assert contents(folder) in (earlier, later), (last, again)
            assert not (folder / STAGE).exists()
            outcomes.append(contents(folder) == later)
            shutil.rmtree(folder)
        if finished:
            break
    assert finished and True in outcomes and False in outcomes


@pytest.mark.core
def test_one_run_at_a_time(tmp_path: Path) -> None:
    """A second one is refused; one that was killed leaves no lock."""
    program = (
        "import sys, time; from mpi4py import MPI; from contact.io.folder import *\n"
        f"with result_folder({str(tmp_path)!r}, MPI.COMM_SELF): print('in', flush=True); "
        "time.sleep(60)"
    )
    first = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, cwd=CLONE)
    assert first.stdout is not None and first.stdout.readline() == b"in\n"
    with pytest.raises(InputError, match=rf"process {first.pid} .*\[folder-locked\]"):
        with result_folder(tmp_path, SELF):
            pass
    first.kill()
    first.communicate()
    with result_folder(tmp_path, SELF):
        assert (tmp_path / LOCK).exists()
    assert not [*tmp_path.iterdir()]


def on_the_line(*arguments: object) -> int:
    return main([str(argument) for argument in (*arguments, "--quiet")])


@pytest.fixture
def cases(shared_tmp_path: Path, comm: MPI.Intracomm) -> dict[str, Path]:
    """Return the files of a static case and of an evolution."""
    texts = {"static": to_toml(block(2)), "evolution": to_toml(steps_case())}
    files = {name: shared_tmp_path / f"{name}.toml" for name in texts}
    on_root(comm, lambda: [files[name].write_text(text) for name, text in texts.items()])
    return files


LEFT_ALONE = (
    "checkpoints/notes.txt",
    "checkpoints/00001.npz",
    "data/contact.csv",
    "figure-mine.png",
    "notes.txt",
)


@pytest.mark.core
@pytest.mark.parallel(2)
def test_a_run_leaves_a_users_files(
    cases: dict[str, Path], shared_tmp_path: Path, comm: MPI.Intracomm
) -> None:
    out, before = shared_tmp_path / "out", {}
    on_root(comm, lambda: before.update(mine(out, *LEFT_ALONE)))
    for _ in range(2):
        assert on_the_line("solve", cases["static"], "--out", out) == 0
        if comm.rank == 0:
            after = contents(out)
            assert before.items() <= after.items()
            assert "summary.json" in after
        comm.barrier()


@pytest.mark.parallel(2)
def test_an_evolution_refuses_checkpoints_that_no_run_has_left(
    cases: dict[str, Path], shared_tmp_path: Path, comm: MPI.Intracomm,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """A file of another name beside its own stays."""
    out, before = shared_tmp_path / "out", {}
    on_root(comm, lambda: before.update(mine(out, "checkpoints/00002.npz", "checkpoints/a.txt")))
    for options in ((), ("--overwrite",)):
        assert on_the_line("solve", cases["evolution"], "--out", out, *options) == 2
        if comm.rank == 0:
            assert contents(out) == before
            assert "no run has left it; accepted: " in capfd.readouterr().err
        comm.barrier()
    on_root(comm, (out / "checkpoints" / "00002.npz").unlink)
    assert on_the_line("solve", cases["evolution"], "--out", out) == 0
    assert [path.name for path in (out / "checkpoints").iterdir()] == ["a.txt"]


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", ["contact.csv", "fields.vtu", "fields.bp/data.0", "summary.json"])
def test_a_file_under_the_name_of_a_result_is_replaced_when_that_is_asked_for(
    name: str, cases: dict[str, Path], shared_tmp_path: Path, comm: MPI.Intracomm,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    out, before = shared_tmp_path / "out", {}
    on_root(comm, lambda: before.update(mine(out, name)))
    assert on_the_line("solve", cases["static"], "--out", out) == 2
    if comm.rank == 0:
        assert "contact solve --overwrite to replace it" in capfd.readouterr().err
        assert contents(out) == before
    comm.barrier()
    assert on_the_line("solve", cases["static"], "--out", out, "--overwrite") == 0
