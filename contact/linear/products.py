"""How PETSc multiplies out P^T A P, of which multigrid makes its coarse levels."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from petsc4py import PETSc

#: The option that says how one rank does it; it has no prefix.
OPTION = "matptap_via"

#: Unknowns up to which it is done by way of A P, in two thirds of the time or less: that takes a
#: kilobyte an unknown.
MOST = 1_000_000


@contextmanager
def quick_products(matrix: PETSc.Mat) -> Iterator[None]:
    """Have products with a matrix, and with what it is coarsened to, made in the quick way.

    Of several ranks, or where the user says how, nothing changes.
    """
    options = PETSc.Options()
    quick = matrix.comm.size == 1 and matrix.getSize()[0] <= MOST and not options.hasName(OPTION)
    if quick:
        options[OPTION] = "rap"
    try:
        yield
    finally:
        if quick:
            options.delValue(OPTION)
