"""The matrix in terms of jumps takes no more memory on several ranks than itself."""

import ctypes
from typing import ClassVar

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.history import BodyState
from contact.linear.constraint import ConstrainedBulk
from contact.linear.layout import times
from scripts.benchmarks.weak import problem_of

COMM = MPI.COMM_WORLD


class Heap(ctypes.Structure):
    """Sizes that glibc's allocator tells (bytes)."""

    _names = "arena ordblks smblks hblks mapped usmblks fsmblks used fordblks keepcost"
    _fields_: ClassVar = [(name, ctypes.c_size_t) for name in _names.split()]


def in_use() -> int:
    """Return the memory that this rank has allocated and not freed."""
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = Heap
    heap = mallinfo()
    return int(heap.used + heap.mapped)


@pytest.mark.parallel
def test_the_matrix_of_jumps_is_kept_alone() -> None:
    """Beside K and Q^T K Q, 12 bytes an entry, PETSc's default keeps twice as much again."""
    problem = problem_of(COMM, 10, 2)
    body, constraint = problem.body, problem.constraint
    rest = BodyState(body.zero_displacement())
    plain = body.create_matrix()
    body.assemble(plain, "secant", rest)
    bulk = ConstrainedBulk(body, constraint, rest)
    before = in_use()
    made = bulk.create_matrix()
    kept, own = in_use() - before, PETSc.Mat.InfoType.LOCAL
    entries = sum(matrix.getInfo(own)["nz_used"] for matrix in (plain, made))
    assert kept < 1.5 * 12 * entries
    made.zeroEntries()
    bulk.assemble(made, "secant", rest)
    values = np.random.default_rng(COMM.rank).standard_normal(constraint.owned)
    image = times(plain, times(constraint.matrix, values))
    expected = times(constraint.matrix, image, transposed=True)
    assert np.abs(times(made, values) - expected).max() < 1e-13 * np.abs(expected).max()
