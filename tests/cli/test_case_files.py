"""Wrong case files and meshes, through the command line: one message each, exit status 2."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.cli.main import BAD_INPUT, CONVERGED, NOT_CONVERGED, main

FIXTURES = Path(__file__).parents[2] / "meshes" / "fixtures"

BAR = """
[mesh]
generator = "rectangle"
size = [2.0, 1.0]
cells = [4, 2]
[mesh.parts.half]
side = "bottom"
to = 1.0
[material]
law = "log"
young = 1.0
poisson = 0.3
yield_strain = 0.05
[[fixed]]
on = "left"
displacement = [0.0, 0.0]
[[load]]
on = "top"
traction = [0.0, -0.001]
[contact]
on = "bottom"
gap = 0.0
[friction]
law = "coulomb"
mu = 0.3
"""

PIEZO = """
[material.piezo]
e31 = -5.4
e33 = 15.8
e15 = 12.3
beta11 = 8.1
beta33 = 7.4
"""

MESH = """
[mesh]
file = "{file}"
[material]
young = 1.0
poisson = 0.3
[[fixed]]
on = "left"
displacement = [0.0, 0.0]
[contact]
on = "bottom"
"""

#: Name -> (text that is replaced, its replacement, words of the message).
WRONG = {
    "a typing error in a key": ("poisson", "poison", ["material.poison", "did you mean poisson"]),
    "an unknown table": ("[friction]", "[friktion]", ["friktion", "did you mean friction"]),
    "a missing key": ("young = 1.0", "", ["material.young", "missing"]),
    "a text for a number": ("young = 1.0", 'young = "one"', ["material.young", "a number > 0"]),
    "Poisson's ratio 1/2": ("0.3\nyield", "0.5\nyield", ["material.poisson", "0.5"]),
    "no yield strain": ("yield_strain = 0.05", "", ["material.yield_strain", "missing"]),
    "no cells along an edge": ("[4, 2]", "[4, 0]", ["mesh.cells", "0"]),
    "a negative size": ("[2.0, 1.0]", "[2.0, -1.0]", ["mesh.size", "-1.0"]),
    "an unknown generator": ('"rectangle"', '"rectangel"', ["mesh.generator", "rectangel"]),
    "a piece between grid positions": ("to = 1.0", "to = 0.9", ["half", "0.9", "0.5, 1"]),
    "a piece of an unknown side": ('side = "bottom"', 'side = "base"', ["half.side", "base"]),
    "an unknown part": ('on = "bottom"', 'on = "botom"', ["contact.on", "botom", "bottom"]),
    "a load on an unknown part": ('on = "top"', 'on = "topp"', ["load.0.on", "topp", "top"]),
    "three components in the plane": (
        "[0.0, -0.001]",
        "[0.0, 0.0, -0.001]",
        ["load.0.traction", "2 components"],
    ),
    "z in the plane": ("-0.001", '"-z"', ["load.0.traction", "x and y"]),
    "a load on the contact part": (
        'on = "top"',
        'on = "bottom"',
        ["load.0.on", "bottom", "contact part"],
    ),
    "a load on some of the contact part": (
        'on = "top"',
        'on = "half"',
        ["load.0.on", "half shares facets with the contact part bottom"],
    ),
    "a formula with a mistake": ("-0.001", '"-0.001*(x"', ["load.0.traction", "not a formula"]),
    "a formula that would run code": ("-0.001", '"__import__(x)"', ["load.0.traction"]),
    "a load that is not finite": ("-0.001", '"log(x-1)"', ["load.0.traction.1", "not finite"]),
    "a load that overflows": ("-0.001", "-1e300", ["load.0.traction.1", "-1e+300", "overflow"]),
    "a load formula that overflows": ("-0.001", '"-1e200*x"', ["load.0.traction.1", "overflow"]),
    "a displacement that overflows": (
        "[0.0, 0.0]",
        "[0.0, 1e300]",
        ["fixed.0.displacement.1", "1e+300", "overflow"],
    ),
    "a modulus that overflows": ("young = 1.0", "young = 1e300", ["material.young", "overflow"]),
    "a modulus that underflows": ("young = 1.0", "young = 1e-300", ["material.young", "1e-300"]),
    "a body that overflows": (
        '[2.0, 1.0]\ncells = [4, 2]\n[mesh.parts.half]\nside = "bottom"\nto = 1.0',
        "[2e300, 1e300]\ncells = [4, 2]",
        ["mesh", "2e+300", "overflow"],
    ),
    "more cells than memory": (
        "[4, 2]",
        "[1000000, 1000000]",
        ["mesh.cells", "2e+12 cells", "memory"],
    ),
    "a displacement that is not finite": (
        "[0.0, 0.0]",
        '[0.0, "log(y-0.5)"]',
        ["fixed.0.displacement.1", "not finite"],
    ),
    "a negative gap": ("gap = 0.0", "gap = -0.1", ["contact.gap", "-0.1"]),
    "a gap that is negative somewhere": ("gap = 0.0", 'gap = "x-1"', ["contact.gap", "x-1"]),
    "a gap that is not finite": ("gap = 0.0", 'gap = "1/(x-1)"', ["contact.gap", "not finite"]),
    "a gap and a shape": (
        "gap = 0.0",
        'gap = 0.0\nfoundation = { shape = "plane", point = [0, 0], normal = [0, 1] }',
        ["contact.gap", "one of them"],
    ),
    "a plane without a normal": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.0], normal = [0.0, 0.0] }',
        ["contact.foundation.normal", "not zero"],
    ),
    "a sphere around a contact node": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 0.0], radius = 1.0 }',
        ["contact.foundation", "centre"],
    ),
    "a plane that faces away": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.0], normal = [0.0, -1.0] }',
        ["contact.foundation", "behind the contact part", "normal towards the body"],
    ),
    "a plane through the body": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.25], normal = [0.0, 1.0] }',
        ["contact.foundation", "cuts it at rest", "0.25"],
    ),
    "an oblique plane into the body": (
        "gap = 0.0",
        'direction = "body"\n'
        'foundation = { shape = "plane", point = [1.0, 0.0], normal = [0.5, 1.0] }',
        ["contact.foundation", "cuts it at rest", "0.5"],
    ),
    "a sphere on the other side": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 3.0], radius = 1.0 }',
        ["contact.foundation", "behind the contact part"],
    ),
    "a sphere that does not hold the body": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 0.5], radius = 0.9, inside = true }',
        ["contact.foundation", "cuts it at rest"],
    ),
    "a sphere that overflows": (
        "gap = 0.0",
        'direction = "body"\n'
        'foundation = { shape = "sphere", centre = [0.0, -1e200], radius = 1e200 }',
        ["contact.foundation.centre", "1e+200", "overflow"],
    ),
    "a plane that overflows": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, -1e300], normal = [0.0, 1.0] }',
        ["contact.foundation.point", "overflow"],
    ),
    "nested meshes of too few cells": (
        "[friction]",
        "[solver]\nnested = true\n[friction]",
        ["solver.nested", "at least 8 cells along each edge"],
    ),
    "friction negative somewhere": ("mu = 0.3", 'mu = "0.3-x"', ["friction.mu", "0.3-x"]),
    "Coulomb without mu": ("mu = 0.3", "", ["friction.mu", "missing"]),
    "charge without piezoelectricity": (
        "traction = [0.0, -0.001]",
        "charge = 1.0",
        ["load.0.charge", "material.piezo"],
    ),
    "contact on a clamped part": ('on = "bottom"\ngap', 'on = "left"\ngap', ["contact.on"]),
    "contact nodes that are all fixed": (
        "displacement = [0.0, 0.0]",
        'displacement = [0.0, 0.0]\n[[fixed]]\non = "bottom"\ndisplacement = ["free", 0.0]',
        ["contact.on", "no node that is free"],
    ),
    "contradicting supports": (
        "displacement = [0.0, 0.0]",
        'displacement = [0.0, 0.0]\n[[fixed]]\non = "left"\ndisplacement = [0.1, 0.0]',
        ["fixed.1.displacement.0", "fixed.0"],
    ),
    "a body that can slide": (
        BAR[BAR.index("[0.0, 0.0]") :],
        '["free", 0.0]\n[contact]\non = "bottom"\n',
        ["not held", "translation along x"],
    ),
    "a potential fixed nowhere": ("[[load]]", PIEZO + "[[load]]", ["fixed", "no potential fixed"]),
    "an indefinite permittivity": (
        "[[load]]",
        PIEZO.replace("7.4", "-7.4") + "[[load]]",
        ["material.piezo.beta33", "-7.4"],
    ),
    "an unknown method": (
        "[friction]",
        '[solver]\nmethod = "uzava"\n[friction]',
        ["solver.method", "uzava"],
    ),
    "a tolerance of 0": ("[friction]", "[solver]\ntolerance = 0.0\n[friction]", ["tolerance"]),
    "a table twice": ("[friction]", "[contact]\n[friction]", ["not a TOML file"]),
}

MESHES = {
    "no mesh at all": ("bad/text.msh", ["text.msh", "no Gmsh .msh file"]),
    "an empty file": ("bad/empty.msh", ["empty.msh"]),
    "no named groups": ("bad/no-groups.msh", ["no-groups.msh"]),
    "a degenerate cell": ("bad/degenerate.msh", ["degenerate.msh"]),
    "a folded mesh": ("bad/folded.msh", ["folded.msh"]),
    "quadrangles": ("bad/quadrangle.msh", ["quadrangle.msh"]),
    "a group inside the body": ("bad/interior.msh", ["interior.msh"]),
    "a mesh in space for a plane case": ("block.msh", ["displacement", "3 components"]),
    "parts of other names": ("square.msh", ["a part of the mesh"]),
}


def run(case: Path, *options: str, capfd: pytest.CaptureFixture[str]) -> tuple[int, list[str]]:
    """Solve a case by the command line; return the exit status and the lines of stderr."""
    MPI.COMM_WORLD.barrier()
    out = case.parent / "out"
    status = main(["solve", str(case), "--out", str(out), "--quiet", *options])
    lines = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    if status == BAD_INPUT:
        assert not out.exists(), "bad input must leave nothing behind"
    return status, lines


def write(folder: Path, text: str, name: str = "case.toml") -> Path:
    """Write a case file, on rank 0."""
    path = folder / name
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(text)
    return path


def refuse(case: Path, words: list[str], capfd: pytest.CaptureFixture[str], *options: str) -> None:
    """Check that a case is refused with one message that names the file and holds the words."""
    status, lines = run(case, *options, capfd=capfd)
    assert status == BAD_INPUT
    if MPI.COMM_WORLD.rank == 0:
        assert len(lines) == 1, lines
        assert lines[0].startswith("contact: ")
        missing = [word for word in [case.name, *words] if word not in lines[0]]
        assert not missing, f"{missing} not in: {lines[0]}"
    else:
        assert lines == []


def test_the_base_case_is_right(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What the wrong cases differ from converges."""
    status, _ = run(write(shared_tmp_path, BAR), capfd=capfd)
    assert status == CONVERGED


@pytest.mark.parametrize("name", WRONG)
def test_wrong_case_file(
    name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Each mistake gets its message."""
    old, new, words = WRONG[name]
    assert old in BAR
    refuse(write(shared_tmp_path, BAR.replace(old, new, 1)), words, capfd)


def test_check_refuses_what_solve_does(
    shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """All but what only the numbers of a solve can tell."""
    for name, (old, new, words) in WRONG.items():
        case = write(shared_tmp_path, BAR.replace(old, new, 1))
        assert main(["check", str(case)]) == BAD_INPUT, name
        lines = capfd.readouterr().err.splitlines()
        assert len(lines) == 1, lines
        assert all(word in lines[0] for word in words), lines


@pytest.mark.parametrize("name", MESHES)
def test_wrong_mesh(name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A mesh that cannot be used is refused like a wrong case."""
    file, words = MESHES[name]
    refuse(write(shared_tmp_path, MESH.format(file=FIXTURES / file)), words, capfd)


def test_missing_files(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Missing case and mesh files are named."""
    refuse(shared_tmp_path / "nothing.toml", ["No such file"], capfd)
    refuse(write(shared_tmp_path, MESH.format(file="absent.msh")), ["absent.msh"], capfd)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--set", "material.young"], ["material.young", "no assignment"]),
        (["--set", "material.young=-1"], ["material.young", "-1"]),
        (["--set", "load.3.on=top"], ["load", "3"]),
        (["--outt", "x"], ["--outt", "--out"]),
        (["--out", ""], ["--out", "no folder"]),
    ],
)
def test_wrong_command_line(
    options: list[str],
    words: list[str],
    shared_tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Options and overrides are checked as the file is."""
    status, lines = run(write(shared_tmp_path, BAR), *options, capfd=capfd)
    assert status == BAD_INPUT
    assert len(lines) == 1
    assert all(word in lines[0] for word in words), lines


@pytest.mark.parametrize(
    ("option", "value", "method"),
    [
        ("contact_ksp_type", "foo", "newton"),
        ("contact_pc_factor_mat_solver_type", "foo", "uzawa"),
        ("penalty_snes_type", "foo", "penalty"),
    ],
)
def test_wrong_petsc_options(
    option: str, value: str, method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What PETSc does not know is bad input, and nothing is left in its options."""
    options = PETSc.Options()
    options[option] = value
    before = set(options.getAll())
    try:
        case = write(shared_tmp_path, BAR + f"[solver]\nmethod = '{method}'\n")
        refuse(case, ["PETSc", value, option.split("_")[0]], capfd)
        assert set(options.getAll()) == before
    finally:
        options.delValue(option)


@pytest.mark.parametrize("name", ["pulled off", "potential of an open contact", "overflow"])
@pytest.mark.parametrize("method", ["uzawa", "newton"])
def test_problem_without_solution(
    name: str, method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Loads that nothing balances and undetermined potentials are bad input too."""
    if name == "pulled off":
        text = BAR.replace("[0.0, 0.0]", '[0.0, "free"]').replace("-0.001", "0.001")
        words = ["pull the body off"]
    elif name == "overflow":
        text = BAR.replace("-0.001", "-1e149").replace("young = 1.0", "young = 1e-149")
        words = ["numbers overflow"]
    else:
        text = BAR.replace("[[load]]", PIEZO + "[[load]]").replace("gap = 0.0", "gap = 0.5")
        text += "\n[electric]\nlaw = 'perfect'\nk_e = 1.0\n"
        words = ["potential is not determined"]
    text += f"\n[solver]\nmethod = '{method}'\n"
    refuse(write(shared_tmp_path, text), words, capfd)


@pytest.mark.parallel
@pytest.mark.parametrize("method", ["uzawa", "newton"])
def test_held_nodes_that_conduct_determine_the_potential(
    method: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Where the body rests on supports and is open elsewhere, the current flows through those."""
    text = BAR.replace("[[load]]", PIEZO + "[[load]]").replace("gap = 0.0", 'gap = "0.5*(x>1)"')
    text = text.replace("[[load]]", '[[fixed]]\non = "half"\ndisplacement = [0.0, 0.0]\n[[load]]')
    text += f"\n[electric]\nk_e = 1.0\nphi_f = 2.0\n[solver]\nmethod = '{method}'\n"
    status, lines = run(write(shared_tmp_path, text), capfd=capfd)
    assert status == CONVERGED, lines


@pytest.mark.parallel
@pytest.mark.parametrize(
    "name",
    [
        "an unknown part",
        "a displacement that is not finite",
        "a load that is not finite",
        "a load that overflows",
        "more cells than memory",
        "a gap that is negative somewhere",
        "a sphere around a contact node",
        "a plane that faces away",
        "a plane through the body",
        "friction negative somewhere",
        "contact nodes that are all fixed",
        "a body that can slide",
    ],
)
def test_all_ranks_refuse_together(
    name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """What only some ranks can see makes all of them leave, with one message."""
    test_wrong_case_file(name, shared_tmp_path, capfd)


@pytest.mark.parallel
def test_not_converged_writes_outputs(
    shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """One outer iteration is too few: exit status 1, and the outputs say so."""
    case = write(shared_tmp_path, BAR.replace("mu = 0.3", 'mu = { law = "slip", rho = 1e4 }'))
    options = ("--set", "solver.method=uzawa", "--set", "solver.max_outer=1")
    status, lines = run(case, *options, capfd=capfd)
    assert status == NOT_CONVERGED
    if MPI.COMM_WORLD.rank == 0:  # --quiet is about progress alone
        assert "contact: stopped: not converged in 1 outer iterations" in lines[-1]
    summary = (shared_tmp_path / "out" / "summary.json").read_text()
    assert '"converged": false' in summary
    assert "not converged in 1 outer iterations" in summary


@pytest.mark.parametrize(("asked", "status"), [(False, CONVERGED), (True, BAD_INPUT)])
def test_petsc_obeys_no_file_that_lies_in_the_folder(asked, status, tmp_path):
    """It comes with a case of somebody else's, and may name libraries to be loaded."""
    (tmp_path / "case.toml").write_text(BAR)
    for name in (".petscrc", "petscrc"):
        (tmp_path / name).write_text("-contact_pc_factor_mat_solver_type nonsense\n")
    options = ["-options_file", ".petscrc"] if asked else []
    command = [sys.executable, "-m", "contact", "solve", "case.toml", "--out", "out", *options]
    done = subprocess.run(
        command,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(FIXTURES.parents[1])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == status, done.stderr
