"""The script of Table 7.1 on a coarse mesh."""

import pytest

from scripts.thesis import table_7_1
from tests.problems.written import rows_of


@pytest.mark.slow
def test_the_table(tmp_path, capsys):
    found = table_7_1.main(["--cells", "4", "--out", str(tmp_path)])
    assert len(found) == len(table_7_1.rows()) == 8
    for runs in found:
        # The rules of the thesis leave residuals well above those of converged ones.
        assert runs["converged"].residual <= 1e-8
        assert runs["printed"].residual > 1e-7
        assert runs["thesis"].residual < 1e-4
        assert 3 <= runs["converged"].outer <= 20
        assert runs["converged"].square <= 9
        assert runs["single"].residual <= 1e-8
        assert runs["single"].solves < 0.5 * runs["converged"].solves
    rows = rows_of(tmp_path / "table-7-1.csv")
    assert [int(row["thesis"]) for row in rows] == [3, 3, 4, 6, 5, 5, 6, 8]
    assert [int(row["to 1e-8"]) for row in rows] == [runs["converged"].outer for runs in found]
    assert "| f2 | rho | thesis |" in (tmp_path / "table-7-1.md").read_text()
    assert "Table 7.1" in capsys.readouterr().out


def test_r_taken_at_its_word(tmp_path):
    """It stops far from the solution, or not at all."""
    runs = table_7_1.literal(table_7_1.Report(tmp_path), 8, 2000)
    assert all(run.residual > 1e-4 for run in runs)
