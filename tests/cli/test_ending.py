"""How the command line begins and ends: PETSc's options, exit statuses, processes."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.cases import CASES
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


@pytest.mark.parametrize("module", ["mpi4py", "petsc4py", "dolfinx", "pyvista"])
def test_without_fenicsx_one_message_has_the_ways_to_it(module: str) -> None:
    status, text = run("plot", "none", before=f"sys.modules['{module}'] = None")
    assert status == 2
    line = text.splitlines()[0]
    assert f"module {module} is needed" in line and line.endswith("[fenicsx]")
    assert "Traceback" not in text
    assert all(way in line for way in ("pip install", "conda", "scripts/fx", "docker"))


@RANKS
def test_without_a_compiler_one_message_tells(
    ranks: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("CC", "no-compiler")
    status, text = run("solve", str(BAR), "--out", str(tmp_path / "out"), *SMALL, ranks=ranks)
    assert status == 2
    assert "[compiler]\n" in text and "Traceback" not in text


#: Few cells and steps of two cases.
IN_PLANE = ["mesh.cells=[8, 2]"]
IN_SPACE = ["mesh.cells=[2, 2, 2]", "evolution.steps=[1, 1, 1]"]


@pytest.mark.parametrize(
    ("case", "changes", "ranks"),
    [
        ("bar", IN_PLANE, 1),
        ("bar", IN_PLANE, 3),
        ("press-shear-unload", IN_SPACE, 1),
        pytest.param("press-shear-unload", IN_SPACE, 3, marks=pytest.mark.slow),
    ],
)
def test_no_library_says_a_word(case: str, changes: list[str], ranks: int, tmp_path: Path) -> None:
    """In 2-D and 3-D, with pictures: VTK writes past Python."""
    given = [str(CASES / f"{case}.toml"), "--out", str(tmp_path / "out"), "--quiet", "--plot"]
    status, text = run("solve", *given, *(f"--set={change}" for change in changes), ranks=ranks)
    assert status == 0
    assert [line for line in text.splitlines() if not line.startswith("warning: ")] == []


def test_a_display_that_does_not_answer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As of an ended session: VTK before 9.4 would abort the program."""
    monkeypatch.setenv("DISPLAY", ":77")
    given = [str(CASES / "press-shear-unload.toml"), "--set=mesh.cells=[2, 2, 2]"]
    given += ["--set=evolution.steps=[1, 1, 1]", "--out", str(tmp_path / "out"), "--quiet"]
    status, text = run("solve", *given, "--plot")
    assert status == 0
    assert [line for line in text.splitlines() if not line.startswith("warning: ")] == []
    assert [*(tmp_path / "out").glob("figure-contact*")]


@pytest.mark.parametrize(
    "before",
    [
        "sys.modules['mpi4py'] = None",
        # that of pip where no library of MPI is found
        "import types\nclass Raising(types.ModuleType):\n"
        "    def __getattr__(self, name): raise RuntimeError('cannot load MPI library')\n"
        "sys.modules['mpi4py'] = Raising('mpi4py')",
    ],
)
def test_without_mpi_python_has_one_message(before: str) -> None:
    program = f"import sys\n{before}\nfrom contact import load_case, solve"
    found = subprocess.run([sys.executable, "-c", program], stderr=subprocess.PIPE, text=True)
    assert found.returncode == 1 and found.stderr.count("Traceback") == 1
    last = found.stderr.splitlines()[-1]
    assert "InputError" in last and "pip install" in last and last.endswith("[fenicsx]")


def test_names_of_the_package_come_in_any_order() -> None:
    """The wheels' dolfinx needs the library of MPI that mpi4py loads."""
    program = "from contact import load_case, solve"
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
