"""Checks that the body is held and that its potential is determined."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.motions import rigid_motions
from contact.body.rigid import Rigid
from contact.errors import InputError
from contact.mesh.pieces import connected_pieces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Rigid motions in the order of `rigid_motions`.
NAMES = {
    2: ["translation along x", "translation along y", "rotation"],
    3: [f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"],
}

#: Eigenvalues of the Gram matrices below are between 0 and about 1.
ROUNDING = 1e-9


def check_held(problem: ContactProblem) -> None:
    """Check that no rigid motion is free, before anything is factorised. Collective.

    Two things are asked for: supports and contact (in the tangential directions too if there
    is friction) leave no rigid motion at all, and the loads do not pull the body off the
    foundation where that alone holds it. Pieces that are not connected are checked one by one,
    but for those that touch each other, or that a rigid part or a foundation joins: they are
    checked together, with its motion.

    Raises
    ------
    InputError
        If the body can move freely or is pulled off.
    """
    piece, count = connected_pieces(problem.equilibrium.space)
    joined = _joined(problem, piece, count)
    for k in np.flatnonzero(~joined):
        _check_group(problem, piece, [k], count)
    if joined.any():
        _check_group(problem, piece, [*np.flatnonzero(joined)], count, _free_motions(problem))


def _free_motions(problem: ContactProblem) -> dict[int, str]:
    """Return the global unknowns that are motions and not given, with their names."""
    return {
        member.begin + k: f"{NAMES[problem.dim][k]} of what is rigid"
        for member in problem.equilibrium.masters.members
        if isinstance(member.what, Rigid)
        for k in np.flatnonzero(member.free)
    }


def _joined(problem: ContactProblem, piece: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """Tell which pieces touch something that moves freely, or each other, (count,). Collective."""
    free, nodes, ties = [*_free_motions(problem)], problem.nodes, problem.equilibrium.masters.ties
    touched = np.zeros(count, dtype=np.intc)
    if free and nodes.motion is not None:
        moves = np.abs(nodes.motion[:, :, free]).max(axis=(1, 2), initial=0.0) > 0
        touched[piece[nodes.nodes[moves]]] = 1
        rows = np.flatnonzero(np.abs(ties[:, free]).sum(axis=1) > 0)
        touched[piece[rows // problem.equilibrium.block_size]] = 1
    if nodes.links is not None and nodes.links.between:
        touched[piece[nodes.links.local]] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
    return touched > 0


def _check_group(
    problem: ContactProblem,
    piece: NDArray[np.int32],
    group: list[int],
    count: int,
    moving: Mapping[int, str] = MappingProxyType({}),
) -> None:
    """Check pieces of the mesh, with the global unknowns that move them. Collective.

    Parameters
    ----------
    problem
        The problem.
    piece
        The piece of each owned node, shape (nodes,).
    group, count
        The pieces that are checked, and how many there are in all.
    moving
        Global unknowns, with their names.
    """
    body, nodes, d = problem.equilibrium, problem.nodes, problem.dim
    points, masters = body.layout.points, body.masters
    columns, names, centres, centre = [], [], [], _centre(problem)
    own_names = NAMES[d][1:2] if problem.domain.revolved else NAMES[d]
    for k in group:
        inside, size = piece == k, problem.domain.size
        if count > 1:
            centre, size = _middle(problem, points[inside])
        rigid = rigid_motions((points[inside] - centre) / size, problem.domain.revolved)
        motions = np.zeros((*body.free.shape, rigid.shape[2]))
        motions[inside, :d] = rigid
        centres.append(centre)
        still = np.zeros(masters.size)
        columns += [np.append(motion.ravel(), still) for motion in np.moveaxis(motions, 2, 0)]
        names += own_names
    for k, name in moving.items():
        columns.append(np.append(np.zeros(body.owned), np.eye(masters.size)[k]))
        names.append(name)
    moved = np.stack(columns, axis=1)
    # Relative to what holds it: supports, and rigid parts where nodes follow them.
    apart = moved[: body.owned] - masters.ties @ moved[body.owned :]
    fixed = ~body.free.copy()
    fixed[:, d:] = False
    supports = _gram(problem, apart[fixed.ravel()][:, None, :])
    free = _null_space(supports)
    if free.shape[1] == 0:
        return
    at_contact = np.stack([nodes.apply(body.local(column)) for column in columns], axis=2)
    normal = np.einsum("ni,nim->nm", nodes.normal, at_contact[:, :d])
    touching = _gram(problem, normal[:, None, :])
    tangential = np.einsum("nij,njm->nim", nodes.tangent, at_contact[:, :d])
    if problem.frictional:
        touching = touching + _gram(problem, tangential)
    loose = _null_space(supports + touching)
    if loose.shape[1] > 0:
        whole = "the body, or what is rigid," if moving else "the body"
        if count > 1:
            own = np.linalg.norm(loose[: len(group) * len(own_names)], axis=1)
            moves = own.reshape(len(group), -1).max(axis=1) > 1e-6
            where = " and ".join(
                f"({', '.join(f'{x:.4g}' for x in c)})" for c in np.array(centres)[moves]
            )
            which = "the one" if np.count_nonzero(moves) == 1 else "what is"
            whole = f"the mesh has {count} pieces that share no nodes, and {which} about {where}"
        raise InputError(
            f"{whole} is not held: it can move as a rigid body ({_describe(loose, names)}); "
            "accepted: displacement components fixed so that it cannot"
            + (", or regions that share the nodes between them" if count > 1 else "")
        )
    loads = body.external(problem.time)
    on_masters = loads[body.owned :]
    own = np.where(np.isin(piece, group)[:, None], body.nodal(loads), 0.0).ravel()
    work = moved[: body.owned].T @ own
    work = problem.comm.allreduce(work, op=MPI.SUM) + moved[body.owned :].T @ on_masters
    scale = problem.comm.allreduce(float(np.abs(own).sum()), op=MPI.SUM)
    _check_loads(problem, work, scale + np.abs(on_masters).sum(), free, normal, tangential)


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
    known = bool(np.any(slopes != 0)) or not np.all(problem.equilibrium.unsupported[:, -1])
    if interface.held is not None:
        through_held = interface.held.slope(state.x)
        known = known or bool(np.any(through_held != 0))
    if not comm.allreduce(known, op=MPI.LOR):
        raise InputError(
            "the potential is not determined: it is prescribed nowhere, and the foundation "
            "conducts nowhere; accepted: a potential fixed on a part, or contact with a "
            "conductive foundation"
        )


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


def _describe(motions: Array, names: list[str]) -> str:
    """Name the axis motions that a space of rigid motions contains, or count it."""
    contained = np.linalg.norm(motions, axis=1) > 1 - 1e-6
    found = [name for name, inside in zip(names, contained, strict=True) if inside]
    for axis in "xyz":
        # Of several together.
        all_along = np.array([f"translation along {axis}" in name for name in names], dtype=float)
        along = all_along * (np.linalg.norm(motions, axis=1) > 1e-6)
        size = float(np.linalg.norm(along))
        if size > 1 and np.linalg.norm(motions.T @ along) > (1 - 1e-6) * size:
            found.append(f"translation along {axis}, together")
    return ", ".join(found) or "translation and rotation combined"


def _check_loads(
    problem: ContactProblem,
    work: Array,
    scale: float,
    free: Array,
    normal: Array,
    tangential: Array,
) -> None:
    """Refuse loads that no contact force can balance.

    That is so where they do work on a rigid motion m on which no admissible contact force can:
    m.nu <= -mu |m_tau| at every node (Farkas). A given friction bound, and a smoothed pressure,
    are not bounded by the pressure at the node: such problems are left to the solver.

    Parameters
    ----------
    problem
        The problem.
    work, scale
        Of the loads on the rigid motions, shape (m,), and the size of the loads.
    free
        The motions that no support holds, shape (m, k).
    normal, tangential
        All motions at the contact nodes, shapes (n, m) and (n, d, m).
    """
    friction = problem.interface.friction
    mu = 0.0 if friction.law is None else friction.law.maximum
    mu = problem.comm.allreduce(mu, op=MPI.MAX)
    if not np.isfinite(mu) or not friction.local:
        return
    comm, work = problem.comm, work @ free
    # |m_tau| <= sqrt(d) times its largest component: a cone of planes inside the cone.
    across = [np.sqrt(problem.dim) * mu * part @ free for part in np.moveaxis(tangential, 1, 0)]
    rows = [normal @ free + sign * part for part in across for sign in (-1, 1)]
    cone = np.concatenate([problem.nodes.gather(row) for row in rows])
    pulled = False
    if comm.rank == 0 and np.abs(work).max() > ROUNDING * scale:
        from scipy.optimize import linprog  # takes a while to load

        motion = linprog(-work, cone, np.zeros(len(cone)), bounds=[(-1, 1)] * free.shape[1])
        pulled = motion.status == 0 and -motion.fun > 1e-6 * scale
    if comm.bcast(pulled):
        raise InputError(
            "the loads pull the body off the foundation, and no support holds it there; accepted: "
            "loads that press it on, or more displacement components fixed"
        )
