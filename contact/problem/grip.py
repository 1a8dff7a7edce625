"""What contact alone can hold of bodies that supports leave free, and when loads let them go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.linear.first_rank import together
from contact.problem.mobility import ROUNDING, Group, groups, null_space
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Directions in space, of half a turn, in which friction is asked for what it can hold.
DIRECTIONS = 8

#: Halvings of the time between loads that contact holds and loads that it does not.
BISECTIONS = 20


@dataclass(frozen=True)
class Grip:
    """What contact forces can hold of components of the mesh, whose supports leave motions free.

    Attributes
    ----------
    group
        The pieces, with all their motions.
    free
        The motions that no support holds, shape (m, k).
    cone
        Of all ranks, shape (rows, k): contact forces do no work on motions q with cone q <= 0.
    """

    group: Group
    free: Array
    cone: Array

    @staticmethod
    def of(group: Group) -> Grip | None:
        """Return the grip on pieces; None if supports hold them, or no bound is known. Collective.

        A given friction bound, and a smoothed pressure, are not bounded by the pressure at the
        node: such problems are left to the solver.
        """
        problem, free = group.problem, null_space(group.supports)
        friction, comm = problem.interface.friction, problem.comm
        mu = 0.0 if friction.law is None else friction.law.maximum
        mu = comm.allreduce(mu, op=MPI.MAX)
        if free.shape[1] == 0 or not np.isfinite(mu) or not friction.local:
            return None
        normal = group.normal @ free
        across = [
            mu * np.einsum("ni,nim->nm", along, group.tangential) @ free
            for along in _sideways(problem.nodes.normal)
        ]
        rows = [normal + sign * part for part in across for sign in (-1, 1)]
        return Grip(group, free, np.concatenate([problem.nodes.gather(row) for row in rows]))

    def holds(self, time: float) -> bool:
        """Tell whether contact forces can balance the loads of a time. Collective.

        They cannot where the loads do work on a rigid motion m on which no admissible contact
        force does any against them: m.nu <= -mu |m_tau| at every node (Farkas).
        """
        problem, moved = self.group.problem, self.group.moved
        body, comm = problem.equilibrium, problem.comm
        loads = body.external(time)
        on_masters = loads[body.owned :]
        own = np.where(self.group.inside[:, None], body.nodal(loads), 0.0).ravel()
        work = comm.allreduce(moved[: body.owned].T @ own, op=MPI.SUM)
        work = (work + moved[body.owned :].T @ on_masters) @ self.free
        scale = comm.allreduce(float(np.abs(own).sum()), op=MPI.SUM) + np.abs(on_masters).sum()
        first = comm.rank == 0
        return bool(comm.bcast(together(comm, lambda: first and self._balances(work, scale))))

    def _balances(self, work: Array, scale: float) -> bool:
        """Tell whether contact can balance a work of loads, on the rank that has the cone."""
        if np.abs(work).max() <= ROUNDING * scale:
            return True
        from scipy.optimize import linprog  # takes a while to load

        bounds = [(-1, 1)] * work.size
        motion = linprog(-work, self.cone, np.zeros(len(self.cone)), bounds=bounds)
        return bool(motion.status != 0 or -motion.fun <= 1e-6 * scale)

    @property
    def besides(self) -> str:
        """What may be lost besides a body that is pulled off, in words."""
        moving = ", or force and moment what is rigid off the body" if self.group.moving else ""
        along = ", or along it by more than friction holds" if self.group.problem.frictional else ""
        return moving + along


def grips(problem: ContactProblem) -> list[Grip]:
    """Return what contact alone has to hold of a problem, at any time. Collective."""
    found = [Grip.of(group) for group in groups(problem)]
    return [grip for grip in found if grip is not None]


def let_go(held_by: Sequence[Grip], begin: float, end: float) -> str:
    """Say when loads let a body go that contact alone holds, and how; nothing if not. Collective.

    Parameters
    ----------
    held_by
        What holds it.
    begin, end
        A time at which contact can hold it, and one that is asked for.
    """
    for grip in held_by:
        if grip.holds(end):
            continue
        for _ in range(BISECTIONS):
            middle = (begin + end) / 2
            begin, end = (middle, end) if grip.holds(middle) else (begin, middle)
        return f"from t = {end:g} on the loads pull the body off the foundation{grip.besides}"
    return ""


def _sideways(normal: Array) -> list[Array]:
    """Return tangential vectors t, shape (n, d) each, with |m_tau| <= max |m.t| for every m.

    In the plane that is the unit tangent. In space they are spread over half a turn, and as long as
    it takes: planes around the cone of friction, 2 % wider at most.
    """
    if normal.shape[1] == 2:
        return [normal[:, ::-1] * [-1.0, 1.0]]
    beside = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(normal, beside)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normal, first)
    longer = 1 / np.cos(np.pi / (2 * DIRECTIONS))
    angles = np.pi / DIRECTIONS * np.arange(DIRECTIONS)
    return [longer * (np.cos(angle) * first + np.sin(angle) * second) for angle in angles]
