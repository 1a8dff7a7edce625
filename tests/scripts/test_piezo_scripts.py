"""The scripts of Examples 8.1 and 8.2 on coarse meshes: tables, figures, Theorem 5.2, sensor."""

import pytest

from scripts.examples import sensor
from scripts.reporting import Report
from scripts.studies import lagged_current
from scripts.thesis import figures_piezo, tables_piezo
from tests.problems.written import rows_of


@pytest.mark.slow
def test_theorem_5_2(tmp_path):
    """The rate of the lagged charge grows with k_e up to a limit, that of the implicit does not."""
    rates = lagged_current.theorem_5_2(Report(tmp_path), coarse=True)
    assert 1.1 < rates["threshold"] < 1.3
    assert rates["lagged, 2"] > 0.9
    assert rates["lagged, 0.5"] < 0.6
    assert rates["implicit, 2"] < 0.5
    assert (tmp_path / "theorem-5-2.png").is_file()


def test_tables(tmp_path):
    report = Report(tmp_path)
    tables_piezo.series(report, "8.3", (16, 8))
    for row in rows_of(tmp_path / "series-k-e-8-2.csv"):
        assert row["converged"] == "True" and float(row["charge imbalance"]) < 1e-8
    tables_piezo.iterative(report, coarse=True)
    assert len(rows_of(tmp_path / "piezo-linear-iterations.csv")) == 4


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
