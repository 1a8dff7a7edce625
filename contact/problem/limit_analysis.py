"""Limit analysis by linear programs: whether contact forces can balance the loads.

For bodies with rigid-body modes that their supports do not constrain. Admissible contact forces do
no positive work on rigid motions m with m.nu <= -mu |m_tau| at every node: if the loads do, no
forces within the friction cones balance them (Farkas' lemma). With given friction bounds s,
friction dissipates s |m_tau| at most: loads whose power is more slide the bodies.

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

#: Facets of the friction cone in 3-D, per half turn.
DIRECTIONS = 8

#: Bisections for the time of release; linear programs of an overload.
ROUNDS = 20


@dataclass(frozen=True)
class UnilateralSupport:
    """Contact as unilateral support of a group of bodies.

    Attributes
    ----------
    group
        The bodies, with their modes.
    free
        The modes that the supports do not constrain, shape (m, k).
    cone
        Rows of all ranks, shape (rows, k): admissible contact forces do no positive work on motions
        q with cone q <= 0.
    """

    group: Group
    free: Array
    cone: Array

    @staticmethod
    def of(group: Group, at: NDArray[np.bool_] | slice = slice(None)) -> UnilateralSupport | None:
        """Return the support of a group by some or all contact nodes of this rank. Collective.

        None if the supports constrain all modes, or if friction is not bounded by the pressure at
        its node: a given bound, a smoothed pressure.
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

    def release(self, time: float) -> Array | None:
        """Return the mode, shape (m,), by which loads release the bodies; None if balanced.

        Collective.
        """
        work, scale = _work(self.group, self.free, time)
        return on_root(self.group.problem.comm, lambda: self._release(work, scale))

    def _release(self, work: Array, scale: float) -> Array | None:
        """Return the mode of most power of the loads, on the rank that has the cone."""
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
        """Other ways of release than a body pulled off, in words."""
        moving = ", or force and moment the rigid part off the body" if self.group.moving else ""
        moving += ", or the force of a bolt one side of its cut" if self.group.cut else ""
        along = ", or along it by more than friction holds" if self.group.problem.frictional else ""
        return moving + along


def unilateral_supports(problem: ContactProblem) -> list[UnilateralSupport]:
    """Return the unilateral supports of all groups that need one. Collective."""
    found = [UnilateralSupport.of(group) for group in groups(problem)]
    return [support for support in found if support is not None]


def released(supports: Sequence[UnilateralSupport], begin: float, end: float) -> str:
    """Say when and how loads up to a time release a body; "" if they do not. Collective.

    Parameters
    ----------
    supports
        The unilateral supports.
    begin, end
        A time of equilibrium, and the time of the loads.
    """
    for support in supports:
        if support.release(end) is None:
            continue
        for _ in range(ROUNDS):
            middle = (begin + end) / 2
            begin, end = (middle, end) if support.release(middle) is None else (begin, middle)
        return f"from t = {end:g} on the loads pull the body off the foundation{support.besides}"
    return ""


@dataclass(frozen=True)
class Overload:
    """Loads on a group that friction within given bounds does not balance.

    Attributes
    ----------
    motion
        The mode by which the bodies slide, shape (m,).
    multiple
        Least multiple of all bounds that balances the loads; infinity for none.
    """

    motion: Array
    multiple: float

    @staticmethod
    def of(group: Group, time: float, friction: Array) -> Overload | None:
        """Return the overload of a group by the loads of a time; None for none. Collective.

        `friction`: bounds of the friction forces at the nodes of this rank, shape (n,) (force).
        """
        problem, free = group.problem, null_space(group.supports)
        if free.shape[1] == 0:
            return None
        nodes, near = problem.nodes, np.isfinite(problem.interface.gap)
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
    """Maximise the power of the loads minus the dissipation of friction.

    The dissipation, bound times |slip|, is approximated from below by slips along unit vectors;
    slip directions of the last motion are added (Kelley's cutting planes). The multiple of the
    bounds is updated from the motion (Dinkelbach).
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
    """Return the power of the loads on free modes, (k,), and the sum of |loads|. Collective."""
    body, comm, moved = group.problem.equilibrium, group.problem.comm, group.moved
    loads = body.external(time)
    on_global = loads[body.owned :]
    own = np.where(group.inside[:, None], body.nodal(loads), 0.0).ravel()
    work = comm.allreduce(moved[: body.owned].T @ own, op=MPI.SUM)
    work = (work + moved[body.owned :].T @ on_global) @ free
    scale = comm.allreduce(float(np.abs(own).sum()), op=MPI.SUM) + np.abs(on_global).sum()
    return work, float(scale)


def _sideways(normal: Array) -> list[Array]:
    """Return tangential vectors t, (n, d) each, with |m_tau| <= max |m.t| for every m.

    The facets of a polyhedral friction cone, 2 % wider at most in 3-D.
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
