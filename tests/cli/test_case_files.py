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
    "a negative size": ("[2.0, 1.0]", "[2.0, -1.0]", "mesh.size"),
    "an unknown part": ('on = "bottom"', 'on = "botom"', "contact.on"),
    "a load on the contact part": ('on = "top"', 'on = "bottom"', "load.0.on"),
    "a load that is not finite": ("-0.001", '"log(x-1)"', "load.0.traction.1"),
    "a load that overflows": ("-0.001", "-1e300", "load.0.traction.1"),
    "more cells than memory": ("[4, 2]", "[1000000, 1000000]", "mesh.cells"),
    "a displacement that is not finite": (
        "[0.0, 0.0]",
        '[0.0, "log(y-0.5)"]',
        "fixed.0.displacement.1",
    ),
    "a gap that is not finite": ("gap = 0.0", 'gap = "1/(x-1)"', "contact.gap"),
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
    "friction negative somewhere": ("mu = 0.3", 'mu = "0.3-x"', "friction.mu"),
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
        "not constrained",
    ),
    "an indefinite permittivity": (
        "[[load]]",
        PIEZO.replace("7.4", "-7.4") + "[[load]]",
        "material.piezo.beta33",
    ),
}

MESHES = {
    "an empty file": ("bad/empty.msh", "empty.msh"),
    "a folded mesh": ("bad/folded.msh", "folded.msh"),
    "a mesh in space for a plane case": ("block.msh", "displacement"),
}


@pytest.mark.core
def test_the_base_case_is_right(shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What the wrong cases differ from converges."""
    status, _ = run(write(shared_tmp_path, BAR), capfd=capfd)
    assert status == CONVERGED


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", WRONG)
def test_wrong_case_file(
    name: str, shared_tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Exit status 2 on all ranks, the key and the identifier; nothing is written."""
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
