"""What is rigid moves alike on any number of ranks."""

import pytest

from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from tests.problems.everywhere import agree
from tests.problems.rigid import column, indented, plate, solved

pytestmark = pytest.mark.parallel(alone=False)


def alike(case, settings, tolerance):
    agree(lambda comm: solved(case, comm, settings)[1], flat, tolerance, 1e-11)


def flat(values):
    """Return all numbers below a table, by their paths."""
    if isinstance(values, dict):
        return {(key, *path): v for key, part in values.items() for path, v in flat(part).items()}
    if isinstance(values, list):
        return flat(dict(enumerate(values)))
    return {(): values}


@pytest.mark.core
@pytest.mark.parametrize(
    "settings",
    [
        NewtonOptions(tolerance=1e-11),
        NewtonOptions(tolerance=1e-11, condense=False),
        FixedPointOptions(tolerance=1e-11),
        PenaltyOptions(tolerance=1e-10),
    ],
)
def test_an_indenter_moves_alike(settings):
    case = indented(n=8, displacement=["free", "free"], force=[0.002, -0.01], rotation=-0.5)
    alike(case, settings, 1e-7)


@pytest.mark.core
@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("make", [plate, column])
def test_plates_and_electrodes_move_alike(make, condense):
    alike(make(), NewtonOptions(tolerance=1e-11, condense=condense), 1e-8)


@pytest.mark.core
@pytest.mark.parametrize(("degree", "condense"), [(1, False), (2, True), (2, False)])
def test_a_ball_in_space_moves_alike(degree, condense):
    case = indented(3, 3, degree, displacement=[0.0, 0.0, "free"], force=[0.0, 0.0, -0.02])
    alike(case, NewtonOptions(tolerance=1e-10, condense=condense), 1e-7)
