"""The same ball as a body of revolution and as a quarter in space."""

import numpy as np
import pytest

pytest.importorskip("gmsh")
from contact import solve
from scripts.studies import indentation_in_space
from scripts.studies.indentation_in_space import ball, measured
from tests.problems.written import rows_of


def test_a_quarter_in_space_tends_to_the_body_of_revolution():
    exact = solve(ball(False, 32, 2)).contact_force[1]
    for space, sizes in ((False, (2, 4, 8)), (True, (2, 4, 6))):
        turn = 4 if space else 1
        forces = [turn * solve(ball(space, n)).contact_force[-1] for n in sizes]
        errors = np.array(forces) / exact - 1
        # Coarse bodies of straight facets are too stiff.
        assert np.all(errors > 0)
        assert errors[-1] < 0.02
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert order > (1.2 if space else 1.7), (space, errors)


@pytest.mark.slow
@pytest.mark.parametrize("conducting", [False, True])
def test_a_piezoelectric_quarter_in_space_tends_to_the_body_of_revolution(conducting):
    """Force, and the charge drawn or the potential at the tip, of the thesis's material."""
    exact = measured(False, 32, conducting, 2)
    for space, sizes in ((False, (2, 4, 8)), (True, (4, 6, 8))):
        errors = np.array([measured(space, n, conducting) for n in sizes]) / exact - 1
        assert np.all(errors[:-1] > 0)
        errors = np.abs(errors)
        assert np.all(errors[-1] < 0.02)
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert np.all(order > 1.6), (space, errors)


@pytest.mark.slow
def test_the_tables(tmp_path):
    indentation_in_space.main(["--coarse", "--out", str(tmp_path)])
    rows = rows_of(tmp_path / "in-space.csv")
    assert [row["mesh"] for row in rows] == 3 * ["half plane"] + 3 * ["space"]
    orders = [float(row[name]) for row in rows[2::3] for name in list(row)[2:]]
    assert min(orders) > 1.4
    rows = rows_of(tmp_path / "tilted-punch.csv")
    coarse, fine, far = (float(row["theta"]) for row in rows)
    assert coarse < fine < 1
    assert far == pytest.approx(fine, abs=0.005)
