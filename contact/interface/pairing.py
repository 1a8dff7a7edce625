"""Contact of two bodies: which nodes, and their geometry at any place.

`find_pair` decides once, in the reference configuration, and checks the input; the
`PairPlacement` that it returns gives normals, gaps, areas, D and M as functions of positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.arguments import expect
from contact.body.equilibrium import BodyEquilibrium
from contact.body.supports import APART
from contact.errors import InputError
from contact.interface.mortar.coupling import LEAST_COVERED, Coupling, couple
from contact.interface.mortar.lumping import pairs_at_axis
from contact.interface.mortar.surface import Surface, surface_of
from contact.interface.nodes import ContactNodes, Geometry, contact_directions
from contact.interface.overlaps import Depths
from contact.interface.placing import check_gap
from contact.mesh.deviation import SMOOTH
from contact.mesh.entities import owned_among
from contact.mesh.owners import Owners
from contact.model.obstacle import Obstacle
from contact.model.obstacle.shapes import measured
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Share of a facet that faces the master, if its nodes are not beyond the rim of that.
FACES = 0.9

#: How an interference is said.
PRESSED = 'overlap = "press" (in Python press=True)'

#: Share of the mesh's extent up to which facets are taken to face each other.
REACH = 0.25


@dataclass(frozen=True)
class PairPlacement:
    """The contact of two bodies, its nodes chosen in the reference configuration."""

    body: BodyEquilibrium  #: both bodies
    slave: Surface  #: the slave side in the reference configuration
    master: Surface  #: the master side, likewise
    reach: float  #: largest distance at which facets face each other (length)
    no_multiplier: NDArray[np.int64]  #: global numbers of slave nodes without multiplier (`couple`)
    nodes: NDArray[np.int64]  #: global numbers of this rank's nodes with a multiplier, (n,)
    added: Array  #: gap at `nodes` beside that between the meshes, shape (n,) (length)
    press: bool  #: whether overlaps in the reference configuration are interferences
    rounding_length: float  #: overlap that counts as rounding (length)

    @property
    def least_added(self) -> float:
        """Least of the gaps that are added. Collective."""
        return self.body.comm.allreduce(float(self.added.min(initial=np.inf)), op=MPI.MIN)

    def at(self, displacement: Array) -> Geometry:
        """Return the geometry at a displacement of the owned nodes, shape (nodes, d). Collective.

        Nodes that face nothing there are open: their gap is infinite.
        """
        slave, master = (side.moved(displacement) for side in (self.slave, self.master))
        coupling = couple(slave, master, self.reach, self.no_multiplier, self.nodes)
        return self.geometry(slave, master, coupling)

    def geometry(self, slave: Surface, master: Surface, coupling: Coupling) -> Geometry:
        """Return the geometry, given both sides at their place and their operator. Collective."""
        body, normal = self.body, coupling.normal
        _, local = owned_among(body.layout.index_map, self.nodes)
        points = body.space.tabulate_dof_coordinates()[local, : body.dim]
        gap, cut = coupling.gap, 0.0
        if not self.press and coupling.depth <= self.rounding_length:
            gap, cut = _touching(body.comm, coupling)
            cut = max(cut - max(self.least_added, 0.0), 0.0)
        unknown = body.comm.allreduce(
            max(side.unknown_deviation for side in (slave, master)), op=MPI.MAX
        )
        movable = body.movable(local)
        prescribed = _prescribed(body, coupling, slave.owners, movable)
        admissible, projector = contact_directions(normal, movable, prescribed)
        nodes = ContactNodes(
            comm=body.comm,
            nodes=local,
            points=points,
            weight=coupling.weight,
            normal=normal,
            admissible_normal=admissible,
            tangential_projector=projector,
            gap=gap + self.added,
            deviation=np.full(local.size, unknown),
            block_size=body.block_size,
            revolved=body.domain.revolved,
            motion=body.global_unknowns.of_foundation(points, body.block_size),
        )
        return Geometry(nodes, coupling, coupling.covered, cut=cut)


def _touching(comm: MPI.Intracomm, coupling: Coupling) -> tuple[Array, float]:
    """Return the gaps of sides that touch, and the largest depth that is left out. Collective."""
    # Chords of two curved sides that touch cut each other by their sagittas, which are no overlap:
    # g_j = max(g_j, min(w_j^-1 int Phi_j max(g, 0), 0)), below 0 where Phi_j alone is negative.
    # An overlap by rounding goes where the sides are moved apart by its depth, which may be a tenth
    # more at the tip of an edge than at the points where it is measured.
    least = np.minimum(coupling.gap_positive_part, 0.0)
    cut = comm.allreduce(float(np.max(least - coupling.gap, initial=0.0)), op=MPI.MAX)
    gap = np.maximum(coupling.gap, least)
    gap = np.where(gap < 0, np.minimum(gap + 2 * coupling.depth, 0.0), gap)
    return gap, max(cut, coupling.depth)


def find_pair(
    body: BodyEquilibrium,
    part: str,
    against: str,
    distance: Obstacle,
    key: str = "contact",
    press: bool = False,
    friction: bool = False,
    overlap: Depths = (0.0, 0.0),
) -> tuple[PairPlacement, Geometry]:
    """Choose the nodes of a part that may touch another one, in the reference place. Collective.

    A node whose normal is fixed by a Dirichlet condition is left out, and its multiplier is handed
    over to its neighbours. With friction that is so too where a tangential component is fixed, but
    not on the other side, on which it would act; where both are, or there is no friction, it is
    removed from the tangent projector. Nodes that face nothing are left out.

    `distance` is added to the gap between the meshes; with `press` the bodies may overlap in the
    reference configuration, and press each other out. `overlap` has the depths of the boundary of
    either body in the other, at the sides and beside those of all pairs (`overlap_depths`)
    (length). The geometry that is returned is that of the reference configuration.

    Refuses parts that share nodes or overlap, follow a rigid part or do not face each other, whose
    nodes cannot move, and supports along the part that would take friction off the other side.
    """
    label = f"{key}.against: {part!r} and {against!r}"
    slave = surface_of(body.domain, body.space, part)
    master = surface_of(body.domain, body.space, against)
    _refuse_shared(slave, master, label)
    reach = REACH * body.domain.size
    expect(f"{key}.foundation", distance, "a gap with against", not distance.is_shape)
    coupling = couple(slave, master, reach)
    beyond, alone = _beyond_rim(slave, coupling)
    no_multiplier: NDArray[np.int64] = np.empty(0, dtype=np.int64)
    while True:
        _, local = owned_among(body.layout.index_map, coupling.nodes)
        points = body.space.tabulate_dof_coordinates()[local, : body.dim]
        _, added = measured(distance, points, coupling.normal, body.comm, key)
        check_gap(body.domain, added, key)
        least = body.comm.allreduce(float(added.min(initial=np.inf)), op=MPI.MIN)
        lost = _without_multiplier(body, slave, coupling, label, part if friction else None)
        if press or least < 0:
            lost = np.union1d(lost, beyond)
        new = np.setdiff1d(lost, no_multiplier)
        if body.comm.allreduce(new.size, op=MPI.SUM) == 0:
            break
        # With the functions of these given to their neighbours, others may face the master.
        no_multiplier = np.union1d(no_multiplier, new)
        coupling = couple(slave, master, reach, no_multiplier)
    if body.comm.allreduce(coupling.nodes.size, op=MPI.SUM) == 0:
        if max(overlap) > 0:
            raise _overlap(max(overlap), True, False, label)
        raise InputError(
            f"{label} have no facets that face each other within {reach:.3g}, or their nodes are "
            "constrained there; accepted: sides of two bodies that look at each other",
            "pair",
        )
    _check_apart(body, coupling, slave.owners, label)
    thinner = body.thicknesses[body.connected_components_of(part, against)].min()
    rounding_length = float(body.rounded_overlap(thinner))
    placement = PairPlacement(
        body, slave, master, reach, no_multiplier, coupling.nodes, added, press, rounding_length
    )
    _check_overlap(placement, coupling, overlap, alone, label)
    return placement, placement.geometry(slave, master, coupling)


def _check_overlap(
    pair: PairPlacement,
    coupling: Coupling,
    overlap: Depths,
    alone: NDArray[np.bool_],
    label: str,
) -> None:
    """Refuse an overlap that is not to be pressed apart, or that nodes do not resolve. Collective.

    `alone`: partly covered facets without a neighbour that faces the master, shape (f,).
    """
    body, rounding_length, owners = pair.body, pair.rounding_length, pair.slave.owners
    least = pair.least_added
    depth, resolved = coupling.interference(owners, pair.added)
    inside, beside = overlap
    depth = max(depth, max(overlap) - max(least, 0.0))
    # Sides that do not face each other see nothing of an overlap, nor of one beside them.
    resolved &= inside <= 2 * coupling.depth and beside - max(least, 0.0) <= rounding_length
    coarse = bool((alone & (coupling.depths > least + rounding_length)).any())
    resolved &= not body.comm.allreduce(coarse, op=MPI.LOR)
    drawn = max(coupling.depth, *overlap) > rounding_length
    if depth <= rounding_length or (resolved and (pair.press or not drawn)):
        return
    if drawn and _connected(body, coupling, owners):
        raise InputError(
            f"{label} are sides of one body that overlap, by up to {depth:.3g}, or that look away "
            f"from each other; accepted: parts that face each other and are apart, or {PRESSED} "
            "for an interference",
            "pair",
        )
    turns = drawn and any([_turns(side) for side in (pair.slave, pair.master)])
    raise _overlap(depth, drawn, resolved, label, turns)


def _turns(side: Surface) -> bool:
    """Return whether straight facets of a side turn as those of an edge of the body. Collective."""
    corners = side.nodes[:, : side.shape.corners]
    normal = np.pad(side.normal, ((0, 0), (0, 1)), constant_values=1.0)
    _, sums = side.owners.sums(corners.ravel(), np.repeat(normal, corners.shape[1], axis=0))
    turned = np.linalg.norm(sums[:, :-1], axis=1) <= SMOOTH * sums[:, -1]
    return side.owners.comm.allreduce(bool(turned.any()) and side.order == 1, op=MPI.LOR)


def _refuse_shared(slave: Surface, master: Surface, label: str) -> None:
    """Refuse sides that share nodes. Collective."""
    owners = slave.owners
    one, other = (owners.requested(side.nodes.ravel()) for side in (slave, master))
    if owners.comm.allreduce(np.intersect1d(one, other).size, op=MPI.SUM) > 0:
        raise InputError(
            f"{label} share nodes; accepted: parts of two bodies whose meshes are apart", "pair"
        )


def _without_multiplier(
    body: BodyEquilibrium, slave: Surface, coupling: Coupling, label: str, friction_part: str | None
) -> NDArray[np.int64]:
    """Return the slave nodes of this rank and its facets that carry no multiplier. Collective."""
    owners = slave.owners
    on_axis = owners.requested(pairs_at_axis(slave, slave.nodes)[:, 0])
    prescribed = np.union1d(_with_prescribed_normal(body, coupling), on_axis)
    if friction_part is not None:
        one_sided = _one_sided(body, coupling, owners)
        one_sided[np.isin(coupling.nodes, prescribed)] = False
        _check_rim(
            body, slave, friction_part, [coupling.nodes[lost] for lost in one_sided.T], label
        )
        prescribed = np.union1d(prescribed, coupling.nodes[one_sided.any(axis=1)])
    return owners.among(prescribed, slave.nodes.ravel())


def _beyond_rim(slave: Surface, coupling: Coupling) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return nodes of this rank and its facets beyond the rim of the master. Collective.

    They belong to partly covered facets beside facets that face the master, but to none of the
    latter. The second result tells which partly covered facets are beside none that faces it, shape
    (f,).
    """
    # Their jump is extrapolated, and closing it would press on the master beyond its rim.
    owners, faces = slave.owners, coupling.faces > FACES
    within = owners.requested(slave.nodes[faces].ravel())
    facing = owners.values(slave.nodes.ravel(), lambda numbers: np.isin(numbers, within))
    facing = facing.reshape(slave.nodes.shape)
    partly, beside = ~faces & (coupling.faces > LEAST_COVERED), facing.any(axis=1)
    beyond = owners.requested(slave.nodes[partly & beside][~facing[partly & beside]])
    return owners.among(beyond, slave.nodes.ravel()), partly & ~beside


def _check_apart(body: BodyEquilibrium, coupling: Coupling, owners: Owners, label: str) -> None:
    """Refuse jumps of nodes that follow something rigid or an electrode. Collective."""
    local = owners.requested(np.concatenate([coupling.slaves, coupling.masters])) - owners.begin
    if body.comm.allreduce(bool(body.global_unknowns.tied[local].any()), op=MPI.LOR):
        raise InputError(
            f"{label}: their nodes follow a rigid part or an electrode of unknown potential; "
            "accepted: parts that end before these",
            "pair",
        )


def _with_prescribed_normal(body: BodyEquilibrium, coupling: Coupling) -> NDArray[np.int64]:
    """Return the slave nodes of this rank whose displacement along the normal is prescribed."""
    _, local = owned_among(body.layout.index_map, coupling.nodes)
    moves = body.free[local, : body.dim]
    constrained = np.linalg.norm(coupling.normal * moves, axis=1) <= APART
    return coupling.nodes[constrained]


def _one_sided(body: BodyEquilibrium, coupling: Coupling, owners: Owners) -> NDArray[np.bool_]:
    """Return which components of slave nodes are fixed but free opposite. Collective."""

    def fixed(numbers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which components of nodes of this rank are fixed."""
        return ~body.free[numbers - owners.begin, : body.dim]

    opposite = owners.values(coupling.masters, fixed)
    return fixed(coupling.nodes) & (np.abs(coupling.M) @ opposite <= 0)


def _prescribed(
    body: BodyEquilibrium, coupling: Coupling, owners: Owners, movable: Array
) -> NDArray[np.bool_]:
    """Return where supports constrain the masters along all directions of the slave, (n,)."""

    def free(numbers: NDArray[np.int64]) -> Array:
        """Return the directions in which nodes of this rank move, shape (k, d^2)."""
        local = np.asarray(numbers - owners.begin, dtype=np.int32)
        return np.abs(body.movable(local)).reshape(local.size, body.dim**2)

    moves = np.abs(coupling.M) @ owners.values(coupling.masters, free)
    constrained = np.eye(body.dim) - movable
    along = constrained @ moves.reshape(-1, body.dim, body.dim)
    return np.asarray(np.abs(along).max(axis=(1, 2), initial=0.0) <= ROUNDING)


def _check_rim(
    body: BodyEquilibrium, slave: Surface, part: str, lost: list[NDArray[np.int64]], label: str
) -> None:
    """Refuse supports on facets, not only on a rim, where the other side is free. Collective."""
    lost = [slave.owners.among(nodes, slave.nodes.ravel()) for nodes in lost]
    facets, filled = body.domain.facets(part), False
    for support in body.description.fixed:
        supported = np.isin(facets, body.domain.facets_anywhere(support.on))
        for k in support.components:
            filled |= bool((supported & np.isin(slave.nodes, lost[k]).all(axis=1)).any())
    if body.comm.allreduce(filled, op=MPI.LOR):
        raise InputError(
            f"{label}: supports hold the first along its surface, where friction would pull at "
            "the second; accepted: on and against exchanged, supports on its rim, no friction",
            "held-side",
        )


def _overlap(
    depth: float, drawn: bool, resolved: bool, label: str, turns: bool = False
) -> InputError:
    """Return the error of an overlap, drawn or by the gap, given whether nodes resolve it."""
    bodies, way = ("bodies", PRESSED) if drawn else ("bodies and the gap", "a gap below 0")
    way += " for an interference"
    if not resolved:
        way += (
            " of sides that face each other there, with on and against exchanged or with shorter "
            "facets of on"
        )
    if turns:
        # The same vertices are those of a polygon, whose edges are in the other body.
        way += (
            "; of a curve whose facets turn by over 52 degrees, shorter or curved ones (mesh.order)"
        )
    return InputError(
        f"{label}: the undeformed {bodies} overlap, by up to {depth:.3g} more than facets "
        f"deviate from a curve; accepted: meshes that are apart or touch, or {way}",
        "overlap",
    )


def _connected(body: BodyEquilibrium, coupling: Coupling, owners: Owners) -> bool:
    """Return whether both sides are on one connected component. Collective."""
    component, count = body.connected_components
    touched = np.zeros((2, count), dtype=np.intc)
    for k, nodes in enumerate((coupling.slaves, coupling.masters)):
        touched[k, component[owners.requested(nodes) - owners.begin]] = 1
    body.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
    return bool(touched.all(axis=0).any())
