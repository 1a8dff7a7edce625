"""Cost of a material in the plastic range in 2-D: factorisations and steps, not seconds."""

from __future__ import annotations

import numpy as np
import pytest

from contact import nesting, solve
from contact.case.file import parse_case
from contact.errors import InputError
from scripts.cases import bar
from scripts.studies.cantilevers import UNIFORM, cantilever

CASE = -0.05, 1e5, "friction.mu=0.5"


def test_a_large_body_that_yields_is_factorised_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tangent is that of a coarser mesh's solution, without being asked for."""
    cold = solve(bar(32, *CASE))
    assert cold.start == "the zero initial guess"
    monkeypatch.setitem(nesting.MANY, "condensed", 8000)
    found = solve(bar(32, *CASE))
    assert found.start == "the solution on a coarser mesh"
    assert found.converged
    assert found.counters.factorizations == 1
    assert found.counters.linear_solves < cold.counters.linear_solves
    assert np.allclose(found.pressure, cold.pressure, rtol=0, atol=1e-6 * cold.pressure.max())


@pytest.mark.parametrize(
    "change", ["solver.nested=false", "material.law=linear", "mesh.parts.loaded.from=2.125"]
)
def test_else_it_starts_from_rest(monkeypatch: pytest.MonkeyPatch, change: str) -> None:
    """A linear body is factorised once in any case; a part may not end on the coarser grid."""
    monkeypatch.setitem(nesting.MANY, "condensed", 100)
    assert solve(bar(8, *CASE, change)).start == "the zero initial guess"


def test_a_slender_body_starts_from_a_coarser_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it a linear beam that lies down takes more than twice as many factorisations."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    beam = cantilever(UNIFORM, [640, 8], 2, 0.3, 0.5)
    found, cold = solve(parse_case(beam)), solve(parse_case({**beam, "solver": {"nested": False}}))
    assert (found.start, cold.start) == ("the solution on a coarser mesh", "the zero initial guess")
    assert found.converged and cold.converged
    assert 2 * found.counters.factorizations < cold.counters.factorizations
    assert np.allclose(found.state.x, cold.state.x, rtol=0, atol=1e-7)


def test_a_coarser_mesh_that_does_not_fit_the_case_is_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With an odd number of cells it has other nodes, at one of which this gap is negative."""
    monkeypatch.setitem(nesting.MANY, "whole", 1000)
    beam = cantilever(UNIFORM, [803, 9], 1, 0.0, 0.5)
    beam["mesh"]["size"] = [402.0, 1.0]
    beam["contact"]["gap"] = "0.05 * sqrt(abs(x - 200)) - 0.0005"
    found = solve(parse_case(beam))
    assert (found.start, found.converged) == ("the zero initial guess", True)
    with pytest.raises(InputError, match=r"gap: .* at a node"):
        solve(parse_case({**beam, "solver": {"nested": True}}))
