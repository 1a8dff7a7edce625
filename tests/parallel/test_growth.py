"""Arrays and messages of a rank do not grow with the number of ranks, at fixed work each.

The matrix in terms of jumps takes no more memory on several ranks than itself.
The set-up is drawn by rank 0, also where other ranks have nothing of a part.
What is no longer in use on several ranks does not pile up.
"""

import ctypes
import resource
from typing import ClassVar

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact import build_problem, load_case, parse_case
from contact.history import BodyState
from contact.linear.layout import times
from contact.linear.transformation import TransformedBulk
from contact.plot.setup import draw_setup
from scripts.benchmarks.weak import costs, problem_of
from scripts.cases import CASES
from tests.problems.bar import changed

COMM = MPI.COMM_WORLD

#: A start from a coarser mesh, means beside a part.
STAGES = ("nested", "separated")


@pytest.mark.parallel(3, alone=False)  # which measures 1 and 2 as well
@pytest.mark.parametrize("bodies", [1, 2])
def test_no_rank_has_more_where_there_are_more(bodies: int) -> None:
    """Slices in a row, so that ranks exchange at the cuts: lists of all would be of each rank."""
    found = {}
    for size in range(1, COMM.size + 1):
        some = COMM.Split(0 if COMM.rank < size else MPI.UNDEFINED, COMM.rank)
        if some != MPI.COMM_NULL:
            found[size] = costs(some, 8, bodies)
        COMM.Barrier()
    found = COMM.bcast(found)  # the first rank is in all of them
    for size, counts in found.items():
        assert counts["coupling"] <= 1.1 * found[1]["coupling"], size
        # Slices are small: ghosts of a cut are up to .37 of one, and a rank has two cuts at most.
        most = 1 + 0.4 * min(size - 1, 2)
        assert counts["python"] <= most * found[1]["python"], size
        for stage in STAGES:
            assert counts[stage] <= 1.1 * found[1][stage], (stage, size)
        for stage in ("received", *(f"{stage}, received" for stage in STAGES)) if size > 1 else ():
            assert counts[stage] / (size - 1) <= 1.1 * found[2][stage], (stage, size)


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
    body, transformation = problem.body, problem.transformation
    rest = BodyState(body.zero_displacement())
    plain = body.create_matrix()
    body.assemble(plain, "secant", rest)
    bulk = TransformedBulk(body, transformation, rest)
    before = in_use()
    made = bulk.create_matrix()
    kept, own = in_use() - before, PETSc.Mat.InfoType.LOCAL
    entries = sum(matrix.getInfo(own)["nz_used"] for matrix in (plain, made))
    assert kept < 1.5 * 12 * entries
    made.zeroEntries()
    bulk.assemble(made, "secant", rest)
    values = np.random.default_rng(COMM.rank).standard_normal(transformation.owned)
    image = times(plain, times(transformation.matrix, values))
    expected = times(transformation.matrix, image, transposed=True)
    assert np.abs(times(made, values) - expected).max() < 1e-13 * np.abs(expected).max()


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("name", "cells"), [("bar", "[8, 2]"), ("piezo-column", "[1, 1, 2]"), ("piezo-8-2", "[8, 4]")]
)
def test_the_set_up_is_drawn_once(name, cells):
    case = load_case(CASES / f"{name}.toml", [f"mesh.cells={cells}"])
    figure = draw_setup(case, build_problem(case))
    assert (figure is not None) == (MPI.COMM_WORLD.rank == 0)


@pytest.mark.parallel
def test_vectors_are_destroyed_as_the_forces_are_asked_for():
    """Petsc4py keeps those of several ranks: 1.6 MB each time, 160 MB in all."""
    problem = build_problem(parse_case(changed()), MPI.COMM_WORLD)
    body, state = problem.body, problem.start()
    sizes = []
    for _ in range(100):
        for comm in (body.comm, problem.domain.mesh.comm):
            PETSc.Vec().createMPI((100_000, None), comm=comm).set(1.0)
        body.internal_forces(state)
        sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert sizes[-1] - sizes[0] < 40_000  # kB
