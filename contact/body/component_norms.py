"""The norms of forces that are compared with each other, and with no others.

Forces and charges have no common unit. And bodies that nothing connects have none in common:
beside the loads of another component of the mesh any error of one may be small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.global_unknowns import GlobalUnknowns
from contact.linear.refinement import Subsystems
from contact.mesh.domain import Domain
from contact.mesh.entities import component_sums, graph_components
from contact.ranks import summed
from contact.typing import Array


@dataclass(frozen=True)
class ComponentNorms:
    """The forces, and the charges, of each of k connected components.

    Components count as one where something that moves freely joins them: a plate, a foundation,
    or an electrode. Those that touch each other are not: contact forces act on both.

    Attributes
    ----------
    comm
        Communicator.
    component
        The component of each owned node, shape (nodes,).
    behind
        That of each global unknown, shape (m,).
    count
        How many components there are.
    block_size, dim
        Unknowns a node, and how many of them are displacements.
    global_mechanical
        Which of the global unknowns are motions, shape (m,).
    """

    comm: MPI.Intracomm
    component: NDArray[np.intp]
    behind: NDArray[np.intp]
    count: int
    block_size: int
    dim: int
    global_mechanical: NDArray[np.bool_]

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Which of owned values, global ones behind them, are displacements or forces."""
        nodal = np.tile(np.arange(self.block_size) < self.dim, self.component.size)
        return np.concatenate([nodal, self.global_mechanical])

    def at(self, nodes: NDArray[np.int32]) -> ComponentNorms:
        """Return those of some owned nodes alone."""
        none = np.zeros(0, dtype=np.intp)
        component = self.component[nodes]
        return ComponentNorms(
            self.comm, component, none, self.count, self.block_size, self.dim, none.astype(bool)
        )

    @property
    def apart(self) -> Subsystems | None:
        """Connected components as uncoupled subsystems; None for one."""
        of = np.repeat(self.component, self.block_size)
        return Subsystems(self.comm, of, self.count) if self.count > 1 else None

    def norms(self, values: Array) -> Array:
        """Return the Euclidean norms of owned values, by field and component. Collective.

        Returns
        -------
        Shape (1, k), or (2, k) where there is a potential: of forces, and of charges.
        """
        if self.block_size == self.dim:
            return self._by_component(values)[None]
        chosen = self.mechanical
        return np.stack(
            [self._by_component(np.where(part, values, 0.0)) for part in (chosen, ~chosen)]
        )

    def _by_component(self, values: Array) -> Array:
        owned = values.size - self.behind.size
        own, other = values[:owned], values[owned:]
        if self.count == 1:
            square = summed(self.comm, np.dot(own, own)) + np.dot(other, other)
            return np.array([np.sqrt(square)])
        component = np.repeat(self.component, self.block_size)
        squares = component_sums(self.comm, component, own**2, self.count)
        return np.sqrt(squares + np.bincount(self.behind, other**2, minlength=self.count))

    def spread(self, norms: Array) -> Array:
        """Return for each owned value the norm that it is compared with."""
        component = np.concatenate([np.repeat(self.component, self.block_size), self.behind])
        return np.where(self.mechanical, norms[0, component], norms[-1, component])


def component_norms_of(
    domain: Domain,
    space: fem.FunctionSpace,
    global_unknowns: GlobalUnknowns,
    components: tuple[NDArray[np.int32], int],
) -> ComponentNorms:
    """Return which forces of a body of given components are compared. Collective."""
    (component, count), members, d = components, global_unknowns.members, domain.dim
    if count > 1 and members:
        touched = np.zeros((len(members), count), dtype=np.intc)
        for member, at in zip(members, touched, strict=True):
            if member.free.any():
                facets = domain.facets_anywhere(member.description.on)
                nodes = fem.locate_dofs_topological(space, d - 1, facets)
                at[component[nodes[nodes < component.size]]] = 1
        domain.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
        member_of, piece_of = np.nonzero(touched)
        # A part whose motion is given joins nothing: forces of its own hold it there.
        count, label = graph_components(member_of, len(members) + piece_of, len(members) + count)
        component, of_members = label[len(members) + component], label[: len(members)]
    else:
        of_members = np.zeros(len(members), dtype=np.intp)
    behind = np.repeat(of_members, [member.free.size for member in members]).astype(np.intp)
    block_size = space.dofmap.index_map_bs
    return ComponentNorms(
        domain.comm,
        component.astype(np.intp),
        behind,
        count,
        block_size,
        d,
        global_unknowns.mechanical,
    )
