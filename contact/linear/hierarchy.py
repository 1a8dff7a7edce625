"""Multigrid for an operator that changes from solve to solve, renewed when iterations say so."""

from __future__ import annotations

from math import ceil, log10

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.linear.faults import petsc_options
from contact.linear.products import quick_products
from contact.linear.refinement import Components, refine
from contact.linear.stiff_nodes import StiffNodes
from contact.typing import Array

#: What it costs to renew the coarse levels, in iterations (seen in `scripts.benchmarks.phases`).
PRICE = 8


class Hierarchy:
    """The levels of GAMG, which follow an operator at little cost.

    To multiply out all coarse operators takes as long as `PRICE` iterations, and from one step of
    Newton's method to the next little changes. So the smoother of the finest level and the
    interpolation at the contact nodes follow the operator in each of them, the coarse levels only
    once the iterations that have been lost without them would have paid for that: the rule of
    those who do not know how often they will ski, and buy when they have paid as much for
    hiring. A solve that loses as many by itself goes on with new ones. No solve takes more
    iterations than `ksp_max_it` allows.

    Parameters
    ----------
    ksp
        A solver with GAMG, set up with the body's operator.
    nodes
        Owned nodes that may have contact blocks, local numbers, shape (n,).
    components
        As of `refine`.
    """

    def __init__(
        self, ksp: PETSc.KSP, nodes: NDArray[np.int32], components: Components | None = None
    ) -> None:
        self._ksp, self._components = ksp, components
        self._stiff = StiffNodes(ksp.getPC(), nodes)
        self._most = ksp.getTolerances()[3]
        self._lost = np.inf
        #: Iterations a digit with coarse levels of the operator itself, and whether they are that.
        self._rate, self._fresh = 0.0, False
        self._taken, self._renewed = 0, False

    def follow(self, own: Array, blocks: Array) -> bool:
        """Follow the operator, and tell whether its coarse levels are renewed. Collective.

        Parameters
        ----------
        own, blocks
            What the body and contact have at the nodes, zero where an unknown is fixed, shape
            (n, block size, block size).
        """
        self._stiff.follow(own, blocks)
        if self._lost >= PRICE:
            self._renew()
            return True
        self._fresh = False
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(True)
        self._set_up()
        pc.getMGSmoother(pc.getMGLevels() - 1).getPC().setUp()
        return False

    def _renew(self) -> None:
        self._ksp.getPC().setReusePreconditioner(False)
        self._set_up()
        self._lost, self._rate, self._fresh, self._renewed = 0.0, 0.0, True, True

    def _set_up(self) -> None:
        self._ksp.setOperators(*self._ksp.getOperators())
        matrix = self._ksp.getOperators()[1]
        with petsc_options(self._ksp.getOptionsPrefix()), quick_products(matrix):
            self._ksp.setUp()

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> tuple[int, bool]:
        """Solve. Collective.

        Returns
        -------
        The number of iterations, and whether the coarse levels have been renewed on the way.
        """
        self._taken, self._renewed = 0, False
        self._solve(rhs.copy(), solution)
        refine(self._ksp, rhs, solution, self._correct, self._components)
        return self._taken, self._renewed

    def _correct(self, rhs: PETSc.Vec, correction: PETSc.Vec) -> None:
        """Solve for what a solution has left, which old coarse levels may not see."""
        if self._taken >= self._most:
            return
        if not self._fresh:
            self._renew()
        self._solve(rhs, correction)

    def _solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        jump = self._stiff.jump(rhs)
        rhs.axpy(-1.0, self._ksp.getOperators()[0] * jump)
        solution.axpy(-1.0, jump)
        self._taken += self._iterate(rhs, solution, self._most - self._taken)
        solution.axpy(1.0, jump)

    def _iterate(self, rhs: PETSc.Vec, solution: PETSc.Vec, most: int) -> int:
        ksp, digits = self._ksp, -log10(self._ksp.getTolerances()[0])
        if self._fresh:
            ksp.setTolerances(max_it=most)
            ksp.setConvergenceHistory(length=most + 1, reset=True)
            ksp.solve(rhs, solution)
            taken, norms = ksp.getIterationNumber(), ksp.getConvergenceHistory()
            # What was asked for is not what was gained: of few digits, or from a start.
            if not self._rate and taken > 0 and norms.size > 0 and norms[-1] > 0:
                self._rate = taken / max(log10(norms[0] / norms[-1]), 1.0)
            return taken
        fresh = self._rate * digits
        ksp.setTolerances(max_it=min(ceil(fresh) + PRICE, most))
        ksp.solve(rhs, solution)
        taken = ksp.getIterationNumber()
        if ksp.getConvergedReason() > 0 or taken >= most:
            self._lost += max(taken - fresh, 0.0)
            return taken
        begun = ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
        self._renew()
        ksp.setInitialGuessNonzero(begun)
        return taken + self._iterate(rhs, solution, most - taken)
