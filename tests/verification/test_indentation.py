"""Indentation beside closed forms: Hertz's ball, and piezoelectric half spaces of class 6mm."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gmsh")
from contact import load_case, parse_case, solve
from contact.case.build import build_problem
from contact.errors import InputError
from forms.elasticity import hexagonal
from scripts.cases import CASES
from scripts.reporting import Report
from scripts.studies import half_space
from scripts.studies.indentation import CURVATURE, Setting, extrapolated, units_and_poling
from scripts.studies.indentation_figures import BALL, TIME, charges
from tests.problems.written import rows_of

#: Material -> E* insulating and conducting (GPa), |Q/P| of a grounded indenter (pC/N): published
#: constants, computed independently of this code.
KNOWN = {
    "PZT-4": (114.321, 86.565, 253.3),
    "PZT-5A": (95.756, 73.125, 303.5),
    "thesis": (98.603, 76.412, 288.1),
}


@pytest.mark.core
@pytest.mark.parametrize("name", KNOWN)
def test_constants_of_the_half_space(name):
    body = Setting(name, "ball").body
    insulating, conducting, ratio = KNOWN[name]
    assert body.insulating == pytest.approx(insulating, abs=6e-4)
    assert body.conducting == pytest.approx(conducting, abs=6e-4)
    assert abs(body.charge_ratio) * 1e3 == pytest.approx(ratio, abs=0.06)
    n = body.inverse
    assert n[1, 0] == pytest.approx(-n[0, 1], rel=1e-10)


@pytest.mark.core
def test_the_ball_on_the_material_of_the_thesis():
    body = Setting("thesis", "ball").body
    assert half_space.ball(body, 1.0, 0.1, None).force == pytest.approx(0.131471, abs=1e-6)
    assert half_space.ball(body, 1.0, 0.1, 0.0).force == pytest.approx(0.101882, abs=1e-6)
    assert half_space.potential_beneath(body, 0.01) == pytest.approx(0.010080, abs=1e-6)


@pytest.mark.core
def test_without_coupling_it_is_transversely_isotropic():
    """The indentation modulus of Delafargue and Ulm, Int. J. Solids Struct. 41 (2004) 7351."""
    c11, c12, c13, c33, c44 = 139.0, 77.8, 74.3, 113.0, 25.6
    stiffness = hexagonal(c11, c12, c13, c33, c44)
    body = half_space.HalfSpace(stiffness, np.zeros((3, 6)), np.diag([6.0, 6.0, 5.5]))
    compliance = 1 / c44 + 2 / (np.sqrt(c11 * c33) + c13)
    known = 2 * np.sqrt((c11 * c33 - c13**2) / c11 / compliance)
    assert body.insulating == pytest.approx(known, rel=1e-10)
    assert body.conducting == pytest.approx(known, rel=1e-10)


@pytest.mark.core
@pytest.mark.parametrize("shape", ["punch", "cone", "ball"])
@pytest.mark.parametrize("potential", [None, 0.002])
def test_pzt4(shape, potential):
    found, boxes = extrapolated(Setting("PZT-4", shape, potential, 6.0))
    for name in ("force", "depth", "charge", "potential"):
        value = getattr(found, name)
        assert np.isnan(value) or value == pytest.approx(1, abs=5e-3), name
    assert found.unknowns < 20_000
    if shape == "punch":
        # A smaller box is stiffer.
        assert boxes[0].force > boxes[1].force > 1.005


def test_poling_reversed_and_si_units(tmp_path):
    """Pressure is the same, potential and charge turn with the poling."""
    units_and_poling(Report(tmp_path), 4.0)
    found = rows_of(tmp_path / "units-and-poling.csv")
    assert len(found) == 6
    for row in found:
        first = next(other for other in found if other["indenter"] == row["indenter"])
        for name in ("P", "Q or phi"):
            assert float(row[name]) == pytest.approx(float(first[name]), rel=1e-9)
            assert float(row[name]) > 0.01
        assert float(row["largest difference of p"]) < 1e-9
        assert float(row["of phi"]) < 1e-8


@pytest.mark.core
def test_hertz_ball_with_few_unknowns():
    """P, a, p_0 within 0.2 %, and delta once the box is extrapolated."""
    depths, boxes = [], (30.0, 60.0)
    for extent in boxes:
        changes = [f"mesh.extent={extent}", f"mesh.size={extent / 8}"]
        solution = solve(load_case(CASES / "indent-ball.toml", changes))
        problem, nodes, pressure = solution.problem, solution.problem.nodes, solution.pressure
        assert problem.body.layout.unknowns <= 20_000
        r = nodes.points[:, 0]
        a = np.sqrt(2.5 * nodes.sum(pressure * r**2) / nodes.sum(pressure))
        closed = np.max(r[solution.status != "open"])
        stiff = 1000.0 / (1 - 0.3**2)
        assert closed <= a * (1 + 1e-3) < closed + 0.01  # the spacing of the nodes
        assert solution.contact_force[1] == pytest.approx(4 / 3 * stiff * a**3 / 4, rel=2e-3)
        inner = r < a / 2
        centre = np.sqrt(np.polyfit(r[inner] ** 2, pressure[inner] ** 2, 1)[1])
        assert centre == pytest.approx(2 * stiff * a / (4 * np.pi), rel=2e-3)
        depths.append((a / extent, 0.25 / (a**2 / 4)))
    (x, first), (y, second) = depths
    assert second - (first - second) * y / (x - y) == pytest.approx(1, abs=2e-3)
    assert abs(second - 1) > 5e-3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ('contact.rigid.displacement=["free", -0.1]', r"\[rigid-part\]"),
        ("contact.rigid.displacement=[0.1, -0.1]", r"\[rigid-part\]"),
        (
            "contact.rigid={ displacement = [0, -1], rotation = 1.0, centre = [0, 0] }",
            r"\[rigid-part\]",
        ),
    ],
)
def test_an_indenter_moves_along_the_axis(change, words):
    with pytest.raises(InputError, match=words):
        build_problem(load_case(CASES / "indent-cone.toml", [change]))


@pytest.mark.core
def test_the_cone_of_sneddon():
    solution = solve(load_case(CASES / "indent-cone.toml"))
    nodes, pressure, r = solution.problem.nodes, solution.pressure, solution.problem.nodes.points
    a = np.sqrt(3 * nodes.sum(pressure * r[:, 0] ** 2) / nodes.sum(pressure))
    cot, stiff = 1 / np.tan(np.deg2rad(70.3)), 1000.0 / (1 - 0.3**2)
    assert solution.contact_force[1] == pytest.approx(np.pi / 2 * stiff * a**2 * cot, rel=1e-3)


def test_the_charge_of_a_ball_that_is_driven_at_constant_velocity():
    """Q = (8/3) |N_21| sqrt(R) (v t)^1.5: the exponents of the published experiment's current."""
    times = TIME * np.array([0.25, 0.5, 1.0])
    found = {}
    for velocity in (1e-6, 2e-6):
        small, large = (charges(velocity, times, 12.0, box) for box in (30.0, 60.0))
        found[velocity] = np.abs(2 * large - small)
        n21 = Setting("PZT-4", "ball").body.inverse[1, 0]
        theory = 8 / 3 * abs(n21) * np.sqrt(BALL) * (velocity * times) ** 1.5
        assert found[velocity] == pytest.approx(theory, rel=5e-3)
    assert found[2e-6] / found[1e-6] == pytest.approx(2**1.5, rel=5e-3)


def gap_beyond(share: float) -> tuple[float, bool]:
    """Return the least gap beyond a part that ends within the interval of radii, and if all press.

    Of a ball at 0.002 GV that conducts where it touches only.
    """
    setting = Setting("PZT-4", "ball", 0.002, 8.0)
    first, last = np.sqrt(CURVATURE * setting.depth), setting.radius
    # The box of 30 radii shifts the interval by 1.1 %.
    radius = 1.0107 * (first + share * (last - first))
    data = setting.case(30.0, f"mesh.radius={radius}").model_dump(exclude_unset=True)
    data["electric"] = {"law": "perfect", "k_e": 1e6, "phi_f": 0.002}
    solution = solve(parse_case(data))
    body = solution.problem.body
    points, u = body.layout.points, body.nodal(solution.state.x)[:, 1]
    beyond = (points[:, 1] > -1e-12) & (points[:, 0] > radius * (1 + 1e-9))
    gap = points[beyond, 0] ** 2 / (2 * CURVATURE) - setting.depth - u[beyond]
    return float(gap.min()), bool(solution.converged and np.all(solution.status != "open"))


def test_conduction_in_contact_alone_leaves_the_radius_open():
    """Each radius from sqrt(R delta) to the closed form's ends a contact: docs/indentation.md."""
    for share in (0.25, 0.75):
        gap, pressed = gap_beyond(share)
        assert pressed
        assert gap > 0
    gap, pressed = gap_beyond(-0.5)
    assert pressed
    assert gap < 0
    assert not gap_beyond(1.5)[1]
