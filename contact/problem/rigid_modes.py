"""Rigid-body modes that the supports do not constrain, and whether contact constrains them.

Of each connected component of the mesh, or of those that move together, the modes are seen by their
Gram matrices at supports and contact nodes. A cut of a bolt under a given force ends a component:
its sides move together, but for the shortening.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.cuts import Pieces
from contact.model.body import Bolt
from contact.model.rigid import Rigid, rigid_motions
from contact.problem.problem import ContactProblem
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Rigid motions in the order of `rigid_motions`.
NAMES = {
    2: ["translation along x", "translation along y", "rotation"],
    3: [f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"],
}


@dataclass(frozen=True)
class Group:
    """Components of the mesh that are held together or not at all, and their m rigid motions.

    Attributes
    ----------
    problem
        The problem.
    component, count
        The component of each owned node, and how many there are.
    components
        Which of them are the group's.
    moved
        The motions, of owned unknowns and global ones, shape (owned + global, m).
    names, centres
        The names of the motions, and the middles of the components.
    supports
        Gram matrix of the motions where supports hold the body, shape (m, m).
    moving, cut
        Whether rigid parts, and cuts of bolts, move with them.
    """

    problem: ContactProblem
    component: NDArray[np.int32]
    count: int
    components: list[int]
    moved: Array
    names: list[str]
    centres: Array
    supports: Array
    moving: bool
    cut: bool

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Which owned nodes are its components'."""
        return np.isin(self.component, self.components)

    def of_components(self, motions: Array) -> Array:
        """Return the rows of motions, shape (m, k), by its components: (components, 1 to 6, k)."""
        each = 1 if self.problem.domain.revolved else 3 * (self.problem.dim - 1)
        own = motions[: each * len(self.components)]
        return own.reshape(len(self.components), each, motions.shape[1])

    @cached_property
    def _at_contact(self) -> Array:
        body, nodes = self.problem.equilibrium, self.problem.nodes
        moved = [nodes.apply(body.local(column))[:, : body.dim] for column in self.moved.T]
        return np.stack(moved, axis=2)

    @cached_property
    def normal(self) -> Array:
        """The motions at the contact nodes of this rank along the normal, (n, m). Collective."""
        return np.einsum("ni,nim->nm", self.problem.nodes.normal, self._at_contact)

    @cached_property
    def tangential(self) -> Array:
        """The others, shape (n, d, m). Collective."""
        return np.einsum("nij,njm->nim", self.problem.nodes.tangent, self._at_contact)

    def held(self, friction: bool, at: NDArray[np.bool_] | slice = slice(None)) -> Array:
        """Return the Gram matrix where supports and contact hold the body, (m, m). Collective.

        Parameters
        ----------
        friction
            Whether contact holds it in the tangential directions too.
        at
            At which contact nodes contact holds it; at all of them by default.
        """
        held = self.supports + _gram(self.problem, self.normal[at][:, None, :])
        return held + _gram(self.problem, self.tangential[at]) if friction else held


def groups(problem: ContactProblem) -> Iterator[Group]:
    """Give the components of the mesh one by one, joined ones together. Collective.

    That is for those that touch each other, or that a rigid part, a foundation or a cut joins: they
    are looked at together, with its motion.
    """
    pieces = _pieces(problem)
    whole = problem.equilibrium.components
    component, count = whole if pieces is None else (pieces.component, pieces.count)
    joined = _joined(problem, component, count)
    for k in map(int, np.flatnonzero(~joined)):
        yield _group(problem, component, [k], count)
    if joined.any():
        yield _group(
            problem, component, [*map(int, np.flatnonzero(joined))], count, _free_motions(problem)
        )


def constrained_by_supports(problem: ContactProblem) -> bool:
    """Tell whether no rigid motion were free without contact. Collective."""
    return all([null_space(group.supports).size == 0 for group in groups(problem)])


def _free_motions(problem: ContactProblem) -> dict[int, str]:
    """Return the global unknowns that are motions and not given, with their names."""
    members = problem.equilibrium.global_unknowns.members
    rigid = {
        member.begin + k: f"{NAMES[problem.dim][k]} of the rigid part"
        for member in members
        if isinstance(member.description, Rigid)
        for k in map(int, np.flatnonzero(member.free))
    }
    return rigid | {
        member.begin: f"shortening of the bolt on {member.description.on!r}"
        for member in members
        if isinstance(member.description, Bolt) and member.free.any()
    }


def _pieces(problem: ContactProblem) -> Pieces | None:
    """Return the pieces between cuts under given forces; None without any. Collective."""
    cuts = problem.equilibrium.cuts
    return None if cuts is None else cuts.pieces


def _joined(problem: ContactProblem, component: NDArray[np.int32], count: int) -> NDArray[np.bool_]:
    """Tell which components touch a free motion, or each other, shape (count,). Collective."""
    free, nodes, ties = (
        [*_free_motions(problem)],
        problem.nodes,
        problem.equilibrium.global_unknowns.ties,
    )
    pieces = _pieces(problem)
    touched = np.zeros(count, dtype=np.intc)
    if free and nodes.motion is not None:
        moves = np.abs(nodes.motion[:, :, free]).max(axis=(1, 2), initial=0.0) > 0
        touched[component[nodes.nodes[moves]]] = 1
        rows = np.flatnonzero(np.abs(ties[:, free]).sum(axis=1) > 0)
        touched[component[rows // problem.equilibrium.block_size]] = 1
    if nodes.coupling is not None and nodes.coupling.between:
        touched[component[nodes.coupling.local]] = 1
    if pieces is not None:
        touched[pieces.below] = touched[pieces.above] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
    return touched > 0


def _group(
    problem: ContactProblem,
    component: NDArray[np.int32],
    components: list[int],
    count: int,
    moving: Mapping[int, str] = MappingProxyType({}),
) -> Group:
    """Return components of the mesh with their motions. Collective.

    Parameters
    ----------
    problem
        The problem.
    component
        The component of each owned node, shape (nodes,).
    components, count
        Those asked for, and how many there are in all.
    moving
        Global unknowns that move them, with their names.
    """
    body, d = problem.equilibrium, problem.dim
    points, global_unknowns = body.layout.points, body.global_unknowns
    names: list[str] = []
    # Rotations about the mean of the contact nodes are well scaled.
    contact = problem.nodes
    weight = contact.sum(np.ones_like(contact.weight))
    centres, centre = [], np.array([contact.sum(x) for x in contact.points.T]) / weight
    pieces = _pieces(problem) if moving else None
    own_names = NAMES[d][1:2] if problem.domain.revolved else NAMES[d]
    many = len(own_names) * len(components) + len(moving)
    moved = np.zeros((body.owned + global_unknowns.size, many))
    motions = moved[: body.owned].reshape(*body.free.shape, many)
    at_cuts = np.zeros((0, d)) if pieces is None else pieces.points
    joints = np.zeros((len(at_cuts), d, many))
    for k in components:
        inside, size = component == k, problem.domain.size
        side = np.zeros(0) if pieces is None else (pieces.above == k) * 1.0 - (pieces.below == k)
        if count > 1:
            centre, size = middle(problem, np.concatenate([points[inside], at_cuts[side != 0]]))
        columns = slice(len(names), len(names) + len(own_names))
        rigid = rigid_motions((points[inside] - centre) / size, problem.domain.revolved)
        motions[inside, :d, columns] = rigid
        rigid = rigid_motions((at_cuts - centre) / size, problem.domain.revolved)
        joints[:, :, columns] = side[:, None, None] * rigid
        centres.append(centre)
        names += own_names
    for k, name in moving.items():
        moved[body.owned + k, len(names)] = 1.0
        if pieces is not None and k in pieces.places:
            joints[:, :, len(names)] = pieces.normals[:, :, pieces.places.index(k)]
        names.append(name)
    # Relative to its restraints: supports, rigid parts where nodes follow them, the other side of
    # a cut.
    nodes = body.layout.restrained
    dofs = nodes[:, None] * body.block_size + np.arange(d)
    follows = global_unknowns.ties[dofs.ravel()] @ moved[body.owned :]
    nodal = motions[nodes, :d] - follows.reshape(nodes.size, d, many)
    held = nodal - np.einsum("nij,njk->nik", body.movable(nodes), nodal)
    return Group(
        problem,
        component,
        count,
        components,
        moved,
        names,
        np.array(centres),
        _gram(problem, held) + _elastic_gram(problem, moved) + _gram(problem, joints),
        any("rigid part" in name for name in moving.values()),
        pieces is not None,
    )


def _elastic_gram(problem: ContactProblem, moved: Array) -> Array:
    """Return the work of elastic supports on motions, over the largest one. Collective."""
    body, size = problem.equilibrium, moved.shape[1]
    if not problem.body.elastic:
        return np.zeros((size, size))
    tied = body.global_unknowns.tied.ravel()
    follows = body.global_unknowns.ties @ moved[body.owned :]
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


def described(motions: Array, names: list[str]) -> str:
    """Name the axis motions that a space of rigid motions contains, or count it."""
    contained = np.linalg.norm(motions, axis=1) > 1 - 1e-6
    found = [name for name, inside in zip(names, contained, strict=True) if inside]
    for axis in "xyz":
        if f"translation along {axis}" in found:
            continue
        # Of several together.
        all_along = np.array([f"translation along {axis}" in name for name in names], dtype=float)
        along = all_along * (np.linalg.norm(motions, axis=1) > 1e-6)
        size = float(np.linalg.norm(along))
        if size > 1 and np.linalg.norm(motions.T @ along) > (1 - 1e-6) * size:
            found.append(f"translation along {axis}, together")
    return ", ".join(dict.fromkeys(found)) or "translation and rotation combined"


def middle(problem: ContactProblem, points: Array) -> tuple[Array, float]:
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


def null_space(gram: Array) -> Array:
    """Return a basis of the null space, shape (m, k), of a matrix with eigenvalues up to some 1."""
    values, vectors = np.linalg.eigh(gram)
    return vectors[:, values < NEGLIGIBLE]
