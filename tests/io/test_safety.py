"""Runs that fail, are killed, or meet a full disk: whole processes.

What a solve that is interrupted leaves.
"""

import ctypes
import json
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mpi4py import MPI

from contact.io.folder import LOCK, STAGE, settle
from contact.linear.operator import SparseOperator
from contact.methods.report import Record
from contact.solving import SolveInterrupted, solve
from tests.problems.processes import BAR, RANKS, SMALL, command, environment, processes, served
from tests.problems.written import block, written


def solving(out: Path, *options: str, ranks: int = 1, before: str = "") -> list[str]:
    """Return a command that solves a small case, after some Python."""
    arguments = ["solve", str(BAR), "--out", str(out), *SMALL, *options]
    return command(*arguments, ranks=ranks, before=before)


def run(*args: object, **options: object) -> tuple[int, str]:
    """Run a command as above; return its status and what it said."""
    done = subprocess.run(
        solving(*args, **options), env=environment(), capture_output=True, text=True, timeout=120
    )
    return done.returncode, done.stderr


def messages(text: str) -> list[str]:
    """Return our lines, without the launcher's and without warnings of the case."""
    return [line for line in text.splitlines() if line.startswith("contact: ")]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of a run, with figures and a checkpoint."""
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    out = tmp_path_factory.mktemp("good") / "out"
    status, text = run(out, "--plot", "--set", "output.checkpoint=true")
    assert status == 0, text
    return out


def same(folder: Path, other: Path) -> bool:
    """Whether two folders hold the same files."""

    def content(root: Path) -> dict[str, bytes]:
        files = (path for path in root.rglob("*") if path.is_file() and path.name != LOCK)
        return {str(path.relative_to(root)): path.read_bytes() for path in files}

    return content(folder) == content(other)


def whole(folder: Path) -> bool:
    """Whether a folder holds what its summary names, and nothing half done."""
    summary = json.loads((folder / "summary.json").read_text())
    return sorted(p.name for p in folder.iterdir() if p.name != LOCK) == summary["files"]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """Return a file system of 700 kB."""
    libc, disk = ctypes.CDLL(None, use_errno=True), tmp_path / "disk"
    disk.mkdir()
    if libc.mount(b"tmpfs", bytes(disk), b"tmpfs", 0, b"size=700k"):
        pytest.skip(f"no tmpfs can be mounted: {os.strerror(ctypes.get_errno())}")
    yield disk
    libc.umount2(bytes(disk), 2)


@RANKS
def test_a_full_disk_keeps_the_earlier_results(ranks: int, good: Path, small_disk: Path) -> None:
    """However little is left, there is one message."""
    out, ballast = small_disk / "out", small_disk / "ballast"
    shutil.copytree(good, out)
    arguments = ["solve", str(BAR), "--out", str(out), *SMALL]
    with served(ranks) as run:
        for left in (0, 40_000):
            ballast.unlink(missing_ok=True)
            room = os.statvfs(small_disk)
            with ballast.open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, room.f_bavail * room.f_bsize - left)
            status, text = run(*arguments)
            assert status == 2, text
            (message,) = messages(text)
            assert "No space left on device" in message
            assert same(out, good)
        ballast.unlink()
        status, text = run(*arguments)
        assert status == 0, text
        assert whole(out) and not (out / "checkpoint.npz").exists()


@RANKS
@pytest.mark.slow
def test_sigterm_while_writing_leaves_one_of_the_runs_whole(
    ranks: int, good: Path, tmp_path: Path
) -> None:
    """It is sent from when the first new file is there; every process ends."""
    out = tmp_path / "out"
    for delay in (0.0, 0.05)[ranks - 1 :]:
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(good, out)
        process = subprocess.Popen(
            solving(out, "--plot", ranks=ranks), env=environment(), start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        end = time.monotonic() + 60
        while not (out / STAGE).exists() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.002)
        assert process.poll() is None  # else no signal meets it
        time.sleep(delay)
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=60)
        end = time.monotonic() + 60
        while left_of(process.pid) and time.monotonic() < end:
            time.sleep(0.05)
        assert not left_of(process.pid)
        settle(out)
        assert same(out, good) or whole(out)


def left_of(session: int) -> list[str]:
    """Return the names of the processes of a session."""
    return [process.name for process in processes() if process.session == session]


@pytest.mark.parallel
def test_interrupted_solve_keeps_its_results(shared_tmp_path: Path) -> None:
    """A signal on one rank ends the solve on all of them, and what was computed is written."""
    handler = signal.getsignal(signal.SIGINT)

    def press(record: Record) -> None:
        if record.iteration == 1 and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(SolveInterrupted, match=r"interrupted \(SIGINT\)") as interrupt:
        solve(block(2, solver={"method": "uzawa"}), monitor=press)
    solution = interrupt.value.solution
    assert solution.title == "Block"
    assert not solution.converged
    assert solution.history[-1].iteration == 1
    summary, rows = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGINT)"
    assert len(rows) == 9
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.parallel
@pytest.mark.parametrize(("method", "solves"), [("uzawa", 5), ("penalty", 8)])
def test_a_solve_stops_between_inner_iterations(
    method: str, solves: int, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal in a long inner loop is not left waiting for its end."""
    solve_once = SparseOperator.solve

    def press(operator: SparseOperator, *args: Any, **options: Any) -> Any:
        if operator.counters.linear_solves == solves and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGTERM)
        return solve_once(operator, *args, **options)

    monkeypatch.setattr(SparseOperator, "solve", press)
    with pytest.raises(SolveInterrupted) as interrupt:
        solve(block(2, solver={"method": method}))
    solution = interrupt.value.solution
    assert solution.counters.linear_solves == solves + 1
    assert solution.outcome.signal == signal.SIGTERM
    summary, _ = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGTERM)"
    assert summary["outer_iterations"] == len(solution.history)
