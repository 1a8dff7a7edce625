"""The release: one version; wheel and source distribution, installed where there is no clone.

What builds and installs is left out of `make test`; `make release` runs it.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import contact
from tests.docs.pages import ROOT

#: Folders of a clone that are packages.
PACKAGES = ("contact", "forms", "meshes")

#: Of a clone, all that a build takes something of, or is to leave out.
NEEDED = (
    *PACKAGES,
    *("scripts/cases", "tests", "README.md", "CHANGELOG.md", "CITATION.cff", "LICENSE"),
    *("pyproject.toml", "MANIFEST.in"),
)

#: The wheel of FEniCSx, and what it has that conda and Debian have by themselves.
WHEEL, APART = "dolfinx-solver-real", ("mpi4py", "petsc4py")
#: Names that pip, conda and Debian do not share: of pip -> of the others.
CONDA = {WHEEL: "fenics-dolfinx", "matplotlib": "matplotlib-base", "gmsh": "python-gmsh"}
DEBIAN = {WHEEL: "dolfinx-real", "petsc4py": "petsc4py-real"}
#: Debian counts these versions from 1 anew.
EPOCHS = (WHEEL, "numpy")
PACKAGING = ROOT / "scripts/packaging"


def _wanted() -> tuple[dict[str, str], dict[str, str]]:
    """Return what the program needs and what reads meshes, name -> bounds, as pip has them."""
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())
    project = given["project"]
    extras = project["optional-dependencies"]
    (wheel,) = (line for line in extras["fenicsx"] if line.startswith(WHEEL))
    lists = (
        [
            f"python{project['requires-python']}",
            wheel,
            *APART,
            *project["dependencies"],
            *extras["pictures"],
        ],
        [*given["build-system"]["requires"], *extras["meshes"]],
    )
    needed, further = ([re.fullmatch(r"([\w-]+)([^;]*).*", row) for row in rows] for rows in lists)
    return {m[1]: m[2] for m in needed if m}, {m[1]: m[2] for m in further if m}


@pytest.mark.parametrize("file", ["environment.yml", "scripts/packaging/conda/recipe.yaml"])
def test_conda_has_the_dependencies(file: str) -> None:
    needed, further = _wanted()
    lines = re.findall(r"^ +- (.*)$", (ROOT / file).read_text(), re.M)
    said = {name: bounds.strip() for name, _, bounds in (line.partition(" ") for line in lines)}
    recipe = file.endswith("recipe.yaml")
    for name, bounds in (needed | further).items():
        if name == "petsc4py":
            assert f"{name} * real*" in lines or f"{name}=*=real*" in lines
        elif recipe or name != "setuptools":
            assert said[CONDA.get(name, name)] == bounds, name


def test_debian_has_the_dependencies() -> None:
    needed, further = _wanted()
    text = (PACKAGING / "debian/control").read_text()
    fields = {
        key: [line.strip(" ,") for line in lines.splitlines()]
        for key, lines in re.findall(r"^([\w-]+):\n((?: .*\n)+)", text, re.M)
    }

    def packages(name: str, bounds: str) -> list[str]:
        package = "python3" if name == "python" else f"python3-{DEBIAN.get(name, name)}"
        epoch = "1:" if name in EPOCHS else ""
        found = re.findall(r"(>=|<)([\d.]+)", bounds)
        signs = {">=": ">=", "<": "<<"}
        return [f"{package} ({signs[sign]} {epoch}{v})" for sign, v in found] or [package]

    for name, bounds in needed.items():
        assert {*packages(name, bounds)} <= {*fields["Depends"]}, name
    assert packages("setuptools", further.pop("setuptools"))[0] in fields["Build-Depends"]
    for name, bounds in further.items():
        assert packages(name, bounds)[0] in fields["Recommends"], name


def test_one_version() -> None:
    said = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert said == [contact.__version__]
    assert re.search(
        rf"^## {re.escape(contact.__version__)}$", (ROOT / "CHANGELOG.md").read_text(), re.M
    )
    given = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert given["project"]["dynamic"] == ["version"]
    assert given["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "contact.__version__"}
    changes = (ROOT / "scripts/packaging/debian/changelog").read_text()
    assert changes.startswith(f"contact-fenicsx ({contact.__version__}-1)")
    recipe = (ROOT / "scripts/packaging/conda/recipe.yaml").read_text()
    assert f"version: {contact.__version__}" in recipe


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command away from the clone; return its output."""
    away = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run([*map(str, command)], cwd=cwd, env=away, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a source distribution, and of the wheel that was built from it."""
    pytest.importorskip("build")
    copy = tmp_path_factory.mktemp("clone")
    for name in NEEDED:
        source, target = ROOT / name, copy / name
        target.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(source, target, symlinks=True, ignore=ignored)
        else:
            shutil.copy(source, target)
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", copy / "dist", cwd=copy)
    return copy / "dist"


@pytest.mark.release
def test_the_source_distribution_has_all_that_the_wheel_has(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = {name.partition("/")[2] for name in files.getnames()}
    (wheel,) = built.glob("*.whl")
    installed = {n for n in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in n}
    clone = [path for name in PACKAGES for path in (ROOT / name).rglob("*")]
    clone += (ROOT / "contact/cases").glob("*.toml")  # a link, which rglob does not follow
    kinds = (".py", ".pyi", ".toml", ".typed")
    sources = {str(path.relative_to(ROOT)) for path in clone if path.suffix in kinds}
    assert sources <= installed <= names
    assert {"LICENSE", "CHANGELOG.md", "CITATION.cff", "README.md"} <= names
    assert not any(name.startswith("tests") for name in names)  # not a part of them alone
    assert archive.name.startswith(f"contact_fenicsx-{contact.__version__}")


@pytest.mark.release
def test_an_index_takes_the_files(built: Path, tmp_path: Path) -> None:
    python = tmp_path / "bin/python"  # not every place has twine
    run(sys.executable, "-m", "venv", tmp_path, cwd=tmp_path)
    run(python, "-m", "pip", "--disable-pip-version-check", "install", "twine", cwd=tmp_path)
    run(python, "-m", "twine", "check", "--strict", *built.iterdir(), cwd=tmp_path)


@pytest.mark.release
def test_the_lines_of_the_readme_install_and_run(
    built: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the unpacked source distribution, then without it."""
    lines = re.search(r"^```bash\n(.*?)^```", (ROOT / "README.md").read_text(), re.M | re.S)
    assert lines is not None and len(lines[1].splitlines()) == 3
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        files.extractall(tmp_path, filter="data")
    (sources,) = tmp_path.glob("contact_fenicsx-*")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))  # no form is compiled yet
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    said = run("bash", "-e", "-c", lines[1], cwd=sources)
    assert "converged: " in said
    assert json.loads((sources / "contact-demo/summary.json").read_text())["converged"]
    assert (sources / "contact-demo/figure-contact.png").exists()

    programs = sources / "venv/bin"
    command = programs / "contact"
    assert run(command, "--version", cwd=tmp_path).split() == ["contact", contact.__version__]
    assert json.loads(run(command, "schema", cwd=tmp_path))["title"].startswith("Case file")
    where = run(programs / "python", "-c", "import contact; print(contact.__file__)", cwd=tmp_path)
    assert str(programs.parent) in where
    on_ranks = [programs / "mpirun", "-n", "2", command, "demo", "--set", "mesh.cells=[16,4]"]
    assert "converged: " in run(*on_ranks, "--out", "on-ranks", cwd=tmp_path)

    pip = [programs / "python", "-m", "pip", "--disable-pip-version-check"]
    run(*pip, "install", "--quiet", "contact-fenicsx[notebooks]", cwd=tmp_path)
    notebook = shutil.copy(ROOT / "scripts/notebooks/first_contact.py", tmp_path)
    program = "import jupytext, nbclient, sys; nbclient.execute(jupytext.read(sys.argv[1]))"
    run(programs / "python", "-c", program, notebook, cwd=tmp_path)
    run(*pip, "uninstall", "--yes", "contact-fenicsx", cwd=tmp_path)
    assert not command.exists()
