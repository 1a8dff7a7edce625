"""Multigrid for bodies that touch each other: the interpolation is made for them apart."""

from __future__ import annotations

from typing import Protocol

from petsc4py import PETSc

from contact.linear.balance import balance
from contact.linear.layout import Layout
from contact.linear.stiff_nodes import TOUCH


class Coupled(Protocol):
    """A body, or several, whose matrices can be had without what couples them."""

    @property
    def layout(self) -> Layout:
        """The unknowns."""

    def take_apart(self, matrix: PETSc.Mat) -> PETSc.Mat | None:
        """Fill a matrix with bodies that do not touch; see `operator.Bulk`."""


class Solver(Protocol):
    """A linear system with its solver, which GAMG preconditions."""

    matrix: PETSc.Mat
    ksp: PETSc.KSP

    @property
    def bulk(self) -> Coupled:
        """What is solved for."""

    def set_up(self, symmetric: bool) -> None:
        """Set up the solver for the matrix as it is."""


def set_up_apart(solver: Solver) -> bool:
    """Set multigrid up for bodies that do not touch; False where none touch each other. Collective.

    Motions of each body are then what is interpolated, and the jumps follow from them. Made for
    jumps the interpolation would mix the sides of a pair, and it would take twice as many coarse
    functions to follow both.

    Parameters
    ----------
    solver
        Has the matrix of bodies that touch, and has it again afterwards.
    """
    matrix, layout = solver.matrix, solver.bulk.layout
    coupled = matrix.copy()
    jumps = solver.bulk.take_apart(matrix)
    if jumps is None:
        return False
    balance(matrix, layout)
    # Bodies that nothing but contact holds would give a singular coarse matrix.
    diagonal = matrix.getDiagonal()
    diagonal.scale(1 + TOUCH)
    matrix.setDiagonal(diagonal)
    solver.set_up(symmetric=True)
    pc = solver.ksp.getPC()
    if pc.getMGLevels() > 1:
        finest = pc.getMGLevels() - 1
        plain = pc.getMGInterpolation(finest).copy()
        made = jumps.matMult(plain)
        own = made.createVecLeft()
        own.array[:] = layout.free.ravel()
        made.diagonalScale(L=own)
        # Where an unknown is fixed all is as it was: coarse functions of these alone remain some.
        own.array[:] = ~layout.free.ravel()
        plain.diagonalScale(L=own)
        made.axpy(1.0, plain)
        pc.setMGInterpolation(finest, made)
        pc.setMGRestriction(finest, made)
    coupled.copy(matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return True
