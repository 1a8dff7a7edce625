"""From a point near the solution to the exact one: solve for the status of each node."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrs

from contact.methods.convex.cones import Array, dot
from contact.methods.convex.interior import DRIFT, Point, Program
from contact.methods.convex.reduced import Mask, cholesky

#: Statuses that are tried, each a correction of the one before.
ROUNDS = 4

#: Solutions with the factors of one status: they refine the linear system, and let the
#: directions of slip in space settle.
SWEEPS = 5


@dataclass(frozen=True)
class _Status:
    """Which nodes touch, which of those with friction stick, and where the others slip to."""

    closed: Mask
    stuck: Mask
    direction: Array


def polished(program: Program, point: Point) -> Point | None:
    """Return the exact solution for the status of a point, or for one close to it.

    Parameters
    ----------
    program
        The problem.
    point
        A point near the solution.

    Returns
    -------
    The best of the points found; None if there is none with smaller residuals.
    """
    best, least = None, program.certify(point).largest
    status = _status(program, point)
    for _ in range(ROUNDS):
        found = _solve(program, point, status)
        if found is None:
            break
        point, following, changed = found
        size = program.certify(point).largest
        if size < least:
            best, least = point, size
        if not changed:
            break
        status = following
    return best


def _status(program: Program, point: Point) -> _Status:
    """Read the status off: slacks and multipliers compared by the flexibility of each node."""
    body = program.body
    give = body.flexibility[body.normals]
    aside = np.append(body.flexibility, 0.0)[body.tangents].max(axis=1, initial=0.0)
    closed = program.gap - point.x[body.normals] < give * point.force
    bound, slip = program.bound, np.linalg.norm(program.slip(point.x), axis=1)
    size = np.linalg.norm(point.friction, axis=1)
    stuck = (bound > 0) & (slip < aside * (bound - size))
    direction = point.friction / np.where(size > 0, size, 1.0)[:, None]
    return _Status(closed, stuck, direction)


def _solve(program: Program, point: Point, status: _Status) -> tuple[Point, _Status, bool] | None:
    """Return the solution for a status, the status it has, and whether they differ."""
    body, gap, bound = program.body, program.gap, program.bound
    stuck = body.tangents[status.stuck]
    slipping = ~status.stuck & (bound > 0)
    x, held = point.x.copy(), np.zeros(point.x.size + 1, dtype=bool)
    x[body.normals[status.closed]] = gap[status.closed]
    held[body.normals[status.closed]] = True
    x[stuck[stuck >= 0]] = 0.0
    held[stuck] = True
    free = np.flatnonzero(~held[:-1])
    direction = np.where(slipping[:, None], status.direction, 0.0)
    if free.size:
        matrix = np.asfortranarray(body.matrix[np.ix_(free, free)])
        motions = body.motions[free]
        matrix += DRIFT * motions @ motions.T
        _add_turning(matrix, program, x, slipping, direction, free)
        factor = cholesky(matrix)
        if factor is None:
            return None
        for _ in range(SWEEPS):
            rest = program.residual(Point(x, 0.0 * gap, bound[:, None] * direction))
            x[free] += dpotrs(factor, rest[free], lower=1)[0]
            direction = _direction(program, x, slipping, direction)
    rest = program.residual(Point(x, 0.0 * gap, bound[:, None] * direction))
    reaction, pull = rest[body.normals], np.append(rest, 0.0)[body.tangents]
    force = np.where(status.closed, np.maximum(reaction, 0.0), 0.0)
    size = np.linalg.norm(pull, axis=1)
    towards = pull / np.where(size > 0, size, 1.0)[:, None]
    sticking = np.minimum(size, bound)[:, None] * towards
    friction = np.where(status.stuck[:, None], sticking, bound[:, None] * direction)

    closed = np.where(status.closed, reaction >= 0, x[body.normals] > gap)
    back = dot(program.slip(x), direction) < 0
    keeps = np.where(status.stuck, size <= bound, slipping & back)
    following = np.where(status.stuck[:, None], towards, direction)
    changed = bool(np.any(closed != status.closed) or np.any(keeps != status.stuck))
    return Point(x, force, friction), _Status(closed, keeps, following), changed


def _direction(program: Program, x: Array, slipping: Mask, direction: Array) -> Array:
    """Return where the nodes slip to. In the plane there are two sides, and one is taken."""
    if direction.shape[1] == 1:
        return direction
    slip = program.slip(x)
    size = np.linalg.norm(slip, axis=1)
    moves = slipping & (size > 0) & (dot(slip, direction) > 0)
    return np.where(moves[:, None], slip / np.where(moves, size, 1.0)[:, None], direction)


def _add_turning(
    matrix: Array, program: Program, x: Array, slipping: Mask, e: Array, free: NDArray[np.intp]
) -> None:
    """Add h/|a| (I - e e'), by which the friction of slipping nodes turns in space."""
    if e.shape[1] == 1:
        return
    size = np.linalg.norm(program.slip(x), axis=1)
    turning = slipping & (size > 0)
    place = np.full(x.size + 1, -1)
    place[free] = np.arange(free.size)
    rows = place[program.body.tangents[turning]]
    across = np.eye(e.shape[1]) - e[turning, :, None] * e[turning, None, :]
    blocks = (program.bound[turning] / size[turning])[:, None, None] * across
    lines, columns = np.broadcast_arrays(rows[:, :, None], rows[:, None, :])
    there = (lines >= 0) & (columns >= 0)
    matrix[lines[there], columns[there]] += blocks[there]
