"""Checks that the body is held and that its potential is determined."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import linprog

from contact.errors import InputError
from contact.mesh.pieces import connected_pieces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Eigenvalues of the Gram matrices below are between 0 and about 1.
ROUNDING = 1e-9


def check_held(problem: ContactProblem) -> None:
    """Check that no rigid motion is free, before anything is factorised. Collective.

    Two things are asked for: supports and contact (in the tangential directions too if there
    is friction) leave no rigid motion at all, and the loads do not pull the body off the
    foundation where that alone holds it. Pieces that are not connected are checked one by one.

    Raises
    ------
    InputError
        If the body can move freely or is pulled off.
    """
    piece, count = connected_pieces(problem.equilibrium.space)
    for k in range(count):
        _check_piece(problem, piece == k, count)


def _check_piece(problem: ContactProblem, inside: NDArray[np.bool_], count: int) -> None:
    """Check one piece, of which there are `count`, given its owned nodes."""
    nodes, d = problem.nodes, problem.dim
    points = problem.equilibrium.layout.points
    touching_here = inside[nodes.nodes]
    centre, size = _centre(problem), problem.domain.size
    if count > 1:
        centre, size = _middle(problem, points[inside])
    fixed = ~problem.free[:, :d]
    held = np.flatnonzero(fixed.any(axis=1) & inside)
    revolved = problem.domain.revolved
    motions = rigid_motions((points[held] - centre) / size, revolved) * fixed[held][:, :, None]
    supports = _gram(problem, motions)
    free = _null_space(supports)
    if free.shape[1] == 0:
        return
    at_contact = rigid_motions((nodes.points - centre) / size, revolved)
    at_contact *= touching_here[:, None, None]
    normal = np.einsum("ni,nim->nm", nodes.normal, at_contact)
    touching = _gram(problem, normal[:, None, :])
    tangential = np.einsum("nij,njm->nim", nodes.tangent, at_contact)
    if problem.frictional:
        touching = touching + _gram(problem, tangential)
    loose = _null_space(supports + touching)
    if loose.shape[1] > 0:
        whole = "the body"
        if count > 1:
            where = ", ".join(f"{x:.4g}" for x in centre)
            whole = f"the mesh has {count} pieces that share no nodes, and the one about ({where})"
        raise InputError(
            f"{whole} is not held: it can move as a rigid body ({_describe(loose, d, revolved)}); "
            "accepted: displacement components fixed so that it cannot"
            + (", or regions that share the nodes between them" if count > 1 else "")
        )
    body = problem.equilibrium
    loads = body.external(problem.time).reshape(-1, body.block_size)[:, :d] * inside[:, None]
    _check_loads(problem, loads, free, normal, tangential, (points - centre) / size)


def check_potential(problem: ContactProblem, state: State) -> None:
    """Check that the potential of a solution is more than known but for a constant. Collective.

    It is where it is prescribed, and where current flows, also through nodes that cannot move.

    Raises
    ------
    InputError
        If no potential is prescribed and no current flows, as on a foundation that is conductive
        but touched nowhere.
    """
    if not problem.piezoelectric:
        return
    interface, nodal, comm = problem.interface, problem.nodal(state), problem.comm
    pressure = interface.pressure(nodal, state.forces)
    slopes = interface.response.jacobian(nodal, pressure)[:, -1, -1]
    known = bool(np.any(slopes != 0)) or not np.all(problem.free[:, -1])
    if interface.held is not None:
        known = known or bool(np.any(interface.held.slope(state.x) != 0))
    if not comm.allreduce(known, op=MPI.LOR):
        raise InputError(
            "the potential is not determined: it is prescribed nowhere, and the foundation "
            "conducts nowhere; accepted: a potential fixed on a part, or contact with a "
            "conductive foundation"
        )


def rigid_motions(points: NDArray[np.floating], revolved: bool = False) -> Array:
    """Return the rigid motions at points of shape (n, d): shape (n, d, 3 or 6).

    Translations come first, then rotations: about z in the plane, about x, y and z in space.
    A body of revolution has one, along its axis: shape (n, 2, 1).
    """
    n, d = points.shape
    motions = np.zeros((n, d, 3 if d == 2 else 6))
    motions[:, np.arange(d), np.arange(d)] = 1.0
    for k, (i, j) in enumerate([(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]):
        motions[:, i, d + k], motions[:, j, d + k] = -points[:, j], points[:, i]
    return motions[:, :, 1:2] if revolved else motions


def _centre(problem: ContactProblem) -> Array:
    """Return the mean of the contact nodes: rotations about it are well scaled."""
    nodes = problem.nodes
    weight = nodes.sum(np.ones_like(nodes.weight))
    return np.array([nodes.sum(x) for x in nodes.points.T]) / weight


def _middle(problem: ContactProblem, points: Array) -> tuple[Array, float]:
    """Return the middle of the box around points of all ranks, and its diagonal."""
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    problem.comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
    problem.comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def _gram(problem: ContactProblem, rows: Array) -> Array:
    """Return the sum over all ranks of the products of rows (n, k, m), scaled to about 1."""
    total = problem.comm.allreduce(np.einsum("nkm,nkl->ml", rows, rows), op=MPI.SUM)
    scale = np.trace(total)
    return np.asarray(total / scale if scale > 0 else total)


def _null_space(gram: Array) -> Array:
    """Return an orthonormal basis of the null space, shape (m, k)."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values < ROUNDING]


def _describe(motions: Array, d: int, revolved: bool) -> str:
    """Name the axis motions that a space of rigid motions contains, or count it."""
    if revolved:
        return "translation along y, its axis"
    names = ["translation along x", "translation along y"]
    names += ["rotation"] if d == 2 else ["translation along z"]
    names += [] if d == 2 else [f"rotation about {axis}" for axis in "xyz"]
    contained = np.linalg.norm(motions, axis=1) > 1 - 1e-6
    found = [name for name, inside in zip(names, contained, strict=True) if inside]
    return ", ".join(found) or "translation and rotation combined"


def _check_loads(
    problem: ContactProblem,
    external: Array,
    free: Array,
    normal: Array,
    tangential: Array,
    points: NDArray[np.floating],
) -> None:
    """Refuse loads that no contact force can balance.

    That is so where they do work on a rigid motion m on which no admissible contact force can:
    m.nu <= -mu |m_tau| at every node (Farkas). A given friction bound, and a smoothed pressure,
    are not bounded by the pressure at the node: such problems are left to the solver.
    """
    friction = problem.interface.friction
    mu = 0.0 if friction.law is None else friction.law.maximum
    mu = problem.comm.allreduce(mu, op=MPI.MAX)
    if not np.isfinite(mu) or not friction.local:
        return
    d, comm = problem.dim, problem.comm
    local = np.einsum("ni,nim->m", external, rigid_motions(points, problem.domain.revolved))
    work = comm.allreduce(local, op=MPI.SUM) @ free
    scale = comm.allreduce(float(np.abs(external).sum()), op=MPI.SUM)
    # |m_tau| <= sqrt(d) times its largest component: a cone of planes inside the cone.
    across = [np.sqrt(d) * mu * part @ free for part in np.moveaxis(tangential, 1, 0)]
    rows = [normal @ free + sign * part for part in across for sign in (-1, 1)]
    cone = np.concatenate([problem.nodes.gather(row) for row in rows])
    pulled = False
    if comm.rank == 0 and np.abs(work).max() > ROUNDING * scale:
        motion = linprog(-work, cone, np.zeros(len(cone)), bounds=[(-1, 1)] * free.shape[1])
        pulled = motion.status == 0 and -motion.fun > 1e-6 * scale
    if comm.bcast(pulled):
        raise InputError(
            "the loads pull the body off the foundation, and no support holds it there; accepted: "
            "loads that press it on, or more displacement components fixed"
        )
