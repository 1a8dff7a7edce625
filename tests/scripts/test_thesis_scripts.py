"""Scripts beside the thesis on coarse meshes: set-ups, stopping by (6.40), refinement, norms.

The scripts of Examples 8.1 and 8.2 on coarse meshes: tables, figures, Theorem 5.2, sensor.
The results pages and the runner of tables and figures.
Pages of the benchmarks, from the files of a run that has measured a part.
The tables of the gallery are those of the program, and its references are met.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import contact
from contact import build_problem, load_case, solve
from contact.model.friction import Friction
from scripts.benchmarks.pages import summary, write_memory
from scripts.benchmarks.phases import PHASES
from scripts.cases import CASES, bar
from scripts.examples import sensor
from scripts.gallery import EXAMPLES, FOLDER, on_meshes, row, solved
from scripts.reporting import Report, subplots
from scripts.studies import corner, lagged_current, refinement_8, sensitivity
from scripts.studies.error_norms import DualNorm
from scripts.studies.hertz_exact import Line, Point
from scripts.thesis import (
    chapters,
    figures_piezo,
    hertz,
    results_page,
    setups,
    stopping_8_3,
    tables_piezo,
)
from tests.docs.pages import ROOT
from tests.problems.written import rows_of


def test_constants_are_those_of_the_thesis(tmp_path):
    setups.constants(Report(tmp_path))
    for line in rows_of(tmp_path / "table-8-1.csv"):
        assert float(line["case file by the thesis"]) == pytest.approx(1.0, abs=1e-5)


def test_example_8_3_stops_after_two_iterations(tmp_path):
    stopping_8_3.main(["--coarse", "--out", str(tmp_path)])
    found = rows_of(tmp_path / "stopping-8-3.csv")
    (honest,) = [r for r in found if r["case"] == "as printed" and "solved" in r["inner loop"]]
    assert [int(honest[key]) for key in list(honest)[2:5]] == [2, 2, 2]
    (early,) = [r for r in found if r["case"] == "as printed" and "0.25 E" in r["inner loop"]]
    assert int(early["(6.40), phi scaled"]) > 2


def test_pressure_inside():
    """A pressure 1 + x over [0, 4] without half a unit at either end: 3 + 6."""
    x = np.array([0.0, 1.0, 2.5, 4.0])
    assert refinement_8.inside(x, 1 + x, 0.5) == pytest.approx(9.0)


def test_the_dual_norm_of_a_pressure_is_the_energy_that_it_makes():
    """Theorem 4.4 is an equality without friction for a linear body: u - u_eps is made by p."""
    case = bar(4, -0.005, 1e4, "material={law='linear', young=1.0, poisson=0.3}")
    case = case.model_copy(update={"friction": Friction()})
    problem = build_problem(case)
    exact = solve(problem, case.solver)
    dual_norm, distances = DualNorm(problem), []
    for eps in (1e-2, 1e-3):
        options = bar(4, -0.005, 1e4, "solver.method=penalty", f"solver.eps_contact={eps}").solver
        penalised = solve(problem, options)
        distances.append(dual_norm.pressure(exact.pressure - penalised.pressure))
        moved = dual_norm.displacement(exact.state.x, penalised.state.x)
        assert distances[-1] == pytest.approx(moved, rel=1e-6)
    assert distances[0] / distances[1] == pytest.approx(10, rel=0.1)


@pytest.mark.slow
def test_sensitivity(tmp_path):
    sensitivity.study(Report(tmp_path, coarse=True), "radius")
    found = rows_of(tmp_path / "sensitivity-radius-table.csv")
    assert {row["converged"] for row in found} == {"True"}


@pytest.mark.parametrize("exact", [Line(), Point()], ids=["line", "point"])
def test_hertz_inside_is_in_equilibrium(exact):
    """Displacements by formulas: divergence by differences, pressure and gap at the surface."""
    d = 2 if isinstance(exact, Line) else 3
    x = np.array([[0.31, 0.7], [0.4, 0.2], [0.9, 0.3]])[[0, 1, 2] if d == 3 else [0, 2]]
    step, law, axes = 1e-4, exact.law, np.eye(d)[:, :, None]

    def stress(x):
        pairs = ((exact.displacement(x + step * e), exact.displacement(x - step * e)) for e in axes)
        gradient = np.array([(up - down) / (2 * step) for up, down in pairs])
        strain = (gradient + gradient.swapaxes(0, 1)) / 2
        spread = np.einsum("iik->k", strain) * np.eye(d)[:, :, None]
        return 2 * law.shear * strain + (law.bulk - 2 * law.shear / 3) * spread

    pairs = [(stress(x + step * e)[j], stress(x - step * e)[j]) for j, e in enumerate(axes)]
    divergence = sum((up - down) / (2 * step) for up, down in pairs)
    assert np.abs(divergence).max() < 1e-6 * np.abs(stress(x)).max()
    if d == 2:
        near = np.array([[0.0, 0.2, 0.4, 0.8], [2e-4] * 4])
        assert stress(near)[1, 1] == pytest.approx(-exact.pressure(near.T), abs=1e-7)
        assert np.abs(stress(near)[0, 1]).max() < 1e-3 * exact.peak
        near[1] = 0.0
        assert exact.gap(near)[:3] == pytest.approx(-exact.displacement(near)[1, :3], abs=1e-15)
    else:  # far from the contact, the force that its pressure adds up to
        far = np.array([[0.0], [0.0], [200.0]])
        force = 2 / 3 * np.pi * exact.radius**2 * exact.peak
        assert stress(far)[2, 2] == pytest.approx(-3 * force / (2 * np.pi * 200.0**2), rel=1e-3)


def test_corner_exponents(tmp_path):
    """90 degrees: sin(pi lambda/2)^2 = 1 - lambda^2 for nu = 1/2, and 0.711 for nu = 0.3."""
    power = corner.exponent(0.5)
    assert np.sin(np.pi / 2 * power) ** 2 == pytest.approx(1 - power**2, abs=1e-12)
    assert power == pytest.approx(0.5946, abs=1e-4)
    assert corner.exponent(0.3) == pytest.approx(0.7112, abs=1e-4)
    fitted = corner.main(["--coarse", "--out", str(tmp_path)])
    assert fitted[-1] == pytest.approx(corner.exponent(0.3), abs=0.03)


@pytest.mark.slow
def test_theorem_5_2(tmp_path):
    """The rate of the lagged charge grows with k_e up to a limit, that of the implicit does not."""
    rates = lagged_current.theorem_5_2(Report(tmp_path, coarse=True))
    assert 1.1 < rates["threshold"] < 1.3
    assert rates["lagged, 2"] > 0.9
    assert rates["lagged, 0.5"] < 0.6
    assert rates["implicit, 2"] < 0.5
    assert (tmp_path / "theorem-5-2.png").is_file()


def test_tables(tmp_path):
    report = Report(tmp_path, coarse=True)
    tables_piezo.series(report, "8.3", (16, 8))
    for line in rows_of(tmp_path / "series-k-e-8-2.csv"):
        assert line["converged"] == "True" and float(line["charge imbalance"]) < 1e-8
    tables_piezo.iterative(report)
    assert len(rows_of(tmp_path / "piezo-linear-iterations.csv")) == 4


@pytest.mark.slow
def test_figures(tmp_path):
    report = Report(tmp_path)
    figures_piezo.figure_8_2a(report, (16, 8))
    figures_piezo.example(report, "8-5", "piezo-8-2", "Example 8.2", (16, 8))
    for name in ("figure-8-2a", "figure-8-5a", "figure-8-5b"):
        assert (tmp_path / f"{name}.png").is_file()
    assert "yielded: 0 % of the body" in (tmp_path / "figure-8-5a.md").read_text()


def test_sensor(tmp_path):
    sensor.main(["--coarse", "--out", str(tmp_path)])
    charge = [float(row["charge per load"]) for row in rows_of(tmp_path / "sensor-table.csv")]
    # In proportion at small loads, no longer at the largest.
    assert charge[1] == pytest.approx(charge[0], rel=1e-2)
    assert abs(charge[2]) > 1.2 * abs(charge[0])
    assert (tmp_path / "sensor.png").is_file()


def test_page(tmp_path):
    report = Report(tmp_path / "results" / "hertz")
    report.table("one", "A table", {"|a|": [1, 2.5, float("nan")], "b": ["x", True, None]}, "Why.")
    figure, axes = subplots()
    axes.plot([0, 1], [0, 1])
    link = "See [two](thesis-studies.md#two)."
    report.figure("two", "A figure", figure, {"x": [0, 1], "y": [0]}, link)
    page = tmp_path / "docs" / "page.md"
    results_page.main(["--out", str(tmp_path / "results"), "--page", str(page)])
    assert "hertz" in page.read_text()
    words = page.with_name("thesis-mechanics.md").read_text()
    assert "| \\|a\\| | b |" in words
    assert "| 2.5 | yes |" in words
    assert "| — | — |" in words
    assert "Why." in words
    assert words.index("A table") < words.index("A figure")
    assert "](page/hertz/two.png)" in words and link in words
    assert (tmp_path / "docs" / "page" / "hertz" / "two.png").is_file()
    assert (tmp_path / "docs" / "page" / "hertz" / "one.csv").read_text().startswith("|a|,b")
    assert "Not computed yet: `make table_7_2`" in words


def test_tables_and_figures_are_those_of_the_pages():
    text = (ROOT / "Makefile").read_text().replace("\\\n", "")
    made = [goal.split() for goal in re.findall(r"^(?:tables|figures): (.+)$", text, re.M)]
    assert {script for scripts in made for script in scripts} == {p.script for p in chapters.PARTS}


@pytest.mark.slow
def test_hertz(tmp_path):
    hertz.main(["--coarse", "--out", str(tmp_path)])
    for name in ("hertz-cylinder.csv", "hertz-sphere.md", "figure-7-2a.png", "figure-7-2b.png"):
        assert (tmp_path / name).is_file()


DOCS = Path(__file__).parents[2] / "docs"
SCALING, MEASURED = DOCS / "scaling.md", DOCS / "benchmarks"


def test_tables_of_pages_are_those_of_the_measured_files(tmp_path):
    assert (MEASURED / "summary.md").read_text() == summary(MEASURED)
    page = tmp_path / "scaling.md"
    page.write_text(SCALING.read_text())
    write_memory(MEASURED, page)
    assert page.read_text() == SCALING.read_text()


def test_what_a_phase_is_measured_by_is_there():
    """A function that has moved would be a phase of no seconds."""
    for place, name in PHASES.values():
        if place != "~":
            assert f"def {name}(" in (Path(contact.__file__).parent / place).read_text(), name


#: Examples that take less than half a second.
SHORT = ("hertz", "press-fit", "column", "layer")


def shown(name: str) -> list[tuple[str, str, str]]:
    """Return the rows of a table: quantity, computed, reference."""
    text = (FOLDER / f"{name}.md").read_text()
    return re.findall(r"^\| (.+) \| (\S+) \| (\S+) \| .+ \|$", text, re.M)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in SHORT else pytest.mark.slow)
        for name, one in EXAMPLES.items()
        if not one.meshes
    ],
)
def test_an_example_has_the_values_of_its_table(name: str, tmp_path: Path) -> None:
    pytest.importorskip("gmsh")
    example = EXAMPLES[name]
    found = list(example.compare(solved(example, tmp_path, figures=False)))
    rows = shown(name)
    assert [name for name, *_ in rows] == [quantity for quantity, _, _ in found]
    for (_, *texts), (_, computed, reference) in zip(rows, found, strict=True):
        assert float(texts[0]) == pytest.approx(computed, rel=1e-3)
        assert float(texts[1]) == pytest.approx(reference, rel=1e-3)
        assert computed == pytest.approx(reference, rel=example.within)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, one in EXAMPLES.items() if one.meshes])
def test_a_coarse_mesh_has_the_values_of_its_table(name: str, tmp_path: Path) -> None:
    """That of the example and the finest one take minutes: their rows are those of its page."""
    pytest.importorskip("gmsh")
    example, kept = EXAMPLES[name], on_meshes(name)
    run = solved(example, tmp_path, figures=False, changes=example.meshes[0][1])
    case = load_case(CASES / f"{example.case}.toml")
    assert case.title and max(run.summary["kkt"].values()) <= case.solver.tolerance
    for quantity, computed in row(run).items():
        assert float(kept[0][quantity]) == pytest.approx(computed, rel=1e-3)
    assert [words for words, _ in example.meshes] == [one["cells"] for one in kept]
    for quantity, computed, reference in shown(name):
        assert float(computed) == pytest.approx(float(kept[1][quantity]), rel=1e-3)
        assert float(reference) == pytest.approx(float(kept[-1][quantity]), rel=1e-3)
        assert float(computed) == pytest.approx(float(reference), rel=example.within)
    text = (FOLDER / f"{name}-meshes.md").read_text()
    for one in kept:
        error = f"{100 * float(one['estimated error']):.2g} %"
        assert f"| {one['cells']} | {one['unknowns']} | " in text and f"| {error} |" in text


def test_every_example_has_its_page() -> None:
    pages = {path.stem.removeprefix("example-") for path in (ROOT / "docs").glob("example-*.md")}
    assert pages == set(EXAMPLES)
    for name, example in EXAMPLES.items():
        text = (ROOT / "docs" / f"example-{name}.md").read_text()
        assert f"scripts/cases/{example.case}.toml" in text
        assert all(change in text for change in example.changes)
