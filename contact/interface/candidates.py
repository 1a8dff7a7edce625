"""The owned nodes of a boundary part that may touch something."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.mortar.lumping import Lumping, Mixing
from contact.interface.mortar.surface import surface_of
from contact.interface.obstacle import Obstacle
from contact.mesh.domain import Domain
from contact.mesh.entities import owned_among
from contact.typing import Array


@dataclass(frozen=True)
class Candidates:
    """The owned nodes of a boundary part, with their areas and the body's normals.

    Attributes
    ----------
    comm
        Communicator.
    nodes, points, weight, normal
        As in `ContactNodes`, whatever is fixed there.
    surface
        Points of the curved surface in front of the nodes, shape (n, d) (length): nodes in the
        middle of straight edges are on chords, and gaps to a shape are measured from the surface.
    deviation
        As in `ContactNodes`, in front of a shape.
    numbers
        Global numbers of the nodes, shape (n,).
    mixing
        The jumps, where these are no nodal values.
    """

    comm: MPI.Intracomm
    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array
    surface: Array
    deviation: float
    numbers: NDArray[np.int64]
    mixing: Mixing | None

    def jumps(self, values: Array) -> Array:
        """Return the jumps of values at these nodes, shape (n, m). Collective."""
        if self.mixing is None:
            return values
        return self.mixing.apply(self.comm, self.numbers, values)

    def measure(self, obstacle: Obstacle) -> tuple[Array, Array]:
        """Return the contact directions and the gaps of nodes, before anything is mixed."""
        return obstacle.measure(self.in_front_of(obstacle), self.normal)

    def in_front_of(self, obstacle: Obstacle) -> Array:
        """Return the points from which gaps are measured: given gaps are those of the nodes."""
        return self.surface if obstacle.is_shape else self.points

    def gaps(self, direction: Array, gap: Array) -> Array:
        """Return the gaps of the jumps, (n,); next to infinite ones no numbers. Collective."""
        if self.mixing is None:
            return gap
        with np.errstate(invalid="ignore"):
            mixed = self.jumps(gap[:, None] * direction)
            return np.asarray(np.einsum("nd,nd->n", direction, mixed))


def candidates(domain: Domain, space: fem.FunctionSpace, part: str) -> Candidates:
    """Collect the nodes of a boundary part whose area is not zero. Collective."""
    facets = surface_of(domain, space, part).gathered(domain.comm)
    lumped = Lumping.of(facets)
    # Vertices are on the curved surface, unless they are in the middle of refined edges.
    deviation = facets.unknown_deviation(domain.levels) if domain.levels > 0 else 0.0
    # Nodes whose function has no mean on Gamma_3 carry none: P2 vertices of edges where they meet
    # the axis of a body of revolution.
    heavy = lumped.weight > 1e-9 * lumped.weight.sum() / max(lumped.weight.size, 1)
    here, nodes = owned_among(space.dofmap.index_map, lumped.nodes)
    here, nodes = here[heavy[here]], nodes[heavy[here]]
    numbers, normal = lumped.nodes[here], lumped.normal[here]
    points = space.tabulate_dof_coordinates()[nodes, : domain.dim]
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    weight, surface = lumped.weight[here], points + lumped.deviation[here]
    return Candidates(
        domain.comm,
        nodes,
        points,
        weight,
        normal,
        surface,
        deviation,
        numbers,
        lumped.mixing,
    )
