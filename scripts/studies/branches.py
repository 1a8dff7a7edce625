"""Solutions of one problem: how they are found, how far they are apart, which are the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact import Case, Solution
from contact.interface.multipliers import Multipliers
from contact.methods.method import METHODS, Method
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Outcome, Record
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.refining import has_coarser, nested_start
from contact.results.remarks import review
from contact.typing import Array
from scripts.studies.error_norms import ProductNorm

#: Relative difference up to which two solutions are the same. Pressures beneath indenters, whose
#: elements differ by a factor of 4000, are known to 4e-7 at residuals of 1e-11; other solutions
#: are 1e-4 away or more.
AGREE = 1e-6

#: Part of the unknowns and forces by which a disturbed start differs from a solution.
DISTURBANCE = 1e-4

#: Linear solves after which Uzawa block relaxation is given up: the slowest example takes 950.
SOLVES = 3000


class TooManyError(Exception):
    """A Uzawa block relaxation has taken all of its solves."""


@dataclass
class Limit:
    """A monitor that ends Uzawa block relaxation after so many linear solves."""

    #: How many there still are.
    left: int

    def __call__(self, record: Record) -> None:
        """Take no note of outer iterations."""

    def poll(self) -> None:
        """Count an inner iteration, on all ranks."""
        if self.left == 0:
            raise TooManyError
        self.left -= 1


@dataclass(frozen=True)
class Difference:
    """Relative differences of two solutions."""

    #: Largest difference at a node over the largest value; phi is NaN without a potential.
    u: float
    phi: float
    #: Of |eps(u)| and |grad(phi)| in L2(Omega), the larger one.
    energy: float
    #: Of -sigma_nu and -sigma_tau in L2(Gamma_3), both over |sigma_nu|.
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
        The problem.

    Attributes
    ----------
    solutions
        Letter -> the first run that has found the solution.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        self.solutions: dict[str, Solution] = {}
        self._norm = ProductNorm(problem)

    def solve(self, settings: Options, start: State | None = None) -> Solution:
        """Solve from zero displacement, or from elsewhere, in up to `SOLVES`. Collective."""
        limit = Limit(SOLVES) if settings.method == "uzawa" else None
        return self._ended(METHODS[settings.method](self.problem, settings, limit), start)

    def next_to(self, start: State, tolerance: float) -> Solution:
        """Solve by Newton's method with all of friction's derivative. Collective.

        From nearby it ends at solutions on the falling part of a friction law as well, which
        the methods themselves leave.
        """
        options = NewtonOptions(tolerance=tolerance, softening=np.inf)
        return self._ended(Newton(self.problem, options), start)

    def _ended(self, method: Method, start: State | None) -> Solution:
        try:
            state, outcome = method.solve(start)
        except TooManyError:
            state, allowed = method.state, method.options.allowed
            outcome = Outcome(evaluate(self.problem, state), allowed, f"given up: {SOLVES} solves")
        return Solution(self.problem, state, outcome, method.history, method.counters, "", {})

    def warned(self, found: Solution) -> bool:
        """Tell whether the program warns that there may be several solutions. Collective."""
        review(found)
        return any("several solutions" in warning for warning in found.warnings)

    def letter(self, found: Solution) -> str:
        """Return the name of a solution, a new one if need be; "—" if it is none. Collective."""
        if not found.converged:
            return "—"
        for letter, known in self.solutions.items():
            if self.difference(found, known).largest <= AGREE:
                return letter
        letter = chr(ord("A") + len(self.solutions))
        self.solutions[letter] = found
        return letter

    def nearest(self, found: Solution) -> tuple[str, Difference]:
        """Return the solution that a run has ended closest to, and how close. Collective."""
        apart = {key: self.difference(found, known) for key, known in self.solutions.items()}
        return min(apart.items(), key=lambda item: item[1].largest)

    def difference(self, found: Solution, other: Solution) -> Difference:
        """Return how far a run has ended from another one, relative to that. Collective."""
        d, norm = self.problem.dim, self.problem.nodes.norm
        apart, x = found.state.x - other.state.x, other.state.x
        change, size = self._nodal(apart), self._nodal(x)
        norms = zip(self._norm(apart), self._norm(x), strict=True)
        scale = norm(other.pressure)
        return Difference(
            self._largest(change[:, :d]) / self._largest(size[:, :d]),
            self._largest(change[:, d:]) / self._largest(size[:, d:])
            if self.problem.piezoelectric
            else np.nan,
            max(moved / whole for moved, whole in norms),
            norm(found.pressure - other.pressure) / scale,
            norm(found.friction - other.friction) / scale,
        )

    def counts(self, found: Solution) -> tuple[int, int, int]:
        """Return how many contact nodes stick, slide and are open. Collective."""
        status = found.status
        numbers = [np.sum(status == word) for word in ("stick", "slip", "open")]
        return tuple(int(n) for n in self.problem.comm.allreduce(np.array(numbers)))

    def size(self, found: Solution) -> tuple[float, float]:
        """Return the largest displacement component and pressure. Collective."""
        u = self._nodal(found.state.x)[:, : self.problem.dim]
        return self._largest(u), self._largest(found.pressure)

    def nested_start(self, case: Case) -> State | None:
        """Return the initial guess of nested iteration; None where there is none. Collective."""
        return nested_start(case, self.problem) if has_coarser(case) else None

    def disturbed(self, found: Solution) -> State:
        """Return a start beside a solution, off by up to `DISTURBANCE` at each node."""
        problem, body = self.problem, self.problem.body
        points = body.space.tabulate_dof_coordinates() / problem.domain.size
        wave = 1 + DISTURBANCE * np.cos(points @ [70.0, 30.0, 50.0])
        x = found.state.x.copy()
        self._nodal(x)[:] *= wave[:, None]  # global unknowns, behind the nodes, stay
        factor, multipliers = wave[problem.nodes.nodes], found.multipliers
        disturbed = Multipliers(
            multipliers.contact * factor, multipliers.friction / factor[:, None]
        )
        return State(body.prescribe(x), disturbed)

    def _nodal(self, x: Array) -> Array:
        return self.problem.body.nodal(x)

    def _largest(self, values: Array) -> float:
        largest = float(np.abs(values).max(initial=0.0))
        return float(self.problem.comm.allreduce(largest, op=MPI.MAX))
