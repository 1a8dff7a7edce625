"""What stands in a folder of results after runs that fail, are killed, or meet."""

import ctypes
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from contact.errors import InputError
from contact.output import transaction
from contact.output.folder import LOCK, result_folder, settle
from contact.output.transaction import STAGE, begin, complete, recover, swap

CLONE = Path(transaction.__file__).parents[2]
BAR = CLONE / "scripts/cases/bar.toml"
SMALL = ["--set", "mesh.cells=[16, 4]", "--quiet"]
RANKS = pytest.mark.parametrize("ranks", [1, 2])


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
    complete(folder, {"run": run})


def held(folder: Path) -> dict[str, str]:
    """Return what stands in a folder, hidden or not."""
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            found[str(path.relative_to(folder))] = path.read_text()
    return found


EARLIER = ("contact.csv", "fields.bp", "checkpoint.bp", "figure-contact.png")
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
    assert "checkpoint.bp/data.0" in earlier and "figure-mine.png" in earlier
    folder = tmp_path / "earlier"
    write(folder, "later", LATER)
    assert {k: v for k, v in held(folder).items() if not k.startswith(STAGE)} == earlier
    swap(folder)
    assert held(folder) == later
    assert sorted(json.loads(later["summary.json"])["files"]) == sorted([*LATER, "summary.json"])


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
    ("checkpoint.bp", _link),
]  # fmt: skip


@pytest.mark.parametrize(("name", "make"), WRONG)
def test_what_is_not_ours_is_refused_before_the_solve(
    name: str, make: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """No pipe is waited for, no link followed, nothing overwritten: one message."""
    import contact.solving
    from contact.cli.main import main

    monkeypatch.setattr(contact.solving, "solve", lambda *_, **__: pytest.fail("it has solved"))
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
    (folder / "summary.json").write_text(json.dumps({"files": names}))
    write(folder, "later", LATER)
    swap(folder)
    assert (tmp_path / "target").read_text() == "mine"
    assert (folder / "notes.txt").read_text() == (folder / ".bashrc").read_text() == "mine"


def test_one_run_at_a_time(tmp_path: Path) -> None:
    """A second one is refused; one that was killed leaves no lock."""
    program = (
        "import sys, time; from mpi4py import MPI; from contact.output.folder import *\n"
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


# ------------------------------------------------------------------ processes


def command(out: Path, *options: str, ranks: int = 1, before: str = "") -> list[str]:
    """Return a command that solves a small case, after some Python."""
    program = f"import sys\n{before}\nfrom contact.cli.main import run\nrun()"
    launch = [] if ranks == 1 else ["mpirun", "--oversubscribe", "-n", str(ranks)]
    arguments = ["solve", str(BAR), "--out", str(out), *SMALL, *options]
    return [*launch, sys.executable, "-c", program, *arguments]


def environment() -> dict[str, str]:
    """Return the environment without what says that this is a rank itself."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    return kept | {
        "PYTHONPATH": str(CLONE), "OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_topo": "basic",
        "OMPI_MCA_btl": "self,sm",
        "OMPI_MCA_mpi_yield_when_idle": "1",
    }  # fmt: skip


def run(*args: object, **options: object) -> tuple[int, str]:
    """Run a command as above; return its status and what it said."""
    done = subprocess.run(
        command(*args, **options), env=environment(), capture_output=True, text=True, timeout=120
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
@pytest.mark.parametrize("format_", ["vtu", "vtx", "xdmf"])
def test_a_full_disk_keeps_the_earlier_results(
    ranks: int, format_: str, good: Path, small_disk: Path
) -> None:
    """However little is left, there is one message, and no abort of a library."""
    out, ballast = small_disk / "out", small_disk / "ballast"
    shutil.copytree(good, out)
    for left in (0, 16_000, 40_000):
        ballast.unlink(missing_ok=True)
        room = os.statvfs(small_disk)
        with ballast.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, room.f_bavail * room.f_bsize - left)
        status, text = run(out, "--set", f"output.fields={format_}", ranks=ranks)
        assert status == 2, text
        (message,) = messages(text)
        assert "No space left on device" in message
        assert same(out, good)
    ballast.unlink()
    status, text = run(out, "--set", f"output.fields={format_}", ranks=ranks)
    assert status == 0, text
    assert whole(out) and not (out / "checkpoint.bp").exists()


@RANKS
@pytest.mark.parametrize("format_", ["vtu", "vtx", "xdmf", "checkpoint"])
def test_a_library_that_fails_to_write_does_not_end_in_an_abort(
    ranks: int, format_: str, good: Path, tmp_path: Path
) -> None:
    """What is left on the disk may go to others after it was asked for."""
    out = tmp_path / "out"
    shutil.copytree(good, out)
    before = (
        "import resource, contact.output.disk as disk; disk.claim_room = lambda *_: None\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))"
    )
    fields = {"checkpoint": "output.checkpoint=true"}.get(format_, f"output.fields={format_}")
    options = ["--set", fields]
    if format_ == "checkpoint":
        options += ["--set", "output.fields=none"]
    status, text = run(out, *options, ranks=ranks, before=before)
    assert status == 2, text
    assert len(messages(text)) == 1 and "earlier results are kept" in messages(text)[0]
    recover(out)
    assert same(out, good)


@RANKS
@pytest.mark.parametrize("what", ["path", "home", "folder"])
def test_what_the_system_refuses_is_said_in_words(what: str, ranks: int, tmp_path: Path) -> None:
    out, environ = tmp_path / "out", environment()
    if what == "path":
        out = tmp_path / ("long" * 75)
    elif what == "folder":
        out = Path("/proc/self/out")
    else:
        environ |= {"HOME": "/proc/self/nobody"}
        environ.pop("XDG_CACHE_HOME", None)
    done = subprocess.run(
        command(out, ranks=ranks), env=environ, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2
    (message,) = messages(done.stderr)
    assert "accepted: " in message
    assert ranks > 1 or done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@RANKS
@pytest.mark.slow
@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_signals_while_writing_leave_one_of_the_runs_whole(
    ranks: int, kind: signal.Signals, good: Path, tmp_path: Path
) -> None:
    """They are sent from when the first new file is there; every process ends."""
    out = tmp_path / "out"
    for delay in (0.0, 0.02, 0.1):
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(good, out)
        process = subprocess.Popen(
            command(out, "--plot", ranks=ranks), env=environment(), start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        end = time.monotonic() + 60
        while not (out / STAGE).exists() and process.poll() is None and time.monotonic() < end:
            time.sleep(0.002)
        time.sleep(delay)
        process.send_signal(kind)
        process.wait(timeout=60)
        end = time.monotonic() + 10
        while left_of(process.pid) and time.monotonic() < end:
            time.sleep(0.05)
        assert not left_of(process.pid)
        recover(out)
        assert same(out, good) or whole(out)


def left_of(session: int) -> list[str]:
    """Return the processes of a session, but for zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        fields = rest.split()
        if fields[0] != "Z" and int(fields[3]) == session:
            found.append(name)
    return found
