"""The set-up is drawn by rank 0, also where other ranks have nothing of a part."""

import pytest
from mpi4py import MPI

from contact import build_problem, load_case
from contact.cli.setup import draw_setup
from scripts.cases import CASES


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("name", "cells"), [("bar", "[8, 2]"), ("piezo-column", "[1, 1, 2]"), ("piezo-8-2", "[8, 4]")]
)
def test_the_set_up_is_drawn_once(name, cells):
    case = load_case(CASES / f"{name}.toml", [f"mesh.cells={cells}"])
    figure = draw_setup(case, build_problem(case))
    assert (figure is not None) == (MPI.COMM_WORLD.rank == 0)
