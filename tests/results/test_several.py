"""Where several solutions may exist it is said, also of nearly incompressible bodies."""

import pytest
from mpi4py import MPI

from contact import load_case, solve
from scripts.cases import CASES

FALLING = "friction.mu={law='slip', a=0.5, b=0.2, rho=1e4}"


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("bar", ["material.law='linear'", "material.poisson=0.499", FALLING, "mesh.cells=[32, 8]"]),
        ("piezo-8-1-conductive", ["electric.phi_f=1e6", "mesh.cells=[16, 8]"]),
    ],
)
def test_several_solutions_are_warned_of(name, changes):
    """Methods were 3 to 5 % apart, and 24 %, without a word."""
    solution = solve(load_case(CASES / f"{name}.toml", changes), comm=MPI.COMM_SELF)
    assert any("several solutions may exist" in text for text in solution.warnings)
