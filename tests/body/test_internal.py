"""Forces of a linear body that are asked for often: by its matrix, and the same ones."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem
from contact.body import weak_forms
from contact.history import BodyState
from forms.hencky import Linear
from tests.problems.mechanics import bar
from tests.problems.piezo import example, hencky
from tests.problems.rigid import indented, plate
from tests.problems.written import electric

SELF = MPI.COMM_SELF
PROBLEMS = {
    "plane P1": lambda: bar(SELF, 4, law=Linear(1.0, 0.3)),
    "plane P2": lambda: bar(SELF, 2, law=Linear(1.0, 0.3), degree=2),
    "space": lambda: build_problem(electric(3)),
    "piezoelectric": lambda: example(SELF, (8, 4)),
    "global unknowns": lambda: build_problem(indented(n=4)),
    "plate": lambda: build_problem(plate()),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_the_matrix_gives_the_forces_that_are_assembled(name, monkeypatch):
    body = PROBLEMS[name]().equilibrium
    assert body.linear
    random = np.random.default_rng(4)
    rows = [body.prescribe(random.standard_normal(body.rest().size)) for _ in range(5)]
    made = []
    create = weak_forms.create_matrix
    monkeypatch.setattr(weak_forms, "create_matrix", lambda form: made.append(1) or create(form))
    assembled = [body.internal_forces(BodyState(x)) for x in rows]
    assert not made
    for _ in range(2):
        body.expect_many()
    assert len(made) == 1
    for x, expected in zip(rows, assembled, strict=True):
        found = body.internal_forces(BodyState(x))
        assert not np.array_equal(found, expected)
        assert np.abs(found - expected).max() < 1e-13 * np.abs(expected).max()


def test_a_body_that_yields_has_no_matrix_of_its_own(monkeypatch):
    def refused(form):
        raise AssertionError

    monkeypatch.setattr(weak_forms, "create_matrix", refused)
    body = bar(SELF, 4, law=hencky()).equilibrium
    body.expect_many()
    body.internal_forces(BodyState(body.rest() + 1.0))
