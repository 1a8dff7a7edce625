"""Expressions of a body's unknowns, compiled once and asked for at several of them."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.body import elements
from forms.hencky import Linear
from tests.problems import mechanics


@pytest.fixture
def body():
    return mechanics.bar(MPI.COMM_WORLD, 4, law=Linear(1.0, 0.3)).body


def stretched(body, by: float) -> np.ndarray:
    """Return the unknowns of u = by x e_x."""
    points = body.space.tabulate_dof_coordinates()
    values = np.zeros((len(points), 2))
    values[:, 0] = by * points[:, 0]
    return values.ravel()


@pytest.mark.parallel
def test_two_readers_of_one_body_do_not_disturb_each_other(monkeypatch, body):
    monkeypatch.setattr(elements, "CHUNK", 5)
    cells = np.arange(body.domain.mesh.topology.index_map(2).size_local, dtype=np.int32)
    middle = np.full((1, 2), 1 / 3)

    def slope(at: fem.Function):
        return ufl.as_vector([at.dx(0)[0]])

    readers = [
        body.pointwise.values("slope", slope, middle, stretched(body, by), cells)
        for by in (1.0, 3.0)
    ]
    found = [(*one, *other) for one, other in zip(*readers, strict=True)]
    assert len(found) == cells.size // 5 + 1
    for chosen, one, same, other in found:
        assert np.array_equal(chosen, same)
        assert np.allclose(one, 1.0) and np.allclose(other, 3.0)
    assert np.array_equal(np.concatenate([row[0] for row in found]), cells)
