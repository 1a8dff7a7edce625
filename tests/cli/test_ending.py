"""How the command line begins and ends: PETSc's options, exit statuses, processes."""

import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI

from contact.methods.signals import Interrupted, ending_on_signal, stop_on_signal
from tests.problems.processes import BAR, RANKS, SMALL, command, environment

BOX = """
title = "Box"
[mesh]
generator = "box"
size = [2.0, 1.0, 1.0]
cells = [24, 12, 12]
[material]
young = 10.0
poisson = 0.3
[[fixed]]
on = "top"
displacement = [0.02, 0.0, -0.02]
[contact]
on = "bottom"
[friction]
law = "coulomb"
mu = 0.3
[solver]
linear = "lu"
"""


def start(*arguments: str, ranks: int = 1, before: str = "") -> subprocess.Popen[str]:
    """Start the command line, after some Python, in a session of its own."""
    if ranks > 1 and shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    return subprocess.Popen(
        command(*arguments, ranks=ranks, before=before),
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def run(*arguments: str, ranks: int = 1, before: str = "") -> tuple[int, str]:
    """Run the command line; return its status and what it said."""
    process = start(*arguments, ranks=ranks, before=before)
    text, _ = process.communicate(timeout=120)
    return process.returncode, text


def test_petsc_is_loaded_after_its_options() -> None:
    """Loaded before, it would not look at those of the command line."""
    program = "import sys, contact.cli.main; sys.exit('petsc4py.PETSc' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_too_little_memory_for_mumps_is_no_free_body(method: str, tmp_path: Path) -> None:
    file = tmp_path / "box.toml"
    file.write_text(BOX)
    options = ["--set", f"solver.method={method}", "-contact_mat_mumps_icntl_23", "1"]
    status, text = run("solve", str(file), "--out", str(tmp_path / "out"), *options)
    assert status == 2
    assert "out of memory in the factorisation" in text and "icntl_23" in text


@RANKS
def test_a_crash_has_a_status_of_its_own(ranks: int, tmp_path: Path) -> None:
    """On any rank; 1 would say that a solve has not converged."""
    before = (
        "import contact.case.build, contact.errors\n"
        "from mpi4py import MPI\n"
        "def build(*_, **__):\n"
        f"    if MPI.COMM_WORLD.rank == {ranks - 1}: raise ZeroDivisionError('wrong')\n"
        "    MPI.COMM_WORLD.barrier()\n"
        "contact.case.build.build_problem = build\n"
    )
    out = tmp_path / "out"
    status, text = run("solve", str(BAR), "--out", str(out), *SMALL, ranks=ranks, before=before)
    assert status == 70, text
    assert "ZeroDivisionError" in text and "contact: " in text
    assert not (out / "summary.json").exists()


def test_a_figure_that_fails_costs_nothing_else(tmp_path: Path) -> None:
    before = "import matplotlib.figure; matplotlib.figure.Figure.savefig = lambda *_: 1 / 0"
    out = tmp_path / "out"
    status, text = run("solve", str(BAR), "--out", str(out), *SMALL, "--plot", before=before)
    assert status == 70, text
    assert (out / "summary.json").exists() and (out / "fields.vtu").is_file()


MESHING = """
[mesh]
generator = "quarter_disc"
size = 0.003
contact_size = 0.003
[material]
young = 1.0
poisson = 0.3
[[fixed]]
on = "top"
displacement = [0.0, 0.0]
[contact]
on = "contact"
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_long_meshing_at_once(number: int, tmp_path: Path) -> None:
    """Gmsh hears none."""
    file = tmp_path / "disc.toml"
    file.write_text(MESHING)
    process = start("check", str(file))
    assert process.stdout is not None
    assert "take Gmsh" in process.stdout.readline()
    process.send_signal(number)
    process.communicate(timeout=10)
    assert process.returncode == -number


def test_an_echo_of_a_signal_does_not_keep_results_from_being_written() -> None:
    """A launcher and its process group both deliver it, the one after the solve has stopped."""
    with ending_on_signal():
        with pytest.raises(Interrupted), stop_on_signal(MPI.COMM_SELF, None) as stop:
            signal.raise_signal(signal.SIGTERM)
            stop.poll()
        signal.raise_signal(signal.SIGTERM)
    with ending_on_signal(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGTERM)
