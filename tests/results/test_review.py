"""What is said about a solution: assumptions, theorems with their constants, small strains.

Names of units label figures and stand in the summary; nothing is assumed without them.
"""

import json
from functools import cache

import numpy as np
import pytest

from contact import Solution, UserLaw, load_case, solve
from contact.case.file import parse_case
from contact.cli.main import main
from contact.plot.body import picture
from contact.plot.run import read_run
from contact.results.options import Units
from contact.writing import written
from forms.ops import exp
from scripts.cases import CASES
from tests.problems.clamped import clamped
from tests.problems.rigid import indented
from tests.problems.written import block


@cache
def reviewed(name: str, *overrides: str) -> Solution:
    """Return the solution of a case, which no test changes."""
    return solve(load_case(CASES / f"{name}.toml", ("solver.method=newton", *overrides)))


def held_around(way: float, depth: float) -> list[dict]:
    """Return smooth walls at both sides, of which the right one moves, and a lid that sinks."""
    return [
        {"on": "left", "displacement": [0.0, "free"]},
        {"on": "right", "displacement": [way, "free"]},
        {"on": "top", "displacement": ["free", -depth]},
    ]


def said(texts: list[str], words: str) -> str:
    (found,) = [text for text in texts if words in text]
    return found


def test_an_auxetic_material_is_not_strongly_monotone():
    """With nu = -0.5, mu_1 = 1 is above (d/2) k_0 = 1/6."""
    solution = reviewed("bar", "mesh.cells=[16, 4]", "material.poisson=-0.5")
    note = said(solution.notes, "strong monotonicity is not met")
    assert "g_0 = 1 <= g <= 1, (d/2) k_0 = 0.1667" in note
    good = reviewed("bar", "mesh.cells=[16, 4]")
    assert "g_0 = 0.3846" in said(good.notes, "strong monotonicity is met")


@pytest.mark.parametrize(("shear", "warns"), [(0.3846, False), (0.2, True)])
def test_a_material_of_ones_own_fits_its_constants(shear, warns):
    law = UserLaw(1.0, 0.3, modulus=lambda t: shear * exp(-t / 10))
    solution = solve(block(2), law=law)
    words = "the secant modulus is 0.2 without strain, and Young's modulus and Poisson's ratio say"
    assert any(words in warning for warning in solution.warnings) == warns


@pytest.mark.parametrize("kinematics", ["axisymmetric", "plane_strain"])
def test_contact_that_is_too_coarse_is_warned_of(kinematics):
    """A ball, or half a cylinder, that touches with a node or two; the named size is enough."""
    words, plate = "too coarse for the pressures", {"point": [0.0, 0.0], "normal": [0.0, 1.0]}
    mesh = {"generator": "quarter_disc", "radius": 10.0, "contact_width": 2.0, "size": 2.0}
    data = {
        "space": {"kinematics": kinematics},
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [
            {"on": "top", "displacement": ["free", -0.02]},
            {"on": "symmetry", "displacement": [0.0, "free"]},
        ],
        "contact": {"on": "contact", "foundation": {"shape": "plane", **plate}},
    }
    coarse = solve(parse_case({**data, "mesh": {**mesh, "contact_size": 0.4}}))
    size = float(said(coarse.warnings, words).rpartition("at most ")[2].split()[0])
    # What few nodes say of the width is only about right.
    fine = solve(parse_case({**data, "mesh": {**mesh, "contact_size": size / 2}}))
    assert not [text for text in fine.warnings if words in text]


@pytest.mark.parametrize(
    ("motion", "warned"), [([0.0, 0.01], True), ([0.0, "free"], True), ([0.0, -0.01], False)]
)
def test_a_foundation_that_nothing_touches_is_warned_of(motion, warned):
    """Also one without a force: it does not know where to be."""
    solution = solve(indented(n=4, displacement=motion))
    assert len([text for text in solution.warnings if "nothing touches" in text]) == warned


def test_large_strains_are_warned_of():
    """A body that is compressed by more than its height, uniformly: det(I + grad u) < 0."""
    small = reviewed("bar", "mesh.cells=[16, 4]")
    assert not [text for text in small.warnings if "strains" in text]
    assert 0 < small.deformation.largest_strain < 0.1
    large = solve(parse_case(clamped([1.0, 1.0], [4, 4], fixed=held_around(0.0, 1.5))))
    made = large.deformation
    assert made.largest_strain == pytest.approx(1.5, rel=1e-9)
    assert made.least_volume == pytest.approx(-0.5, rel=1e-9)
    assert "lies between -0.5 and" in said(large.warnings, "rotations are not small")


@pytest.mark.parametrize(("slope", "warned"), [(0.2, False), (0.5, True)])
def test_large_rotations_are_warned_of(slope: float, warned: bool) -> None:
    """A block that nothing else holds comes to lie on a slope, without strain."""
    case = block(
        2,
        fixed=[],
        load=[{"on": "top", "traction": [0.0, -1e-4]}],
        contact={"on": "bottom", "gap": f"{slope}*x"},
        solver={"method": "newton"},
    )
    solution = solve(case)
    assert solution.converged and solution.deformation.largest_strain < 0.01
    assert any("rotations are not small" in text for text in solution.warnings) == warned


@pytest.mark.parametrize(("depth", "warned"), [(1e-9, False), (1e-12, True)])
def test_pressures_that_are_lost_in_rounding_are_warned_of(depth: float, warned: bool) -> None:
    """A bar of twice its length is pressed uniformly, by next to nothing beside that."""
    case = block(
        2,
        material={"young": 10.0, "poisson": 0.0},
        fixed=held_around(2.0, depth),
        friction={"law": "none"},
    )
    solution = solve(case)
    off = np.abs(solution.pressure / (10.0 * depth) - 1.0).max()
    assert solution.converged and 0 < off < solution.outcome.residuals.pressure_rounding
    assert (off > 1e-4) == warned
    assert any("contact forces are known to" in text for text in solution.warnings) == warned


def test_pressures_that_the_tolerance_leaves_open_are_warned_of() -> None:
    """The same bar by multigrid: 1e-8 of its stresses is more than what presses it."""
    case = block(
        2,
        material={"young": 10.0, "poisson": 0.0},
        fixed=held_around(2.0, 1e-11),
        friction={"law": "none"},
        solver={"linear": "iterative"},
    )
    solution = solve(case)
    # In the norm in which residuals are told: single nodes are off by up to .005.
    weight = solution.problem.nodes.weight
    off = np.sqrt(weight @ (solution.pressure / 1e-10 - 1.0) ** 2 / weight.sum())
    assert solution.converged
    (said,) = [text for text in solution.warnings if "contact forces are known to" in text]
    # Far above the tolerance; how far is up to PETSc's multigrid: 1.6e-5 by that of 3.25.
    assert 1e-6 < off < float(said.split("known to ")[1].split()[0])


def test_forces_that_are_rounding_are_not_out_of_balance() -> None:
    """A free block is unloaded: what was left was said to be beside what supports bear: none."""
    top = {"on": "top", "traction": [0.0, -0.01], "amplitude": "pulse"}
    pulse = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}
    evolution = {"times": [0.0, 1.0, 2.0], "steps": [1, 1], "amplitudes": {"pulse": pulse}}
    solution = solve(
        block(2, fixed=[], load=[top], evolution=evolution, solver={"method": "uzawa"})
    )
    assert solution.converged
    assert not [text for text in solution.warnings if "out of balance" in text]


@pytest.mark.parallel
def test_a_gap_that_was_forgotten() -> None:
    """A curved part without a gap fits its foundation; a plane one lies on it."""
    disc = {
        "mesh": {"generator": "half_disc", "size": 2.0, "contact_size": 0.5},
        "fixed": [{"on": "top", "displacement": [0.0, -0.01]}],
        "friction": {},
    }
    (warning,) = (
        w for w in solve(block(2, contact={"on": "contact"}, **disc)).warnings if "curved" in w
    )
    assert warning.startswith("the part contact is not flat and its gap is 0 everywhere")
    plane = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    for other in (block(2), block(2, contact={"on": "contact", "foundation": plane}, **disc)):
        assert not any("curved and its gap" in text for text in solve(other).warnings)


PIECE = {"side": "bottom", "from": 1.5, "to": 2.5}


def on_a_disc(part: str, depth: float, moved: str, direction: str, steps: int) -> Solution:
    """Press a block and a disc of radius 5 on each other, either of which is moved."""
    up = depth if moved == "foundation" else 0.0
    contact = {
        "on": part,
        "foundation": {"shape": "sphere", "centre": [2.0, -5.0], "radius": 5.0},
        "direction": direction,
        "rigid": {"displacement": [0.0, up]},
    }
    fixed = [{"on": "top", "displacement": [0.0, up - depth]}]
    data = clamped([4.0, 1.0], [32, 8], fixed=fixed, contact=contact)
    data["mesh"]["parts"] = {"middle": PIECE}
    if direction == "axis":
        data["contact"]["axis"] = [0.0, -1.0]
    if steps:
        press = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}
        data["fixed"][0]["amplitude"] = data["contact"]["rigid"]["amplitude"] = "press"
        data["evolution"] = {
            "times": [0.0, 1.0, 2.0],
            "steps": [1, 1],
            "amplitudes": {"press": press},
        }
    return solve(parse_case(data))


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("moved", "direction", "steps"),
    [
        ("body", "foundation", 0),
        ("foundation", "foundation", 0),
        ("foundation", "axis", 0),
        ("body", "axis", 1),
    ],
)
def test_a_body_that_passes_beside_its_contact_part_is_warned_of(moved, direction, steps):
    """At x = 0.5 the disc is 0.025 lower. In steps it is so at the end of the first alone."""
    words, given = "beside the contact part 'middle' the body passes", (moved, direction, steps)
    deep = on_a_disc("middle", 0.1, *given)
    assert words in said(deep.warnings, "[part-end]")
    whole = on_a_disc("bottom", 0.1, *given)
    assert not any("[part-end]" in text for text in whole.warnings)
    if not steps:
        assert deep.contact.pressure.max() > 1.2 * whole.contact.pressure.max()
    shallow = on_a_disc("middle", 0.01, *given)
    assert not any("[part-end]" in text for text in shallow.warnings)


SMALL = ("mesh.cells=[8, 4]", "solver.method=newton")


def test_labels_name_units_where_they_are_given():
    units = Units(length="mm", stress="MPa")
    assert units.label("x", "length") == "x (mm)"
    assert units.label("p", "stress") == "p (MPa)"
    assert units.label("phi", "potential") == "phi"
    assert Units().label("x", "length") == "x"


def test_units_reach_figures_and_summary(tmp_path):
    """Also the figures that are drawn later, from the files."""
    sets = [word for setting in SMALL for word in ("--set", setting)]
    folder = tmp_path / "out"
    arguments = ["solve", str(CASES / "piezo-8-1.toml"), "--out", str(folder), "--quiet"]
    assert main([*arguments, *sets]) == 0
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["units"] == {"length": "m", "stress": "GPa", "potential": "GV", "charge": "C"}
    again = read_run(folder)
    assert picture(again, "potential").label == r"potential $\varphi$ (GV)"
    assert written(solve(load_case(CASES / "piezo-8-1.toml", SMALL))).units == again.units
