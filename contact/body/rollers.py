"""Rollers: prescribed displacements along the normal of a part, in any direction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, la
from dolfinx.la import InsertMode
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.description import Body
from contact.errors import InputError
from contact.linear.layout import Inclined
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain
from contact.mesh.geometry import facet_normals
from contact.model.fields import Amplitude, Field, Moving, values_at
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Least cosine of the angle between the normals of a node and of a facet there. More is an edge.
SMOOTH = 0.8

#: Least singular value of the normals of a node that count as independent: the sine of the angle
#: between one normal and the span of the others.
APART = 0.2


@dataclass(frozen=True)
class Roller:
    """The displacement of a part along its normal, as a function of time.

    Attributes
    ----------
    number
        Index among the body's `fixed`.
    nodes, points, normal
        Owned nodes, their coordinates (length) and unit normals, shapes (n,) and (n, d).
    lift
        Displacement of the nodes by a unit along the normal, in directions free of other supports,
        shape (n, d).
    slack
        Relative error allowed where other supports constrain the nodes already, shape (n,).
    field, amplitude
        The prescribed function and its factor as a function of time.
    comm
        Communicator.
    """

    number: int
    nodes: NDArray[np.int32]
    points: Array
    normal: Array
    lift: Array
    slack: Array
    field: Field | Moving
    amplitude: Amplitude
    comm: MPI.Intracomm

    def given(self, time: float) -> Array:
        """Return the displacements along the normal at a time, shape (n,). Collective."""
        name = f"fixed.{self.number}.normal"
        return self.amplitude(time) * values_at(self.field, self.points, time, name, self.comm)

    def along(self, nodal: Array) -> Array:
        """Return the normal displacements of nodal unknowns, (nodes, >= d), shape (n,)."""
        d = self.normal.shape[1]
        return np.asarray(np.einsum("ni,ni->n", self.normal, nodal[self.nodes, :d]))


def nodal_normals(
    domain: Domain, space: fem.FunctionSpace, part: str
) -> tuple[NDArray[np.int32], Array, float]:
    """Return owned nodes of a part, their mean unit normals, and the least cosine to facets'."""
    d, facets = domain.dim, domain.facets(part)
    degree, shape = space.ufl_element().embedded_superdegree, shape_of(domain.mesh)
    cells, place, normal = facet_normals(domain, part, degree)
    nodes = np.take_along_axis(space.dofmap.list[cells], shape.facet_nodes(degree)[place], axis=1)
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


class Rollers:
    """The rollers of a body, which constrain shared nodes together.

    At a node with normals n_i, and A their parts along components without other supports, the
    displacement is that of least squares, by A's pseudo-inverse. The forces are its transpose:
    each roller bears a force along its own normal, of dependent normals the least.
    The order of rollers has no effect. Collective to make.

    Parameters
    ----------
    domain, space, body
        Mesh, space of the unknowns, and description of the body.
    unsupported
        Mask of the owned nodal unknowns without other supports, shape (nodes, block size).

    Attributes
    ----------
    each
        The rollers.
    inclined
        Their constrained directions; None without rollers.

    Raises
    ------
    InputError
        If a part is missing, or has an edge.
    """

    def __init__(
        self,
        domain: Domain,
        space: fem.FunctionSpace,
        body: Body,
        unsupported: NDArray[np.bool_],
    ) -> None:
        self._domain, self._space, self._body = domain, space, body
        self.each: list[Roller] = []
        self.inclined: Inclined | None = None
        chosen = [(i, fixed) for i, fixed in enumerate(body.fixed) if fixed.normal is not None]
        if not chosen:
            return
        found = []
        for number, fixed in chosen:
            nodes, normal, least = nodal_normals(domain, space, fixed.on)
            if least < SMOOTH:
                raise InputError(
                    f"fixed.{number}.normal: {fixed.on} has an edge, where it has no normal; "
                    "accepted: a smooth part; each face of an edge as a part and an entry of its "
                    "own",
                    "roller-normal",
                )
            found.append((nodes, normal))
        d, size = domain.dim, unsupported.shape[1]
        every = np.unique(np.concatenate([nodes for nodes, _ in found])).astype(np.int32)
        places = [np.searchsorted(every, nodes) for nodes, _ in found]
        normals = np.zeros((every.size, len(found), d))
        count = np.zeros(every.size, dtype=np.intp)
        for k, (place, (_, normal)) in enumerate(zip(places, found, strict=True)):
            normals[place, k] = normal
            count[place] += 1
        left, values, right = np.linalg.svd(
            normals * unsupported[every, None, :d], full_matrices=False
        )
        independent = values > APART
        inverse = np.divide(1.0, values, out=np.zeros_like(values), where=independent)
        lift = np.einsum("mkr,mr,mrd->mkd", left, inverse, right)
        across = np.zeros((every.size, size, size))
        across[:, :d, :d] = np.einsum("mrd,mr,mre->mde", right, independent, right)
        # Normals that are nearly parallel are one direction, and their values differ a little.
        slack = np.maximum(np.where(independent, 0.0, values).max(axis=1), ROUNDING**0.5)
        for k, (place, (number, fixed)) in enumerate(zip(places, chosen, strict=True)):
            assert fixed.normal is not None
            nodes = every[place]
            points = space.tabulate_dof_coordinates()[nodes, :d]
            own = normals[place, k], lift[place, k], slack[place]
            given = fixed.normal, fixed.factor, domain.comm
            self.each.append(Roller(number, nodes, points, *own, *given))
        some = independent.any(axis=1)
        self.inclined = Inclined(every[some], across[some])
        self._nodes, self._borne = every, np.einsum("mki,mkj->mij", normals, lift)
        spare = bool((count > independent.sum(axis=1)).any())
        self._spare = domain.comm.allreduce(spare, op=MPI.LOR)

    def check_apart(self, tied: NDArray[np.bool_]) -> None:
        """Refuse rollers on tied nodes, the mask `GlobalUnknowns.tied`. Collective."""
        for roller in self.each:
            shared = bool(tied[roller.nodes, : self._domain.dim].any())
            if self._domain.comm.allreduce(shared, op=MPI.LOR):
                raise InputError(
                    f"fixed.{roller.number}.normal: the part shares nodes with a rigid part; "
                    "accepted: parts apart",
                    "roller-normal",
                )

    def set(self, nodal: Array, time: float) -> None:
        """Put the displacements at a time into nodal unknowns, (nodes, >= d). Collective.

        Components of other supports remain. Contradictions are refused on all ranks.
        """
        given = [roller.given(time) for roller in self.each]
        missing = [g - roller.along(nodal) for g, roller in zip(given, self.each, strict=True)]
        for roller, way in zip(self.each, missing, strict=True):
            nodal[roller.nodes, : self._domain.dim] += roller.lift * way[:, None]
        if self.each and self._spare:
            self._check(given, [roller.along(nodal) for roller in self.each])

    def _check(self, given: Sequence[Array], met: Sequence[Array]) -> None:
        """Refuse contradictory displacements at nodes of several supports. Collective."""
        comm, least = self._domain.comm, ROUNDING * self._domain.size
        worst = (0.0, 0, 0, np.zeros(0), 0.0, 0.0)
        for k, (roller, asked, got) in enumerate(zip(self.each, given, met, strict=True)):
            left = np.abs(asked - got)
            left -= roller.slack * np.maximum(np.abs(asked), np.abs(got)) + least
            at = int(left.argmax()) if left.size else 0
            if left.size and left[at] > worst[0]:
                place = roller.points[at], float(asked[at]), float(got[at])
                worst = (float(left[at]), k, int(roller.nodes[at]), *place)
        every = comm.allgather(worst[0])
        if max(every) <= 0:
            return
        root = int(np.argmax(every))
        _, k, node, point, asked_there, got_there = comm.bcast(worst, root)
        beside = []
        for number, fixed in enumerate(self._body.fixed):
            facets = self._domain.facets_anywhere(fixed.on)
            nodes = fem.locate_dofs_topological(self._space, self._domain.dim - 1, facets)
            there = comm.bcast(bool(np.isin(node, nodes)), root)
            moves = fixed.normal is not None or bool(fixed.components)
            beside += [fixed.on] * (moves and there and number != self.each[k].number)
        number = self.each[k].number
        names = " and ".join(repr(name) for name in beside) or "the axis"
        where = ", ".join(f"{x + 0.0:.4g}" for x in np.where(np.abs(point) < least, 0.0, point))
        raise InputError(
            f"fixed.{number}.normal: given {asked_there:.4g} along the normal of "
            f"{self._body.fixed[number].on!r}, and at ({where}) {names} asks for {got_there:.4g}; "
            "accepted: displacements that agree where parts meet, or parts apart",
            "roller-values",
        )

    def forces(self, number: int, nodes: NDArray[np.int32]) -> Array:
        """Return the matrices from residuals at owned nodes to a roller's forces, (n, d, d)."""
        roller = next(roller for roller in self.each if roller.number == number)
        return _at(nodes, roller.nodes, np.einsum("ni,nj->nij", roller.normal, roller.lift))

    def borne(self, nodes: NDArray[np.int32]) -> Array:
        """Return the matrices from residuals at owned nodes to the forces of all rollers."""
        if not self.each:
            return np.zeros((nodes.size, self._domain.dim, self._domain.dim))
        return _at(nodes, self._nodes, self._borne)


def _at(nodes: NDArray[np.int32], known: NDArray[np.int32], values: Array) -> Array:
    """Return values at nodes, 0 at those without."""
    found = np.zeros((nodes.size, *values.shape[1:]))
    _, at, own = np.intersect1d(nodes, known, return_indices=True)
    found[at] = values[own]
    return found
