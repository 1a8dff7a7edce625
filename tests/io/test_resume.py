"""An evolution that is ended at any step goes on from its checkpoints to the same numbers."""

import json
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mpi4py import MPI

from contact import solve
from contact.case.file import to_toml
from contact.cli.main import main
from contact.cli.solve import solve_and_keep
from contact.io.checkpoint import Checkpoints, read_steps
from tests.problem.test_plasticity import block
from tests.problems.mechanics import close
from tests.problems.written import rows_of
from tests.results.test_steps import case_of as steps_case

SELF = MPI.COMM_SELF


class Killed(BaseException):
    """What ends a run here."""


@contextmanager
def ended(count: int) -> Iterator[None]:
    """Let a run end after some of its steps."""
    keep = Checkpoints.keep

    def last(self, record):
        keep(self, record)
        if self._count == count:
            raise Killed

    with pytest.MonkeyPatch.context() as patched, pytest.raises(Killed):
        patched.setattr(Checkpoints, "keep", last)
        yield


def hencky(**changes):
    law = {"material__law": "log", "material__yield_strain": 0.002}
    return steps_case(load__0__traction=[0.0, -0.01], **law, **changes)


@pytest.mark.core
@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("count", [1, 3])
def test_going_on(tmp_path, count, elsewhere):
    case = hencky()
    whole = solve(case, comm=SELF)
    with ended(count):
        solve_and_keep(case, None, SELF, tmp_path)
    out = tmp_path
    if elsewhere:
        out = tmp_path / "elsewhere"
        out.mkdir()
    solution = solve_and_keep(case, None, SELF, out, tmp_path)
    assert solution.converged
    assert len(solution.steps) == len(whole.steps)
    for one, two in zip(whole.steps, solution.steps, strict=True):
        assert close(one.state, two.state, atol=1e-12)
        for name, value in one.row.items():
            if name not in ("linear_solves", "factorizations", "kkt"):
                assert two.row[name] == pytest.approx(value, rel=1e-9, abs=1e-12)
    assert len(list((out / "checkpoints").glob("0*.npz"))) == 5
    assert whole.warnings == solution.warnings


@pytest.mark.core
@pytest.mark.parallel
def test_other_ranks_go_on(shared_tmp_path: Path) -> None:
    """All ranks, one of them alone, and all again in one folder; of one rank bit for bit."""
    world, place = MPI.COMM_WORLD, shared_tmp_path / "checkpoints"
    case = block("chaboche", cells=3)
    whole = solve(case, comm=world)
    for count, comm in ((2, world), (4, SELF), (None, world)):
        restart = None if count == 2 else shared_tmp_path
        if comm is world or world.rank == 0:
            if count is None:
                solution = solve_and_keep(case, None, comm, shared_tmp_path, restart)
            else:
                with ended(count):
                    solve_and_keep(case, None, comm, shared_tmp_path, restart)
        world.barrier()
    assert solution.converged and len(solution.steps) == len(whole.steps) == 6
    assert len(solution.history) < len(whole.history)
    assert whole.plastic_dissipation > 0
    close_to = {"rtol": 1e-12} if world.size == 1 else {"rtol": 1e-9, "atol": 1e-9}
    for one, two in zip(whole.steps, solution.steps, strict=True):
        assert close(one.state, two.state, **close_to)
    assert sorted(path.name for path in place.iterdir()) == [f"{k:05d}.npz" for k in range(1, 7)]
    again = read_steps(shared_tmp_path, whole.problem)
    assert [step.state.time for step in again] == [step.state.time for step in whole.steps]


@pytest.mark.parametrize("data", [b"", b"no archive"])
def test_a_damaged_checkpoint_ends_the_steps(tmp_path, data, capfd):
    """A run goes on from the step before it; without one there is a message."""
    solve_and_keep(steps_case(), None, SELF, tmp_path)
    place = tmp_path / "checkpoints"
    (place / "00003.npz").write_bytes(data)
    assert len(read_steps(tmp_path, solve(steps_case(), comm=SELF).problem)) == 2
    assert len(solve_and_keep(steps_case(), None, SELF, tmp_path, tmp_path).steps) == 5
    assert len(list(place.iterdir())) == 5
    (place / "00001.npz").write_bytes(data)
    assert on_the_line("solve", "--restart", tmp_path) == 2
    assert "no checkpoints there" in capfd.readouterr().err


def on_the_line(*arguments):
    return main([str(argument) for argument in (*arguments, "--quiet")])


@pytest.mark.core
def test_the_command_line(tmp_path, capfd):
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(to_toml(steps_case()))
    assert on_the_line("solve", "--restart", out) == 2
    assert f"--restart {out}: no checkpoints there" in capfd.readouterr().err
    with ended(2):
        on_the_line("solve", case, "--out", out)
    other = ("--set", "friction.mu.rho=1.0")
    assert on_the_line("solve", case, "--restart", out, *other) == 2
    words = "given checkpoints of another case: there friction.mu.rho is 10000.0, here 1.0"
    assert words in capfd.readouterr().err
    assert on_the_line("solve", case, "--out", out, *other) == 2
    words = f"--out {out}: given a folder with checkpoints of another case: there friction.mu.rho"
    assert words in capfd.readouterr().err
    assert len(list((out / "checkpoints").glob("0*.npz"))) == 2
    assert on_the_line("solve", "--restart", out, "--set", "output.fields=none") == 0
    assert not (out / "checkpoints").exists()
    summary = json.loads((out / "summary.json").read_text())
    assert summary["converged"]
    assert len((out / "steps.csv").read_text().splitlines()) == 6


def test_a_complete_run_may_be_run_again_and_go_on_anywhere(tmp_path, monkeypatch):
    """A case with a file was another case from another folder, and after an interruption."""
    (tmp_path / "press.csv").write_text("t,factor\n0.0,0.0\n1.0,1.0\n2.0,0.5\n")
    before, _, _ = to_toml(steps_case()).rpartition("time = ")
    monkeypatch.chdir(tmp_path)
    Path("case.toml").write_text(f'{before}file = "press.csv"\n')
    assert on_the_line("solve", "case.toml", "--out", "out") == 0
    with ended(2):
        on_the_line("solve", "case.toml", "--out", "out")
    assert on_the_line("solve", "--restart", "out") == 0
    monkeypatch.chdir("/")
    assert on_the_line("solve", tmp_path / "case.toml", "--out", tmp_path / "out") == 0
    # A file of this name in another folder is another one.
    other = shutil.copytree(tmp_path, tmp_path / "other", ignore=shutil.ignore_patterns("out"))
    assert on_the_line("solve", other / "case.toml", "--out", tmp_path / "out") == 2


def test_a_signal_keeps_the_complete_steps(tmp_path, monkeypatch, capfd):
    """They are written, and checkpoints remain to go on from, to the numbers of a whole run."""
    keep, out, case = Checkpoints.keep, tmp_path / "out", tmp_path / "case.toml"
    case.write_text(to_toml(hencky()))
    assert on_the_line("solve", case, "--out", tmp_path / "whole") == 0

    def interrupted(self, record):
        keep(self, record)
        if self._count == 2:
            signal.raise_signal(signal.SIGTERM)

    with monkeypatch.context() as context:
        context.setattr(Checkpoints, "keep", interrupted)
        assert on_the_line("solve", case, "--out", out) == 143
    assert f"results in {out}; contact solve --restart {out} goes on" in capfd.readouterr().err
    assert len(rows_of(out / "steps.csv")) == 2
    summary = json.loads((out / "summary.json").read_text())
    assert not summary["converged"]
    assert "interrupted (SIGTERM)" in summary["reason"]
    assert len(list((out / "checkpoints").glob("0*.npz"))) == 2
    assert on_the_line("solve", "--restart", out) == 0
    for one, two in zip(
        rows_of(tmp_path / "whole" / "steps.csv"), rows_of(out / "steps.csv"), strict=True
    ):
        for name in one.keys() - {"linear_solves", "factorizations", "kkt"}:
            assert float(two[name]) == pytest.approx(float(one[name]), rel=1e-9, abs=1e-12)


MESHES = Path(__file__).parents[2] / "meshes" / "fixtures"


SQUARE = """
[mesh]
file = "{mesh}"
[material]
young = 1.0
poisson = 0.3
[[fixed]]
on = "top"
displacement = ["0", "-0.001*t"]
[contact]
on = "bottom"
[evolution]
times = [0.0, 1.0]
steps = [3]
"""


def test_another_mesh_file_is_not_continued(tmp_path, capfd):
    """Of the same nodes."""
    out, case, mesh = tmp_path / "out", tmp_path / "case.toml", tmp_path / "square.msh"
    shutil.copy(MESHES / "square.msh", mesh)
    case.write_text(SQUARE.format(mesh=mesh))
    with ended(1):
        on_the_line("solve", case, "--out", out)
    mesh.write_text(mesh.read_text() + "\n")
    assert on_the_line("solve", "--restart", out) == 2
    words = "the file mesh.file has changed since the checkpoints were written"
    assert words in capfd.readouterr().err
