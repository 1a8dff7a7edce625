"""Contact nodes in front of a rigid foundation: the nodes of a part, their directions and gaps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.arguments import naming
from contact.body.equilibrium import BodyEquilibrium
from contact.body.rollers import APART
from contact.errors import InputError, counted
from contact.interface.mortar.lumping import Lumping, Mixing
from contact.interface.mortar.surface import Surface, surface_of
from contact.interface.nodes import ContactNodes, contact_directions
from contact.mesh.domain import Domain
from contact.mesh.entities import owned_among
from contact.mesh.owners import Owners
from contact.model.obstacle import Obstacle, Shape
from contact.model.obstacle.protocol import measured
from contact.ranks import on_all_ranks
from contact.typing import Array

#: Depth in a shape, over the size of the mesh, that is taken for rounding: its numbers are written
#: by hand, with fewer digits than positions in files.
ROUNDED = 1e-5


@dataclass(frozen=True)
class Candidates:
    """The owned nodes of a boundary part, with their areas and the body's normals.

    Attributes
    ----------
    numbers
        Global numbers of the nodes, ascending, shape (n,).
    nodes, points, weight, normal
        As in `ContactNodes`, whatever is fixed there.
    surface
        Points of the curved surface in front of the nodes, shape (n, d) (length): nodes in the
        middle of straight edges are on chords, and gaps to a shape are measured from the surface.
    explained
        Depth of the nodes, shape (n,) (length), in a shape that the curved surface, or the straight
        facets, touch.
    unknown
        The part of it that gaps do not have; none at degree 1, whose nodes are on the surface.
    owners
        The owners of the nodes.
    mixing
        The jumps, where these are no nodal values.
    facets
        The facets of the part, as far as this rank owns them.
    """

    numbers: NDArray[np.int64]
    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array
    surface: Array
    explained: Array
    unknown: float
    owners: Owners
    mixing: Mixing | None
    facets: Surface

    def jumps(self, values: Array) -> Array:
        """Return the jumps of values at these nodes, shape (n, m). Collective."""
        if self.mixing is None:
            return values
        return self.mixing.apply(self.owners, values)

    def in_front_of(self, obstacle: Obstacle) -> Array:
        """Return the points from which gaps are measured: given gaps are those of the nodes."""
        return self.surface if obstacle.is_shape else self.points

    def to_curve(self, gap: Array) -> tuple[Array, Array]:
        """Return gaps to a shape from the curve through the corners, and how far they are unknown.

        Collective. In the middle of straight edges gaps at the corners tell that too: where a body
        lies on a shape of its own form, they are right although its curvature varies or jumps.
        """
        if not self.facets.follows:
            return gap, np.full_like(gap, self.unknown)
        corners = self.facets.nodes[:, : self.facets.shape.corners]
        values = self.owners.values(
            corners.ravel(), lambda given: gap[np.searchsorted(self.numbers, given)]
        )
        own, found = self.facets.told_by(values.reshape(corners.shape))
        told, weight, unknown = found[np.searchsorted(own, self.numbers)].T
        with np.errstate(invalid="ignore"):
            return np.where(weight > 0, (1 - weight) * gap + weight * told, gap), unknown

    def along(self, direction: Array, gap: Array) -> Array:
        """Return the gaps of the jumps, given directions and gaps at the nodes. Collective.

        Next to infinite gaps these are no numbers.
        """
        if self.mixing is None:
            return gap
        with np.errstate(invalid="ignore"):
            mixed = self.jumps(gap[:, None] * direction)
            return np.asarray(np.einsum("nd,nd->n", direction, mixed))


def candidates(domain: Domain, space: fem.FunctionSpace, part: str) -> Candidates:
    """Collect the nodes of a boundary part; those of no area carry no multiplier. Collective."""
    comm, facets = domain.comm, surface_of(domain, space, part)
    lumped = Lumping.of(facets).without_axis(facets)
    # Functions without a mean on Gamma_3 carry nothing: P2 vertices on the axis of revolution.
    size = np.array([lumped.weight.sum(), lumped.weight.size])
    area, count = comm.allreduce(size, op=MPI.SUM)
    light = lumped.weight <= 1e-9 * area / max(count, 1)
    _, nodes = owned_among(space.dofmap.index_map, lumped.nodes)
    normal = lumped.normal
    points = space.tabulate_dof_coordinates()[nodes, : domain.dim]
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    exact = facets.degree == 1 and not facets.refined
    known = np.einsum("nd,nd->n", lumped.deviation, normal)
    explained = np.maximum(known, known - lumped.least)
    if facets.refined and facets.order == 1:
        # The last edges of a part are halves of one chord, which tell nothing of the curve.
        most = comm.allreduce(float(explained.max(initial=0.0)), op=MPI.MAX)
        explained = np.full_like(explained, most)
    return Candidates(
        lumped.nodes,
        nodes,
        points,
        np.where(light, 0.0, lumped.weight),
        normal,
        points + lumped.deviation,
        explained,
        comm.allreduce(0.0 if exact else facets.unknown_deviation, op=MPI.MAX),
        facets.owners,
        lumped.mixing,
        facets,
    )


def _place(
    domain: Domain,
    obstacle: Obstacle,
    found: Candidates,
    direction: Array,
    gap: Array,
    press: bool,
) -> tuple[Array, Array, float]:
    """Refuse a foundation behind or around the contact part, or one that the body cuts already.

    Nodes that face away are not looked at: all of a disc may be the contact part. Nodes on
    straight facets of a curved part may lie in a ball that the facets' corners touch, by the
    deviation of the curve from the facets at this node, and their gap is 0. Where the foundation
    is to press on the body from the beginning, gaps are left as they are.

    Returns
    -------
    The gap from the curve and the part of it that is unknown, as of `Candidates.to_curve`, and the
    largest depth that was taken for 0.
    """
    facing = np.einsum("ni,ni->n", direction, found.normal)
    # Where no ray meets the foundation the gap is infinite, and `find_nodes` has its message.
    seen = np.isfinite(gap)
    best = domain.comm.allreduce(np.max(facing[seen], initial=-np.inf), op=MPI.MAX)
    if np.isfinite(best) and best <= 1e-9:
        raise InputError(
            "foundation: it lies behind the contact part: the contact direction points "
            "into the body at every node; accepted: a normal towards the body, a shape in front "
            "of it, or inside = true for a body within",
            "behind",
        )
    rounding = ROUNDED * domain.size
    _refuse_within(domain, obstacle, found.surface[facing > 0], gap[facing > 0], rounding)
    gap, unknown = found.to_curve(gap)
    if press:
        return gap, unknown, 0.0
    depth = np.where(facing > 0, -gap, 0.0)
    # The contact direction may be the body's, a little aside.
    tolerance = rounding + 1.1 * found.explained
    cut = domain.comm.allreduce(np.max(depth, initial=0.0), op=MPI.MAX)
    if domain.comm.allreduce(bool(np.any(depth > tolerance)), op=MPI.LOR):
        raise InputError(
            f"foundation: the undeformed body cuts it, by up to {cut:.3g}; accepted: gaps "
            f">= 0 but for {rounding:.1g} (rounding), and the deviation of straight facets from a "
            'curve, or overlap = "press"',
            "overlap",
        )
    return np.where(facing > 0, np.maximum(gap, 0.0), gap), unknown, float(cut)


def _refuse_within(
    domain: Domain, obstacle: Obstacle, points: Array, gap: Array, rounding: float
) -> None:
    """Refuse nodes in a shape from which the contact direction leads on through it. Collective.

    It then meets a far side, or nothing, and nodes that touch would seem to be free.
    """
    if not isinstance(obstacle, Shape):
        return
    with on_all_ranks(domain.comm), naming("foundation"):
        within = (obstacle.distance(points)[0] < -rounding) & (gap > rounding)
    count = domain.comm.allreduce(np.count_nonzero(within))
    if count > 0:
        raise InputError(
            f"foundation: {counted(count, 'contact node')} within it, and the contact direction "
            "does not lead back to its surface; accepted: a distance that is positive, or "
            "triangles whose normals point, towards the body, and overlaps less deep than the "
            "shape",
            "inside-out",
        )


def check_gap(domain: Domain, gap: Array, key: str) -> None:
    """Refuse gaps that are no lengths; those below 0 are interferences. Collective."""
    if domain.comm.allreduce(bool(np.any(~(gap > -np.inf))), op=MPI.LOR):
        raise InputError(
            f"{key}: the gap is no number at a node; accepted: lengths, or inf", "negative"
        )


def find_nodes(
    body: BodyEquilibrium,
    part: str,
    obstacle: Obstacle,
    key: str = "contact",
    press: bool = False,
) -> tuple[ContactNodes, Candidates]:
    """Collect the contact nodes of a boundary part, and all of its nodes. Collective.

    A node whose contact direction supports hold, or that follows a rigid part, is left out. Where
    they hold it aslant to that, as a plane of symmetry beside an inclined foundation does, it is
    met by the displacements that are free and those that are prescribed; the force along directions
    that are held is borne by the supports. Friction acts along the directions of
    `ContactNodes.tangent`.

    Parameters
    ----------
    body, part, obstacle
        Whose nodes, and the obstacle in front of them.
    key
        Name of the contact in messages.
    press
        Whether a shape may cut the body in the reference configuration.

    Raises
    ------
    InputError
        If no contact node is left on any rank, none sees the foundation, one has no contact
        direction or a gap that is no number, or the foundation lies behind the contact part or
        cuts the body in the reference configuration.
    """
    domain, space = body.domain, body.space
    found = candidates(domain, space, part)
    nodes, points, weight = found.nodes, found.points, found.weight
    front = found.in_front_of(obstacle)
    direction, gap = measured(obstacle, front, found.normal, domain.comm, key)
    if domain.comm.allreduce(bool(np.isnan(direction).any()), op=MPI.LOR):
        raise InputError(
            f"{key}.foundation: a contact node has no contact direction (it is the sphere's "
            "centre, on the axis of a cylinder, or where a formula has no value or no slope)",
            "contact-direction",
        )
    unknown, cut = np.zeros_like(gap), 0.0
    if obstacle.is_shape:
        check_gap(domain, gap, f"{key}.foundation: {type(obstacle).__name__}")
        try:
            gap, unknown, cut = _place(domain, obstacle, found, direction, gap, press)
        except InputError as error:
            raise error.within(f"{key}.") from None
    else:
        check_gap(domain, gap, key)
    gap = found.along(direction, gap)
    movable = body.movable(nodes)
    free = np.linalg.norm(np.einsum("nij,nj->ni", movable, direction), axis=1)
    # A gap is infinite where the contact direction does not lead to the foundation.
    meets = np.isfinite(gap)
    if not domain.comm.allreduce(bool(meets.any()), op=MPI.LOR):
        raise InputError(
            f"{key}: from no node of the part {part!r} does the contact direction meet the "
            "foundation; accepted: a shape in front of the part; an axis from the body towards it",
            "foundation-missed",
        )
    keep = (free > APART) & meets & (weight > 0)
    nodes, points, direction = nodes[keep], points[keep], direction[keep]
    jump = ContactNodes(
        domain.comm,
        nodes,
        points,
        weight[keep],
        direction,
        *contact_directions(direction, movable[keep]),
        gap[keep],
        unknown[keep],
        space.dofmap.index_map_bs,
        cut if cut > ROUNDED * domain.size else 0.0,
        domain.revolved,
        body.global_unknowns.of_foundation(points, body.block_size, part),
    )
    if jump.size == 0:
        bare = domain.comm.allreduce(bool(((free > APART) & meets).any()), op=MPI.LOR)
        if bare:
            raise InputError(
                f"{key}.on: of part {part!r} the axis of revolution alone meets the foundation, "
                "where nodes carry no pressure; accepted: a finer mesh there",
                "tip-on-axis",
            )
        raise InputError(
            f"{key}.on: part {part!r} has no node that is free to move towards the foundation",
            "held-part",
        )
    return jump, found


def held_nodes(
    found: Candidates, obstacle: Obstacle, free: NDArray[np.bool_], jump: ContactNodes
) -> ContactNodes:
    """Return the nodes of Gamma_3 that cannot move but whose potential is free.

    They carry no contact force, but let the current through like others: without them their share
    of Gamma_3 would be missing.

    Parameters
    ----------
    found, obstacle
        All owned nodes of Gamma_3, and the obstacle in front of them.
    free
        Which components of the owned nodes are not fixed, shape (nodes, block size).
    jump
        The contact nodes.
    """
    direction, gap = obstacle.measure(found.in_front_of(obstacle), found.normal)
    unknown = np.zeros_like(gap)
    if obstacle.is_shape:
        gap, unknown = found.to_curve(gap)
    gap = found.along(direction, gap)
    keep = ~np.isin(found.nodes, jump.nodes) & free[found.nodes, -1] & np.isfinite(gap)
    keep &= found.weight > 0
    return replace(
        jump,
        nodes=found.nodes[keep],
        points=found.points[keep],
        weight=found.weight[keep],
        normal=direction[keep],
        lift=direction[keep],
        tangent=np.zeros((np.count_nonzero(keep), jump.dim, jump.dim)),
        gap=gap[keep],
        deviation=unknown[keep],
        motion=None,
    )
