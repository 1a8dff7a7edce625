"""A contact problem with its body condensed onto the contact nodes.

Once the material is linearised, all that is left to be found is what happens at Gamma_3: the
Schur complement of the body takes the place of its operator, and every method that solves a
contact problem solves this one too, in small dense steps.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import fem
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from petsc4py import PETSc
from scipy.linalg.lapack import dgetrf, dgetrs

from contact.linear import multigrid as linear_amg
from contact.linear.operator import Counters, LinearOperator, check_overflow, petsc_options
from contact.linear.schur import SchurComplement
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Unknowns that are kept at most: the dense matrix then takes 130 MB.
LARGEST = 4200

PREFIX = "contact_"


class CondensedProblem(ContactProblem):
    """The contact nodes of a problem, with a linear body behind them.

    Parameters
    ----------
    full
        The problem whose laws, nodes and foundation these are.

    Attributes
    ----------
    stiffness
        The body's Schur complement, on all ranks.
    """

    def __init__(self, full: ContactProblem) -> None:
        # Everything about Gamma_3 is shared; nothing of the body is built again.
        self.__dict__.update(full.__dict__)
        held = full.held.nodes if full.held is not None else full.trace.nodes[:0]
        self.nodes = np.concatenate([full.trace.nodes, held])
        positions = np.arange(self.nodes.size, dtype=np.int32)
        own = full.trace.nodes.size
        self.trace = replace(full.trace, nodes=positions[:own])
        if full.held is not None:
            self.held = replace(full.held, nodes=positions[own:])
        self.free = full.free[self.nodes]
        self._unknowns = np.zeros(self.free.size)
        self.external = np.zeros(self.free.size)

    @property
    def unknowns(self) -> Array:
        """The iterate at the kept nodes."""
        return self._unknowns

    @property
    def linear_material(self) -> bool:
        """True: the material has been linearised."""
        return True

    @property
    def load_size(self) -> float:
        """Norm of the loads and reactions of the whole body."""
        return self._load_size

    def linearise(
        self, stiffness: Array, residual: Array, offset: int, full: ContactProblem, size: float
    ) -> None:
        """Take a new linear body.

        Parameters
        ----------
        stiffness, residual
            Its Schur complement, and the condensed internal forces minus loads, all ranks.
        offset
            Where the owned unknowns begin.
        full
            The problem that it was linearised at.
        size
            Norm of the loads and reactions of the whole body.
        """
        self.stiffness, self._residual, self._load_size = stiffness, residual, size
        self._at = full.unknowns.reshape(-1, full.block_size)[self.nodes].ravel()
        self.own = slice(offset, offset + self._at.size)
        self._unknowns = self._at.copy()

    def internal_forces(self) -> Array:
        """Return the owned forces of the linear body, loads taken off."""
        moved = self.trace.gather(self.moved)
        return self.stiffness[self.own] @ moved + self._residual[self.own]

    @property
    def moved(self) -> Array:
        """How far the owned unknowns have moved since the body was linearised."""
        return self._unknowns - self._at

    def freeze(self) -> None:
        """Do nothing: the body is linear."""

    def reset(self) -> None:
        """Set the free unknowns to zero."""
        self._unknowns[:] = np.where(self.free.ravel(), 0.0, self._at)

    def add(self, increment: Array) -> None:
        """Add an increment of the owned unknowns."""
        self._unknowns += increment


class Condensation:
    """The body of a problem, linearised and condensed onto the contact nodes.

    Parameters
    ----------
    full
        The whole problem.
    counters
        Where sparse factorisations and solves are counted.

    Attributes
    ----------
    problem
        What is left to be solved at the contact nodes.
    """

    def __init__(self, full: ContactProblem, counters: Counters) -> None:
        self.full, self.counters = full, counters
        self.problem = CondensedProblem(full)
        self._matrix = create_matrix(full.secant)
        self._form: fem.Form | None = None
        self._schur: SchurComplement | None = None

    def linearise(self, form: fem.Form) -> bool:
        """Condense the body at the full problem's iterate, after `freeze`. Collective.

        Parameters
        ----------
        form
            `problem.secant` or `problem.tangent`.

        Returns
        -------
        Whether it can be: few unknowns are kept, and these hold the others.

        Raises
        ------
        InputError
            If numbers overflow.
        """
        full, problem = self.full, self.problem
        if self._schur is None or form is not self._form or not full.linear_material:
            self._matrix.zeroEntries()
            assemble_matrix(self._matrix, form, bcs=full.bcs)
            self._matrix.assemble()
            if self._schur is None:
                columns = np.arange(full.block_size, dtype=np.int32)
                kept = (problem.nodes[:, None] * full.block_size + columns).ravel()
                self._schur = SchurComplement(self._matrix, kept, PREFIX)
            if self._schur.dense_size > LARGEST:
                return False
            with petsc_options(PREFIX):
                self._stiffness = self._schur.factorise(self._matrix)
            self._form = form
            self.counters.factorizations += 1
        residual, free = full.internal_forces() - full.external, full.free.ravel()
        check_overflow(full, self._matrix.norm(), full.norm(residual))
        reactions = full.norm(np.where(free, 0.0, residual))
        forces = -self._schur.condense(np.where(free, -residual, 0.0))
        problem.linearise(
            self._stiffness, forces, self._schur.offset, full, full.load_size + reactions
        )
        return bool(np.isfinite(self._stiffness).all() and np.isfinite(forces).all())

    def expand(self) -> Array:
        """Return the increment of the full problem's owned unknowns. Collective."""
        assert self._schur is not None
        self.counters.linear_solves += 1
        return self._schur.expand(self.problem.trace.gather(self.problem.moved))


def condensation(problem: ContactProblem, counters: Counters, kind: str) -> Condensation | None:
    """Return the problem condensed onto its contact nodes, where that pays. Collective.

    That is where a direct solver does, with the contact nodes few, unless options of PETSc ask
    for a solver of the user's.
    """
    options = PETSc.Options(PREFIX)
    names = ("ksp_type", "pc_type", "pc_factor_mat_solver_type")
    chosen = any(options.hasName(name) for name in names)
    iterative = kind == "iterative" or (kind == "auto" and linear_amg.is_large(problem))
    if chosen or iterative or problem.trace.size * problem.block_size > LARGEST:
        return None
    return Condensation(problem, counters)


class DenseOperator:
    """The linear body of a condensed problem plus nodal blocks; as `linear.LinearOperator`."""

    symmetric = False

    def __init__(self, problem: CondensedProblem, counters: Counters) -> None:
        self.problem, self.counters = problem, counters
        self._factors: tuple[Array, Array] | None = None

    def update(self, form: fem.Form, blocks: Array, *, constant: bool = False) -> None:
        """Add up and factorise. Collective; see `linear.LinearOperator.update`."""
        problem = self.problem
        if problem.held is not None:
            blocks = np.concatenate([blocks, problem.held.block(problem.unknowns)])
        free = problem.free.astype(float)
        masked = problem.trace.gather(blocks * free[:, :, None] * free[:, None, :])
        total = problem.stiffness.copy(order="F")
        n, size = masked.shape[:2]
        rows = np.arange(n * size).reshape(n, size)
        total[rows[:, :, None], rows[:, None, :]] += masked
        factors, pivots, _ = dgetrf(total, overwrite_a=True)
        self._factors = factors, pivots
        self.counters.factorizations += 1

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns. Collective; see `linear.LinearOperator.solve`."""
        assert self._factors is not None
        problem = self.problem
        total = problem.trace.gather(np.where(problem.free.ravel(), rhs, 0.0))
        self.counters.linear_solves += 1
        solution, _ = dgetrs(*self._factors, total, overwrite_b=True)
        return np.asarray(solution[problem.own])


def operator(
    problem: ContactProblem, *, symmetric: bool = True, counters: Counters, kind: str = "auto"
) -> LinearOperator | DenseOperator:
    """Return the operator of a problem: sparse, or dense where its body is condensed."""
    if isinstance(problem, CondensedProblem):
        return DenseOperator(problem, counters)
    return LinearOperator(problem, symmetric=symmetric, counters=counters, kind=kind)
