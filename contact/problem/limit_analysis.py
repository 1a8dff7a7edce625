"""Whether contact forces can balance the loads on bodies: limit analysis by linear programs.

Of bodies with rigid-body modes that their supports do not constrain. Contact forces do no work on
rigid motions m with m.nu <= -mu |m_tau| at every node: where loads do, no forces within the
friction cones balance them (Farkas). With bounds s on the friction in place of the cones, friction
takes s |m_tau| at most, and loads whose work is more slide the bodies for ever.

References
----------
Drucker, Coulomb friction, plasticity, and limit loads, J. Appl. Mech. 21 (1954) 71.
Livesley, Limit analysis of structures formed from rigid blocks, Int. J. Numer. Methods Engrg. 12
(1978) 1853.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.nodes import unit_vectors
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import Group, groups, null_space
from contact.ranks import on_root
from contact.tolerances import BALANCED, NEGLIGIBLE
from contact.typing import Array

#: Directions in 3-D, of half a turn, in which friction is asked for its bound.
DIRECTIONS = 8

#: Halvings of the time between loads that contact holds and others; linear programs of a limit.
ROUNDS = 20


@dataclass(frozen=True)
class UnilateralSupport:
    """Contact as a unilateral support of bodies with modes that their supports do not constrain.

    Attributes
    ----------
    group
        The components, with all their motions.
    free
        The motions that no support holds, shape (m, k).
    cone
        Of all ranks, shape (rows, k): contact forces do no work on motions q with cone q <= 0.
    """

    group: Group
    free: Array
    cone: Array

    @staticmethod
    def of(group: Group, at: NDArray[np.bool_] | slice = slice(None)) -> UnilateralSupport | None:
        """Return that of bodies; None if supports hold them, or no bound is known. Collective.

        A given friction bound, and a smoothed pressure, are not bounded by the pressure at the
        node: such problems are left to the solver.

        Parameters
        ----------
        group, at
            The bodies, and the contact nodes of this rank that may press, all by default.
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
        return UnilateralSupport(
            group, free, np.concatenate([problem.nodes.gather(row[at]) for row in rows])
        )

    def lost(self, time: float) -> Array | None:
        """Return the rigid motion by which the loads of a time take the bodies off. Collective.

        Shape (m,); None where contact forces can balance them. They cannot where the loads do work
        on a rigid motion m on which no admissible contact force does any against them:
        m.nu <= -mu |m_tau| at every node (Farkas).
        """
        work, scale = _work(self.group, self.free, time)
        return on_root(self.group.problem.comm, lambda: self._lost(work, scale))

    def _lost(self, work: Array, scale: float) -> Array | None:
        """Return the motion on which loads do most work, on the rank that has the cone."""
        if np.abs(work).max() <= NEGLIGIBLE * scale:
            return None
        from scipy.optimize import linprog  # takes a while to load

        bounds = [(-1, 1)] * work.size
        motion = linprog(-work, self.cone, np.zeros(len(self.cone)), bounds=bounds)
        if motion.status != 0 or -motion.fun <= BALANCED * scale:
            return None
        return np.asarray(self.free @ motion.x)

    @property
    def besides(self) -> str:
        """The other motions that may be lost besides a body that is pulled off, in words."""
        moving = ", or force and moment the rigid part off the body" if self.group.moving else ""
        moving += ", or the force of a bolt one side of its cut" if self.group.cut else ""
        along = ", or along it by more than friction holds" if self.group.problem.frictional else ""
        return moving + along


def unilateral_supports(problem: ContactProblem) -> list[UnilateralSupport]:
    """Return the modes of a problem that contact alone has to constrain. Collective."""
    found = [UnilateralSupport.of(group) for group in groups(problem)]
    return [support for support in found if support is not None]


def released(held_by: Sequence[UnilateralSupport], begin: float, end: float) -> str:
    """Say when loads let a body go that contact alone holds, and how; nothing if not. Collective.

    Parameters
    ----------
    held_by
        Its unilateral supports.
    begin, end
        A time at which contact can hold it, and one that is asked for.
    """
    for support in held_by:
        if support.lost(end) is None:
            continue
        for _ in range(ROUNDS):
            middle = (begin + end) / 2
            begin, end = (middle, end) if support.lost(middle) is None else (begin, middle)
        return f"from t = {end:g} on the loads pull the body off the foundation{support.besides}"
    return ""


@dataclass(frozen=True)
class Overload:
    """Loads on bodies that friction within given bounds does not balance.

    Attributes
    ----------
    motion
        The rigid motion by which they slide, of all motions of a group, shape (m,).
    multiple
        The least multiple of all bounds that balances them; infinity where none does.
    """

    motion: Array
    multiple: float

    @staticmethod
    def of(group: Group, time: float, friction: Array) -> Overload | None:
        """Return that of bodies; None where friction balances the loads. Collective.

        Parameters
        ----------
        group
            The bodies.
        time
            The time of the loads.
        friction
            The largest friction forces of the contact nodes of this rank, shape (n,) (force).
        """
        problem, free = group.problem, null_space(group.supports)
        if free.shape[1] == 0:
            return None
        nodes, near = problem.nodes, np.isfinite(problem.nodes.gap)
        normal, tangential, bound = (
            nodes.gather(of[near])
            for of in (group.normal @ free, group.tangential @ free, friction)
        )
        sideways = [nodes.gather(along[near]) for along in _sideways(nodes.normal)]
        work, scale = _work(group, free, time)
        if np.abs(work).max() <= NEGLIGIBLE * scale:
            return None

        def found() -> Overload | None:
            bears = bound > NEGLIGIBLE * scale / bound.size
            along = [unit_vectors(of[bears]) for of in sideways]
            slips, own = tangential[bears], np.asarray(bound[bears] / scale, dtype=float)
            each = np.asarray(work / scale, dtype=float)
            return _overload(free, each, normal, slips, own, along)

        return on_root(problem.comm, found)


def _overload(
    free: Array, work: Array, normal: Array, tangential: Array, bound: Array, along: list[Array]
) -> Overload | None:
    """Return how loads slide bodies by the motion whose work exceeds most that of friction.

    Of a motion friction takes the bounds times the length of its slips, which unit vectors along
    tell from below: where the motion that was found slips in other directions, these are taken in
    (Kelley's cutting planes). The multiple is that of this motion, then that of the worst with the
    bounds so multiplied, and so on (Dinkelbach).
    """
    from scipy.optimize import linprog  # takes a while to load
    from scipy.sparse import block_array, eye_array

    one = eye_array(bound.size)
    bounds = [(-1, 1)] * work.size + [(0, None)] * bound.size
    multiple, motion = 1.0, None
    for _ in range(ROUNDS):
        slips = [np.einsum("ni,nik->nk", of, tangential) for of in along]
        rows = [[normal, None], *([sign * of, -one] for of in slips for sign in (1, -1))]
        cone = block_array(rows, format="csr")
        cost = np.concatenate([-work, multiple * bound])
        found = linprog(cost, cone, np.zeros(cone.shape[0]), bounds=bounds)
        if found.status != 0 or -found.fun <= BALANCED:
            break
        worst = found.x[: work.size]
        ways = tangential @ worst
        driven, taken = float(work @ worst), float(bound @ np.linalg.norm(ways, axis=1))
        if driven - multiple * taken > BALANCED:
            motion = worst
            if taken <= BALANCED * driven:
                multiple = np.inf
                break
            multiple = driven / taken
        along.append(unit_vectors(ways))
    return None if motion is None else Overload(free @ motion, multiple)


def _work(group: Group, free: Array, time: float) -> tuple[Array, float]:
    """Return the work of loads on free motions, shape (k,), and the sum of them. Collective."""
    body, comm, moved = group.problem.equilibrium, group.problem.comm, group.moved
    loads = body.external(time)
    on_masters = loads[body.owned :]
    own = np.where(group.inside[:, None], body.nodal(loads), 0.0).ravel()
    work = comm.allreduce(moved[: body.owned].T @ own, op=MPI.SUM)
    work = (work + moved[body.owned :].T @ on_masters) @ free
    scale = comm.allreduce(float(np.abs(own).sum()), op=MPI.SUM) + np.abs(on_masters).sum()
    return work, float(scale)


def _sideways(normal: Array) -> list[Array]:
    """Return tangential vectors t, shape (n, d) each, with |m_tau| <= max |m.t| for every m.

    In 2-D that is the unit tangent. In 3-D they are spread over half a turn, and as long as
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
