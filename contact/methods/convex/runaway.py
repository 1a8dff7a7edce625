"""Loads that nothing holds: free motions that open all gaps and gain work without end."""

from __future__ import annotations

import numpy as np

from contact.methods.convex.cones import Array
from contact.methods.convex.interior import Program

#: Relative size of what counts as nothing.
NOTHING = 1e-9

#: Directions that stand for the disc of friction in space where a motion is looked for.
DIRECTIONS = 16


def runs_away(program: Program, way: Array) -> bool:
    """Return whether the free motion within a displacement proves that there is no minimum."""
    body = program.body
    if not body.motions.size:
        return False
    motion = body.motions @ (body.motions.T @ way) / np.diag(body.matrix)
    largest = float(np.abs(motion).max())
    if not (np.isfinite(largest) and largest > 0):
        return False
    motion = motion / largest
    closes = float(np.max(motion[body.normals], initial=0.0))
    rubs = float(program.bound @ np.linalg.norm(program.slip(motion), axis=1))
    work, most = program.load @ motion, np.abs(program.load) @ np.abs(motion)
    return bool(closes <= NOTHING and work - rubs > NOTHING * (most + rubs))


def runaway(program: Program) -> bool:
    """Look for such a motion: the one that gains most, by a linear program.

    The unknowns are the few amplitudes of free motions and a length of slip at each node with
    friction; in space a polygon stands for the disc, and `runs_away` has the last word.
    """
    body = program.body
    count, rubbing = body.motions.shape[1], np.flatnonzero(program.bound > 0)
    if not count:
        return False
    motions = body.motions / np.diag(body.matrix)[:, None]
    motions = motions / np.abs(motions).max(axis=0)
    slips = np.stack([program.slip(motion) for motion in motions.T], axis=2)[rubbing]
    bound = program.bound[rubbing]
    if slips.shape[1] == 1:
        sides = np.array([[1.0], [-1.0]])
    else:
        angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        sides = np.column_stack([np.cos(angles), np.sin(angles)])
    lengths = -np.eye(rubbing.size)
    rows = [np.hstack([motions[body.normals], np.zeros((body.normals.size, rubbing.size))])]
    rows += [np.hstack([np.einsum("i,kij->kj", side, slips), lengths]) for side in sides]
    table = np.vstack(rows)
    limits = [(-1.0, 1.0)] * count + [(0.0, None)] * rubbing.size
    gain = np.append(program.load @ motions, -bound)
    from scipy.optimize import linprog  # takes a while to load

    found = linprog(-gain, A_ub=table, b_ub=np.zeros(table.shape[0]), bounds=limits)
    if found.status != 0:
        return False
    return runs_away(program, motions @ found.x[:count])
