"""Checks that the body is held and that its potential is determined."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import linalg

from contact.errors import InputError
from contact.interface.current import Conductor
from contact.problem.grip import Grip
from contact.problem.mobility import Group, described, groups, middle, null_space
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


def check_held(problem: ContactProblem) -> None:
    """Check that no rigid motion is free, before anything is factorised. Collective.

    Three things are asked for: supports and contact (in the tangential directions too if there
    is friction) leave no rigid motion at all, the loads do not pull the body off the foundation
    where that alone holds it, and its potential is known or could be if it conducted everywhere.

    Raises
    ------
    InputError
        If the body can move freely or is pulled off, or its potential cannot be determined.
    """
    for group in groups(problem):
        _check_group(problem, group)
    check_potential(problem)


def _check_group(problem: ContactProblem, group: Group) -> None:
    """Check components of the mesh. Collective."""
    free = null_space(group.supports)
    if free.shape[1] == 0:
        return
    loose = null_space(group.held(problem.frictional))
    if loose.shape[1] > 0:
        raise InputError(_what_is_loose(problem, group, loose))
    grip = Grip.of(group)
    if grip is not None and not grip.holds(problem.time):
        raise InputError(
            f"the loads pull the body off the foundation{grip.besides}, and no support holds it "
            "there; accepted: loads that press it on, or more displacement components fixed"
        )


def _what_is_loose(problem: ContactProblem, group: Group, loose: Array) -> str:
    """Say which pieces can move, and how."""
    count = group.count
    whole = "the body, or what is rigid," if group.moving else "the body"
    if count > 1:
        one = 1 if problem.domain.revolved else 3 * (problem.dim - 1)
        own = np.linalg.norm(loose[: len(group.pieces) * one], axis=1)
        moves = own.reshape(len(group.pieces), -1).max(axis=1) > 1e-6
        where = " and ".join(f"({', '.join(f'{x:.4g}' for x in c)})" for c in group.centres[moves])
        which = "the one" if np.count_nonzero(moves) == 1 else "what is"
        whole = f"the mesh has {count} connected components, and {which} about {where}"
    return (
        f"{whole} is not held: it can move as a rigid body ({described(loose, group.names)}); "
        "accepted: displacement components fixed so that it cannot"
        + (", or regions that share the nodes between them" if count > 1 else "")
    )


def check_potential(problem: ContactProblem, state: State | None = None) -> None:
    """Check that the potential is more than known but for constants. Collective.

    Parameters
    ----------
    problem
        The problem.
    state
        A solution; before there is one, contact may be anywhere and conduct there.

    Notes
    -----
    It is where it is prescribed, and where current flows, also through nodes that cannot move: to
    a foundation, or to another piece whose potential is known. Electrodes join what they lie on.

    Raises
    ------
    InputError
        If no potential is prescribed and no current flows, as on a foundation that is conductive
        but touched nowhere, or on a body that touches another one and does not conduct.
    """
    if not problem.piezoelectric:
        return
    body, interface = problem.equilibrium, problem.interface
    piece, count = body.components
    # Constants by which the potential may be raised: of each piece, and of each electrode.
    raised = np.zeros((*body.free.shape, count))
    raised[np.arange(piece.size), -1, piece] = 1.0
    electrodes = np.eye(body.masters.size)[:, ~body.masters.mechanical]
    follows = (body.masters.ties @ electrodes)[body.block_size - 1 :: body.block_size]
    rows = [np.hstack([raised[:, -1], -follows])[~body.free[:, -1]]]
    columns = linalg.block_diag(raised.reshape(body.owned, count), electrodes)
    locally = [body.local(column) for column in columns.T]
    flows, among_held = _flows(problem, state)
    rows.append(np.column_stack([problem.nodes.apply(x)[flows, -1] for x in locally]))
    if interface.held is not None:
        jump = interface.held.jump
        rows.append(np.column_stack([jump.apply(x)[among_held, -1] for x in locally]))
    gram = sum(problem.comm.allreduce(part.T @ part, op=MPI.SUM) for part in rows)
    floating = null_space(gram / max(np.trace(gram), 1.0))
    if floating.shape[1] == 0:
        return
    where, known = "", "a conductive foundation"
    if count > 1:
        alone = np.flatnonzero(np.linalg.norm(floating[:count], axis=1) > 1e-6)
        middles = (middle(problem, body.layout.points[piece == k])[0] for k in alone)
        found = " and ".join(f"({', '.join(f'{x:.4g}' for x in c)})" for c in middles)
        where = f" of the piece of the mesh about {found}"
        known += ", or with a body that conducts and whose potential is known"
    raise InputError(
        f"the potential{where} is not determined: it is prescribed nowhere, and the foundation "
        f"conducts nowhere; accepted: a potential fixed on a part, or contact with {known}"
    )


def _flows(
    problem: ContactProblem, state: State | None
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell through which contact nodes current flows, or could, and through which held ones."""
    interface = problem.interface
    law, held = interface.law, interface.held
    if state is None:
        conductors = law.conductor, None if held is None else held.conductor
        sizes = interface.jump.nodes.size, 0 if held is None else held.jump.nodes.size
        at_contact, among_held = (
            np.zeros(size, dtype=bool)
            if conductor is None
            else _conducts(conductor, size, interface.size)
            for conductor, size in zip(conductors, sizes, strict=True)
        )
        return at_contact, among_held
    nodal = problem.nodal(state)
    pressure = interface.pressure(nodal, state.forces)
    slope = np.zeros(0) if held is None else held.slope(state.x)
    return law.jacobian(nodal, pressure)[:, -1, -1] != 0, slope != 0


def _conducts(conductor: Conductor, count: int, deep: float) -> NDArray[np.bool_]:
    """Tell which nodes conduct where they are pressed, and far into what is in front of them."""
    closed = np.ones(count, dtype=bool)
    psi = conductor.psi.at(np.full(count, deep), ~closed, closed)
    return np.broadcast_to(psi, (count,)) > 0
