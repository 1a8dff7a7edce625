"""The semismooth Newton method with its fallbacks, on one problem.

1. Newton's steps on one problem, the whole or the condensed one (`solve_with_fallbacks`).
2. Fallbacks, where these end without convergence, in turn (`fall_back`):

   - all nodes open, by one linear solve from the best iterate, then a working set from there;
   - continuation in psi of the charge, of a condensed problem alone, from the initial guess
     `problem.start()`;
   - secants of a layer that saturates, from that guess;
   - a rigid motion that separates the bodies, of a condensed problem alone;
   - proximal points, from that guess;
   - the interior point from that guess, its first slacks from the gaps of the linear solve;
   - steps on the condensed body, of a whole problem that does not begin with them, from that guess.

3. The iterate of least residual.

The notes of the history name them. They are also tried where Newton's method has converged to a
solution at which a rigid-body mode has become unconstrained, although friction could constrain it.

References
----------
Allgower and Georg, Introduction to Numerical Continuation Methods, SIAM (2003).
Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic
programs, Math. Program. 27 (1983).
Nocedal and Wright, Numerical Optimization, Springer (2006), chapter 16: working sets.
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. 5 (1983).
Rockafellar, Monotone operators and the proximal point algorithm, SIAM J. Control Optim. 14 (1976).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from contact.errors import SingularError
from contact.interface.interface import Interface, Proximal
from contact.methods.interior_point import interior_point
from contact.methods.report import PROGRESS, Outcome
from contact.methods.semismooth import End, SemismoothNewton
from contact.methods.unconstrained_modes import RIGID_MOTION
from contact.problem.condensed import CondensedProblem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.state import State
from contact.ranks import summed

logger = logging.getLogger("contact.solver")

#: Notes of steps in the history.
WORKING_SET, CONTINUATION, PROXIMAL_POINT = "working set", "continuation", "proximal point"
SECANT = "secant of the layer"

#: Most secants of a layer, the least one over the largest, and the ratio of residuals from one
#: trial of Newton's last steps to the next.
SECANTS, SOFTEST, NEARER_BY = 50, 1e-6, 0.1

#: Factor by which k_e of the charge grows: the first, and the least one that is tried.
FACTOR, LEAST_FACTOR = 1e3, 1.2

#: First part of k_e.
FIRST_PART = FACTOR**-3

#: Stagnation limit in a continuation; Example 8.4 with ten times its k_e needs it.
CONTINUATION_LIMIT = 20

#: Proximal points: first stiffness of the bed over c, and its factors after success and failure.
PROXIMAL_STIFFNESS, SOFTER, STIFFER = 1e-2, 0.2, 4.0

#: Ratio of the residual without the bed to the least so far that counts as progress, and most
#: problems in succession without it: friction cannot hold the body then.
NEARER, STAGNANT_PROBLEMS = 0.9, 16

#: Residual without the bed below which Newton's last steps are tried.
NEARLY_BALANCED = 0.03


def solve_with_fallbacks(semismooth: SemismoothNewton, begin: State) -> End:
    """Solve one problem by Newton's steps, then by its fallbacks. Collective."""
    state, outcome = semismooth.iterate(begin, check_c=True)
    if outcome.converged and semismooth.modes.unconstrained_at(semismooth.problem, state):
        end = fall_back(semismooth, state, outcome)
        return end if end[1].converged else (state, outcome)
    return (state, outcome) if outcome.final else fall_back(semismooth, state, outcome)


def fall_back(semismooth: SemismoothNewton, state: State, outcome: Outcome) -> End:
    """Try the fallbacks in turn until one converges; else return the best iterate. Collective."""
    logger.info(
        "%s; going on with fallbacks", outcome.ended or "a rigid-body mode is unconstrained"
    )
    singular, problem = None, semismooth.problem
    without_contact = all_open(semismooth)
    fallbacks: tuple[Callable[[], End | None], ...]
    if isinstance(problem, CondensedProblem):
        fallbacks = (
            partial(working_set, semismooth, without_contact),
            partial(conductivity_continuation, semismooth),
            partial(layer_secants, semismooth),
            partial(rigid_motion, semismooth, problem, outcome),
            partial(proximal_points, semismooth),
            partial(interior_points, semismooth, without_contact),
        )
    else:
        fallbacks = (
            partial(working_set, semismooth, without_contact),
            partial(layer_secants, semismooth),
            partial(proximal_points, semismooth),
            partial(interior_points, semismooth, without_contact),
            partial(on_condensed_body, semismooth),
        )
    for fallback in fallbacks:
        try:
            end = fallback()
        except SingularError as error:
            singular = error
            continue
        if end is not None:
            state, outcome = end
            if outcome.final:
                return end
    # A nonlinear material may be singular at the strains of a step alone.
    if singular is not None and problem.body.linear and not outcome.converged:
        raise singular
    if outcome.converged or semismooth.best.iterate is None:
        return state, outcome
    best = semismooth.best.iterate
    return best, replace(outcome, residuals=evaluate(problem, best))


def all_open(semismooth: SemismoothNewton) -> State | None:
    """Return the state after one linear solve with all nodes open, from the best iterate.

    None where the supports do not constrain all rigid-body modes: friction may have another
    solution then. Collective.
    """
    if not semismooth.modes.constrained_by_supports:
        return None
    problem, best = semismooth.problem, semismooth.best.iterate
    try:
        return semismooth.step.without_contact(problem, problem.start() if best is None else best)
    except SingularError:  # the potential may be floating without contact
        return None


def working_set(semismooth: SemismoothNewton, without_contact: State | None) -> End | None:
    """Return the solution with all nodes open, or of `growing_working_set`, or None. Collective.

    Active sets may cycle on contact forces that are rounding.
    """
    if without_contact is None:
        return None
    problem, allowed = semismooth.problem, semismooth.options.allowed
    residuals = evaluate(problem, without_contact)
    if not residuals.unmet(allowed):
        return without_contact, Outcome(residuals, allowed)
    candidate = growing_working_set(semismooth, without_contact)
    if candidate is None:
        return None
    residuals = evaluate(problem, candidate)
    semismooth.see(candidate, residuals)
    return None if residuals.unmet(allowed) else (candidate, Outcome(residuals, allowed))


def interior_points(semismooth: SemismoothNewton, without_contact: State | None) -> End | None:
    """Return the end of the interior-point method (`interior_point`) and Newton's last steps."""
    steps = semismooth.steps_left
    if steps <= 0:
        return None
    if semismooth.condensed_steps is not None:
        steps //= 2  # the other half is for the condensed body
    return interior_point(semismooth, without_contact, steps)


def on_condensed_body(semismooth: SemismoothNewton) -> End | None:
    """Return the end of steps on the condensed body, where they do not pay as the first stage."""
    if semismooth.condensed_steps is None or semismooth.steps_left <= 0:
        return None
    end = semismooth.condensed_steps(semismooth, semismooth.problem.start())
    # The reason of the interior point says more, unless no steps are left.
    return end if end[1].converged or semismooth.steps_left <= 0 else None


def rigid_motion(
    semismooth: SemismoothNewton, problem: CondensedProblem, outcome: Outcome
) -> End | None:
    """Return a solution with all nodes open after a rigid motion, if any."""
    if outcome.converged or semismooth.modes.constrained_by_supports:
        return None
    state = semismooth.modes.separated(problem, semismooth.step)
    if state is None:
        return None
    # No force acts there: relative to the forces at zero displacement.
    body = problem.body
    unbalanced, first = (
        body.norm(body.unbalanced(residual_forces(problem, at))) for at in (state, problem.start())
    )
    equilibrium = unbalanced / first if first > 0 else 0.0
    residuals = replace(evaluate(problem, state), equilibrium=equilibrium)
    semismooth.recorder.record(residuals, RIGID_MOTION, inner=2)
    semismooth.see(state, residuals)
    outcome = Outcome(residuals, semismooth.options.allowed)
    return (state, outcome) if outcome.converged else None


def growing_working_set(semismooth: SemismoothNewton, state: State) -> State | None:
    """Return a solution by Newton's method on a growing set of contact nodes. Collective.

    For bodies that touch at one node or two: stops, tips, corners. Without contact most of their
    nodes penetrate, and active sets of all these cycle. The node of largest penetration enters the
    working set, then one more in turn, as in dual active set methods; none leaves it, but Newton's
    method may open it. None where a node more does not halve the number of those
    that penetrate: an interior point then takes fewer steps.
    """
    problem, interface = semismooth.problem, semismooth.problem.interface
    nodes = interface.nodes
    inside = np.zeros(nodes.weight.shape, dtype=bool)
    deepest, count = _penetrating(interface, state, inside)
    while count > 0:
        normal_gap = interface.normal_gap(nodes.jump(state.x))
        inside |= normal_gap <= -deepest
        gap = np.where(inside, interface.gap, np.inf)
        less = problem.with_interface(replace(interface, gap=gap))
        # At one stiff node of a soft body a forcing term leaves pressures of any sign.
        state, outcome = semismooth.with_problem(less).iterate(state, note=WORKING_SET, exact=True)
        before = count
        deepest, count = _penetrating(interface, state, inside)
        if not outcome.converged or count > PROGRESS * before:
            return None
    return state


def _penetrating(
    interface: Interface, state: State, inside: NDArray[np.bool_]
) -> tuple[float, int]:
    """Return the largest penetration of nodes outside a set, and their number. Collective."""
    jump = interface.nodes.jump(state.x)
    depth = np.where(inside, 0.0, -interface.normal_gap(jump))
    deepest = interface.nodes.maximum(depth)
    rounding_length = interface.rounding_stress(jump) / interface.c_b
    count = int(summed(interface.comm, np.count_nonzero(depth > rounding_length)))
    return deepest, count


def continuation(solve: Callable[[float, State], End], start: State) -> End | None:
    """Solve by continuation in a parameter from `FIRST_PART` to 1; None on failure. Collective.

    After a failure the square root of the factor is taken; after a failure of the first part none.
    `solve` takes a part of the parameter, and an initial guess.
    """
    state, reached, part, factor = start, 0.0, FIRST_PART, FACTOR
    while factor > LEAST_FACTOR:
        tried, outcome = solve(part, state)
        if outcome.converged and part == 1.0:
            return tried, outcome
        if outcome.converged:
            state, reached = tried, part
        elif reached == 0:
            break
        else:
            factor = factor**0.5
        part = reached * factor
        part = part if part * LEAST_FACTOR < 1 else 1.0
    return None


def conductivity_continuation(semismooth: SemismoothNewton) -> End | None:
    """Solve by continuation in k_e of a conductive foundation, if any.

    With a large k_e the foundation fixes the potential of a node that comes near, and releases it
    where the node leaves: the active set cycles. With a small one contact is nearly uncoupled.
    """
    problem, interface = semismooth.problem, semismooth.problem.interface
    if interface.foundation.conductor is None:
        return None

    def solve(part: float, state: State) -> End:
        less = replace(interface, foundation=interface.foundation.conducting(part))
        method = (
            semismooth if part == 1.0 else semismooth.with_problem(problem.with_interface(less))
        )
        return method.iterate(state, note=CONTINUATION, stagnation_limit=CONTINUATION_LIMIT)

    return continuation(solve, problem.start())


def layer_secants(semismooth: SemismoothNewton) -> End | None:
    """Solve by secants of a layer that saturates, if any.

    The tangent of the layer is zero where it is saturated, and before its first touch: Newton's
    matrix may be singular, or as weak as elastic supports. Kacanov's method takes the secant
    p_nu(s)/s of the last iterate (it is positive). Newton's method takes the last steps, where the
    forces nearly balance, and once where a secant leaves the regimes (open, below saturation,
    saturated) unchanged: supports that bear little bring the load to balance slowly. Proximal
    points solve the bed's problem where friction alone constrains a mode along it.
    """
    problem, interface = semismooth.problem, semismooth.problem.interface
    foundation, near = interface.foundation, NEARLY_BALANCED
    if interface.nodes.maximum(foundation.saturates(interface.size).astype(float)) == 0:
        return None
    state, largest = problem.start(), foundation.largest_secant(interface.size)
    secant, unchanged = largest, 0
    regimes: NDArray[np.int8] = np.full(largest.size, -1, dtype=np.int8)
    for _ in range(SECANTS):
        bed = foundation.elastic_bed(np.maximum(secant, SOFTEST * largest))
        method = semismooth.with_problem(problem.with_interface(replace(interface, foundation=bed)))
        state, outcome = method.iterate(state, note=SECANT)
        if not outcome.converged:
            end = proximal_points(method)
            if end is None:
                return None
            state = end[0]
        jump = interface.nodes.jump(state.x)
        before, regimes = regimes, foundation.regimes(jump)
        changed = float(summed(interface.comm, not np.array_equal(regimes, before))) > 0
        unchanged = 0 if changed else unchanged + 1
        balanced = evaluate(problem, state).significant <= near
        if balanced or unchanged == 1:
            end = semismooth.iterate(semismooth.started(state), note=SECANT)
            if end[1].converged:
                return end
        near = NEARER_BY * near if balanced else near
        secant = foundation.secant(jump)
    return None


def proximal_points(semismooth: SemismoothNewton) -> End | None:
    """Solve by a proximal-point method where friction has to constrain a rigid-body mode, if any.

    For belts, arched leaves, wedges: bodies with a mode that friction alone constrains. The
    friction of the pressures of an iterate may not balance the loads, and the body slides off. An
    elastic bed at the contact nodes, k (u_tau - u_tau of the last iterate), constrains the mode;
    k falls after each problem that is solved, and rises after one that is not. Where the bed
    bears little, Newton's method takes the last steps without it.
    """
    problem, interface = semismooth.problem, semismooth.problem.interface
    if not interface.friction.acts or semismooth.modes.constrained_by_supports:
        return None
    if semismooth.steps_left <= 0:
        return None
    nodes, state = interface.nodes, problem.start()
    stiffness = PROXIMAL_STIFFNESS * semismooth.step.parameters.c
    least, stagnant = np.inf, 0
    while stagnant < STAGNANT_PROBLEMS:
        stagnant += 1
        term = Proximal(stiffness, nodes.tangential_component(nodes.jump(state.x)))
        method = semismooth.with_problem(problem.with_interface(replace(interface, proximal=term)))
        try:
            balanced, outcome = method.iterate(state, note=PROXIMAL_POINT)
        except SingularError:  # no contact: a normal motion is unconstrained
            return None
        if outcome.converged:
            state, stiffness = balanced, SOFTER * stiffness
            residual = evaluate(problem, state).significant
            if residual < NEARER * least:
                least, stagnant = residual, 0
            if residual <= NEARLY_BALANCED:
                end = semismooth.iterate(semismooth.started(state), note=PROXIMAL_POINT)
                if end[1].converged:
                    return end
        elif least == np.inf or semismooth.steps_left <= 0:
            return None
        else:
            stiffness = STIFFER * stiffness
    return None
