"""Supports: Dirichlet conditions, elastic supports, rollers along the normal of a part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from numpy.typing import NDArray

from contact._compat import collapse, lasting
from contact.body.loads import expression
from contact.body.weak_form import ElasticSupport
from contact.errors import InputError
from contact.linear.layout import Inclined
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain, on_axis
from contact.mesh.entities import sums_at
from contact.mesh.geometry import facet_normals
from contact.model.body import Body
from contact.model.fields import Factor, Field, Moving, steady, values_at
from contact.model.formula import Expression
from contact.ranks import on_all_ranks
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Least cosine of the angle between the normals of a node and of a facet there. More is an edge.
SMOOTH = 0.8

#: Least singular value of the normals of a node that count as independent: the sine of the angle
#: between one normal and the span of the others.
APART = 0.2


@dataclass(frozen=True)
class Support:
    """A prescribed component of the unknowns on a part, as a function of time."""

    condition: fem.DirichletBC  #: the Dirichlet condition, with values without the amplitude
    values: fem.Function  #: the function of the condition's values
    dofs: NDArray[np.int32]  #: its degrees of freedom, shape (n,)
    points: Array  #: their coordinates, shape (n, d) (length)
    comm: MPI.Intracomm
    field: Field | Moving | None = None  #: the prescribed function, None for zero
    amplitude: Factor = steady  #: its factor as a function of time
    scale: float = 1.0  #: unit of the component in the unknowns
    name: str = ""  #: of the component, in messages
    check: Callable[[Array], None] | None = None  #: of the values, collective; None for any values

    def evaluate(self, time: float) -> None:
        """Set the values of the condition at a time. Collective where the field is."""
        if self.field is None:
            return
        prescribed = values_at(self.field, self.points, time, self.name, self.comm)
        if self.check is not None:
            self.check(prescribed)
        self.values.x.array[self.dofs] = prescribed / self.scale

    def set(self, into: Array, time: float) -> None:
        """Put the prescribed values at a time into local unknowns. Collective."""
        if isinstance(self.field, Moving):
            self.evaluate(time)
        self.condition.set(into, None, self.amplitude(time))


def supports_of(domain: Domain, space: fem.FunctionSpace, body: Body) -> list[Support]:
    """Return a body's supports, one a component, and u_r = 0 on an axis of revolution. Collective.

    Refuses missing parts, vectors of the wrong length, a potential prescribed for a body without
    one, and a radial displacement prescribed on the axis.
    """
    supports, dim = [], domain.dim
    domain.mesh.topology.create_connectivity(dim - 1, dim)
    for number, fixed in enumerate(body.fixed):
        if fixed.symmetry is not None:
            _check_across(f"fixed.{number}.symmetry", domain, fixed.on, "xyz".index(fixed.symmetry))
        if fixed.displacement is not None and len(fixed.displacement) != dim:
            raise InputError(
                f"fixed on {fixed.on!r}: displacement has {len(fixed.displacement)} components, "
                f"the body has {dim}",
                "components",
            )
        if fixed.potential is not None and body.piezo is None:
            raise InputError(
                f"fixed on {fixed.on!r}: a potential needs a piezoelectric material", "piezo"
            )
        electric = {} if fixed.potential is None else {dim: fixed.potential}
        for component, value in (fixed.components | electric).items():
            scale = body.phi_scale if component == dim else 1.0
            key = "potential" if component == dim else f"displacement.{component}"
            name = f"fixed.{number}.{key}"
            supports.append(
                _support(domain, space, component, fixed.on, value, scale, fixed.factor, name)
            )
    if domain.revolved:
        supports.append(_axis(domain, space))
    return supports


def elastic_supports_of(domain: Domain, body: Body) -> list[ElasticSupport]:
    """Return the elastic supports for the weak form. Collective.

    Refuses missing parts, and stiffnesses of the wrong length or negative somewhere.
    """
    supports, x = [], ufl.SpatialCoordinate(domain.mesh)
    for number, support in enumerate(body.elastic):
        axes, on = support.stiffness or (), support.on
        if axes and len(axes) != domain.dim:
            raise InputError(
                f"elastic on {on!r}: the stiffness has {len(axes)} components, the body "
                f"has {domain.dim}",
                "elastic",
            )
        stiffness: dict[str, Field | Moving] = {
            f"stiffness.{i}": value for i, value in enumerate(axes)
        }
        stiffness["normal"] = Expression(0.0) if support.normal is None else support.normal
        for key, value in stiffness.items():
            _check_stiffness(domain, on, value, f"elastic.{number}.{key}")
        *along, normal = (
            expression(domain, value, x, 0.0, f"elastic.{number}.{key}")
            for key, value in stiffness.items()
        )
        supports.append(ElasticSupport(along, normal, domain.ds(on)))
    return supports


def _check_stiffness(domain: Domain, on: str, value: Any, key: str) -> None:
    """Refuse a stiffness with values on a part that are not >= 0. Collective."""
    mesh, facets = domain.mesh, domain.facets(on)
    points = compute_midpoints(mesh, domain.dim - 1, facets)
    if facets.size > 0:  # dolfinx divides by their number
        corners = np.unique(entities_to_geometry(mesh, domain.dim - 1, facets))
        points = np.concatenate([points, mesh.geometry.x[corners]])
    with on_all_ranks(domain.comm), np.errstate(all="ignore"):
        values = np.asarray(value.numpy(points[:, : domain.dim]))
    wrong = ~(np.isfinite(values) & (values >= 0))
    by_rank = domain.comm.allgather(values[wrong][:1].tolist())
    worst = [one for rank_values in by_rank for one in rank_values]
    if worst:
        raise InputError(
            f"{key}: given {worst[0]:g} on {on!r}; accepted: numbers >= 0 everywhere",
            "negative-stiffness",
        )


def _check_across(key: str, domain: Domain, on: str, axis: int) -> None:
    """Refuse a part outside a plane across an axis. Collective."""
    name = "xyz"[axis]
    if axis >= domain.dim or (domain.revolved and axis == 0):
        accepted = "y" if domain.revolved else " or ".join("xyz"[: domain.dim])
        raise InputError(f'{key}: given "{name}"; accepted: {accepted}', "value")
    facets, coordinates = domain.facets(on), np.zeros(0)
    if facets.size:  # which `entities_to_geometry` divides by
        nodes = entities_to_geometry(domain.mesh, domain.dim - 1, facets)
        coordinates = domain.mesh.geometry.x[nodes.ravel(), axis]
    low = domain.comm.allreduce(float(coordinates.min(initial=np.inf)), op=MPI.MIN)
    high = domain.comm.allreduce(float(coordinates.max(initial=-np.inf)), op=MPI.MAX)
    if high - low > 1e-6 * domain.size:
        raise InputError(
            f"{key}: {on} reaches from {name} = {low:.6g} to {high:.6g}; accepted: a part in a "
            f"plane across {name}",
            "symmetry",
        )


def _axis(domain: Domain, space: fem.FunctionSpace) -> Support:
    """Return u_r = 0 where r = 0."""
    subspace = space.sub(0)
    scalar, _ = collapse(subspace)
    dofs = fem.locate_dofs_geometrical((subspace, scalar), lambda x: on_axis(domain, x.T))
    return _nothing(subspace, fem.Function(scalar), dofs)


def _nothing(
    subspace: fem.FunctionSpace, zero: fem.Function, dofs: Sequence[NDArray[np.int32]]
) -> Support:
    """Return the homogeneous condition on a component at some of its dofs."""
    condition = fem.dirichletbc(zero, dofs, subspace)
    none, comm = np.zeros((dofs[1].size, 0)), lasting(subspace.mesh.comm)
    return Support(condition, zero, dofs[1], none, comm)


def _off_axis(domain: Domain, part: str, points: Array) -> Callable[[Array], None]:
    """Return a check that there is no radial displacement on the axis. Collective."""
    inside = on_axis(domain, points)

    def check(radial: Array) -> None:
        local = float(np.abs(radial[inside]).max(initial=0.0))
        largest = domain.comm.allreduce(local, op=MPI.MAX)
        if largest > 1e-12 * domain.size:
            raise InputError(
                f"fixed on {part!r}: a radial displacement of {largest:.4g} where the part meets "
                'the axis; accepted: 0 at x = 0, for instance "0.1*x", or "free": there u_r = 0 '
                "anyway",
                "axis",
            )

    return check


def _support(
    domain: Domain,
    space: fem.FunctionSpace,
    component: int,
    part: str,
    value: Field | Moving,
    scale: float,
    amplitude: Factor,
    name: str,
) -> Support:
    """Return the support of a component on a part. Collective."""
    dim, facets = domain.dim, domain.facets_anywhere(part)
    subspace = space.sub(component)
    scalar, _ = collapse(subspace)
    data = fem.Function(scalar)
    dofs = fem.locate_dofs_topological((subspace, scalar), dim - 1, facets)
    # On the part alone: a formula need not make sense elsewhere.
    points = scalar.tabulate_dof_coordinates()[dofs[1], :dim]
    condition = fem.dirichletbc(data, dofs, subspace)
    check = _off_axis(domain, part, points) if domain.revolved and component == 0 else None
    support = Support(
        condition,
        data,
        dofs[1],
        points,
        domain.comm,
        field=value,
        amplitude=amplitude,
        scale=scale,
        name=name,
        check=check,
    )
    support.evaluate(0.0)
    return support


def without_field(space: fem.FunctionSpace, cells: NDArray[np.int32]) -> Support:
    """Return the condition phi = 0 at all nodes outside owned piezoelectric cells. Collective.

    There is no electric field in other materials, whose surface is that of an insulator.
    """
    subspace = space.sub(space.dofmap.index_map_bs - 1)
    scalar, to_whole = collapse(subspace)
    inside = sums_at(scalar.dofmap.index_map, scalar.dofmap.list[cells], 1.0)
    nodes = np.flatnonzero(inside == 0).astype(np.int32)
    dofs = [to_whole[nodes], nodes]
    return _nothing(subspace, fem.Function(scalar), dofs)


def free_components(space: fem.FunctionSpace, supports: Sequence[Support]) -> NDArray[np.bool_]:
    """Return the mask of the owned nodes' unsupported unknowns, shape (nodes, block size)."""
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    free = np.ones(index_map.size_local * bs, dtype=bool)
    for support in supports:
        dofs, owned = support.condition.dof_indices()
        free[dofs[:owned]] = False
    return free.reshape(-1, bs)


@dataclass(frozen=True)
class Roller:
    """The displacement of a part along its normal, as a function of time."""

    number: int  #: index among the body's `fixed`
    nodes: NDArray[np.int32]  #: owned nodes, shape (n,)
    points: Array  #: their coordinates, shape (n, d) (length)
    normal: Array  #: their unit normals, shape (n, d)
    #: Displacement by a unit along the normal, in directions free of other supports, (n, d).
    lift: Array
    slack: Array  #: relative error allowed where other supports constrain the nodes already, (n,)
    field: Field | Moving  #: the prescribed function
    amplitude: Factor  #: its factor as a function of time
    comm: MPI.Intracomm

    def prescribed(self, time: float) -> Array:
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
    sums = sums_at(space.dofmap.index_map, nodes, normal)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    mean = np.divide(sums, length, out=np.zeros_like(sums), where=length > 0)
    facet_normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    cosine = np.einsum("fqd,fqd->fq", facet_normal, mean[nodes]).min(initial=1.0)
    least = domain.comm.allreduce(float(cosine), op=MPI.MIN)
    domain.mesh.topology.create_connectivity(d - 1, d)
    owned = fem.locate_dofs_topological(space, d - 1, facets)
    owned = owned[owned < space.dofmap.index_map.size_local]
    return owned, mean[owned], least


class Rollers:
    """The rollers of a body, which constrain shared nodes together.

    At a node with normals n_i, and A their parts along components without other supports, the
    displacement is that of least squares, by A's pseudo-inverse. The forces are its transpose: each
    roller bears a force along its own normal, of dependent normals the least. The order of rollers
    has no effect. Collective to make.

    `unsupported` is the mask of the owned nodal unknowns without other supports, shape
    (nodes, block size). `inclined` are the constrained directions of the rollers `each`; None
    without rollers. Refuses parts that are missing, or have an edge.
    """

    def __init__(
        self,
        domain: Domain,
        space: fem.FunctionSpace,
        body: Body,
        unsupported: NDArray[np.bool_],
    ) -> None:
        self._domain = domain
        self.each: list[Roller] = []
        self.inclined: Inclined | None = None
        chosen = [(i, fixed) for i, fixed in enumerate(body.fixed) if fixed.normal is not None]
        if not chosen:
            return
        supported = []
        for number, fixed in chosen:
            nodes, normal, least = nodal_normals(domain, space, fixed.on)
            if least < SMOOTH:
                raise InputError(
                    f"fixed.{number}.normal: {fixed.on} has an edge, where it has no normal; "
                    "accepted: a smooth part; each face of an edge as a part and an entry of its "
                    "own",
                    "roller-normal",
                )
            supported.append((nodes, normal))
        d, size = domain.dim, unsupported.shape[1]
        every = np.unique(np.concatenate([nodes for nodes, _ in supported])).astype(np.int32)
        places = [np.searchsorted(every, nodes) for nodes, _ in supported]
        normals = np.zeros((every.size, len(supported), d))
        count = np.zeros(every.size, dtype=np.intp)
        for k, (place, (_, normal)) in enumerate(zip(places, supported, strict=True)):
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
            directions = normals[place, k], lift[place, k], slack[place]
            prescription = fixed.normal, fixed.factor, domain.comm
            self.each.append(Roller(number, nodes, points, *directions, *prescription))
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
        prescribed = [roller.prescribed(time) for roller in self.each]
        missing = [g - roller.along(nodal) for g, roller in zip(prescribed, self.each, strict=True)]
        for roller, way in zip(self.each, missing, strict=True):
            nodal[roller.nodes, : self._domain.dim] += roller.lift * way[:, None]
        if self.each and self._spare:
            self._check(prescribed, [roller.along(nodal) for roller in self.each])

    def _check(self, prescribed: Sequence[Array], met: Sequence[Array]) -> None:
        """Refuse contradictory displacements at nodes of several supports. Collective."""
        least = ROUNDING * self._domain.size
        for roller, asked, got in zip(self.each, prescribed, met, strict=True):
            mismatch = np.abs(asked - got) - roller.slack * np.maximum(np.abs(asked), np.abs(got))
            wrong = mismatch > least
            rows = np.column_stack([asked, got, roller.points])[wrong][:1]
            every = np.concatenate(self._domain.comm.allgather(rows))
            if not every.size:
                continue
            where = ", ".join(f"{x:.4g}" for x in every[0, 2:])
            raise InputError(
                f"fixed.{roller.number}.normal: given {every[0, 0]:.4g} along the normal, other "
                f"supports at ({where}) ask for {every[0, 1]:.4g}; accepted: displacements that "
                "agree where parts meet, or parts apart",
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


def _at(nodes: NDArray[np.int32], sources: NDArray[np.int32], values: Array) -> Array:
    """Return values at nodes, 0 at those without."""
    extended = np.zeros((nodes.size, *values.shape[1:]))
    _, at, rows = np.intersect1d(nodes, sources, return_indices=True)
    extended[at] = values[rows]
    return extended
