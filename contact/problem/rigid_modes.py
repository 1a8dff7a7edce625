"""Rigid-body modes of connected components, and their constraints by supports and contact.

A mode is constrained unless it is in the null space of the Gram matrix of the modes at supports and
contact nodes. Components joined by contact, a rigid part or the cut of a bolt are one group; a cut
under a given force separates components, whose modes agree there but for the shortening.

Limit analysis by linear programs says whether contact forces can balance the loads on modes that
the supports do not constrain. Admissible contact forces do no negative work on rigid motions m with
m.nu <= -mu |m_tau| at every node: if the loads do positive work, no forces within the friction
cones balance them (Farkas' lemma). A layer of the largest pressure P resists a motion with the
power P max(0, m.nu + mu |m_tau|) at most; with a friction bound of at most s that is not mu times
the pressure of its node, P max(0, m.nu) + s |m_tau|. With given friction bounds s, friction
dissipates s |m_tau| at most: loads whose power is more slide the bodies.

References
----------
Drucker, Coulomb friction, plasticity, and limit loads, J. Appl. Mech. 21 (1954) 71.
Livesley, Limit analysis of structures formed from rigid blocks, Int. J. Numer. Methods Engrg. 12
(1978) 1853.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.global_unknowns import CutComponents
from contact.interface.nodes import unit_vectors
from contact.model.body import Bolt
from contact.model.rigid import Motion, rigid_motions
from contact.problem.problem import ContactProblem
from contact.ranks import on_root
from contact.tolerances import BALANCED, NEGLIGIBLE
from contact.typing import Array

#: Names of the rigid motions, in the order of `rigid_motions`.
NAMES = {
    2: ["translation along x", "translation along y", "rotation"],
    3: [f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"],
}


@dataclass(frozen=True)
class Group:
    """A connected component, or several that contact or rigid parts join, and their m modes.

    Attributes
    ----------
    problem
        The problem.
    connected_component, count
        Connected component of each owned node, and their number in the mesh.
    connected_components
        Those of the group.
    moved
        The modes in owned and global unknowns, shape (owned + global, m).
    names, axes, centres
        Names of the modes, axes of the translations among them (-1: none), shape (m,), and centres
        of the components.
    supports
        Gram matrix of the modes at the supports, shape (m, m).
    cut
        Whether the modes have shortenings of bolts.
    """

    problem: ContactProblem
    connected_component: NDArray[np.int32]
    count: int
    connected_components: list[int]
    moved: Array
    names: list[str]
    axes: NDArray[np.intp]
    centres: Array
    supports: Array
    cut: bool

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Which owned nodes belong to the group."""
        return np.isin(self.connected_component, self.connected_components)

    def by_connected_component(self, motions: Array) -> Array:
        """Return motions, shape (m, k), by components: (components, 1 to 6, k)."""
        each = 1 if self.problem.domain.revolved else 3 * (self.problem.dim - 1)
        body_motions = motions[: each * len(self.connected_components)]
        return body_motions.reshape(len(self.connected_components), each, motions.shape[1])

    def translation(self, motion: Array) -> float | None:
        """Return the amount of a motion (m,) that moves parts alike along one axis; else None."""
        amounts = np.abs(motion)
        moving = amounts > 1e-6 * amounts.max()
        alike = np.ptp(motion[moving]) <= 1e-6 * amounts.max()
        axes = self.axes[moving]
        return float(amounts.max()) if alike and axes[0] >= 0 and np.ptp(axes) == 0 else None

    @cached_property
    def _at_contact(self) -> Array:
        body, nodes = self.problem.body, self.problem.nodes
        moved = [nodes.jump(body.local(column))[:, : body.dim] for column in self.moved.T]
        return np.stack(moved, axis=2)

    @cached_property
    def normal(self) -> Array:
        """Normal jumps of the modes at the contact nodes of this rank, (n, m). Collective."""
        return np.einsum("ni,nim->nm", self.problem.nodes.normal, self._at_contact)

    @cached_property
    def tangential(self) -> Array:
        """Tangential jumps of the modes, shape (n, d, m). Collective."""
        return np.einsum("nij,njm->nim", self.problem.nodes.tangential_projector, self._at_contact)

    def constraints(self, friction: bool, at: NDArray[np.bool_] | slice = slice(None)) -> Array:
        """Return the Gram matrix of the modes at supports and contact nodes, (m, m). Collective.

        With tangential jumps if there is friction; at some or all of the contact nodes.
        """
        gram = self.supports + _gram(self.problem, self.normal[at][:, None, :])
        return gram + _gram(self.problem, self.tangential[at]) if friction else gram


def groups(problem: ContactProblem) -> Iterator[Group]:
    """Yield the groups of a problem: single components, and one of all joined ones. Collective."""
    at_bolts = _cut_components(problem)
    whole = problem.body.connected_components
    component, count = whole if at_bolts is None else (at_bolts.connected_component, at_bolts.count)
    joined = _joined(problem, component, count)
    for k in map(int, np.flatnonzero(~joined)):
        yield _group(problem, component, [k], count)
    if joined.any():
        yield _group(
            problem, component, [*map(int, np.flatnonzero(joined))], count, _free_motions(problem)
        )


def unsupported(problem: ContactProblem) -> tuple[Group, ...]:
    """Return the groups with modes that the supports do not constrain. Collective."""
    return tuple(group for group in groups(problem) if null_space(group.supports).size > 0)


def _free_motions(problem: ContactProblem) -> dict[int, tuple[str, int]]:
    """Return the free motions among the global unknowns: names, axes of translations, else -1."""
    unknowns, names = problem.body.global_unknowns.groups, NAMES[problem.dim]
    rigid = {
        one.begin + k: (f"{names[k]} of the rigid part", k if k < problem.dim else -1)
        for one in unknowns
        if isinstance(one.description, Motion)
        for k in map(int, np.flatnonzero(one.free))
    }
    return rigid | {
        one.begin: (f"shortening of the bolt on {one.part!r}", -1)
        for one in unknowns
        if isinstance(one.description, Bolt) and one.free.any()
    }


def _cut_components(problem: ContactProblem) -> CutComponents | None:
    """Return the components between cuts under given forces; None without cuts. Collective."""
    cuts = problem.body.cuts
    return None if cuts is None else cuts.connected_components


def _joined(problem: ContactProblem, component: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """Tell which components a free motion, contact or a cut joins, shape (count,). Collective."""
    free, nodes = [*_free_motions(problem)], problem.nodes
    tied_motion = problem.body.global_unknowns.tied_motion
    at_bolts = _cut_components(problem)
    touched = np.zeros(count, dtype=np.intc)
    if free and nodes.motion is not None:
        moves = np.abs(nodes.motion[:, :, free]).max(axis=(1, 2), initial=0.0) > 0
        touched[component[nodes.nodes[moves]]] = 1
        rows = np.flatnonzero(np.abs(tied_motion[:, free]).sum(axis=1) > 0)
        touched[component[rows // problem.body.block_size]] = 1
    if nodes.coupling is not None and nodes.coupling.between:
        touched[component[nodes.coupling.local]] = 1
    if at_bolts is not None:
        touched[at_bolts.below] = touched[at_bolts.above] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
    return touched > 0


def _group(
    problem: ContactProblem,
    component: NDArray[np.int32],
    connected_components: list[int],
    count: int,
    moving: Mapping[int, tuple[str, int]] = MappingProxyType({}),
) -> Group:
    """Return a group with its modes; `moving`: global unknowns among these. Collective."""
    body, d = problem.body, problem.dim
    points, global_unknowns = body.layout.points, body.global_unknowns
    names: list[str] = []
    axes: list[int] = []
    # Rotations about the mean of the contact nodes: well scaled.
    contact = problem.nodes
    weight = contact.sum(np.ones_like(contact.weight))
    centres, centre = [], np.array([contact.sum(x) for x in contact.points.T]) / weight
    at_bolts = _cut_components(problem) if moving else None
    rigid_names, rigid_axes = NAMES[d], [*range(d), *[-1] * (len(NAMES[d]) - d)]
    if problem.domain.revolved:
        rigid_names, rigid_axes = rigid_names[1:2], rigid_axes[1:2]
    many = len(rigid_names) * len(connected_components) + len(moving)
    moved = np.zeros((body.owned + global_unknowns.size, many))
    motions = moved[: body.owned].reshape(*body.free.shape, many)
    at_cuts = np.zeros((0, d)) if at_bolts is None else at_bolts.points
    joints = np.zeros((len(at_cuts), d, many))
    for k in connected_components:
        inside, size = component == k, problem.domain.size
        side = (
            np.zeros(0) if at_bolts is None else (at_bolts.above == k) * 1.0 - (at_bolts.below == k)
        )
        if count > 1:
            centre, size = middle(problem, np.concatenate([points[inside], at_cuts[side != 0]]))
        columns = slice(len(names), len(names) + len(rigid_names))
        rigid = rigid_motions((points[inside] - centre) / size, problem.domain.revolved)
        motions[inside, :d, columns] = rigid
        rigid = rigid_motions((at_cuts - centre) / size, problem.domain.revolved)
        joints[:, :, columns] = side[:, None, None] * rigid
        centres.append(centre)
        names += rigid_names
        axes += rigid_axes
    for k, (name, axis) in moving.items():
        moved[body.owned + k, len(names)] = 1.0
        if at_bolts is not None and k in at_bolts.places:
            joints[:, :, len(names)] = at_bolts.normals[:, :, at_bolts.places.index(k)]
        names.append(name)
        axes.append(axis)
    supports = _gram(problem, _at_supports(problem, moved))
    return Group(
        problem=problem,
        connected_component=component,
        count=count,
        connected_components=connected_components,
        moved=moved,
        names=names,
        axes=np.array(axes),
        centres=np.array(centres),
        supports=supports + _elastic_gram(problem, moved) + _gram(problem, joints),
        cut=at_bolts is not None,
    )


def _at_supports(problem: ContactProblem, moved: Array) -> Array:
    """Return modes at supports, relative to rigid parts, along fixed directions, (n, d, m)."""
    body, nodes, m = problem.body, problem.body.layout.restrained, moved.shape[1]
    motions = moved[: body.owned].reshape(*body.free.shape, m)[nodes, : body.dim]
    dofs = nodes[:, None] * body.block_size + np.arange(body.dim)
    follows = body.global_unknowns.tied_motion[dofs.ravel()] @ moved[body.owned :]
    nodal = motions - follows.reshape(motions.shape)
    return nodal - np.einsum("nij,njk->nik", body.movable(nodes), nodal)


def _elastic_gram(problem: ContactProblem, moved: Array) -> Array:
    """Return the stiffness of elastic supports against the modes, scaled to 1. Collective."""
    body, size = problem.body, moved.shape[1]
    if not problem.description.elastic:
        return np.zeros((size, size))
    tied = body.global_unknowns.tied.ravel()
    follows = body.global_unknowns.tied_motion @ moved[body.owned :]
    motions = np.where(tied[:, None], follows, moved[: body.owned])
    forces = np.stack(
        [
            np.sum(body.elastic_forces(body.local(np.append(motion, q))), axis=0)
            for motion, q in zip(motions.T, moved[body.owned :].T, strict=True)
        ],
        axis=1,
    )
    gram = problem.comm.allreduce(motions.T @ forces, op=MPI.SUM)
    return np.asarray(gram / max(float(np.diag(gram).max()), np.finfo(float).tiny))


def mode_names(motions: Array, names: list[str]) -> str:
    """Name the modes that a space of rigid motions contains, else those that it combines."""
    share = np.linalg.norm(motions, axis=1)
    contained, combined = (
        [*dict.fromkeys(name for name, weight in zip(names, share, strict=True) if weight > least)]
        for least in (1 - 1e-6, 1e-6)
    )
    words = ", ".join(contained or combined)
    return words if contained or len(combined) == 1 else f"a combination of {words}"


def middle(problem: ContactProblem, points: Array) -> tuple[Array, float]:
    """Return the centre of the bounding box of points, and its diagonal. Collective."""
    low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
    problem.comm.Allreduce(MPI.IN_PLACE, low, op=MPI.MIN)
    problem.comm.Allreduce(MPI.IN_PLACE, high, op=MPI.MAX)
    return (low + high) / 2, float(np.linalg.norm(high - low))


def _gram(problem: ContactProblem, rows: Array) -> Array:
    """Return the Gram matrix of rows (n, k, m) of all ranks, with trace 1. Collective."""
    total = problem.comm.allreduce(np.einsum("nkm,nkl->ml", rows, rows), op=MPI.SUM)
    scale = np.trace(total)
    return np.asarray(total / scale if scale > 0 else total)


def null_space(gram: Array) -> Array:
    """Return an orthonormal basis of the null space, (m, k), of a matrix of norm about 1."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values < NEGLIGIBLE]


#: Facets of the friction cone in 3-D, per half turn.
DIRECTIONS = 8

#: Bisections for the time of release; linear programs of an overload.
ROUNDS = 20


#: The motion of a body by loads beyond its unilateral supports.
PULLED_OFF = "pull the body off the foundation, or along it by more than friction holds"


@dataclass(frozen=True)
class Release:
    """A motion by which loads move bodies off their unilateral supports."""

    motion: Array  #: the mode, (m,)
    power: float  #: f . m of the loads
    resisted: float  #: largest resistance of layers and friction, less than the power
    saturated: bool  #: whether rigid parts in place of the layers would balance the loads


#: The motion of a body by loads beyond the pressure of a layer without a rigid part.
PUSHED_THROUGH = "push the body through the layer"


@dataclass(frozen=True)
class UnilateralSupport:
    """Contact as unilateral support of a group of bodies.

    A node resists a motion q with the power `bound` max(0, largest row q) at most. Each counts
    twice where friction is not bounded by the pressure there: `normal`, then along the surface.
    """

    group: Group  #: the bodies, with their modes
    free: Array  #: modes that the supports do not constrain, (m, k)
    cone: Array  #: rows of all ranks, (rows, n, k)
    #: Largest forces, (n,) (force); infinite but on saturating layers and for the friction there.
    bound: Array
    normal: NDArray[np.bool_]  #: which are contact forces, (n,)

    @staticmethod
    def of(group: Group) -> UnilateralSupport | None:
        """Return the support of a group by the contact nodes that face something. Collective.

        None if the supports constrain all modes, or if friction is not bounded by the pressure at
        its node, by Tresca's law or with a smoothed pressure, and no layer saturates.
        """
        problem, free = group.problem, null_space(group.supports)
        interface, friction = problem.interface, problem.interface.friction
        if free.shape[1] == 0:
            return None
        mu = 0.0 if friction.law is None else friction.law.maximum
        mu = problem.comm.allreduce(mu, op=MPI.MAX)
        by_pressure = np.isfinite(mu) and friction.local
        if not by_pressure and interface.saturation == 0:
            return None
        nodes, normal, largest = problem.nodes, group.normal @ free, interface.largest_pressure
        near = np.isfinite(nodes.gap)
        across = [
            np.einsum("ni,nim->nm", along, group.tangential) @ free
            for along in _sideways(nodes.normal)
        ]
        sideways = [sign * part for part in across for sign in (-1, 1)]
        bound = nodes.gather((nodes.weight * largest)[near])
        if by_pressure:
            cone = np.stack([nodes.gather((normal + mu * part)[near]) for part in sideways])
            return UnilateralSupport(group, free, cone, bound, np.ones(bound.size, dtype=bool))
        pressing, sliding = (
            np.stack([nodes.gather(part) for part in parts])
            for parts in ([normal[near]] * len(sideways), sideways)
        )
        most = nodes.gather(nodes.weight * friction.largest_bound(largest, nodes))
        return UnilateralSupport(
            group,
            free,
            np.concatenate([pressing, sliding], axis=1),
            np.concatenate([bound, most]),
            np.arange(bound.size + most.size) < bound.size,
        )

    def release(self, time: float) -> Release | None:
        """Return the mode by which loads move the bodies off; None if balanced. Collective."""
        work, scale = _work(self.group, self.free, self.group.problem.body.external(time))
        return on_root(self.group.problem.comm, lambda: self._release(work, scale))

    def _release(self, work: Array, scale: float) -> Release | None:
        """Return the mode of most power left to the loads, on the rank that has the cone."""
        if np.abs(work).max() <= NEGLIGIBLE * scale:
            return None
        from scipy.optimize import linprog  # takes a while to load
        from scipy.sparse import block_array, eye_array

        def most_powerful(bound: Array, margin: float) -> tuple[Array, Array] | None:
            """Return mode and resistance of each node; None where all is balanced."""
            finite = np.isfinite(bound)
            rigid, yielding = self.cone[:, ~finite].reshape(-1, work.size), self.cone[:, finite]
            cost = np.concatenate([-(1 + margin) * work, bound[finite]]) / scale
            bounds = [(-1, 1)] * work.size + [(0, None)] * yielding.shape[1]
            rows = [[rigid, None], *([each, -eye_array(each.shape[0])] for each in yielding)]
            cone = block_array(rows, format="csr")
            optimum = linprog(cost, cone, np.zeros(cone.shape[0]), bounds=bounds)
            if optimum.status != 0 or -optimum.fun <= BALANCED:
                return None
            resisted = np.zeros(bound.size)
            resisted[finite] = bound[finite] * optimum.x[work.size :]
            return optimum.x[: work.size], resisted

        # First with rigid parts in place of the layers: no larger limit helps against this mode.
        released = most_powerful(np.where(self.normal, np.inf, self.bound), 0.0)
        saturated = released is None and bool(np.isfinite(self.bound[self.normal]).any())
        if saturated:
            # With the whole layer at its limit the position of a body is undetermined.
            released = most_powerful(self.bound, 2 * BALANCED)
        if released is None:
            return None
        motion, resisted = released
        power = float(work @ motion)
        if saturated and resisted[self.normal].sum() <= BALANCED * power:
            return None
        return Release(self.free @ motion, power, float(resisted.sum()), saturated)


def unilateral_supports(problem: ContactProblem) -> list[UnilateralSupport]:
    """Return the unilateral supports of all groups that need one. Collective."""
    supports = [UnilateralSupport.of(group) for group in groups(problem)]
    return [support for support in supports if support is not None]


def release_message(supports: Sequence[UnilateralSupport], begin: float, end: float) -> str:
    """Say when and how loads up to a time release the first body; "" if they do not. Collective.

    From a time of equilibrium on, by bisection: a release that passes before the end is not seen.
    """
    earliest = None
    for support in supports:
        low, release = begin, support.release(end)
        if release is None:
            continue
        for _ in range(ROUNDS):
            half = (low + end) / 2
            before = support.release(half)
            low, end = (half, end) if before is None else (low, half)
            release = before or release
        earliest = release
    if earliest is None:
        return ""
    return f"from t = {end:g} on the loads {PUSHED_THROUGH if earliest.saturated else PULLED_OFF}"


def sliding_mode(group: Group, loads: Array, friction: Array) -> Array | None:
    """Return the mode, shape (m,), by which owned loads slide a group; None if balanced.

    By bounds of the friction forces at the nodes of this rank, shape (n,) (force). Collective.
    """
    problem, free = group.problem, null_space(group.supports)
    if free.shape[1] == 0:
        return None
    nodes, near = problem.nodes, np.isfinite(problem.nodes.gap)
    normal, tangential, bound = (
        nodes.gather(of[near]) for of in (group.normal @ free, group.tangential @ free, friction)
    )
    sideways = [nodes.gather(along[near]) for along in _sideways(nodes.normal)]
    work, scale = _work(group, free, loads)
    if np.abs(work).max() <= NEGLIGIBLE * scale:
        return None

    def largest_mode() -> Array | None:
        bears = bound > NEGLIGIBLE * scale / bound.size
        along = [unit_vectors(of[bears]) for of in sideways]
        scaled_work = np.asarray(work / scale, dtype=float)
        scaled_bound = np.asarray(bound[bears] / scale, dtype=float)
        mode = _most_power(scaled_work, normal, tangential[bears], scaled_bound, along)
        return None if mode is None else np.asarray(free @ mode)

    return on_root(problem.comm, largest_mode)


def missing_pressure(group: Group, loads: Array, pressing: Array) -> float:
    """Return the relative imbalance of owned loads and contact forces on motions without slip.

    `pressing`: normal contact forces at the nodes of this rank, shape (n,) (force). Collective.
    """
    problem, free = group.problem, null_space(group.supports)
    work, scale = _work(group, free, loads)
    slipless = free @ null_space(
        _gram(problem, group.tangential[np.isfinite(problem.nodes.gap)] @ free)
    )
    normal = group.normal @ slipless
    resisted, most = problem.comm.allreduce(
        np.stack([pressing @ normal, pressing @ np.abs(normal)]), op=MPI.SUM
    )
    missing = np.abs(slipless.T @ free @ work - resisted)
    reference = np.maximum(most, BALANCED * scale)
    acts = reference > 0
    return float(np.max(missing[acts] / reference[acts], initial=0.0))


def _most_power(
    work: Array, normal: Array, tangential: Array, bound: Array, along: list[Array]
) -> Array | None:
    """Return the mode of largest ratio of the loads' power to the dissipation, if it is above 1.

    The dissipation, bound times |slip|, is approximated from below by slips along unit vectors;
    slip directions of the last mode are added (Kelley's cutting planes). The ratio is updated from
    the mode (Dinkelbach).
    """
    from scipy.optimize import linprog  # takes a while to load
    from scipy.sparse import block_array, eye_array

    one = eye_array(bound.size)
    bounds = [(-1, 1)] * work.size + [(0, None)] * bound.size
    ratio, mode = 1.0, None
    for _ in range(ROUNDS):
        slips = [np.einsum("ni,nik->nk", of, tangential) for of in along]
        rows = [[normal, None], *([sign * of, -one] for of in slips for sign in (1, -1))]
        cone = block_array(rows, format="csr")
        cost = np.concatenate([-work, ratio * bound])
        optimum = linprog(cost, cone, np.zeros(cone.shape[0]), bounds=bounds)
        if optimum.status != 0 or -optimum.fun <= BALANCED:
            break
        worst = np.asarray(optimum.x[: work.size])
        slip = tangential @ worst
        power, dissipation = float(work @ worst), float(bound @ np.linalg.norm(slip, axis=1))
        if power - ratio * dissipation > BALANCED:
            mode = worst
            if dissipation <= BALANCED * power:
                break
            ratio = power / dissipation
        along.append(unit_vectors(slip))
    return mode


def _work(group: Group, free: Array, loads: Array) -> tuple[Array, float]:
    """Return the power of owned loads on free modes, (k,), and the sum of |loads|. Collective."""
    body, comm, moved = group.problem.body, group.problem.comm, group.moved
    on_global = loads[body.owned :]
    group_loads = np.where(group.inside[:, None], body.nodal(loads), 0.0).ravel()
    work = comm.allreduce(moved[: body.owned].T @ group_loads, op=MPI.SUM)
    work = (work + moved[body.owned :].T @ on_global) @ free
    scale = comm.allreduce(float(np.abs(group_loads).sum()), op=MPI.SUM) + np.abs(on_global).sum()
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
