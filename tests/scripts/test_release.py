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
from pathlib import Path

import pytest

import contact
from tests.docs.pages import ROOT

#: Of a clone, all that a build needs.
NEEDED = ("contact", "forms", "meshes", "scripts/cases", "README.md", "LICENSE", "pyproject.toml")


def test_one_version() -> None:
    said = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.M)
    assert said == [contact.__version__]
    assert re.search(
        rf"^## {re.escape(contact.__version__)}$", (ROOT / "CHANGELOG.md").read_text(), re.M
    )
    assert 'dynamic = ["version"]' in (ROOT / "pyproject.toml").read_text()
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
    assert {"contact/cases/bar.toml", "contact/__init__.pyi", "forms/j2.py", "LICENSE"} <= names
    assert archive.name.startswith(f"contact_fenicsx-{contact.__version__}")


@pytest.mark.release
def test_the_wheel_runs_without_a_clone(built: Path, tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    run(sys.executable, "-m", "venv", "--system-site-packages", venv, cwd=tmp_path)
    (wheel,) = built.glob("*.whl")
    pip = [venv / "bin/python", "-m", "pip", "--disable-pip-version-check"]
    run(*pip, "install", "--no-deps", "--no-index", wheel, cwd=tmp_path)
    command = venv / "bin/contact"
    assert run(command, "--version", cwd=tmp_path).split() == ["contact", contact.__version__]
    said = run(command, "demo", "--set", "mesh.cells=[16,4]", cwd=tmp_path)
    assert said.startswith("converged")
    assert json.loads((tmp_path / "contact-demo/summary.json").read_text())["converged"]
    assert (tmp_path / "contact-demo/figure-contact.png").exists()
    assert json.loads(run(command, "schema", cwd=tmp_path))["title"].startswith("Case file")
    where = run(venv / "bin/python", "-c", "import contact; print(contact.__file__)", cwd=tmp_path)
    assert str(venv) in where
    run(*pip, "uninstall", "--yes", "contact-fenicsx", cwd=tmp_path)
    assert not command.exists()
