"""scripts/fx: runs a command where FEniCSx is, or makes that place once.

A copy of the launcher runs with a PATH of stand-ins, so nothing is downloaded or mounted and the
tests are the same in all environments.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.problems.launcher import CLONE, PYTHON, Launcher

UNAVAILABLE = 69


@pytest.fixture
def launcher(tmp_path: Path) -> Launcher:
    return Launcher(tmp_path)


def test_runs_directly_where_fenicsx_is(launcher):
    launcher.fake("python3")
    status, out, _ = launcher.run("sh", "-c", 'echo "$PYTHONPATH:$1:$PWD"; exit 7', "sh", "a  b")
    assert status == 7
    assert out == f"{launcher.clone}:a  b:{launcher.elsewhere}\n"
    assert launcher.places() == []


@pytest.mark.parametrize("before", [[], ["mpirun", "-n", "2"], ["sh", "-c", '"$@"', "sh"]])
def test_contact_that_is_not_installed_is_that_of_the_clone(launcher, before):
    launcher.fake("python3", '[[ $1 == - ]] || echo "$PYTHONPATH $*"')
    launcher.fake("mpirun", '[[ $1 == --version ]] || exec "${@:3}"')
    status, out, _ = launcher.run(*before, "contact", "solve", "a  b")
    command = launcher.clone / "scripts/bin/contact"
    assert (status, out) == (0, f"{launcher.clone} {command} solve a  b\n")


def test_contact_of_the_clone_runs_where_a_folder_has_its_name(tmp_path):
    (tmp_path / "contact").mkdir()
    words = [CLONE / "scripts/fx", "mpirun", "-n", "2", "contact", "--version"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout[:8]) == (0, "contact "), done.stderr


def test_threads_under_mpi_only_where_the_user_set_none(launcher):
    launcher.fake("python3")
    variables = "$OMP_NUM_THREADS $PRTE_MCA_rmaps_default_mapping_policy $OMPI_MCA_topo"
    launcher.fake("mpirun", f'echo "{variables}"')
    launcher.fakes.joinpath("mpirun").write_text(
        launcher.fakes.joinpath("mpirun").read_text()
        + "[[ $1 != --version ]] || echo 'mpirun (Open MPI) 5.0.7'\n"
    )
    assert launcher.run("mpirun", "-n", "3")[1] == "1 :oversubscribe basic\n"
    assert launcher.run("mpirun", "-n", "3", OMP_NUM_THREADS="2")[1] == "2 :oversubscribe basic\n"
    assert launcher.run("sh", "-c", "echo ${OMP_NUM_THREADS-unset}")[1] == "unset\n"


def test_ranks_of_mpich_that_wait_give_way(launcher):
    launcher.fake("python3")
    launcher.fake("mpirun", "echo 'HYDRA build details:'")
    count = "MPIR_CVAR_CH4_PROGRESS_THROTTLE_NO_PROGRESS_COUNT"
    variables = f"$MPIR_CVAR_CH4_PROGRESS_THROTTLE ${count} $MPIR_CVAR_ENABLE_HEAVY_YIELD"
    words = ["sh", "-c", f"echo {variables}"]
    assert launcher.run(*words)[1] == "1 100 1\n"
    assert launcher.run(*words, **{count: "9"})[1] == "1 9 1\n"


@pytest.mark.parametrize(("text", "display"), [("exit 1", ""), ("echo 42 >&3", ":42")])
def test_a_root_without_a_display_gets_one_if_it_starts(launcher, text, display):
    (launcher.fakes / "marker7").write_text("trixie\n")
    launcher.fake("setsid", 'exec "$@"')
    launcher.fake("setpriv", 'exec "${@:3}"')
    launcher.fake("Xvfb", text)
    words = ["sh", "-c", 'echo "$DISPLAY"; exit 7']
    assert launcher.run(*words, DISPLAY="", INSIDE="7") == (7, f"{display}\n", "")


@pytest.mark.parametrize(
    ("version", "scalar", "reason"),
    [
        ("0.9.0", "float", None),
        ("0.10.0.post2", "float", None),
        ("0.11.0", "float", None),
        ("0.8.0", "float", "dolfinx 0.8.0 is not in >=0.9,<0.12"),
        ("0.12.0", "float", "dolfinx 0.12.0 is not in >=0.9,<0.12"),
        ("0.9.0", "complex", "complex scalars"),
        ("ImportError('no dolfinx')", "float", "cannot import it: no dolfinx"),
        ("RuntimeError('no library\\n/tried')", "float", "cannot import it: no library)"),
    ],
)
def test_tells_which_fenicsx_is_supported(launcher, version, scalar, reason):
    modules = launcher.elsewhere / "modules"
    (modules / "petsc4py").mkdir(parents=True)
    (modules / "petsc4py/__init__.py").touch()
    (modules / "petsc4py/PETSc.py").write_text(f"RealType = float\nScalarType = {scalar}\n")
    text = f"print('a warning'); __version__ = {version!r}"
    (modules / "dolfinx.py").write_text(f"raise {version}" if "Error" in version else text)
    launcher.fake("python3", f'exec "{sys.executable}" "$@"')
    status, out, err = launcher.run("sh", "-c", "echo here", PYTHONPATH=str(modules))
    if reason is None:
        assert (status, out, err) == (0, "here\n", "")
    else:
        assert (status, out) == (UNAVAILABLE, "")
        assert reason in err


@pytest.fixture(params=["wheels", "trixie"])
def place(request: pytest.FixtureRequest, launcher: Launcher) -> str:
    """Return the kind of place that is made: wheels where they can be used."""
    launcher.bootstrap_tools()
    if request.param == "wheels":
        launcher.python_for_wheels()
    return request.param


def test_makes_the_place_once_and_passes_the_status(launcher, place):
    status, out, err = launcher.run("sh", "-c", 'echo "$1"; exit 5', "sh", "a  b")
    assert (status, out) == (5, "a  b\n")
    assert "conda env create" in err
    (made,) = launcher.places()
    assert made.startswith(f"{place}-") and not made.endswith(".part")
    status, out, err = launcher.run("sh", "-c", "exit 6")
    assert (status, out, err) == (6, "", "")
    assert launcher.calls() == 1


@pytest.mark.parametrize("place", ["trixie"], indirect=True)  # the lock is one for both
def test_a_second_start_waits_for_the_first(launcher, place):
    with launcher.start("true", FAKE_SECONDS="2") as first:
        while launcher.calls() == 0:
            time.sleep(0.05)
        status, _, err = launcher.run("true")
    assert (status, first.returncode, launcher.calls()) == (0, 0, 1)
    assert "waiting for it" in err


@pytest.mark.parametrize("place", ["wheels"], indirect=True)
def test_what_a_killed_start_has_begun_is_finished(launcher, place):
    with launcher.start("true", FAKE_SECONDS="2") as first:
        while launcher.calls() == 0:
            time.sleep(0.05)
        first.kill()
        status, _, err = launcher.run("true")
    assert (status, launcher.calls()) == (0, 1)
    assert "waiting for it" in err


def test_nothing_is_left_of_a_failure(launcher, place):
    status, _, err = launcher.run("true", FAKE_FAILURE="yes")
    assert (status, launcher.places()) == (UNAVAILABLE, [])
    *_, what, why = err.splitlines()
    assert "network" in what and "room in" in what  # whichever it was
    assert why.startswith("fx: E: the mirror is gone (all of it: ")
    assert err.count("docker build") == 1
    assert launcher.run("true")[0] == 0


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_nothing_is_left_of_an_interrupt(launcher, place, number, status):
    with launcher.start("true", FAKE_SECONDS="20") as process:
        while launcher.calls() == 0:
            time.sleep(0.05)
        process.send_signal(number)
        assert process.wait(timeout=10) == status
    assert launcher.places() == []
    assert launcher.run("true")[0] == 0


def test_wheels_come_first_in_the_path(launcher):
    launcher.python_for_wheels()
    launcher.env["FENICSX"] = "wheels"
    status, out, _ = launcher.run("sh", "-c", 'echo "$VIRTUAL_ENV"; command -v python3')
    (made,) = launcher.places()
    venv = launcher.cache / "contact-fenicsx" / made
    assert (status, out) == (0, f"{venv}\n{venv}/bin/python3\n")
    assert (venv / "pyvenv.cfg").read_text() == f"home = {venv}\n"  # not that of the unfinished


def test_wheels_whose_python_has_left_are_made_again(launcher):
    launcher.python_for_wheels()
    assert launcher.run("true")[0] == 0
    (made,) = launcher.places()
    python = launcher.cache / "contact-fenicsx" / made / "bin/python3"
    python.unlink()
    python.symlink_to(launcher.elsewhere / "python3.13")
    assert launcher.run("true")[0] == 0
    assert launcher.run("true")[0] == 0
    assert (launcher.places(), launcher.calls()) == ([made], 2)
    assert not python.is_symlink()


@pytest.mark.parametrize("lacking", ["a C compiler", "Python.h"])
def test_tells_what_wheels_lack(launcher, lacking):
    launcher.python_for_wheels()
    if "compiler" in lacking:
        (launcher.fakes / "cc").unlink()
    launcher.fake("python3.13", "echo Python.h; exit 1")
    status, _, err = launcher.run("true", FENICSX="wheels")
    assert (status, launcher.places()) == (UNAVAILABLE, [])
    assert f"the wheels need {lacking}" in err
    assert "FENICSX=debian before" in err and "FENICSX=wheels" not in err


def test_a_python_that_only_prints_an_error_is_none(launcher):
    launcher.python_for_wheels()
    launcher.env["FENICSX"] = "wheels"
    launcher.fake("python3.13", "echo 'command not found' >&2; exit 127")
    status, _, err = launcher.run("true")
    assert (status, launcher.places()) == (UNAVAILABLE, [])
    assert "Python >= 3.12" in err
    for version in ("3.11.9", "3.12.9", "3.13.2"):  # the newest of pyenv is taken
        programs = f".pyenv/versions/{version}/bin"
        (launcher.cache.parent / programs).mkdir(parents=True)
        launcher.fake(f"../{programs}/python3", f"{PYTHON}\n# {version}")
    assert launcher.run("true")[0] == 0
    (made,) = launcher.places()
    python = launcher.cache / "contact-fenicsx" / made / "bin/python3"
    assert python.read_text().endswith("# 3.13.2\n")


def test_each_choice_has_a_place_of_its_own(launcher):
    launcher.bootstrap_tools()
    launcher.python_for_wheels()
    launcher.fake("python3")  # FEniCSx is here, but another one is asked for
    for choice, kind in {"sid": "sid", "debian": "trixie", "wheels": "wheels"}.items():
        assert launcher.run("true", FENICSX=choice)[0] == 0
        assert kind in [name.split("-")[0] for name in launcher.places()]
    status, _, err = launcher.run("true", FENICSX="buster")
    assert status == 2
    assert "'buster'" in err and "sid" in err


def test_usage():
    fx = CLONE / "scripts/fx"
    for arguments, status in (([], 2), (["--help"], 0)):
        done = subprocess.run([fx, *arguments], capture_output=True, text=True, env=os.environ)
        assert done.returncode == status
        assert "FENICSX " in done.stderr
