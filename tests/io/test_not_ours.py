"""Files of a user's own in a folder of results: nothing but what a manifest names is removed."""

import hashlib
import json
import logging
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
from contact.case.text import to_toml
from contact.cli.main import main
from contact.io.checkpoint import Checkpoints
from contact.io.files import write_outputs
from contact.plot.figures import plot
from tests.problems.written import block
from tests.results.test_steps import case_of as steps_case

SELF = MPI.COMM_SELF


def on_root(comm: MPI.Intracomm, action: object) -> None:
    """Do something on rank 0 while the others wait."""
    comm.barrier()
    if comm.rank == 0:
        action()
    comm.barrier()


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a folder, by their names."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def mine(folder: Path, *names: str) -> dict[str, bytes]:
    """Write files of a user's own; return them."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"mine: {name}")
    return contents(folder)


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
    "checkpoints.new/weights.npz",
    "data/contact.csv",
    "figure-mine.png",
    "notes.txt",
    ".contact-draft",
)


@pytest.mark.parallel(2)
def test_a_static_run_leaves_a_users_files(
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
@pytest.mark.parametrize("name", ["checkpoints/notes.txt", "checkpoints.new/00001.npz"])
def test_an_evolution_refuses_checkpoints_that_no_run_has_left(
    name: str, cases: dict[str, Path], shared_tmp_path: Path, comm: MPI.Intracomm,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    out, before = shared_tmp_path / "out", {}
    on_root(comm, lambda: before.update(mine(out, name)))
    for options in ((), ("--overwrite",)):
        assert on_the_line("solve", cases["evolution"], "--out", out, *options) == 2
        if comm.rank == 0:
            assert contents(out) == before
            assert "which no run has left there; accepted: " in capfd.readouterr().err
        comm.barrier()


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
        message = capfd.readouterr().err
        assert "accepted: --overwrite to replace" in message
        assert contents(out) == before
    comm.barrier()
    assert on_the_line("solve", cases["static"], "--out", out, "--overwrite") == 0


@pytest.mark.parallel(2)
def test_a_file_in_our_checkpoints_stays(
    shared_tmp_path: Path, comm: MPI.Intracomm, monkeypatch: pytest.MonkeyPatch,
    cases: dict[str, Path],
) -> None:  # fmt: skip
    """Our own are removed at the end of the run, one by one."""
    out, keep = shared_tmp_path / "out", Checkpoints.keep

    def last(self: Checkpoints, record: object) -> None:
        keep(self, record)
        if self._count == 3:
            on_root(comm, lambda: mine(out, "checkpoints/notes.txt"))

    monkeypatch.setattr(Checkpoints, "keep", last)
    assert on_the_line("solve", cases["evolution"], "--out", out) == 0
    assert [path.name for path in (out / "checkpoints").iterdir()] == ["notes.txt"]


def test_outputs_from_python_replace_nothing_of_a_users(tmp_path: Path) -> None:
    solution = solve(block(2), comm=SELF)
    for name in ("steps.csv", "fields-0003.vtu"):
        before = mine(tmp_path / name, name)
        with pytest.raises(Exception, match=rf"{name}: given a file that no run's summary"):
            write_outputs(solution, tmp_path / name)
        assert contents(tmp_path / name) == before


def test_a_figure_of_a_users_stays(tmp_path: Path) -> None:
    write_outputs(solve(block(2), comm=SELF), tmp_path)
    before = mine(tmp_path, "figure-displacement.png")
    with pytest.raises(Exception, match=r"figure-displacement\.png: given a file that no run's"):
        plot(tmp_path, ["displacement"])
    assert contents(tmp_path) == before
    (tmp_path / "figure-displacement.png").unlink()
    for _ in range(2):
        assert [path.name for path in plot(tmp_path, ["displacement"])] == [
            "figure-displacement.png"
        ]


def test_a_table_of_a_users_is_no_sweep(tmp_path: Path, cases: dict[str, Path]) -> None:
    before = mine(tmp_path / "out", "sweep.csv", "sweep.csv.draft")
    sweep = ("sweep", cases["static"], "--over", "friction.mu=0.2", "--out", tmp_path / "out")
    assert on_the_line(*sweep) == 2
    assert contents(tmp_path / "out") == before
    (tmp_path / "out" / "sweep.csv").unlink()
    assert on_the_line(*sweep) == 0
    assert (tmp_path / "out" / "sweep.csv.draft").exists()


def flip(path: Path) -> None:
    """Change one bit in the middle of a file."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


DAMAGES = {
    "truncated": lambda path: os.truncate(path, path.stat().st_size // 2),
    "flipped": flip,
    "missing arrays": lambda path: np.savez(path.open("wb"), x=np.zeros(3)),
    "empty": lambda path: os.truncate(path, 0),
    "missing": Path.unlink,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_checkpoints_are_gone_on_from_before(
    damage: str, tmp_path: Path, cases: dict[str, Path], caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """From the last step that is intact, and it is said; without one there is a message."""
    whole = solve(steps_case(), comm=SELF, folder=tmp_path / "kept")
    for name in (
        "00003.npz",
        "00001.npz",
        "nodes.npz",
        "case.toml",
        "manifest.json",
    ):
        folder = tmp_path / name
        shutil.copytree(tmp_path / "kept", folder)
        DAMAGES[damage](folder / "checkpoints" / name)
        caplog.clear()
        with caplog.at_level(logging.WARNING, "contact.steps"):
            status = on_the_line("solve", "--restart", folder)
        message = capfd.readouterr().err
        if name == "00003.npz":
            assert status == 0
            assert "going on from step 2" in caplog.text
            rows = (folder / "steps.csv").read_text().splitlines()
            assert len(rows) == len(whole.steps) + 1
        elif name == "manifest.json" and status == 0:  # it is a checksum that is damaged
            assert "going on from step" in caplog.text
        else:
            assert status == 2, message
            assert message.count("\n") == 1
            assert message.startswith("contact: ")
            if name == "nodes.npz":  # a missing one was called a place to write to
                assert "nodes.npz: no checkpoint, or a damaged one" in message


@pytest.mark.parametrize("kind", [complex, object])
def test_arrays_of_another_kind_are_no_state(kind: type, tmp_path: Path, cases: dict[str, Path],
                                             caplog: pytest.LogCaptureFixture) -> None:  # fmt: skip
    """Their checksum may be right; it was a traceback."""
    solve(steps_case(), comm=SELF, folder=tmp_path)
    path = tmp_path / "checkpoints" / "00003.npz"
    arrays = dict(np.load(path))
    np.savez(path, **arrays | {"x": arrays["x"].astype(kind)})
    manifest = path.with_name("manifest.json")
    said = json.loads(manifest.read_text())
    said["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    manifest.write_text(json.dumps(said))
    with caplog.at_level(logging.WARNING, "contact.steps"):
        assert on_the_line("solve", "--restart", tmp_path) == 0
    assert "going on from step 2" in caplog.text


def test_a_summary_of_a_users_own_names_no_files_of_ours(tmp_path, cases):
    """Its word "files" is not ours: it has no versions of the libraries."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "summary.json").write_text('{"files": ["data.csv", "mine.json", "summary.json"]}')
    kept = mine(out, "data.csv", "mine.json")
    assert on_the_line("solve", cases["static"], "--out", out, "--overwrite") == 0
    after = contents(out)
    assert all(after[name] == kept[name] for name in ("data.csv", "mine.json"))
    (out / "summary.json").write_text("[1]")
    assert on_the_line("plot", out) == 2
