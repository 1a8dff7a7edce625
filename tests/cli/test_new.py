"""A case for a mesh of one's own, and what ``check`` says of a case before it is solved."""

import json
from pathlib import Path

import numpy as np
import pytest

from contact.case.file import load_case
from contact.cli.check import quality
from contact.cli.main import BAD_INPUT, CONVERGED, main
from contact.mesh.cells import HEXAHEDRON, QUADRILATERAL, TETRAHEDRON, TRIANGLE
from meshes import write


def test_a_case_to_begin_with(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    """It passes check as it is, and solves; of names with blanks."""
    mesh, path = tmp_path / "block.msh", tmp_path / "block.toml"
    write("block", mesh, size=0.5, contact_size=0.5)
    mesh.write_text(mesh.read_text().replace('"bottom"', '"under side"'))
    assert main(["new", str(mesh)]) == CONVERGED
    assert "contact check" in capsys.readouterr().out
    text = path.read_text()
    assert "top, under side." in text and "# Regions: body." in text
    case = load_case(path)
    assert (case.fixed[0].on, case.contact.on) == ("top", "under side")
    assert main(["check", str(path)]) == CONVERGED
    assert main(["solve", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == CONVERGED
    assert main(["new", str(mesh)]) == BAD_INPUT
    assert "is there already; accepted: another name" in capsys.readouterr().err
    assert path.read_text() == text


SIX = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n5,.5,0\n6,1,.5\n7,.5,1\n8,0,.5\n9,.5,.5\n"
SIX += "*ELEMENT, TYPE={}\n1,1,2,3,5,6,9\n2,1,3,4,9,7,8\n"
FOUR = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT, TYPE={}\n1,1,2,3,4\n"
BOTH = FOUR.format("CPS4") + "*NODE\n5,2,0.5\n*ELEMENT, TYPE=CAX3\n2,2,5,3\n"


@pytest.mark.parametrize(
    ("elements", "degree", "kinematics"),
    [
        (FOUR.format("CPE4R"), 1, "plane_strain"),
        (FOUR.format("CPS4"), 1, "plane_stress"),
        (FOUR.format("CAX4R"), 1, "axisymmetric"),
        (SIX.format("CAX6M"), 2, "axisymmetric"),
        (SIX.format("CPE6"), 2, "plane_strain"),
        (BOTH, 1, "plane_strain"),
    ],
)
def test_the_space_is_that_of_the_elements(
    elements: str, degree: int, kinematics: str, tmp_path: Path
) -> None:
    """Also of straight cells of second order, and of a converted mesh."""
    sets = "*NSET, NSET=axis\n1,4\n*NSET, NSET=high\n3,4\n*NSET, NSET=low\n1,2\n"
    (tmp_path / "plate.inp").write_text(elements + sets)
    assert main(["mesh", str(tmp_path / "plate.inp"), str(tmp_path / "other.xdmf")]) == CONVERGED
    for name in ("plate.inp", "other.xdmf"):
        assert main(["new", str(tmp_path / name)]) == CONVERGED
        case = load_case((tmp_path / name).with_suffix(".toml"))
        assert (case.space.degree, case.space.kinematics) == (degree, kinematics)
        assert (case.fixed[0].on, case.contact.on) == ("high", "low")
        assert main(["check", str((tmp_path / name).with_suffix(".toml"))]) == CONVERGED


@pytest.mark.core
def test_two_bodies(tmp_path: Path) -> None:
    """The case presses them onto each other; it passes check as it is, and solves."""
    mesh = tmp_path / "blocks.msh"
    write("two_blocks", mesh, lower_size=0.4, upper_size=0.3)
    assert main(["new", str(mesh)]) == CONVERGED
    path = mesh.with_suffix(".toml")
    case = load_case(path)
    assert [fixed.on for fixed in case.fixed] == ["upper_top", "lower_bottom"]
    (contact,) = case.contact
    assert {contact.on, contact.against} == {"upper_bottom", "lower_top"}
    assert main(["check", str(path)]) == CONVERGED
    assert main(["solve", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == CONVERGED
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["contact_nodes"] > 0


def test_several_bodies(tmp_path: Path) -> None:
    """A ball between plates: both contacts."""
    mesh = tmp_path / "ball.msh"
    write("ball_between_plates", mesh, size=0.4, contact_size=0.1)
    assert main(["new", str(mesh)]) == CONVERGED
    contacts = load_case(mesh.with_suffix(".toml")).contact
    sides = {frozenset((contact.on, contact.against)) for contact in contacts}
    expected = [("ball_bottom", "lower_top"), ("ball_top", "upper_bottom")]
    assert sides == {frozenset(pair) for pair in expected}
    assert main(["check", str(mesh.with_suffix(".toml"))]) == CONVERGED


def test_the_quality_of_cells() -> None:
    """1 for regular ones of any size; by hand for others, of a kite that of its worst corner."""
    triangle = 3.0 * np.array([[0, 0], [1, 0], [0.5, np.sqrt(0.75)]])
    tetrahedron = 0.2 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    right = np.array([[0, 0], [1, 0], [0, 1.0]])
    square, cube = (shape.nodes(1) for shape in (QUADRILATERAL, HEXAHEDRON))
    rhombus = square @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    kite = square.copy()
    kite[3] = 0.75, 0.75  # its edges are 0.75 and 0.25 there, at a blunt angle
    for shape, corners, ratio in (
        (TRIANGLE, triangle, 1.0),
        (TETRAHEDRON, tetrahedron, 1.0),
        (TRIANGLE, right, np.sqrt(3) / 2),
        (TRIANGLE, right[[0, 2, 1]], np.sqrt(3) / 2),
        (QUADRILATERAL, 3 * square, 1.0),
        (HEXAHEDRON, 0.1 * cube, 1.0),
        (HEXAHEDRON, cube * [1, 1, 8], 3 * 8 ** (2 / 3) / 66),
        (QUADRILATERAL, rhombus, np.sqrt(0.75)),
        (QUADRILATERAL, kite, 2 * (0.75**2 - 0.25**2) / (2 * (0.75**2 + 0.25**2))),
    ):
        assert quality(shape, corners[None]) == pytest.approx([ratio], rel=1e-12)


def two_squares(path: Path, gap: float, *, skins: bool = False) -> Path:
    """Write two unit squares above each other: sides with names, or one name a square."""
    corners = [(x, y + k * (1 + gap)) for k in (0, 1) for y in (0, 1) for x in (0, 1)]
    lines = [f"{i},{x},{y}" for i, (x, y) in enumerate(corners, 1)]
    lines = ["*NODE", *lines, "*ELEMENT, TYPE=CPE4", "1,1,2,4,3", "2,5,6,8,7"]
    sets = {"base": "1,2", "roof": "3,4", "under": "5,6", "lid": "7,8"}
    for name, nodes in ({"a": "1,2,3,4", "b": "5,6,7,8"} if skins else sets).items():
        lines += [f"*NSET, NSET={name}", nodes]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("gap", [0.0, 0.05])
def test_the_displacement_closes_the_gap(gap: float, tmp_path: Path) -> None:
    mesh = two_squares(tmp_path / "apart.inp", gap)
    assert main(["new", str(mesh)]) == CONVERGED
    case, out = mesh.with_suffix(".toml"), tmp_path / "out"
    assert main(["solve", str(case), "--out", str(out), "--quiet"]) == CONVERGED
    assert json.loads((out / "summary.json").read_text())["contact_nodes"] > 0
    (_, down) = (component.value for component in load_case(case).fixed[0].displacement)
    assert -gap - 0.005 < down < -gap


def test_bodies_that_overlap_are_pressed_apart(tmp_path: Path) -> None:
    mesh = two_squares(tmp_path / "over.inp", -0.001)
    assert main(["new", str(mesh)]) == CONVERGED
    assert load_case(mesh.with_suffix(".toml")).contact[0].overlap == "press"
    assert main(["check", str(mesh.with_suffix(".toml"))]) == CONVERGED
