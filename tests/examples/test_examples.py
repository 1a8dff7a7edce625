"""The examples: every case file converges, and Example 7.2 has its reference values."""

import json
from pathlib import Path

import numpy as np
import pytest

from contact.case.file import load_case
from contact.cli.main import CONVERGED, main
from contact.solving import solve
from scripts.cases import CASES, bar

#: Cells along the length, load f2, rho -> largest pressure, largest displacement component:
#: an independent code's solutions of Example 7.2.
REFERENCE = [
    (64, -0.005, 1e5, 0.01367, 0.00499),
    (128, -0.005, 1e5, 0.01679, 0.00501),
    (128, -0.05, 1e5, 0.14840, 0.05022),
    (128, -0.05, 6e7, 0.14806, 0.05022),
]


#: Of meshes that have no number of cells.
COARSE = {
    "ball-in-steel": ["mesh.contact_size=0.012", "mesh.edge_size=0.012"],
    "indent-punch-tilted": ["mesh.contact_size=0.6", "mesh.edge_size=0.1"],
}


#: All case files but those whose coarse versions other tests solve, with the same assertions:
#: `test_thesis_scripts` (of the gallery) and `test_plastic_partners`.
PATHS = [p for p in sorted(CASES.glob("*.toml")) if p.stem not in ("bracket", "bimorph-stop")]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.stem)
def test_case_converges(path: Path) -> None:
    """A coarse version of each case file, in fewer steps, converges by the file's own method."""
    case, coarse = load_case(path), [*COARSE.get(path.stem, ())]
    assert case.title
    if case.mesh.cells is not None:
        coarse.append(f"mesh.cells={[max(n // 4, 2) for n in case.mesh.cells]}")
    if case.evolution is not None:
        coarse.append(f"evolution.steps={[max(n // 4, 1) for n in case.evolution.steps]}")
    case = load_case(path, coarse)
    solution = solve(case)
    assert solution.converged, solution.outcome.reason
    assert solution.outcome.residuals.largest <= case.solver.tolerance


@pytest.mark.parametrize(("cells", "load", "rho", "pressure", "largest"), REFERENCE)
def test_example_7_2(cells: int, load: float, rho: float, pressure: float, largest: float) -> None:
    """Pressure and displacement are those of the independent code; by uzawa: `test_uzawa`."""
    case = bar(cells // 4, load, rho, "solver.method=newton")
    solution = solve(case)
    assert solution.converged
    assert solution.outcome.residuals.largest <= 1e-8
    assert solution.pressure.max() == pytest.approx(pressure, abs=1.01e-5 / 2)
    assert np.abs(solution.displacement.x.array).max() == pytest.approx(largest, abs=1.01e-5 / 2)


def test_warning_and_review(tmp_path: Path) -> None:
    """The uniqueness estimate of the slip law and monotonicity are told, in the summary too."""
    path = str(CASES / "bar-large.toml")
    arguments = ["solve", path, "--out", str(tmp_path), "--quiet", "--set", "mesh.cells=[64, 16]"]
    assert main(arguments) == CONVERGED
    summary = json.loads((tmp_path / "summary.json").read_text())
    (warning,) = [text for text in summary["warnings"] if "friction falls" in text]
    assert "L_mu = 5000/length" in warning
    assert "several solutions may exist" in warning
    assert any("strong monotonicity is met" in note for note in summary["notes"])
    assert summary["max_dev_strain"] > 0.05


def test_gentle_slip_law_warns_of_nothing() -> None:
    """The sliding block has one solution."""
    assert solve(bar(4, -0.005, 100.0, "solver.method=uzawa")).warnings == []
