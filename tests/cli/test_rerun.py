"""A run into a folder with results: replaced without a word are those of the same problem alone."""

from pathlib import Path

import pytest
from mpi4py import MPI

from contact.cli.main import BAD_INPUT, CONVERGED, main

pytestmark = pytest.mark.parallel(2)


@pytest.fixture
def case(shared_tmp_path: Path) -> Path:
    """Return the path of a small case."""
    path = shared_tmp_path / "case.toml"
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(
            'title = "Block"\n'
            '[mesh]\ngenerator = "rectangle"\nsize = [2, 1]\ncells = [4, 2]\n'
            "[material]\nyoung = 10\npoisson = 0.3\n"
            '[[fixed]]\non = "top"\ndisplacement = [0.02, -0.02]\n'
            '[contact]\non = "bottom"\n[friction]\nlaw = "coulomb"\nmu = 0.3\n'
        )
    MPI.COMM_WORLD.barrier()
    return path


def run(case: Path, *options: str) -> int:
    return main(["solve", str(case), "--out", str(case.parent / "out"), "--quiet", *options])


@pytest.mark.core
def test_the_same_problem_again(case: Path) -> None:
    """By another method, to another tolerance, with other outputs: it is the same."""
    assert run(case) == CONVERGED
    assert run(case, "--set", "solver.method=uzawa", "--set", "output.fields=xdmf") == CONVERGED
    assert run(case, "--set", "title=again") == CONVERGED


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("mesh.cells=[8, 4]", "there mesh.cells.0 is 4, here 8"),
        ("friction.mu=0.2", "there friction.mu is 0.3, here 0.2"),
        ("fixed.0.displacement=[0, '-0.1*x']", "there fixed.0.displacement.0 is 0.02, here 0.0"),
        ("mesh.parts.piece={side='top'}", "there mesh.parts is missing"),
    ],
)
def test_another_problem_asks(
    change: str, words: str, case: Path, capsys: pytest.CaptureFixture
) -> None:
    """What is there stays, until it is said that it may go."""
    assert run(case) == CONVERGED
    summary = case.parent / "out" / "summary.json"
    MPI.COMM_WORLD.barrier()
    before = summary.read_bytes()
    capsys.readouterr()
    assert run(case, "--set", change) == BAD_INPUT
    if MPI.COMM_WORLD.rank == 0:
        message = capsys.readouterr().err
        assert words in message
        assert "accepted: --overwrite" in message
        assert len(message.splitlines()) == 1
    assert summary.read_bytes() == before
    MPI.COMM_WORLD.barrier()
    assert run(case, "--set", change, "--overwrite") == CONVERGED
    MPI.COMM_WORLD.barrier()
    assert summary.read_bytes() != before


@pytest.mark.parametrize("method", ["uzawa", "penalty"])
def test_log(method: str, case: Path) -> None:
    """The log has all iterations, inner ones too, and goes on where it ends."""
    log = case.parent / "run.log"
    for runs in (1, 2):
        assert run(case, "--log", str(log), "--set", f"solver.method={method}") == CONVERGED
        MPI.COMM_WORLD.barrier()
        text = log.read_text()
        MPI.COMM_WORLD.barrier()
        assert text.count("process on") == runs
        assert text.count("contact.solver: iteration 1: ") == runs
        assert text.count("inner iteration 1: residual ") >= runs
        assert text.splitlines()[-1].endswith("<= 1e-08") or "penalised" in text.splitlines()[-1]
