"""Wrong case files and meshes: one message each, exit status 2."""

from collections.abc import Callable
from pathlib import Path

import pytest

from contact.cli.main import BAD_INPUT, CONVERGED, main
from tests.cli.running import BAR, MESH, PIEZO, refuse, run, write

FIXTURES = Path(__file__).parents[2] / "meshes" / "fixtures"

#: Name -> (text that is replaced, its replacement, key that the message names).
WRONG = {
    "a typing error in a key": ("poisson", "poison", "material.poison"),
    "an unknown table": ("[friction]", "[friktion]", "friktion"),
    "a missing key": ("young = 1.0", "", "material.young"),
    "a text for a number": ("young = 1.0", 'young = "one"', "material.young"),
    "Poisson's ratio 1/2": ("0.3\nyield", "0.5\nyield", "material.poisson"),
    "no yield strain": ("yield_strain = 0.05", "", "material.yield_strain"),
    "no cells along an edge": ("[4, 2]", "[4, 0]", "mesh.cells"),
    "a negative size": ("[2.0, 1.0]", "[2.0, -1.0]", "mesh.size"),
    "an unknown generator": ('"rectangle"', '"rectangel"', "mesh.generator"),
    "a piece between grid positions": ("to = 1.0", "to = 0.9", "half"),
    "a piece of an unknown side": ('side = "bottom"', 'side = "base"', "half.side"),
    "an unknown part": ('on = "bottom"', 'on = "botom"', "contact.on"),
    "a load on an unknown part": ('on = "top"', 'on = "topp"', "load.0.on"),
    "three components in the plane": (
        "[0.0, -0.001]",
        "[0.0, 0.0, -0.001]",
        "load.0.traction",
    ),
    "z in the plane": ("-0.001", '"-z"', "load.0.traction"),
    "a load on the contact part": (
        'on = "top"',
        'on = "bottom"',
        "load.0.on",
    ),
    "a load on some of the contact part": (
        'on = "top"',
        'on = "half"',
        "load.0.on",
    ),
    "a formula with a mistake": ("-0.001", '"-0.001*(x"', "load.0.traction"),
    "a formula that would run code": ("-0.001", '"__import__(x)"', "load.0.traction"),
    "a load that is not finite": ("-0.001", '"log(x-1)"', "load.0.traction.1"),
    "a load that overflows": ("-0.001", "-1e300", "load.0.traction.1"),
    "a load formula that overflows": ("-0.001", '"-1e200*x"', "load.0.traction.1"),
    "a displacement that overflows": (
        "[0.0, 0.0]",
        "[0.0, 1e300]",
        "fixed.0.displacement.1",
    ),
    "a modulus that overflows": ("young = 1.0", "young = 1e300", "material.young"),
    "a modulus that underflows": ("young = 1.0", "young = 1e-300", "material.young"),
    "a body that overflows": (
        '[2.0, 1.0]\ncells = [4, 2]\n[mesh.parts.half]\nside = "bottom"\nto = 1.0',
        "[2e300, 1e300]\ncells = [4, 2]",
        "mesh",
    ),
    "more cells than memory": (
        "[4, 2]",
        "[1000000, 1000000]",
        "mesh.cells",
    ),
    "a displacement that is not finite": (
        "[0.0, 0.0]",
        '[0.0, "log(y-0.5)"]',
        "fixed.0.displacement.1",
    ),
    "a gap that is not finite": ("gap = 0.0", 'gap = "1/(x-1)"', "contact.gap"),
    "a gap and a shape": (
        "gap = 0.0",
        'gap = 0.0\nfoundation = { shape = "plane", point = [0, 0], normal = [0, 1] }',
        "contact.gap",
    ),
    "a plane without a normal": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.0], normal = [0.0, 0.0] }',
        "contact.foundation.normal",
    ),
    "a sphere around a contact node": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 0.0], radius = 1.0 }',
        "contact.foundation",
    ),
    "a plane that faces away": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.0], normal = [0.0, -1.0] }',
        "contact.foundation",
    ),
    "a plane through the body": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, 0.25], normal = [0.0, 1.0] }',
        "contact.foundation",
    ),
    "an oblique plane into the body": (
        "gap = 0.0",
        'direction = "body"\n'
        'foundation = { shape = "plane", point = [1.0, 0.0], normal = [0.5, 1.0] }',
        "contact.foundation",
    ),
    "a sphere on the other side": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 3.0], radius = 1.0 }',
        "contact.foundation",
    ),
    "a sphere that does not hold the body": (
        "gap = 0.0",
        'foundation = { shape = "sphere", centre = [1.0, 0.5], radius = 0.9, inside = true }',
        "contact.foundation",
    ),
    "a sphere that overflows": (
        "gap = 0.0",
        'direction = "body"\n'
        'foundation = { shape = "sphere", centre = [0.0, -1e200], radius = 1e200 }',
        "contact.foundation.centre",
    ),
    "a plane that overflows": (
        "gap = 0.0",
        'foundation = { shape = "plane", point = [0.0, -1e300], normal = [0.0, 1.0] }',
        "contact.foundation.point",
    ),
    "nested meshes of too few cells": (
        "[friction]",
        "[solver]\nnested = true\n[friction]",
        "solver.nested",
    ),
    "friction negative somewhere": ("mu = 0.3", 'mu = "0.3-x"', "friction.mu"),
    "Coulomb without mu": ("mu = 0.3", "", "friction.mu"),
    "charge without piezoelectricity": (
        "traction = [0.0, -0.001]",
        "charge = 1.0",
        "load.0.charge",
    ),
    "contact on a clamped part": ('on = "bottom"\ngap', 'on = "left"\ngap', "contact.on"),
    "contact nodes that are all fixed": (
        "displacement = [0.0, 0.0]",
        'displacement = [0.0, 0.0]\n[[fixed]]\non = "bottom"\ndisplacement = ["free", 0.0]',
        "contact.on",
    ),
    "contradicting supports": (
        "displacement = [0.0, 0.0]",
        'displacement = [0.0, 0.0]\n[[fixed]]\non = "left"\ndisplacement = [0.1, 0.0]',
        "fixed.1.displacement.0",
    ),
    "a body that can slide": (
        BAR[BAR.index("[0.0, 0.0]") :],
        '["free", 0.0]\n[contact]\non = "bottom"\n',
        "not held",
    ),
    "a potential fixed nowhere": ("[[load]]", PIEZO + "[[load]]", "fixed"),
    "an indefinite permittivity": (
        "[[load]]",
        PIEZO.replace("7.4", "-7.4") + "[[load]]",
        "material.piezo.beta33",
    ),
    "an unknown method": (
        "[friction]",
        '[solver]\nmethod = "uzava"\n[friction]',
        "solver.method",
    ),
    "a tolerance of 0": ("[friction]", "[solver]\ntolerance = 0.0\n[friction]", "tolerance"),
    "a table twice": ("[friction]", "[contact]\n[friction]", "not a TOML file"),
}

MESHES = {
    "no mesh at all": ("bad/text.msh", "text.msh"),
    "an empty file": ("bad/empty.msh", "empty.msh"),
    "no named groups": ("bad/no-groups.msh", "no-groups.msh"),
    "a degenerate cell": ("bad/degenerate.msh", "degenerate.msh"),
    "a folded mesh": ("bad/folded.msh", "folded.msh"),
    "quadrangles": ("bad/quadrangle.msh", "quadrangle.msh"),
    "a group inside the body": ("bad/interior.msh", "interior.msh"),
    "a mesh in space for a plane case": ("block.msh", "displacement"),
    "parts of other names": ("square.msh", "a part of the mesh"),
}


@pytest.mark.core
def test_the_base_case_is_right(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What the wrong cases differ from converges."""
    status, _ = run(write(shared_tmp_path, BAR), capfd=capfd)
    assert status == CONVERGED


@pytest.mark.core
@pytest.mark.parametrize("name", WRONG)
def test_wrong_case_file(
    name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Exit status 2, the key and the identifier; nothing is written."""
    old, new, key = WRONG[name]
    assert old in BAR
    refuse(write(shared_tmp_path, BAR.replace(old, new, 1)), [key], capfd)


@pytest.mark.wording
def test_messages_of_check(
    snapshot: Callable[[str, dict[str, str]], None],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """It refuses all but what only the numbers of a solve can tell."""
    said = {}
    for name, (old, new, _) in WRONG.items():
        case = write(tmp_path, BAR.replace(old, new, 1))
        assert main(["check", str(case)]) == BAD_INPUT, name
        (said[name],) = capfd.readouterr().err.replace(str(tmp_path), "").splitlines()
    snapshot("wrong-cases", said)


@pytest.mark.parametrize("name", MESHES)
def test_wrong_mesh(name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A mesh that cannot be used is refused like a wrong case."""
    file, word = MESHES[name]
    refuse(write(shared_tmp_path, MESH.format(file=FIXTURES / file)), [word], capfd)


def test_missing_files(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Missing case and mesh files are named."""
    refuse(shared_tmp_path / "nothing.toml", ["No such file"], capfd)
    refuse(write(shared_tmp_path, MESH.format(file="absent.msh")), ["absent.msh"], capfd)


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize(
    "name",
    [
        "an unknown part",
        "a displacement that is not finite",
        "a load that is not finite",
        "a load that overflows",
        "more cells than memory",
        "a gap that is not finite",
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
