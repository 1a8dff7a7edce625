"""The other side of contacts between bodies: forces and pressures, tables and figures."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case, solve
from contact.body.description import Body
from contact.methods.options import NewtonOptions
from contact.model.body import Fixed, Load
from contact.model.contact import Contact
from contact.model.obstacle import GapFunction
from contact.plot.figures import figures_of
from contact.plot.run import read_grid, read_run
from contact.problem.problem import ContactProblem
from contact.results.contact_nodes import opposite_surface
from contact.results.quantities import AGAINST, OPPOSITE, quantities
from contact.solving import solve_problem
from contact.writing import write_outputs
from forms.hencky import Linear
from tests.io.test_reference import fits
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant
from tests.problems.pairs import case

COMM = MPI.COMM_WORLD


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_constant_pressure_is_constant_on_both_sides(dim: int, degree: int) -> None:
    domain = Blocks(dim, *((5, 8) if dim == 2 else (2, 3)), turn=30.0).domain(COMM)
    up, zero = Blocks(dim, turn=30.0).axes[:, -1], constant(0.0, dim)
    body = Body(
        Linear(1.0, 0.0),
        [Fixed("bottom", [zero] * dim)],
        [Load("top", pressure=constant(0.01, dim))],
    )
    gap = GapFunction(lambda points: np.zeros(len(points)))
    problem = ContactProblem(domain, body, Contact("under", gap, against="over"), degree=degree)
    # The upper block can move as a rigid body, which `solve` would refuse.
    found = solve_problem(problem, NewtonOptions(tolerance=1e-13))
    surface = opposite_surface(found)
    assert surface is not None
    fields = surface.at_points
    np.testing.assert_allclose(fields["pressure"], 0.01, rtol=1e-11)
    np.testing.assert_allclose(
        fields["traction"], np.tile(-0.01 * up, (len(fields["weight"]), 1)), atol=1e-13
    )
    np.testing.assert_allclose(
        fields["normal"], np.tile(up, (len(fields["weight"]), 1)), atol=1e-12
    )
    assert COMM.allreduce(fields["weight"].sum()) == pytest.approx(1.0)


def test_files_and_figures_of_both_sides(tmp_path: Path) -> None:
    """What one side exerts the other one takes; a run draws the same as its files."""
    solution = solve(parse_case(case(load=[{"on": "upper_top", "traction": [0.1, -1.0]}])))
    write_outputs(solution, tmp_path, figures=True)
    with (tmp_path / "contact-against.csv").open() as file:
        rows = list(csv.DictReader(file))
    named = [next(q.name for q in quantities(AGAINST) if fits(q, name)) for name in rows[0]]
    assert list(dict.fromkeys(named)) == [q.name for q in quantities(AGAINST)]
    assert {row["on"] for row in rows} == {"lower_top"}
    force = [sum(float(r["weight"]) * float(r[f"traction_{a}"]) for r in rows) for a in "xy"]
    np.testing.assert_allclose(force, solution.contact_force, rtol=1e-12)
    np.testing.assert_allclose(force, [0.2, -2.0], rtol=1e-7)
    fields = read_grid(tmp_path / "contact-against.vtu").point_data
    assert set(fields) == {q.name for q in quantities(OPPOSITE)}
    for figures in (solution.plot(), figures_of(read_run(tmp_path))):
        (legend,) = figures["contact"].legends
        assert "pressure on the other side" in [text.get_text() for text in legend.get_texts()]


def test_without_another_body_there_is_none(tmp_path: Path) -> None:
    foundation = {"shape": "plane", "point": [0.0, -1.0], "normal": [0.0, 1.0]}
    given = case(contact={"on": "lower_bottom", "foundation": foundation})
    given["fixed"] = [
        {"on": "lower_left", "displacement": [0.0, 0.0]},
        {"on": "upper_top", "displacement": [0.0, 0.0]},
    ]
    given["load"] = []
    solution = solve(parse_case(given))
    assert opposite_surface(solution) is None
    write_outputs(solution, tmp_path)
    assert not list(tmp_path.glob("contact-against.*"))
