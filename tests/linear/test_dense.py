"""The dense operator: factors that are kept, and corrected where few blocks have changed."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from mpi4py import MPI

from contact.history import BodyState
from contact.linear.dense import DenseOperator, Factors
from contact.linear.operator import Counters

NODES, SIZE = 40, 2


@dataclass
class Bulk:
    """A positive definite matrix of 40 nodes, one of which is fixed."""

    comm = MPI.COMM_SELF
    own = slice(0, NODES * SIZE)
    factors: Factors = field(default_factory=Factors)

    def __post_init__(self):
        random = np.random.default_rng(3)
        half = random.standard_normal((NODES * SIZE, NODES * SIZE))
        self.stiffness = half @ half.T + np.eye(NODES * SIZE)
        self.free = np.ones((NODES, SIZE), dtype=bool)
        self.free[7] = False
        self.stiffness[14:16] = self.stiffness[:, 14:16] = 0.0
        self.stiffness[14:16, 14:16] = np.eye(2)

    def total(self, blocks):
        total = self.stiffness.copy()
        for node, block in enumerate(blocks):
            if self.free[node].all():
                total[2 * node : 2 * node + 2, 2 * node : 2 * node + 2] += block
        return total


@pytest.mark.parametrize("changed", [[], [3], [3, 5, 7, 20], list(range(12)), list(range(30))])
def test_solves_are_those_of_the_whole_matrix_however_many_blocks_change(changed):
    random, bulk = np.random.default_rng(5), Bulk()
    operator = DenseOperator(bulk, Counters())
    # Stiff blocks, not symmetric ones, that come and go.
    blocks = 1e4 * random.standard_normal((NODES, SIZE, SIZE)) ** 2
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    kept = bulk.factors.lower_upper
    blocks[changed] = random.standard_normal((len(changed), SIZE, SIZE)) ** 2
    other = DenseOperator(bulk, Counters())
    other.update("secant", BodyState(np.zeros(0)), blocks)
    assert (bulk.factors.lower_upper is kept) == (len(changed) < 20)
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    expected = np.linalg.solve(bulk.total(blocks), rhs)
    assert np.allclose(other.solve(rhs), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_columns_of_the_inverse_are_asked_for_once():
    random, bulk = np.random.default_rng(8), Bulk()
    operator = DenseOperator(bulk, Counters())
    blocks = random.standard_normal((NODES, SIZE, SIZE)) ** 2
    asked = []
    for changed in ([], [1, 2, 3], [2, 3, 9], [1, 9], [], range(20, 30), range(30, 38)):
        blocks[changed] = random.standard_normal((len(changed), SIZE, SIZE)) ** 2
        operator.update("secant", BodyState(np.zeros(0)), blocks)
        asked.append(bulk.factors.known.size)
        rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
        expected = np.linalg.solve(bulk.total(blocks), rhs)
        assert np.allclose(operator.solve(rhs), expected, rtol=0, atol=1e-12)
    assert asked == [0, 6, 8, 8, 8, 28, 0]


def test_nodes_that_slip_along_an_axis_ask_for_the_columns_of_their_tangential_rows():
    random, bulk = np.random.default_rng(2), Bulk()
    operator = DenseOperator(bulk, Counters())
    blocks = random.standard_normal((NODES, SIZE, SIZE)) ** 2
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    kept = bulk.factors.lower_upper
    blocks[10:40, 0] = random.standard_normal((30, SIZE))
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    assert bulk.factors.lower_upper is kept
    assert np.array_equal(bulk.factors.known, range(20, 80, 2))
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    expected = np.linalg.solve(bulk.total(blocks), rhs)
    assert np.allclose(operator.solve(rhs), expected, rtol=0, atol=1e-12)


def test_blocks_that_alone_hold_a_node_are_taken_away():
    """The whole matrix is singular then: a solution without numbers, not an error."""
    bulk = Bulk()
    bulk.stiffness[20:22] = bulk.stiffness[:, 20:22] = 0.0
    blocks = np.zeros((NODES, SIZE, SIZE))
    blocks[10] = np.eye(SIZE)
    operator = DenseOperator(bulk, Counters())
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    operator.update("secant", BodyState(np.zeros(0)), np.zeros_like(blocks))
    assert not np.isfinite(operator.solve(np.ones(NODES * SIZE))).all()
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    assert np.allclose(operator.solve(np.ones(NODES * SIZE))[20:22], 1.0)
