"""Contact with a rigid foundation: which nodes of a part, and their geometry at any place.

`find_nodes` decides once, in the reference configuration, and checks the input; the
`FoundationPlacement` that it returns gives directions, gaps and areas as functions of positions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.arguments import naming
from contact.body.equilibrium import BodyEquilibrium
from contact.body.supports import APART
from contact.errors import InputError, counted
from contact.interface.mortar.coupling import RESOLVED
from contact.interface.mortar.lumping import JumpRows, Lumping
from contact.interface.mortar.surface import Surface, surface_of
from contact.interface.nodes import ContactNodes, Geometry, contact_directions
from contact.mesh.cells import rule
from contact.mesh.domain import Domain
from contact.mesh.entities import owned_among
from contact.mesh.owners import Owners
from contact.model.obstacle import Obstacle, Shape
from contact.model.obstacle.shapes import measured
from contact.ranks import on_all_ranks
from contact.typing import Array

#: Depth in a shape that counts as rounding, over that in a body: numbers of shapes are written by
#: hand, with fewer digits than positions in files.
BY_HAND = 10

#: Degree of the rule at whose points facets are compared with a shape.
WITHIN = 20


@dataclass(frozen=True)
class Candidates:
    """The owned nodes of a boundary part at a place, and the obstacle in front of them."""

    nodes: NDArray[np.int32]  #: as in `ContactNodes`, whatever is fixed there
    weight: Array  #: likewise
    places: Array  #: current positions of the nodes, shape (n, d) (length)
    facing: Array  #: cosine between the contact direction and the body's normal, shape (n,)
    #: Points from which gaps are measured, shape (n, d) (length): given gaps from the nodes, gaps
    #: to a shape from the curved surface, as nodes in the middle of straight edges are on chords.
    front: Array
    #: Depth of the nodes, shape (n,) (length), in a shape that the curved surface, or the straight
    #: facets, touch, and rounding.
    chord_penetration: Array
    rounding_length: float  #: and that counts as rounding (length)
    direction: Array  #: the contact direction, shape (n, d)
    measured: Array  #: the gap from `front`, shape (n,)
    gap: Array  #: from the curve through the corners, shape (n,)
    #: The part of the deviation that gaps do not have, shape (n,); none at degree 1, whose nodes
    #: are on the surface.
    unknown: Array
    owners: Owners
    jumps: JumpRows | None  #: rows of the jumps; None where these are the nodal values

    def of_jumps(self, gap: Array) -> Array:
        """Return the gaps of the jumps, given those at the nodes. Collective.

        Next to infinite gaps these are no numbers.
        """
        if self.jumps is None:
            return gap
        with np.errstate(invalid="ignore"):
            jumps = self.jumps.apply(self.owners, gap[:, None] * self.direction)
            return np.asarray(np.einsum("nd,nd->n", self.direction, jumps))


def find_candidates(
    body: BodyEquilibrium,
    part: str,
    facets: Surface,
    obstacle: Obstacle,
    displacement: Array,
    key: str,
) -> Candidates:
    """Return the nodes of a part at a place, and the obstacle as they see it. Collective.

    The facets are those of the part at this place, the displacement is that of the owned nodes,
    shape (nodes, d).
    """
    comm, lumped = body.comm, Lumping.of(facets).without_axis(facets)
    rounding_length = _rounding_length(body, part)
    # Functions without a mean on Gamma_3 carry nothing: P2 vertices on the axis of revolution.
    size = np.array([lumped.weight.sum(), lumped.weight.size])
    area, count = comm.allreduce(size, op=MPI.SUM)
    weight = np.where(lumped.weight <= 1e-9 * area / max(count, 1), 0.0, lumped.weight)
    _, nodes = owned_among(body.space.dofmap.index_map, lumped.nodes)
    points = body.space.tabulate_dof_coordinates()[nodes, : body.dim] + displacement[nodes]
    normal = lumped.normal / np.linalg.norm(lumped.normal, axis=1)[:, None]
    deviation = np.einsum("nd,nd->n", lumped.deviation, normal)
    chord_penetration = np.maximum(deviation, deviation - lumped.least)
    if facets.refined and facets.order == 1:
        # The last edges of a refined part are halves of one chord: their deviation is unknown.
        most = comm.allreduce(float(chord_penetration.max(initial=0.0)), op=MPI.MAX)
        chord_penetration = np.full_like(chord_penetration, most)
    front = points + lumped.deviation if obstacle.is_shape else points
    direction, gap = measured(obstacle, front, normal, comm, key)
    if comm.allreduce(bool(np.isnan(direction).any()), op=MPI.LOR):
        raise InputError(
            f"{key}.foundation: a contact node has no contact direction (it is the sphere's "
            "centre, on the axis of a cylinder, or where a formula has no value or no slope)",
            "contact-direction",
        )
    unknown, curved = np.zeros_like(gap), gap
    if obstacle.is_shape:
        check_gap(body.domain, gap, f"{key}.foundation: {type(obstacle).__name__}")
        exact = facets.degree == 1 and not facets.refined
        most = comm.allreduce(0.0 if exact else facets.unknown_deviation, op=MPI.MAX)
        curved, unknown = _from_curve(facets, lumped.nodes, gap, most)
    return Candidates(
        nodes=nodes,
        weight=weight,
        places=points,
        facing=np.einsum("ni,ni->n", direction, normal),
        front=front,
        # The contact direction may differ a little from the normal.
        chord_penetration=rounding_length + 1.1 * chord_penetration,
        rounding_length=rounding_length,
        direction=direction,
        measured=gap,
        gap=curved,
        unknown=unknown,
        owners=facets.owners,
        jumps=lumped.jumps,
    )


def _rounding_length(body: BodyEquilibrium, part: str) -> float:
    """Return the depth of a part in a shape that counts as rounding (length). Collective."""
    thinnest = body.thicknesses[body.connected_components_of(part)].min()
    return float(body.rounded_overlap(thinnest, BY_HAND))


def _from_curve(
    facets: Surface, numbers: NDArray[np.int64], gap: Array, unknown: float
) -> tuple[Array, Array]:
    """Return gaps from the curve through the corners, and their unknown part. Collective."""
    # Gaps at the corners tell the curve too: on a shape of the body's own form they are right
    # although its curvature varies or jumps.
    if not facets.follows:
        return gap, np.full_like(gap, unknown)
    corners = facets.nodes[:, : facets.shape.corners]
    values = facets.owners.values(
        corners.ravel(), lambda asked: gap[np.searchsorted(numbers, asked)]
    )
    nodes, curve = facets.reconstructed(values.reshape(corners.shape))
    curve_gap, weight, unknown_part = curve[np.searchsorted(nodes, numbers)].T
    with np.errstate(invalid="ignore"):
        return np.where(weight > 0, (1 - weight) * gap + weight * curve_gap, gap), unknown_part


@dataclass(frozen=True)
class FoundationPlacement:
    """The contact of a part with a rigid foundation, its nodes chosen in the reference place."""

    body: BodyEquilibrium
    part: str
    facets: Surface  #: of the part, in the reference configuration
    obstacle: Obstacle
    key: str  #: name of the contact in messages
    press: bool  #: whether overlaps in the reference configuration are interferences
    contact: NDArray[np.bool_]  #: which nodes of the part are contact nodes, shape (n,)
    fixed_conducting: NDArray[np.bool_] | None  #: which cannot move but conduct, shape (n,)

    def refuse_unresolved(self) -> None:
        """Refuse a shape that cuts facets between their nodes. Collective."""
        try:
            _refuse_unresolved(self.obstacle, self.facets, _rounding_length(self.body, self.part))
        except InputError as error:
            raise error.within(f"{self.key}.") from None

    def at(self, displacement: Array) -> Geometry:
        """Return the geometry at a displacement of the owned nodes, shape (nodes, d). Collective.

        Nodes that see no foundation there are open: their gap is infinite.
        """
        facets = self.facets.moved(displacement)
        return self.geometry(
            find_candidates(self.body, self.part, facets, self.obstacle, displacement, self.key)
        )

    def geometry(self, candidates: Candidates) -> Geometry:
        """Return the geometry, given all nodes of the part at their place. Collective."""
        body, of = self.body, candidates.nodes[self.contact]
        points = body.space.tabulate_dof_coordinates()[of, : body.dim]
        direction, gap, cut = candidates.direction[self.contact], candidates.gap, 0.0
        if self.obstacle.is_shape and not self.press:
            chord = (candidates.facing > 0) & (gap < 0) & (-gap <= candidates.chord_penetration)
            cut = body.comm.allreduce(float(np.max(-gap[chord], initial=0.0)), op=MPI.MAX)
            gap = np.where(chord, 0.0, gap)
        admissible, projector = contact_directions(direction, body.movable(of))
        nodes = ContactNodes(
            comm=body.comm,
            nodes=of,
            points=points,
            weight=candidates.weight[self.contact],
            normal=direction,
            admissible_normal=admissible,
            tangential_projector=projector,
            gap=candidates.of_jumps(gap)[self.contact],
            deviation=candidates.unknown[self.contact],
            block_size=body.block_size,
            revolved=body.domain.revolved,
            motion=body.global_unknowns.of_foundation(
                candidates.places[self.contact], body.block_size, self.part
            ),
        )
        if self.fixed_conducting is None:
            return Geometry(nodes, candidates.jumps, cut=cut)
        conducting = self.fixed_conducting
        conducting_nodes = candidates.nodes[conducting]
        fixed_conducting = replace(
            nodes,
            nodes=conducting_nodes,
            points=body.space.tabulate_dof_coordinates()[conducting_nodes, : body.dim],
            weight=candidates.weight[conducting],
            normal=candidates.direction[conducting],
            admissible_normal=candidates.direction[conducting],
            tangential_projector=np.zeros((conducting_nodes.size, body.dim, body.dim)),
            gap=candidates.of_jumps(candidates.gap)[conducting],
            deviation=candidates.unknown[conducting],
            motion=None,
        )
        return Geometry(nodes, candidates.jumps, fixed_conducting=fixed_conducting, cut=cut)


def find_nodes(
    body: BodyEquilibrium,
    part: str,
    obstacle: Obstacle,
    key: str = "contact",
    press: bool = False,
    conducts: bool = False,
) -> tuple[FoundationPlacement, Geometry]:
    """Choose the contact nodes of a boundary part in the reference configuration. Collective.

    A node whose contact direction supports hold, or that follows a rigid part, is left out. Where
    they hold it aslant to that, as a plane of symmetry beside an inclined foundation does, it is
    met by the displacements that are free and those that are prescribed; the force along directions
    that are constrained is borne by the supports. Friction acts along the directions of
    `ContactNodes.tangential_projector`.

    With `press` a shape may cut the body in the reference configuration. Where the foundation
    `conducts`, nodes that cannot move carry charge too. The geometry that is returned is that of
    the reference configuration.

    Refuses a part without a contact node on any rank, or without one that sees the foundation;
    nodes without a contact direction, or with a gap that is no number; and foundations that lie
    behind the contact part, or cut the body in the reference configuration.
    """
    comm, facets = body.comm, surface_of(body.domain, body.space, part)
    zero = np.zeros((body.layout.index_map.size_local, body.dim))
    candidates = find_candidates(body, part, facets, obstacle, zero, key)
    if obstacle.is_shape:
        try:
            _refuse_behind(body, obstacle, facets, candidates)
            _refuse_within(body.comm, obstacle, candidates)
            if not press:  # an adaptive run starts on facets that hide the shape
                _refuse_overlap(body, candidates)
                _refuse_unresolved(obstacle, facets, candidates.rounding_length)
        except InputError as error:
            raise error.within(f"{key}.") from None
    else:
        check_gap(body.domain, candidates.gap, key)
    movable = body.movable(candidates.nodes)
    free = np.linalg.norm(np.einsum("nij,nj->ni", movable, candidates.direction), axis=1) > APART
    # A gap is infinite where the contact direction does not lead to the foundation.
    meets = np.isfinite(candidates.of_jumps(candidates.gap))
    if not comm.allreduce(bool(meets.any()), op=MPI.LOR):
        raise InputError(
            f"{key}: from no node of the part {part!r} does the contact direction meet the "
            "foundation; accepted: a shape in front of the part; an axis from the body towards it",
            "foundation-missed",
        )
    bears, acts = candidates.weight > 0, free & meets
    chosen = acts & bears
    if not comm.allreduce(bool(chosen.any()), op=MPI.LOR):
        if comm.allreduce(bool(acts.any()), op=MPI.LOR):
            raise InputError(
                f"{key}.on: of part {part!r} the axis of revolution alone meets the foundation, "
                "where nodes carry no pressure; accepted: a finer mesh there",
                "tip-on-axis",
            )
        raise InputError(
            f"{key}.on: part {part!r} has no node that is free to move towards the foundation",
            "held-part",
        )
    fixed_conducting = None
    if conducts:
        fixed_conducting = ~chosen & body.free[candidates.nodes, -1] & meets & bears
        _check_charged(body, part, candidates.nodes, fixed_conducting, key)
    placement = FoundationPlacement(
        body, part, facets, obstacle, key, press, chosen, fixed_conducting
    )
    return placement, placement.geometry(candidates)


def _check_charged(
    body: BodyEquilibrium,
    part: str,
    nodes: NDArray[np.int32],
    fixed_conducting: NDArray[np.bool_],
    key: str,
) -> None:
    """Refuse charge at nodes of electrodes, or at fixed ones of a moving part. Collective."""
    taken = bool(body.global_unknowns.tied[nodes, -1].any())
    if body.comm.allreduce(taken, op=MPI.LOR):
        raise InputError(
            f"{key}.on: part {part!r}, which carries charge, shares nodes with an "
            "electrode of unknown potential; accepted: parts apart, or an insulated foundation",
            "rigid-part",
        )
    any_charged = body.comm.allreduce(bool(fixed_conducting.any()), op=MPI.LOR)
    if any_charged and body.global_unknowns.foundation(part) is not None:
        raise InputError(
            f"{key}.rigid: supports hold nodes of part {part!r}, which carry charge as "
            "the foundation comes near; accepted: a part that can move everywhere",
            "held-charge",
        )


def _refuse_behind(
    body: BodyEquilibrium, obstacle: Obstacle, facets: Surface, candidates: Candidates
) -> None:
    """Refuse a foundation behind the contact part; all of a disc may be one. Collective."""
    # Where no ray meets the foundation the gap is infinite, and `find_nodes` has its message.
    seen = np.isfinite(candidates.measured)
    best = body.comm.allreduce(np.max(candidates.facing[seen], initial=-np.inf), op=MPI.MAX)
    if np.isfinite(best) and best <= 1e-9:
        # Nodes beside a punch that is within facets see it sideways.
        _refuse_unresolved(obstacle, facets, candidates.rounding_length, facing=False)
        raise InputError(
            "foundation: it lies behind the contact part: the contact direction points "
            "into the body at every node; accepted: a normal towards the body, a shape in front "
            "of it, or inside = true for a body within",
            "behind",
        )


def _refuse_within(comm: MPI.Intracomm, obstacle: Obstacle, candidates: Candidates) -> None:
    """Refuse nodes in a shape from which the contact direction leads on through it. Collective."""
    # It meets a far side, or nothing, and nodes that touch would seem to be open.
    if not isinstance(obstacle, Shape):
        return
    rounding_length, facing = candidates.rounding_length, candidates.facing > 0
    with on_all_ranks(comm), naming("foundation"):
        within = obstacle.distance(candidates.front[facing])[0] < -rounding_length
        within &= candidates.measured[facing] > rounding_length
    count = comm.allreduce(np.count_nonzero(within))
    if count > 0:
        raise InputError(
            f"foundation: {counted(count, 'contact node')} within it, and the contact direction "
            "does not lead back to its surface; accepted: a distance that is positive, or "
            "triangles whose normals point, towards the body, and overlaps less deep than the "
            "shape",
            "inside-out",
        )


def _refuse_overlap(body: BodyEquilibrium, candidates: Candidates) -> None:
    """Refuse nodes in a shape by more than facets deviate from a curve. Collective."""
    # Nodes on straight facets of a curved part may lie in a ball that the facets' corners touch.
    depth = np.where(candidates.facing > 0, -candidates.gap, 0.0)
    cut = body.comm.allreduce(np.max(depth, initial=0.0), op=MPI.MAX)
    if body.comm.allreduce(bool(np.any(depth > candidates.chord_penetration)), op=MPI.LOR):
        raise InputError(
            f"foundation: the undeformed body cuts it, by up to {cut:.3g}; accepted: gaps "
            f">= 0 but for {candidates.rounding_length:.1g} (rounding), and the deviation of "
            'facets from a curve, or overlap = "press"',
            "overlap",
        )


def _refuse_unresolved(
    obstacle: Obstacle, facets: Surface, rounding_length: float, facing: bool = True
) -> None:
    """Refuse shapes that cut facets between their nodes, deeper than at these. Collective.

    `facing`: only where their surface faces that of the body.
    """
    if not isinstance(obstacle, Shape):
        return
    comm, shape = facets.owners.comm, facets.shape
    at = np.concatenate([shape.nodes(2), shape.middle, rule(shape, WITHIN)[0]])
    with on_all_ranks(comm), naming("foundation"):
        near = np.flatnonzero(obstacle.distance(facets.centres)[0] < 2 * facets.radii)
        x = shape.lagrange(facets.order, at) @ facets.points[near]
        distance, outward = obstacle.distance(x.reshape(-1, x.shape[2]))
    facet, reference = np.repeat(near, len(at)), np.tile(at, (near.size, 1))
    normal = facets.normal[facet]
    # No overlap where the facets, or the surfaces that they approximate, have none.
    behind = np.minimum(facets.distance_bounds(facet, reference, normal)[0], 0.0)
    faces = (np.einsum("pd,pd->p", normal, outward) < 0) | (not facing)
    depths = np.where(faces, -distance + 1.1 * behind, 0.0).reshape(near.size, len(at))
    nodes = depths[:, : len(shape.nodes(facets.degree))].max(axis=1)
    deepest = depths.max(axis=1)
    depth = comm.allreduce(float(deepest.max(initial=0.0)), op=MPI.MAX)
    missed = (deepest > depth / 2) & (nodes < RESOLVED * depth)
    if comm.allreduce(bool(missed.any()), op=MPI.LOR) and depth > rounding_length:
        raise InputError(
            f"foundation: it cuts facets of the undeformed body between their nodes, by up to "
            f"{depth:.3g}; accepted: shorter facets there, a shape that is apart or touches",
            "overlap",
        )


def check_gap(domain: Domain, gap: Array, key: str) -> None:
    """Refuse gaps that are no lengths; those below 0 are interferences. Collective."""
    if domain.comm.allreduce(bool(np.any(~(gap > -np.inf))), op=MPI.LOR):
        raise InputError(
            f"{key}: the gap is no number at a node; accepted: lengths, or inf", "negative"
        )
