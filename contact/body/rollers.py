"""Rollers: prescribed displacements along the normal of a part, which no axis need be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from dolfinx.la import InsertMode
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.body.description import Body, Field
from contact.body.fields import Amplitude, Moving, values_at
from contact.errors import InputError
from contact.linear.layout import Inclined
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import cells_at
from contact.mesh.geometry import across, jacobians
from contact.typing import Array

#: Least cosine of the angle between the normals of a node and of a facet there. More is an edge.
SMOOTH = 0.8

#: Least sine of the angle between two normals of a node that hold it in two directions.
APART = 0.2


@dataclass(frozen=True)
class Roller:
    """The displacement of a part along its normal, as a function of time.

    Attributes
    ----------
    number
        Which of the body's `fixed` it is.
    nodes, points, normal
        Owned nodes, their coordinates (length) and unit normals, shapes (n,) and (n, d).
    along
        The part of the normal along which nothing else holds the node, of length 1, shape (n, d).
    field, amplitude
        The prescribed function and its factor as a function of time.
    comm
        The ranks that ask together.
    """

    number: int
    nodes: NDArray[np.int32]
    points: Array
    normal: Array
    along: Array
    field: Field | Moving
    amplitude: Amplitude
    comm: MPI.Intracomm

    def set(self, nodal: Array, time: float) -> None:
        """Put the displacement at a time into nodal unknowns, (nodes, >= d). Collective.

        Components that other supports hold at the nodes remain.
        """
        name, d = f"fixed.{self.number}.normal", self.normal.shape[1]
        given = self.amplitude(time) * values_at(self.field, self.points, time, name, self.comm)
        missing = given - np.einsum("ni,ni->n", self.normal, nodal[self.nodes, :d])
        share = np.einsum("ni,ni->n", self.normal, self.along)
        nodal[self.nodes, :d] += self.along * (missing / share)[:, None]


def nodal_normals(
    domain: Domain, space: fem.FunctionSpace, part: str
) -> tuple[NDArray[np.int32], Array, float]:
    """Return the owned nodes of a part and their normals, means over facets. Collective.

    Returns
    -------
    The nodes, shape (n,); unit normals out of the body, shape (n, d); and the least cosine of their
    angles to those of facets.
    """
    mesh, d, facets = domain.mesh, domain.dim, domain.facets(part)
    cells, place = cells_at(mesh, facets)
    degree, shape = space.ufl_element().embedded_superdegree, shape_of(mesh)
    nodes = np.take_along_axis(space.dofmap.list[cells], shape.facet_nodes(degree)[place], axis=1)
    x = mesh.geometry.x[_compat.geometry_dofmap(mesh)[cells]][:, :, :d]
    corners = shape.facet_nodes(domain.order)[place]
    points = np.take_along_axis(x, corners[:, :, None], axis=1)
    normal = across(jacobians(shape.facet, points, shape.facet.nodes(degree)))
    away = points.mean(axis=1) - x.mean(axis=1)
    normal = normal * np.sign(np.einsum("fqd,fd->fq", normal, away))[..., None]
    normal = np.broadcast_to(normal, (*nodes.shape, d))
    total = la.vector(space.dofmap.index_map, d)
    sums = total.array.reshape(-1, d)
    np.add.at(sums, nodes, normal)
    total.scatter_reverse(InsertMode.add)
    total.scatter_forward()
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    mean = np.divide(sums, length, out=np.zeros_like(sums), where=length > 0)
    own = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    cosine = np.einsum("fqd,fqd->fq", own, mean[nodes]).min(initial=1.0)
    least = domain.comm.allreduce(float(cosine), op=MPI.MIN)
    domain.mesh.topology.create_connectivity(d - 1, d)
    found = fem.locate_dofs_topological(space, d - 1, facets)
    found = found[found < space.dofmap.index_map.size_local]
    return found, mean[found], least


def rollers_of(
    domain: Domain, space: fem.FunctionSpace, body: Body, unsupported: NDArray[np.bool_]
) -> tuple[list[Roller], Inclined | None]:
    """Return the rollers of a body, and the directions that they hold. Collective.

    Parameters
    ----------
    domain, space, body
        Mesh, space of the unknowns, and the body as it is described.
    unsupported
        Which unknowns of the owned nodes no other support holds, shape (nodes, block size).

    Returns
    -------
    The rollers; and their directions, None where there are no rollers.

    Raises
    ------
    InputError
        If a part is missing, or has an edge.
    """
    chosen = [(i, fixed) for i, fixed in enumerate(body.fixed) if fixed.normal is not None]
    if not chosen:
        return [], None
    d, size = domain.dim, unsupported.shape[1]
    held = np.zeros((len(unsupported), size, size))
    rollers = []
    for number, fixed in chosen:
        assert fixed.normal is not None
        nodes, normal, least = nodal_normals(domain, space, fixed.on)
        if least < SMOOTH:
            raise InputError(
                f"fixed.{number}.normal: {fixed.on} has an edge, where it has no normal; accepted: "
                "a smooth part; each face of an edge as a part and an entry of its own"
            )
        free = normal * unsupported[nodes, :d]
        free -= np.einsum("nij,nj->ni", held[nodes, :d, :d], free)
        length = np.linalg.norm(free, axis=1)
        keep = length > APART
        nodes, along = nodes[keep], free[keep] / length[keep, None]
        held[nodes, :d, :d] += along[:, :, None] * along[:, None, :]
        points = space.tabulate_dof_coordinates()[nodes, :d]
        given = fixed.normal, fixed.factor, domain.comm
        rollers.append(Roller(number, nodes, points, normal[keep], along, *given))
    nodes = np.unique(np.concatenate([roller.nodes for roller in rollers])).astype(np.int32)
    return rollers, Inclined(nodes, held[nodes])


def directions_of(rollers: Sequence[Roller], number: int, nodes: NDArray[np.int32]) -> Array:
    """Return the projectors onto the directions of a support along its normal, (n, d, d).

    Parameters
    ----------
    rollers
        Those of the body.
    number
        Which of the body's `fixed`.
    nodes
        At which of the owned nodes.
    """
    for roller in rollers:
        if roller.number == number:
            _, at, own = np.intersect1d(nodes, roller.nodes, return_indices=True)
            found = np.zeros((nodes.size, *2 * roller.along.shape[1:]))
            found[at] = np.einsum("ni,nj->nij", roller.along[own], roller.along[own])
            return found
    raise ValueError(f"fixed.{number} is no roller")
