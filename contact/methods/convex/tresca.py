"""Frictionless contact and Tresca friction solved for sure: a primal-dual interior point.

For a body that is condensed onto its contact nodes, the displacements u minimise

    u'Su/2 - f'u + sum_i w_i s_i |T_i u_i|   subject to   nu_i . u_i <= g_i,

which is convex: Newton's method on the central path of its conditions finds the minimum whatever
the body, with a duality gap that says how far away it is at most. Mehrotra's predictor and
corrector share one Cholesky factorisation of S plus nodal blocks a step. The status of each node
at the end is then taken as given and solved for exactly.

References
----------
Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992);
Acary, Bremond and Huber, On solving contact problems with Coulomb friction, in Advanced Topics
in Nonsmooth Dynamics (2018).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.methods.convex.cones import Array, units
from contact.methods.convex.interior import Certificate, Interior, Point, Program
from contact.methods.convex.polish import polished
from contact.methods.convex.reduced import Mask, Reduced
from contact.methods.convex.runaway import runaway, runs_away

#: Steps that are taken at most; 8 to 25 are usual.
LIMIT = 100

#: Steps beyond the tolerance, where the status of the nodes cannot be told yet.
MORE = 3

#: Steps after which it is asked whether there is a solution at all.
DOUBT = 25


@dataclass(frozen=True)
class Result:
    """What was found, in the units of the problem.

    Attributes
    ----------
    displacement
        u, shape (n, d) (length).
    pressure
        p >= 0, shape (n,) (stress).
    friction
        lambda, shape (n, d), |lambda_i| <= s_i (stress): S u = f - w (p nu + lambda).
    status
        "solved"; "unbounded": nothing holds the body against its load; "infeasible": a gap is
        negative where the body is fixed; "unsolved".
    certificate
        Its residuals.
    iterations
        Steps of the interior-point method, one factorisation each.
    polished
        Whether the point solves the equations of its contact status, instead of being inside.
    message
        The outcome in words.
    point
        What a next problem can start from: displacements and forces of the restrained
        unknowns, and friction over its bound.
    """

    displacement: Array
    pressure: Array
    friction: Array
    status: str
    certificate: Certificate
    iterations: int
    polished: bool
    message: str
    point: Point | None = None

    @property
    def certified(self) -> bool:
        """Whether this is the solution, to the tolerance asked for."""
        return self.status == "solved"


class TrescaSolver:
    """The problems of one body with one foundation, for any loads and friction bounds.

    Parameters
    ----------
    stiffness
        Symmetric S (force/length), node-major, shape (n d, n d): positive definite, or
        semidefinite where contact alone holds the body. Not changed.
    normal
        nu, unit vectors, shape (n, d).
    tangent
        T, projectors onto the free tangential directions, shape (n, d, d).
    gap
        g, shape (n,) (length); infinite where nothing is in the way.
    weight
        w > 0, shape (n,): area or length of each node.
    free
        Unknowns that are not fixed, shape (n, d); the rows of the others are identity.
    rubbing
        Nodes whose friction bound may be positive, shape (n,); all by default. Without friction
        what slides freely is eliminated, which is faster.

    Raises
    ------
    NotConvexError
        If S has negative eigenvalues.
    ValueError
        If shapes do not fit or numbers are not finite.
    """

    def __init__(
        self,
        stiffness: Array,
        normal: Array,
        tangent: Array,
        gap: Array,
        weight: Array,
        free: Mask | None = None,
        rubbing: Mask | None = None,
    ) -> None:
        n, d = normal.shape
        free = np.ones((n, d), dtype=bool) if free is None else free
        rubbing = np.ones(n, dtype=bool) if rubbing is None else rubbing
        if stiffness.shape != (n * d, n * d) or tangent.shape != (n, d, d) or not free.any():
            raise ValueError("shapes do not fit each other, or nothing is free")
        if not (np.isfinite(stiffness).all() and np.all(weight > 0) and not np.isnan(gap).any()):
            raise ValueError("the stiffness is not finite, a weight not positive, or a gap none")
        fixed = np.linalg.norm(normal * free, axis=1) < 1e-6
        self._impossible = np.flatnonzero(fixed & (gap < 0))
        closing = np.isfinite(gap) & ~fixed
        self.body = Reduced(stiffness, normal, tangent, closing, rubbing, free)
        self.gap, self.weight, self.normal, self.tangent = gap, weight, normal, tangent

    def solve(
        self,
        load: Array,
        bound: Array,
        *,
        tolerance: float = 1e-10,
        start: Point | None = None,
        limit: int = LIMIT,
    ) -> Result:
        """Solve one problem.

        Parameters
        ----------
        load
            f, shape (n d,) (force).
        bound
            s >= 0, shape (n,) (stress).
        tolerance
            Largest entry of the certificate.
        start
            The point of a similar problem of the same solver: if the status of its nodes, or
            one close to it, is right, no step is needed.
        limit
            Most steps.
        """
        body, n = self.body, self.weight.size
        if not (np.isfinite(load).all() and np.isfinite(bound).all() and np.all(bound >= 0)):
            raise ValueError("a load is not finite, or a friction bound not finite or negative")
        b, gap = body.load(load.reshape(n, -1)), self.gap[body.touching]
        limits: Array = (self.weight * bound)[body.rubbing]
        deepest = float(np.max(-gap, initial=0.0))
        force = max(float(np.abs(b).max(initial=0.0)), body.unit * deepest)
        unit = force or 1.0
        program = Program(body, b * (1 / unit), gap * (body.unit / unit), limits * (1 / unit))
        zero = Point(0 * b, 0 * gap, np.zeros(body.tangents.shape))
        if self._impossible.size:
            message = f"node {self._impossible[0]} is fixed beyond its gap"
            return self._result(program, zero, unit, "infeasible", 0, False, message)
        if force == 0:
            return self._result(program, zero, unit, "solved", 0, True, "no load")

        if start is not None:
            near = start.scaled(body.unit / unit, 1 / unit)
            shares = start.friction * program.bound[:, None]
            found = polished(program, Point(near.x, near.force, shares))
            if found is not None and program.certify(found).largest <= tolerance:
                message = "solved with nearly the status of the start"
                return self._result(program, found, unit, "solved", 0, True, message)
        iteration, steps, status = Interior(program), 0, "unsolved"
        best, least, exact = zero, np.inf, None
        message = f"{limit} steps were not enough"
        last = limit
        while True:
            size = program.certify(iteration.point).largest
            if size < least:
                best, least = iteration.point, size
            if size <= tolerance:
                last = min(last, steps + MORE)
                status, message = "solved", f"duality gap closed after {steps} steps"
                exact = polished(program, best)
            if exact is not None or steps >= last:
                break
            if not iteration.step():
                message = message if last < limit else f"rounding ends it after {steps} steps"
                break
            steps += 1
            ways = (iteration.x, iteration.direction)
            lost = any(runs_away(program, way) for way in ways)
            if lost or (steps == DOUBT and runaway(program)):
                status, message = "unbounded", "nothing holds the body against its load"
                break
        if status == "unsolved":
            exact = polished(program, best)
            if exact is not None and program.certify(exact).largest <= tolerance:
                status, message = "solved", f"solved with the status found after {steps} steps"
            elif runaway(program):
                status, message = "unbounded", "nothing holds the body against its load"
        best = best if exact is None else exact
        return self._result(program, best, unit, status, steps, exact is not None, message)

    def _result(
        self,
        program: Program,
        point: Point,
        unit: float,
        status: str,
        steps: int,
        exact: bool,
        message: str,
    ) -> Result:
        body, (n, d) = self.body, self.normal.shape
        real = point.scaled(unit / body.unit, unit)
        pressure, friction = np.zeros(n), np.zeros((n, d))
        pressure[body.touching] = real.force / self.weight[body.touching]
        friction[body.rubbing] = body.tangential(real.friction)
        friction /= self.weight[:, None]
        displacement = body.expand(real.x)
        # what had no friction slips as it does
        some = program.bound > 0
        shares = point.friction / np.where(some, program.bound, 1.0)[:, None]
        shares = np.where(some[:, None], shares, units(program.slip(point.x)))
        return Result(
            displacement,
            pressure,
            friction,
            status,
            program.certify(point),
            steps,
            exact,
            message,
            Point(real.x, real.force, shares),
        )


def tresca(
    stiffness: Array,
    load: Array,
    normal: Array,
    tangent: Array,
    gap: Array,
    weight: Array,
    bound: Array,
    free: Mask | None = None,
    *,
    tolerance: float = 1e-10,
) -> Result:
    """Solve one problem of contact with given friction bounds; see `TrescaSolver`."""
    solver = TrescaSolver(stiffness, normal, tangent, gap, weight, free, bound > 0)
    return solver.solve(load, bound, tolerance=tolerance)
