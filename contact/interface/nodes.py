"""The contact nodes: where the foundation acts on the body.

Multipliers and auxiliary variables live at these nodes, and the products of L2(Gamma_3) are
lumped there. Each rank holds the contact nodes that it owns; sums and norms are global.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.interface.obstacle import Foundation, GapFunction, Plane, Sphere
from contact.mesh.make import Domain
from contact.typing import Array


@dataclass(frozen=True)
class ContactTrace:
    """The contact nodes that this rank owns.

    Attributes
    ----------
    comm
        Communicator of the mesh.
    nodes
        Local node (block) numbers, shape (n,).
    points
        Coordinates, shape (n, d) (length).
    weight
        Integrals of the nodal basis functions over Gamma_3, shape (n,): they reproduce the
        nodal forces of a constant pressure (vertex rule for P1, Simpson's for P2 edges).
    normal
        Contact direction, a unit vector out of the body, shape (n, d).
    tangent
        Projector onto the free tangential directions, shape (n, d, d).
    gap
        Distance to the foundation along the contact direction, shape (n,).
    block_size
        Unknowns a node: d, or d + 1 with the potential.
    cut
        Largest depth in the foundation, at rest, of a node on a straight facet of a curved
        part; the gap of these nodes is 0 (length).
    """

    comm: MPI.Comm
    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array
    tangent: Array
    gap: Array
    block_size: int
    cut: float = 0.0

    @property
    def dim(self) -> int:
        """Dimension d of the displacement."""
        return self.normal.shape[1]

    def values(self, array: Array) -> Array:
        """Return the nodal unknowns, shape (n, block_size), of a local dof array."""
        owned = array[: array.size // self.block_size * self.block_size]
        return owned.reshape(-1, self.block_size)[self.nodes]

    def add(self, array: Array, nodal: Array) -> None:
        """Add nodal vectors of shape (n, d) or (n, block_size) to a local dof array."""
        columns = np.arange(nodal.shape[1])
        array[self.nodes[:, None] * self.block_size + columns] += nodal

    def normal_component(self, u: Array) -> Array:
        """Return u . nu, shape (n,), of vectors of shape (n, >= d)."""
        return np.einsum("ni,ni->n", u[:, : self.dim], self.normal)

    def tangential_component(self, u: Array) -> Array:
        """Return u_tau in the free tangential directions, shape (n, d)."""
        return np.einsum("nij,nj->ni", self.tangent, u[:, : self.dim])

    def sum(self, values: Array) -> float:
        """Return the lumped integral of nodal values over Gamma_3."""
        return float(self.comm.allreduce(np.dot(self.weight, values), op=MPI.SUM))

    def norm(self, values: Array) -> float:
        """Return the lumped L2(Gamma_3) norm of scalars (n,) or vectors (n, d)."""
        squares = values**2 if values.ndim == 1 else np.einsum("ni,ni->n", values, values)
        return float(np.sqrt(self.sum(squares)))

    def maximum(self, values: Array, default: float = 0.0) -> float:
        """Return the largest nodal value over all ranks."""
        return float(self.comm.allreduce(np.max(values, initial=default), op=MPI.MAX))

    @cached_property
    def size(self) -> int:
        """Number of contact nodes over all ranks."""
        return int(self.comm.allreduce(self.nodes.size, op=MPI.SUM))

    def gather(self, values: Array) -> Array:
        """Return the values of all ranks, in rank order, on every rank."""
        return np.concatenate(self.comm.allgather(values))


def _assembled(space: fem.FunctionSpace, form: ufl.Form) -> Array:
    """Return the owned part of an assembled vector, one row a node."""
    vector = fem.assemble_vector(fem.form(form))
    vector.scatter_reverse(InsertMode.add)
    size = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
    return vector.array[:size].reshape(-1, space.dofmap.index_map_bs)


def free_components(space: fem.FunctionSpace, bcs: Sequence[fem.DirichletBC]) -> NDArray[np.bool_]:
    """Return which components of the owned nodes are not fixed, shape (nodes, block size)."""
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    free = np.ones(index_map.size_local * bs, dtype=bool)
    for bc in bcs:
        dofs, owned = bc.dof_indices()
        free[dofs[:owned]] = False
    return free.reshape(-1, bs)


def _prescribed(space: fem.FunctionSpace, bcs: Sequence[fem.DirichletBC]) -> Array:
    """Return the prescribed values of the owned nodes, 0 where free, (nodes, block size)."""
    values = fem.Function(space)
    for bc in bcs:
        bc.set(values.x.array)
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    return values.x.array[: index_map.size_local * bs].reshape(-1, bs)


@dataclass(frozen=True)
class Candidates:
    """The owned nodes of a boundary part, with their areas and the body's normals.

    Attributes
    ----------
    nodes, points, weight, normal
        As in `ContactTrace`, whatever is fixed there.
    """

    nodes: NDArray[np.int32]
    points: Array
    weight: Array
    normal: Array


def candidates(domain: Domain, space: fem.FunctionSpace, part: str) -> Candidates:
    """Collect the nodes of a boundary part whose area is not zero. Collective."""
    d = domain.dim
    v = ufl.TestFunction(space)
    nu = ufl.FacetNormal(domain.mesh)
    ds = domain.ds(part)
    weight = _assembled(space, v[0] * ds)[:, 0]
    normal = _assembled(space, sum(nu[i] * v[i] for i in range(d)) * ds)[:, :d]

    measure = domain.comm.allreduce(weight.sum(), op=MPI.SUM)
    count = domain.comm.allreduce(int(np.count_nonzero(weight)), op=MPI.SUM)
    # Nodes whose basis function has no mean on Gamma_3 (P2 vertices of triangles) carry none.
    nodes = np.flatnonzero(weight > 1e-9 * measure / max(count, 1)).astype(np.int32)
    points = space.tabulate_dof_coordinates()[nodes, :d]
    normal = normal[nodes] / np.linalg.norm(normal[nodes], axis=1)[:, None]
    return Candidates(nodes, points, weight[nodes], normal)


def _corners(space: fem.FunctionSpace) -> NDArray[np.int32]:
    """Return the local nodes at vertices of the mesh."""
    layout, cells = space.dofmap.dof_layout, space.dofmap.list
    corners = [layout.entity_dofs(0, i) for i in range(space.mesh.topology.dim + 1)]
    return np.unique(cells[:, np.concatenate(corners)])


def _chord_depth(domain: Domain, part: str, foundation: Foundation) -> float:
    """Return how deep nodes on straight facets of a curved part may lie in the foundation."""
    facets = domain.facets(part)
    longest = np.max(domain.mesh.h(domain.dim - 1, facets), initial=0.0) if facets.size else 0.0
    length = 2**domain.levels * float(domain.comm.allreduce(longest, op=MPI.MAX))
    if isinstance(foundation, Sphere):
        # The contact direction may be the body's, a little aside.
        return 1.1 * foundation.chord_depth(length)
    return 0.0 if isinstance(foundation, Plane) else 1e-3 * domain.size


def _place(
    domain: Domain,
    space: fem.FunctionSpace,
    contact: tuple[str, Foundation],
    found: Candidates,
    direction: Array,
    gap: Array,
) -> tuple[Array, float]:
    """Refuse a foundation behind the contact part, or one that the body cuts at rest.

    Nodes that face away are not looked at: all of a disc may be the contact part. Nodes on
    straight facets of a curved part may lie in a ball that the facets' corners touch: they
    would be on its surface if the facets were curved, and their gap is 0.

    Returns
    -------
    The gap, and the largest depth that was taken for 0.
    """
    facing = np.einsum("ni,ni->n", direction, found.normal)
    # Where no ray meets the foundation the gap is infinite, and `build_trace` has its message.
    seen = np.isfinite(gap)
    best = domain.comm.allreduce(np.max(facing[seen], initial=-np.inf), op=MPI.MAX)
    if np.isfinite(best) and best <= 1e-9:
        raise InputError(
            "contact.foundation: it lies behind the contact part: the contact direction points "
            "into the body at every node; accepted: a normal towards the body, a sphere in front "
            "of it, or inside = true for a body within"
        )
    rounding = 1e-5 * domain.size  # that of mesh files
    tolerance = np.full_like(gap, rounding)
    chord = max(rounding, _chord_depth(domain, *contact))
    if domain.levels > 0:
        tolerance[:] = chord
    elif space.ufl_element().embedded_superdegree > 1:
        tolerance[~np.isin(found.nodes, _corners(space))] = chord
    depth = np.where(facing > 0, -gap, 0.0)
    cut = domain.comm.allreduce(np.max(depth, initial=0.0), op=MPI.MAX)
    if domain.comm.allreduce(bool(np.any(depth > tolerance)), op=MPI.LOR):
        raise InputError(
            f"contact.foundation: the body cuts it at rest, by up to {cut:.3g}; accepted: gaps "
            f">= 0 but for {rounding:.1g} (rounding), and what straight facets take off a curve"
        )
    return np.where(facing > 0, np.maximum(gap, 0.0), gap), float(cut)


def build_trace(
    domain: Domain,
    space: fem.FunctionSpace,
    bcs: Sequence[fem.DirichletBC],
    part: str,
    foundation: Foundation,
) -> ContactTrace:
    """Collect the contact nodes of a boundary part.

    A node whose contact direction is fixed by a Dirichlet condition is left out; a fixed
    tangential component is removed from its tangent projector. On a symmetry line the
    direction is turned into the free components, and what the fixed ones contribute to
    u_nu is taken off the gap.

    Raises
    ------
    InputError
        If no contact node is left on any rank, one has no contact direction, or the foundation
        lies behind the contact part or cuts the body at rest.
    """
    d = domain.dim
    found = candidates(domain, space, part)
    nodes, points, weight = found.nodes, found.points, found.weight
    direction, gap = foundation.measure(points, found.normal)
    if domain.comm.allreduce(bool(np.isnan(direction).any()), op=MPI.LOR):
        raise InputError(
            "contact.foundation: a contact node has no contact direction "
            "(it is the sphere's centre)"
        )
    cut = 0.0
    if not isinstance(foundation, GapFunction):  # whose values are what was asked for
        gap, cut = _place(domain, space, (part, foundation), found, direction, gap)

    free = free_components(space, bcs)[nodes, :d]
    gap = gap - np.einsum("ni,ni->n", direction, _prescribed(space, bcs)[nodes, :d])
    admissible = direction * free
    length = np.linalg.norm(admissible, axis=1)
    # A gap is infinite where the body's normal does not lead to the foundation.
    keep = (length > 0.5) & np.isfinite(gap)
    nodes, points, weight = nodes[keep], points[keep], weight[keep]
    gap, free = gap[keep], free[keep]
    direction = admissible[keep] / length[keep, None]
    gap = gap / length[keep]
    tangent = -direction[:, :, None] * direction[:, None, :]
    tangent[:, np.arange(d), np.arange(d)] += free
    trace = ContactTrace(
        domain.comm,
        nodes,
        points,
        weight,
        direction,
        tangent,
        gap,
        space.dofmap.index_map_bs,
        cut if cut > 1e-5 * domain.size else 0.0,
    )
    if trace.size == 0:
        raise InputError(
            f"contact.on: part {part!r} has no node that is free to move towards the foundation"
        )
    return trace
