"""What stands in a folder of results after any step at which a run ends."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from mpi4py import MPI

from contact.errors import InputError
from contact.io.field_files import claim_room
from contact.io.folder import (
    LOCK,
    STAGE,
    begin,
    complete,
    recover,
    result_folder,
    settle,
    swap,
)
from tests.problems.processes import BAR, CLONE, SMALL


class Killed(BaseException):
    """Stands for SIGKILL."""


def write(folder: Path, run: str, names: tuple[str, ...]) -> None:
    """Write members of a run as far as `complete`."""
    new = begin(folder)
    for name in names:
        if name.endswith(".bp"):
            (new / name).mkdir()
            (new / name / "data.0").write_text(run)
        else:
            (new / name).write_text(run)
    complete(folder, {"run": run, "versions": {}})


def held(folder: Path) -> dict[str, str]:
    """Return what stands in a folder, hidden or not."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found[str(path.relative_to(folder))] = path.read_text()
    return found


EARLIER = ("contact.csv", "fields.bp", "cells.bp", "checkpoint.npz", "figure-contact.png")
LATER = ("contact.csv", "fields.bp", "cells.bp", "figure-deformed.png")


def two_runs(folder: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Write one run; return what it left and what a second one has to leave."""
    wanted = []
    for run, names in (("earlier", EARLIER), ("later", LATER)):
        trial = folder / run
        trial.mkdir()
        (trial / "figure-mine.png").write_text("mine")
        write(trial, run, names)
        swap(trial)
        wanted.append(held(trial))
    return wanted[0], wanted[1]


def count_steps(monkeypatch: pytest.MonkeyPatch, fail: Callable[[int], None]) -> None:
    """Call `fail` with their number before all steps that change the folder."""
    steps = 0

    def counted(function: Callable[..., None]) -> Callable[..., None]:
        def step(*args: object, **options: object) -> None:
            nonlocal steps
            steps += 1
            fail(steps)
            function(*args, **options)

        return step

    for module, name in ((os, "rename"), (os, "replace"), (os, "unlink"), (os, "rmdir")):
        monkeypatch.setattr(module, name, counted(getattr(module, name)))
    monkeypatch.setattr(Path, "unlink", counted(Path.unlink))


def test_members_are_replaced_and_others_left_alone(tmp_path: Path) -> None:
    earlier, later = two_runs(tmp_path)
    assert "checkpoint.npz" in earlier and "figure-mine.png" in earlier
    folder = tmp_path / "earlier"
    write(folder, "later", LATER)
    assert {k: v for k, v in held(folder).items() if not k.startswith(STAGE)} == earlier
    swap(folder)
    assert held(folder) == later
    assert sorted(json.loads(later["summary.json"])["files"]) == sorted([*LATER, "summary.json"])


@pytest.mark.core
def test_killed_at_any_step_one_of_the_runs_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And if it is killed while it recovers, at any step again."""
    earlier, later = two_runs(tmp_path)
    folder, outcomes = tmp_path / "folder", []
    for last in range(1, 60):
        for again in (0, 1, 2, 3, 5, 8):
            shutil.copytree(tmp_path / "earlier", folder)
            finished = False
            for run, step in (
                (lambda: (write(folder, "later", LATER), swap(folder)), last),
                (lambda: recover(folder), again),
            ):

                def kill(number: int, step: int = step) -> None:
                    if number == step:
                        raise Killed

                with monkeypatch.context() as patched:
                    count_steps(patched, kill)
                    try:
                        run()
                        finished = True
                    except Killed:
                        finished = False
                # Without a run that recovers there is no summary of one run beside another's.
                summary = held(folder).get("summary.json")
                if summary is not None and summary == later["summary.json"]:
                    assert {k: v for k, v in held(folder).items() if STAGE not in k} == later
            recover(folder)
            outcomes.append(held(folder) == later)
            assert held(folder) in (earlier, later), (last, again)
            assert not (folder / STAGE).exists()
            shutil.rmtree(folder)
        if finished and last > 40:
            break
    assert True in outcomes and False in outcomes


def test_a_run_that_is_killed_while_it_asks_for_room_is_recovered_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    earlier, _ = two_runs(tmp_path)
    folder = tmp_path / "earlier"
    new = begin(folder)
    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", lambda *_, **__: None)  # SIGKILL leaves it to nobody
        claim_room(MPI.COMM_SELF, new, 1000)
    assert [*new.iterdir()]
    recover(folder)
    assert held(folder) == earlier


def test_refused_at_any_step_the_earlier_run_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    earlier, later = two_runs(tmp_path)
    folder = tmp_path / "folder"
    refused = 0
    for last in range(1, 20):
        shutil.copytree(tmp_path / "earlier", folder)
        write(folder, "later", LATER)

        def refuse(number: int, last: int = last) -> None:
            if number == last:
                raise PermissionError(1, "not permitted")

        with monkeypatch.context() as patched:
            count_steps(patched, refuse)
            try:
                swap(folder)
            except PermissionError:
                refused += 1
                assert held(folder) == earlier
        recover(folder)
        assert held(folder) in (earlier, later)
        shutil.rmtree(folder)
    assert refused >= 8


def _fifo(path: Path) -> None:
    os.mkfifo(path)


def _link(path: Path) -> None:
    target = path.parent.parent / "target"
    target.write_text("mine")
    path.symlink_to(target)


def _folder(path: Path) -> None:
    path.mkdir()
    (path / "mine.txt").write_text("mine")


def _file(path: Path) -> None:
    path.write_text("mine")


WRONG = [
    *((name, make) for name in ("summary.json", "contact.csv", "fields.bp", STAGE, LOCK)
      for make in (_fifo, _link, _folder, _file) if (name, make) not in {
          ("summary.json", _file), ("contact.csv", _file), (LOCK, _file)}),
    ("figure-contact.png", _fifo),
    ("checkpoint.npz", _link),
]  # fmt: skip


@pytest.mark.parametrize(("name", "make"), WRONG)
def test_what_is_not_ours_is_refused_before_the_solve(
    name: str, make: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """No pipe is waited for, no link followed, nothing overwritten: one message."""
    from contact.cli.main import main

    monkeypatch.setattr("contact.cli.solve.solve", lambda *_, **__: pytest.fail("it has solved"))
    folder = tmp_path / "out"
    folder.mkdir()
    make(folder / name)
    before = sorted(tmp_path.rglob("*"))
    assert main(["solve", str(BAR), "--out", str(folder), *SMALL]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and message.startswith("contact: ") and name in message
    assert sorted(tmp_path.rglob("*")) == before
    for path in before:
        if path.is_file():
            assert path.read_text() == "mine"


@pytest.mark.parametrize(
    "names", [["../target"], ["notes.txt"], ["/etc/hostname"], [".bashrc"], [3, None], {"a": 1}]
)
def test_a_summary_from_elsewhere_removes_nothing(names: object, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (tmp_path / "target").write_text("mine")
    for name in ("notes.txt", ".bashrc"):
        (folder / name).write_text("mine")
    (folder / "summary.json").write_text(json.dumps({"versions": {}, "files": names}))
    write(folder, "later", LATER)
    swap(folder)
    assert (tmp_path / "target").read_text() == "mine"
    assert (folder / "notes.txt").read_text() == (folder / ".bashrc").read_text() == "mine"


def test_one_run_at_a_time(tmp_path: Path) -> None:
    """A second one is refused; one that was killed leaves no lock."""
    program = (
        "import sys, time; from mpi4py import MPI; from contact.io.folder import *\n"
        f"with result_folder({str(tmp_path)!r}, MPI.COMM_SELF): print('in', flush=True); "
        "time.sleep(60)"
    )
    first = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, cwd=CLONE)
    assert first.stdout is not None and first.stdout.readline() == b"in\n"
    from mpi4py import MPI

    with pytest.raises(InputError, match=f"another run works in it .process {first.pid} on "):
        with result_folder(tmp_path, MPI.COMM_SELF):
            pass
    first.kill()
    first.communicate()
    assert (tmp_path / LOCK).exists()
    with result_folder(tmp_path, MPI.COMM_SELF):
        assert (tmp_path / LOCK).exists()
    assert not (tmp_path / LOCK).exists()


def test_a_reader_settles_what_was_interrupted(tmp_path: Path) -> None:
    _, later = two_runs(tmp_path)
    folder = tmp_path / "earlier"
    write(folder, "later", LATER)
    settle(folder)
    assert held(folder) == later
