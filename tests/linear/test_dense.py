"""The dense operator: a matrix plus blocks at nodes, factorised by the first rank."""

import tracemalloc

import numpy as np
import pytest
from mpi4py import MPI

from contact.history import BodyState
from contact.linear.operator import Counters
from contact.linear.schur import DenseOperator, DenseStiffness

NODES, SIZE = 40, 2


class Bulk:
    """A positive definite matrix of 40 nodes, one of which is fixed."""

    def __init__(self):
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

    def operator(self):
        return DenseOperator(MPI.COMM_SELF, self.free, DenseStiffness(self.stiffness), Counters())


@pytest.mark.core
@pytest.mark.parametrize("kind", ["definite", "indefinite", "asymmetric"])
def test_solves_are_those_of_the_whole_matrix(kind):
    """By Cholesky or LU, with stiff blocks that come and go."""
    random, bulk = np.random.default_rng(5), Bulk()
    operator = bulk.operator()
    operator.update("secant", BodyState(np.zeros(0)), 1e4 * np.ones((NODES, SIZE, SIZE)))
    blocks = 1e4 * random.standard_normal((NODES, SIZE, SIZE)) ** 2
    if kind != "asymmetric":
        blocks = blocks @ blocks.transpose(0, 2, 1) * {"definite": 1e-4, "indefinite": -1e-4}[kind]
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    expected = np.linalg.solve(bulk.total(blocks), rhs)
    assert np.allclose(operator.solve(rhs), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


def test_one_copy_of_the_matrix_is_made_where_blocks_act_at_all_unknowns():
    """There were two: the matrix without what is eliminated was a copy too."""
    stiffness = DenseStiffness(np.eye(1000))
    blocks = np.tile(np.eye(2), (500, 1, 1))
    tracemalloc.start()
    try:
        stiffness.factorise(blocks)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 1.2 * stiffness.matrix.nbytes


def test_the_same_sum_is_factorised_once():
    """By all operators of one stiffness, each of which solves with its own blocks."""
    random, bulk = np.random.default_rng(6), Bulk()
    stiffness, state = DenseStiffness(bulk.stiffness), BodyState(np.zeros(0))
    given = [random.standard_normal((NODES, SIZE, SIZE)) ** 2 for _ in "ab"]
    first, second, again = (
        DenseOperator(MPI.COMM_SELF, bulk.free, stiffness, Counters()) for _ in "abc"
    )
    for operator, blocks in ((first, given[0]), (again, given[0].copy()), (second, given[1])):
        operator.update("secant", state, blocks)
    made = [operator.counters.factorizations for operator in (first, again, second)]
    assert made == [1, 0, 1]
    rhs = np.where(bulk.free.ravel(), random.standard_normal(NODES * SIZE), 0.0)
    for operator, blocks in ((again, given[0]), (second, given[1]), (first, given[0])):
        expected = np.linalg.solve(bulk.total(blocks), rhs)
        assert operator.solve(rhs) == pytest.approx(expected, abs=1e-10)


@pytest.mark.core
def test_blocks_that_alone_hold_a_node_are_taken_away():
    """The whole matrix is singular then: a solution without numbers, not an error."""
    bulk = Bulk()
    bulk.stiffness[20:22] = bulk.stiffness[:, 20:22] = 0.0
    blocks = np.zeros((NODES, SIZE, SIZE))
    blocks[10] = np.eye(SIZE)
    operator = bulk.operator()
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    operator.update("secant", BodyState(np.zeros(0)), np.zeros_like(blocks))
    assert not np.isfinite(operator.solve(np.ones(NODES * SIZE))).all()
    operator.update("secant", BodyState(np.zeros(0)), blocks)
    assert np.allclose(operator.solve(np.ones(NODES * SIZE))[20:22], 1.0)
