"""Plates over a gap in 3-D: the interior point beside projected gradients, both by multigrid.

`python3 -m scripts.studies.projected_gradients [--out DIR] [--coarse] [--cells N]`, on one rank.
A plate clamped at one side is pressed onto a rigid plane, without friction: a quadratic programme
with the bounds u_n <= g. Modified proportioning with reduced gradient projections (Dostal) takes
conjugate gradients on the unknowns that are free, projects a step that meets a bound, and frees
nodes where these dominate the residual. The hierarchy of the body is kept: as it is, or with its
finest level adapted to the nodes that are held, as Newton's method has it.

References
----------
Dostal and Schoeberl, Minimizing quadratic functions subject to bound constraints with the rate of
convergence and finite termination, Comput. Optim. Appl. 30 (2005); Kruzik, Horak, Cermak, Pospisil
and Pecha, Active set expansion strategies in MPRGP algorithm, Adv. Eng. Softw. 149 (2020).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from contact import build_problem, solve
from contact.case.file import parse_case
from contact.history import BodyState
from contact.linear.operator import Counters, SparseOperator
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.typing import Array
from scripts.reporting import Report, parser

#: Cells along each side of the plate, and with --coarse.
SIZES, COARSE = (12, 20, 40, 100), (8,)

#: Residual over the load where projected gradients are done, and the V-cycles that they are given
#: for each one of the interior point.
TOLERANCE, MOST = 1e-8, 10

#: Nodes are freed where their reactions outweigh the residual elsewhere by this.
GAMMA = 1.0

#: Stiffness at held nodes, beside the body's, that the adapted hierarchy is told.
STIFF = 1e8


def plate(n: int) -> dict[str, Any]:
    """Return a plate 100 x 100 x 1 of n x n x 1 cells, half a thickness above a plane."""
    wide, gap = 100.0, 0.5
    # to 100 times the gap, where nothing were in the way
    load = 100 * 8 * gap / 12 / wide**4
    return {
        "mesh": {"generator": "box", "size": [wide, wide, 1.0], "cells": [n, n, 1]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, 0.0, -load]}],
        "contact": {"on": "bottom", "gap": gap},
    }


@dataclass
class Counted:
    """The costs of a solve.

    Attributes
    ----------
    products, cycles
        With the matrix, and of multigrid.
    conjugate, expansions, proportionings
        Steps of these kinds.
    left
        Residual: the projected gradient over the load, or that of the program.
    done
        Whether it converged.
    seconds
        Of the processor.
    """

    products: int
    cycles: int
    conjugate: int
    expansions: int
    proportionings: int
    left: float
    done: bool
    seconds: float


class ProjectedGradients:
    """min x'Kx/2 - b'x, x_i <= g_i for the normal unknowns of a plane's contact nodes.

    Parameters
    ----------
    problem
        With a plane whose normal is an axis: its nodes need no basis of their own.
    adapted
        Whether the hierarchy is told which nodes are held.
    """

    def __init__(self, problem: ContactProblem, adapted: bool) -> None:
        self._problem, self._adapted = problem, adapted
        interface, body, start = problem.interface, problem.equilibrium, problem.start()
        nodes = interface.nodes
        operator = body.operator(
            interface.coupled,
            problem.constraint,
            symmetric=True,
            counters=Counters(),
            kind="iterative",
        )
        assert isinstance(operator, SparseOperator)
        self._operator, self._x = operator, start.x
        self._blocks = np.zeros((nodes.nodes.size, nodes.block_size, nodes.block_size))
        operator.update("secant", start, self._blocks)
        self._matrix = operator.matrix.copy()
        self._load = body.layout.mask(-residual_forces(problem, start)[: body.owned])
        self._free = body.layout.free.ravel()
        axis = int(np.argmax(np.abs(nodes.normal[0])))
        self._axis, sign = axis, nodes.normal[:, axis]
        self._bounded = nodes.nodes * nodes.block_size + axis
        self._bound = np.full(self._load.size, np.inf)
        self._bound[self._bounded] = interface.gap
        self._sign = np.ones(self._load.size)
        self._sign[self._bounded] = sign
        self._own = float(np.median(np.abs(self._matrix.getDiagonal().array[self._bounded])))
        self._in, self._out = self._matrix.createVecs()
        self.products = self.cycles = 0
        self.conjugate = self.expansions = self.proportionings = 0
        self.left = np.inf

    def _times(self, x: Array) -> Array:
        """Return K x, in signs in which all normals point along their axes."""
        self.products += 1
        self._in.array[:] = self._sign * x
        self._matrix.mult(self._in, self._out)
        return self._sign * np.where(self._free, self._out.array, 0.0)

    def _precondition(self, gradient: Array, held: Array) -> Array:
        """Return a cycle's answer on free unknowns."""
        self.cycles += 1
        self._in.array[:] = self._sign * gradient
        self._operator.ksp.getPC().apply(self._in, self._out)
        return np.where(self._free & ~held, self._sign * self._out.array, 0.0)

    def _follow(self, held: Array) -> None:
        if self._adapted:
            blocks = self._blocks.copy()
            blocks[:, self._axis, self._axis] = STIFF * self._own * held[self._bounded]
            self._operator.update("secant", BodyState(self._x), blocks, constant=True)

    def _largest(self) -> float:
        """Return about the largest eigenvalue, by the power method."""
        x, value = np.random.default_rng(0).standard_normal(self._load.size), 1.0
        for _ in range(20):
            x = self._times(np.where(self._free, x, 0.0) / np.linalg.norm(x))
            value = float(np.linalg.norm(x))
        return 1.1 * value

    def solve(self, most: int) -> Array:
        """Minimise from zero by at most so many cycles; return the owned unknowns."""
        load, bound = self._sign * self._load, self._bound
        short, size = 1.9 / self._largest(), float(np.linalg.norm(load))
        x = np.zeros_like(load)
        gradient, held = self._times(x) - load, x >= bound
        known, direction, old = np.zeros_like(held), np.zeros_like(x), 0.0
        begins = True
        while self.cycles < most:
            free = np.where(held, 0.0, gradient)
            chopped = np.where(held, np.maximum(gradient, 0.0), 0.0)
            self.left = float(np.linalg.norm(free + chopped)) / size
            if self.left <= TOLERANCE:
                break
            reduced = np.maximum(free, (x - bound) / short)
            if float(chopped @ chopped) > GAMMA**2 * float(reduced @ free):
                self.proportionings += 1
                length = float(chopped @ gradient) / float(chopped @ self._times(chopped))
                x = np.minimum(x - length * chopped, bound)
            else:
                if begins:
                    if not np.array_equal(held, known):
                        self._follow(held)
                        known = held
                    direction = self._precondition(free, held)
                    old, begins = float(direction @ gradient), False
                image = self._times(direction)
                length = old / float(direction @ image)
                moved = x - length * direction
                if np.all(moved <= bound):
                    self.conjugate += 1
                    x, gradient = moved, gradient - length * image
                    seen = self._precondition(np.where(held, 0.0, gradient), held)
                    new = float(seen @ gradient)
                    direction, old = seen + new / old * direction, new
                    continue
                self.expansions += 1
                x = np.minimum(moved, bound)
            gradient, held, begins = self._times(x) - load, x >= bound, True
        return self._sign * x


def by_interior_point(problem: ContactProblem) -> tuple[Counted, Array]:
    """Solve as the program does; return its costs, and the owned unknowns."""
    begin = time.process_time()
    found = solve(problem, NewtonOptions(linear="iterative"))
    took, cycles = time.process_time() - begin, found.counters.linear_iterations
    x = problem.equilibrium.owned_part(found.state.x)
    # each iteration of conjugate gradients is a product and a cycle
    left = found.outcome.residuals.largest
    return Counted(cycles, cycles, cycles, 0, 0, left, found.converged, took), x


def by_projected_gradients(
    problem: ContactProblem, adapted: bool, most: int
) -> tuple[Counted, Array]:
    """Solve by projected gradients; return its costs, and the owned unknowns."""
    begin = time.process_time()
    method = ProjectedGradients(problem, adapted)
    x = method.solve(most)
    took = time.process_time() - begin
    steps = (method.conjugate, method.expansions, method.proportionings)
    done = method.left <= TOLERANCE
    return Counted(method.products, method.cycles, *steps, method.left, done, took), x


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve the plates by both and print the costs."""
    command = parser(__doc__, "projected_gradients")
    command.add_argument("--cells", type=int, nargs="+", help="along each side, in place of all")
    command.add_argument("--most", type=int, default=MOST, help="cycles for one of the other's")
    given = command.parse_args(arguments)
    rows: dict[str, list[Any]] = {}
    for n in given.cells or (COARSE if given.coarse else SIZES):
        problem = build_problem(parse_case(plate(n)))
        ours, reference = by_interior_point(problem)
        _add(rows, n, "interior point", ours, 0.0)
        for adapted in (True, False):
            found, x = by_projected_gradients(problem, adapted, given.most * ours.cycles)
            off = float(np.abs(x - reference).max() / np.abs(reference).max())
            name = "projected gradients" + adapted * ", adapted"
            _add(rows, n, name, found, off)
    caption = "Plates over a gap in 3-D, without friction, by multigrid"
    Report(given.out).table("projected-gradients", caption, rows)


def _add(rows: dict[str, list[Any]], n: int, method: str, took: Counted, off: float) -> None:
    """Enter the costs of a solve in a table, and print it."""
    row = {"cells": n, "method": method, **asdict(took), "difference": off}
    print(*row.values(), flush=True)
    for key, value in row.items():
        rows.setdefault(key, []).append(value)


if __name__ == "__main__":
    main()
