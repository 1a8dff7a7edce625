"""Solutions of one problem: how they are found, how far they are apart, which are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact import Case, InputError, Solution
from contact.case.nesting import coarser_cases
from contact.methods.nested import prolong
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Outcome
from contact.nesting import coarse_solution
from contact.output.review import review
from contact.problem.kkt import KKT, evaluate
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers
from contact.solving import METHODS, Method
from contact.typing import Array
from scripts.reporting import iterate
from scripts.studies.limit_theorem import ProductNorm

#: Relative difference up to which two solutions are the same.
AGREE = 1e-7

#: Part of the unknowns and forces by which a disturbed start differs from a solution.
DISTURBANCE = 1e-4


#: Owned unknowns and contact forces from which a run may start.
Start = tuple[Array, Multipliers]


@dataclass(frozen=True)
class Found:
    """Where a run has ended.

    Attributes
    ----------
    x
        The owned unknowns.
    solution
        The solution; what it reads off the iterate is right only while that is `x`.
    pressure
        -sigma_nu at the contact nodes of this rank, layer and rigid part, shape (n,).
    status
        "open", "stick" or "slip", shape (n,).
    """

    x: Array
    solution: Solution
    pressure: Array
    status: Array

    @property
    def converged(self) -> bool:
        """Whether the run has converged."""
        return self.solution.converged

    @property
    def start(self) -> Start:
        """Where another run may start from."""
        return self.x, self.solution.forces


@dataclass(frozen=True)
class Difference:
    """Relative differences of two solutions.

    Attributes
    ----------
    u, phi
        Largest difference at a node over the largest value; phi is NaN without a potential.
    energy
        Of |eps(u)| and |grad(phi)| in L2(Omega), the larger one.
    pressure, friction
        Of -sigma_nu and -sigma_tau in L2(Gamma_3), both over |sigma_nu|.
    """

    u: float
    phi: float
    energy: float
    pressure: float
    friction: float

    @property
    def largest(self) -> float:
        """The largest of them."""
        return float(np.nanmax([self.u, self.phi, self.energy, self.pressure, self.friction]))


class Branches:
    """The solutions of one problem that have been found so far, called A, B, C, ...

    Parameters
    ----------
    problem
        The problem; its iterate is that of the last run.

    Attributes
    ----------
    solutions
        Letter -> the first run that has found the solution.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self.solutions: dict[str, Found] = {}
        self._norm = ProductNorm(problem)

    def run(self, settings: Options, start: Start | None = None) -> Found:
        """Solve from zero displacement, or from elsewhere. Collective."""
        method = METHODS[settings.method](self.problem, settings, None)
        if start is None:
            return self._ended(method, method.solve())
        self._put(start[0])
        return self._ended(method, method.solve_from(start[1]))

    def next_to(self, start: Start, tolerance: float) -> Found:
        """Solve by Newton's method with all of friction's derivative. Collective.

        From nearby it ends at solutions on the falling part of a friction law as well, which
        the methods themselves leave.
        """
        method = Newton(self.problem, NewtonOptions(tolerance=tolerance, softening=np.inf))
        self._put(start[0])
        return self._ended(method, method.solve_from(start[1]))

    def _ended(self, method: Method, outcome: Outcome) -> Found:
        history, counters = method.history, method.counters
        solution = Solution(self.problem, method.forces, outcome, history, counters, "", {})
        return Found(iterate(self.problem), solution, solution.pressure, solution.status)

    def residuals(self, found: Found) -> KKT:
        """Return the residuals of a solution, computed once more from scratch. Collective."""
        self._put(found.x)
        return evaluate(self.problem, found.solution.forces)

    def warned(self, found: Found) -> bool:
        """Tell whether the program warns that there may be several solutions. Collective."""
        self._put(found.x)
        review(found.solution)
        return any("several solutions" in warning for warning in found.solution.warnings)

    def letter(self, found: Found) -> str:
        """Return the name of a solution, a new one if need be; "—" if it is none. Collective."""
        if not found.converged:
            return "—"
        for letter, known in self.solutions.items():
            if self.difference(found, known).largest <= AGREE:
                return letter
        letter = chr(ord("A") + len(self.solutions))
        self.solutions[letter] = found
        return letter

    def nearest(self, found: Found) -> tuple[str, Difference]:
        """Return the solution that a run has ended closest to, and how close. Collective."""
        apart = {key: self.difference(found, known) for key, known in self.solutions.items()}
        return min(apart.items(), key=lambda item: item[1].largest)

    def difference(self, found: Found, other: Found) -> Difference:
        """Return how far a run has ended from another one, relative to that. Collective."""
        d, trace = self.problem.dim, self.problem.trace
        change, size = (self._nodal(x) for x in (found.x - other.x, other.x))
        norms = zip(self._norm(found.x - other.x), self._norm(other.x), strict=True)
        scale = trace.norm(other.pressure)
        friction = trace.norm(found.solution.friction - other.solution.friction)
        return Difference(
            self._largest(change[:, :d]) / self._largest(size[:, :d]),
            self._largest(change[:, d:]) / self._largest(size[:, d:])
            if self.problem.piezoelectric
            else np.nan,
            max(moved / whole for moved, whole in norms),
            trace.norm(found.pressure - other.pressure) / scale,
            friction / scale,
        )

    def counts(self, found: Found) -> tuple[int, int, int]:
        """Return how many contact nodes stick, slide and are open. Collective."""
        numbers = [np.sum(found.status == word) for word in ("stick", "slip", "open")]
        return tuple(int(n) for n in self.problem.comm.allreduce(np.array(numbers)))

    def size(self, found: Found) -> tuple[float, float]:
        """Return the largest displacement component and pressure. Collective."""
        u = self._nodal(found.x)[:, : self.problem.dim]
        return self._largest(u), self._largest(found.pressure)

    def nested_start(self, case: Case) -> Start | None:
        """Return what nested meshes start from; None where there are none. Collective."""
        try:
            coarser_cases(case)
        except InputError:
            return None
        forces = prolong(*coarse_solution(case, self.problem.comm), self.problem)
        return iterate(self.problem), forces

    def disturbed(self, found: Found) -> Start:
        """Return a start beside a solution, off by up to `DISTURBANCE` at each node."""
        problem = self.problem
        points = problem.space.tabulate_dof_coordinates() / problem.domain.size
        wave = 1 + DISTURBANCE * np.cos(points @ [70.0, 30.0, 50.0])
        owned = problem.owned // problem.block_size
        x = (self._nodal(found.x) * wave[:owned, None]).ravel()
        factor, forces = wave[problem.trace.nodes], found.solution.forces
        return x, Multipliers(forces.pressure * factor, forces.friction / factor[:, None])

    def _nodal(self, x: Array) -> Array:
        return x.reshape(-1, self.problem.block_size)

    def _put(self, x: Array) -> None:
        """Make given owned unknowns the iterate; prescribed values stay what they are."""
        problem = self.problem
        problem.x.x.array[: problem.owned] = x
        problem.apply_load(1.0)

    def _largest(self, values: Array) -> float:
        largest = float(np.abs(values).max(initial=0.0))
        return float(self.problem.comm.allreduce(largest, op=MPI.MAX))
