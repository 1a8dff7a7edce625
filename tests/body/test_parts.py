"""Forms of a large body are those of its parts."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem
from contact.body import materials
from contact.case.file import Case, parse_case
from contact.linear.layout import times
from contact.problem.residuals import evaluate

COMM = MPI.COMM_WORLD


def case(**material: object) -> Case:
    """Return a block on an elastic support, with some material."""
    return parse_case(
        {
            "title": "block",
            "mesh": {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 2, 2]},
            "material": {"young": 1.0, "poisson": 0.3, **material},
            "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
            "elastic": [{"on": "right", "normal": 0.1}],
            "load": [{"on": "top", "traction": [0.0, 0.005, -0.02]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 0.3},
        }
    )


@pytest.mark.parallel
@pytest.mark.parametrize(
    "material",
    [{"law": "log", "yield_strain": 0.02}, {"law": "j2", "yield_stress": 0.01, "hardening": 0.1}],
)
def test_parts_add_up_to_the_body(
    material: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Matrices and residuals are the same; ranks with few cells have as many parts, empty ones."""
    found = []
    for size in (materials.CHUNK, 5):
        monkeypatch.setattr(materials, "CHUNK", size)
        problem = build_problem(case(**material), COMM)
        body, state = problem.body, problem.start()
        x = np.sin(17.0 * body.layout.points).ravel() * 0.02
        state = type(state)(body.local(x), state.forces, state.time, state.history)
        matrix = body.create_matrix()
        products = []
        for kind in ("secant", "tangent", "secant"):
            body.assemble(matrix, kind, state)
            products.append(times(matrix, np.cos(np.arange(body.owned, dtype=float))))
        forces = body.internal_forces(state), body.internal_forces(state, body.local(x / 2))
        found.append((len(body.forms.secant), evaluate(problem, state), *products, *forces))
    (one, plain, *whole), (many, parted, *sums) = found
    assert many - one >= COMM.allreduce(body.cells[0].size, op=MPI.MAX) // 20 > 0
    assert plain.largest == pytest.approx(parted.largest, rel=1e-12)
    for values, other in zip(whole, sums, strict=True):
        np.testing.assert_allclose(values, other, rtol=0, atol=1e-13 * max(abs(values), default=1))
