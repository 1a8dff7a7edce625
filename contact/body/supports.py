"""Supports: prescribed displacements and potentials as Dirichlet conditions, and elastic ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI
from numpy.typing import NDArray

from contact._compat import collapse, lasting
from contact.body.description import Body
from contact.body.loads import expression
from contact.body.weak_form import ElasticSupport
from contact.errors import InputError
from contact.mesh.domain import Domain, on_axis
from contact.model.fields import Amplitude, Field, Moving, steady, values_at
from contact.model.formula import Expression
from contact.ranks import on_all_ranks
from contact.typing import Array


@dataclass(frozen=True)
class Support:
    """A prescribed component of the unknowns on a part, as a function of time.

    Attributes
    ----------
    condition
        The Dirichlet condition, with values without the amplitude.
    amplitude
        Factor as a function of time.
    field
        The prescribed function; None for zero.
    values, dofs, points
        The function of the condition's values, its dofs, shape (n,), their coordinates, (n, d).
    scale
        Unit of the component in the unknowns.
    name, comm
        Name in messages, and communicator.
    check
        Check of the values, collective; None for any values.
    """

    condition: fem.DirichletBC
    amplitude: Amplitude
    field: Field | Moving | None
    values: fem.Function
    dofs: NDArray[np.int32]
    points: Array
    scale: float
    name: str
    comm: MPI.Intracomm
    check: Callable[[Array], None] | None = None

    def evaluate(self, time: float) -> None:
        """Set the values of the condition at a time. Collective where the field is."""
        if self.field is None:
            return
        given = values_at(self.field, self.points, time, self.name, self.comm)
        if self.check is not None:
            self.check(given)
        self.values.x.array[self.dofs] = given / self.scale

    def set(self, into: Array, time: float) -> None:
        """Put the prescribed values at a time into local unknowns. Collective."""
        if isinstance(self.field, Moving):
            self.evaluate(time)
        self.condition.set(into, None, self.amplitude(time))


def supports_of(domain: Domain, space: fem.FunctionSpace, body: Body) -> list[Support]:
    """Return a body's supports, one a component, and u_r = 0 on an axis of revolution. Collective.

    Raises
    ------
    InputError
        If a part is missing, a vector has the wrong length, a potential is prescribed for a
        body without, or a radial displacement on the axis.
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
        for key, value in fixed.given.items():
            if key == "normal":
                continue
            component = dim if key == "potential" else int(key[-1])
            scale = body.phi_scale if component == dim else 1.0
            name = f"fixed.{number}.{key}"
            supports.append(
                _support(domain, space, component, fixed.on, value, scale, fixed.factor, name)
            )
    if domain.revolved:
        supports.append(_axis(domain, space))
    return supports


def elastic_supports_of(domain: Domain, body: Body) -> list[ElasticSupport]:
    """Return the elastic supports for the weak form. Collective.

    Raises
    ------
    InputError
        If a part is missing, or a stiffness has the wrong length or is negative somewhere.
    """
    found, x = [], ufl.SpatialCoordinate(domain.mesh)
    for number, support in enumerate(body.elastic):
        axes, on = support.stiffness or (), support.on
        if axes and len(axes) != domain.dim:
            raise InputError(
                f"elastic on {on!r}: the stiffness has {len(axes)} components, the body "
                f"has {domain.dim}",
                "elastic",
            )
        given: dict[str, Field | Moving] = {f"stiffness.{i}": value for i, value in enumerate(axes)}
        given["normal"] = Expression(0.0) if support.normal is None else support.normal
        for key, value in given.items():
            _check_stiffness(domain, on, value, f"elastic.{number}.{key}")
        *along, normal = (
            expression(domain, value, x, 0.0, f"elastic.{number}.{key}")
            for key, value in given.items()
        )
        found.append(ElasticSupport(along, normal, domain.ds(on)))
    return found


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
    found = domain.comm.allgather(values[wrong][:1].tolist())
    worst = [one for own in found for one in own]
    if worst:
        raise InputError(
            f"{key}: given {worst[0]:g} on {on!r}; accepted: numbers >= 0 everywhere",
            "negative-stiffness",
        )


def _check_across(key: str, domain: Domain, on: str, axis: int) -> None:
    """Refuse a part outside a plane across an axis. Collective."""
    name = "xyz"[axis]
    if axis >= domain.dim or (domain.revolved and axis == 0):
        known = "y" if domain.revolved else " or ".join("xyz"[: domain.dim])
        raise InputError(f'{key}: given "{name}"; accepted: {known}', "value")
    facets, there = domain.facets(on), np.zeros(0)
    if facets.size:  # which `entities_to_geometry` divides by
        nodes = entities_to_geometry(domain.mesh, domain.dim - 1, facets)
        there = domain.mesh.geometry.x[nodes.ravel(), axis]
    low = domain.comm.allreduce(float(there.min(initial=np.inf)), op=MPI.MIN)
    high = domain.comm.allreduce(float(there.max(initial=-np.inf)), op=MPI.MAX)
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
    return Support(condition, steady, None, zero, dofs[1], none, 1.0, "", comm)


def _off_axis(domain: Domain, part: str, points: Array) -> Callable[[Array], None]:
    """Return a check that there is no radial displacement on the axis. Collective."""
    inside = on_axis(domain, points)

    def check(radial: Array) -> None:
        here = float(np.abs(radial[inside]).max(initial=0.0))
        largest = domain.comm.allreduce(here, op=MPI.MAX)
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
    amplitude: Amplitude,
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
    made = Support(
        condition, amplitude, value, data, dofs[1], points, scale, name, domain.comm, check
    )
    made.evaluate(0.0)
    return made


def without_field(space: fem.FunctionSpace, cells: NDArray[np.int32]) -> Support:
    """Return the condition phi = 0 at all nodes outside owned piezoelectric cells. Collective.

    There is no electric field in other materials, whose surface is that of an insulator.
    """
    subspace = space.sub(space.dofmap.index_map_bs - 1)
    scalar, to_whole = collapse(subspace)
    inside = fem.Function(scalar)
    inside.x.array[scalar.dofmap.list[cells].ravel()] = 1.0
    inside.x.scatter_reverse(InsertMode.add)
    inside.x.scatter_forward()
    nodes = np.flatnonzero(inside.x.array == 0).astype(np.int32)
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
