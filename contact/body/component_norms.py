"""Norms of forces and charges, by connected component of the mesh.

Forces and charges have no common unit, and separate bodies no common scale: beside the loads of
another body any error of one may be small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.global_unknowns import GlobalUnknowns
from contact.linear.petsc import Subsystems
from contact.mesh.domain import Domain
from contact.mesh.entities import component_sums, graph_components
from contact.ranks import summed
from contact.typing import Array


@dataclass(frozen=True)
class ComponentNorms:
    """Norms of the forces, and of the charges, of each of k connected components.

    A plate, a foundation or an electrode that is free to move joins components to one; contact does
    not.

    Attributes
    ----------
    comm
        Communicator.
    component, behind
        The component of each owned node, shape (nodes,), and of each global unknown, shape (m,).
    count
        Number k of components.
    block_size, dim
        Unknowns a node, and number of displacements among them.
    global_mechanical
        Mask of motions among the global unknowns, shape (m,).
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
        """Mask of displacements, or forces, among owned values with the global ones behind."""
        nodal = np.tile(np.arange(self.block_size) < self.dim, self.component.size)
        return np.concatenate([nodal, self.global_mechanical])

    def at(self, nodes: NDArray[np.int32]) -> ComponentNorms:
        """Return the norms of some owned nodes alone."""
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
        """Return the norms of forces, and of charges if any, shape (1 or 2, k). Collective."""
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
        """Return for each owned value the norm of its kind and component."""
        component = np.concatenate([np.repeat(self.component, self.block_size), self.behind])
        return np.where(self.mechanical, norms[0, component], norms[-1, component])


def component_norms_of(
    domain: Domain,
    space: fem.FunctionSpace,
    global_unknowns: GlobalUnknowns,
    components: tuple[NDArray[np.int32], int],
) -> ComponentNorms:
    """Return the norms of a body of given connected components. Collective."""
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
        # A part with a given motion has reactions of its own, and joins nothing.
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
