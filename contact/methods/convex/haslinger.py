"""Coulomb friction as a fixed point over Tresca problems, each solved for sure.

With a friction bound s the problem is convex; its pressure and slip give the next bound,
mu(slip) R p. Haslinger's iteration repeats that, accelerated by Anderson's method on s.

References
----------
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. (1983); Walker and Ni, Anderson acceleration for fixed-point iterations,
SIAM J. Numer. Anal. 49 (2011).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contact.methods.convex.cones import Array
from contact.methods.convex.interior import Point
from contact.methods.convex.tresca import Result, TrescaSolver

#: Earlier Tresca problems that the next bound is made of.
DEPTH = 6

#: Growth of the change that is borne before going back to the best bound so far.
PATIENCE = 2.0

#: Shortest share of a plain step that is tried on the way back.
SHORTEST = 1 / 32


@dataclass(frozen=True)
class CoulombResult:
    """Outcome of the fixed point.

    Attributes
    ----------
    result
        The Tresca problem whose bound came closest to that of its own solution.
    bound
        Its s, shape (n,) (stress).
    converged
        Whether s agrees with the bound that its solution gives, and that one is certified.
    change
        |bound(p, slip) - s| / |bound(p, slip)|, lumped norms.
    problems, iterations
        Tresca problems and interior-point steps in all.
    message
        The outcome in words.
    """

    result: Result
    bound: Array
    converged: bool
    change: float
    problems: int
    iterations: int
    message: str


def coulomb(
    solver: TrescaSolver,
    load: Array,
    bound: Callable[[Array, Array], Array],
    *,
    tolerance: float = 1e-8,
    inner: float = 1e-10,
    limit: int = 60,
    start: Point | None = None,
) -> CoulombResult:
    """Look for a bound that its own Tresca problem gives, from zero on.

    Nothing guarantees that there is one within reach if mu is large, nor that it is the only
    one: which of several is found depends on the first bound.

    Parameters
    ----------
    solver
        The body and the foundation.
    load
        f, shape (n d,) (force).
    bound
        Maps pressures and lengths of slips, each of shape (n,), to friction bounds s >= 0.
    tolerance
        Relative change of the bound that ends the iteration.
    inner
        Tolerance of each Tresca problem.
    limit
        Most Tresca problems.
    start
        What the first one starts from.
    """
    root, body = np.sqrt(solver.weight), solver.body
    s: Array = np.zeros_like(root)
    history: deque[tuple[Array, Array]] = deque(maxlen=DEPTH)
    best: CoulombResult | None = None
    target, share, iterations = s, 1.0, 0
    for problems in range(1, limit + 1):
        result = solver.solve(load, s, tolerance=inner, start=start)
        iterations += result.iterations
        if result.status == "unbounded" and best is None and problems == 1:
            # What friction alone holds is first taken for stuck.
            s = np.full_like(s, 10 * np.abs(body.load(load.reshape(root.size, -1))).sum())
            s /= solver.weight
            continue
        change = np.inf
        if result.certified:
            slip = np.einsum("nij,nj->ni", solver.tangent, result.displacement)
            image = np.maximum(bound(result.pressure, np.linalg.norm(slip, axis=1)), 0.0)
            size = float(np.linalg.norm(root * image))
            defect = float(np.linalg.norm(root * (image - s)))
            change = defect / size if size > 0 else (np.inf if defect > 0 else 0.0)
        if best is None or change < best.change:
            best = CoulombResult(result, s, False, change, problems, iterations, "")
            start, target, share = result.point, image if result.certified else s, 1.0
        if change <= tolerance:
            message = f"the friction bound settled after {problems} Tresca problems"
            return _ended(best, True, problems, iterations, message)
        if best.change == np.inf and not result.certified:
            return _ended(
                best, False, problems, iterations, f"no bound to go on from: {result.message}"
            )
        if change > PATIENCE * best.change:
            # towards the bound that the best one gave, more carefully each time
            history.clear()
            if share < SHORTEST:
                break
            s = best.bound + share * (target - best.bound)
            share /= 2
            continue
        history.append((s, image - s))
        s = np.maximum(_accelerated(history, root), 0.0)
    assert best is not None
    message = (
        f"the friction bound does not settle: it still changes by {best.change:.1g} "
        f"after {problems} Tresca problems"
    )
    return _ended(best, False, problems, iterations, message)


def _ended(
    best: CoulombResult, converged: bool, problems: int, iterations: int, message: str
) -> CoulombResult:
    return CoulombResult(
        best.result, best.bound, converged, best.change, problems, iterations, message
    )


def _accelerated(history: deque[tuple[Array, Array]], root: Array) -> Array:
    """Return the next bound from bounds s and defects e: Anderson's, in the lumped norm."""
    s, e = history[-1]
    if len(history) == 1:
        return s + e
    bounds = np.diff([pair[0] for pair in history], axis=0).T
    defects = np.diff([pair[1] for pair in history], axis=0).T
    # combinations that the defects hardly tell apart are rounding
    weights = np.linalg.lstsq(root[:, None] * defects, root * e, rcond=1e-8)[0]
    return s + e - (bounds + defects) @ weights
