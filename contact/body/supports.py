"""Supports: prescribed displacements and potentials as Dirichlet conditions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import fem
from dolfinx.la import InsertMode
from numpy.typing import NDArray

from contact.body.description import Body, Field
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.typing import Array


def dirichlet(domain: Domain, space: fem.FunctionSpace, body: Body) -> list[fem.DirichletBC]:
    """Return the conditions of a body's supports and electrodes, one a component. Collective.

    Raises
    ------
    InputError
        If a part is missing, a vector has the wrong length, or a potential is prescribed for a
        body without.
    """
    conditions, dim = [], domain.dim
    domain.mesh.topology.create_connectivity(dim - 1, dim)
    for fixed in body.fixed:
        given: list[Field | None] = [None] * dim
        if fixed.displacement is not None:
            if len(fixed.displacement) != dim:
                raise InputError(
                    f"fixed on {fixed.on!r}: displacement has {len(fixed.displacement)} "
                    f"components, the body has {dim}"
                )
            given = list(fixed.displacement)
        if fixed.potential is not None:
            if body.piezo is None:
                raise InputError(
                    f"fixed on {fixed.on!r}: a potential needs a piezoelectric material"
                )
            given.append(fixed.potential)
        facets = domain.facets(fixed.on)
        for component, value in enumerate(given):
            if value is not None:
                scale = body.phi_scale if component == dim else 1.0
                conditions.append(_condition(space, component, facets, value, scale))
    return conditions


def _condition(
    space: fem.FunctionSpace,
    component: int,
    facets: NDArray[np.int32],
    value: Field,
    scale: float,
) -> fem.DirichletBC:
    dim = space.mesh.topology.dim
    subspace = space.sub(component)
    scalar, _ = subspace.collapse()
    data = fem.Function(scalar)
    dofs = fem.locate_dofs_topological((subspace, scalar), dim - 1, facets)
    # On the part alone: a formula need not make sense elsewhere.
    points = scalar.tabulate_dof_coordinates()[dofs[1], :dim]
    data.x.array[dofs[1]] = np.asarray(value.numpy(points)) / scale
    return fem.dirichletbc(data, dofs, subspace)


def without_field(space: fem.FunctionSpace, cells: NDArray[np.int32]) -> fem.DirichletBC:
    """Return the condition phi = 0 at the nodes that belong to no piezoelectric cell. Collective.

    There is no electric field in what is not piezoelectric: a current that reaches its surface
    ends there, as at that of an insulator.

    Parameters
    ----------
    space
        Of displacement and potential.
    cells
        Owned piezoelectric cells.
    """
    subspace = space.sub(space.dofmap.index_map_bs - 1)
    scalar, to_whole = subspace.collapse()
    inside = fem.Function(scalar)
    inside.x.array[scalar.dofmap.list[cells].ravel()] = 1.0
    inside.x.scatter_reverse(InsertMode.add)
    inside.x.scatter_forward()
    nodes = np.flatnonzero(inside.x.array == 0).astype(np.int32)
    dofs = [np.asarray(to_whole, dtype=np.int32)[nodes], nodes]
    return fem.dirichletbc(fem.Function(scalar), dofs, subspace)


def free_components(
    space: fem.FunctionSpace, conditions: Sequence[fem.DirichletBC]
) -> NDArray[np.bool_]:
    """Return which components of the owned nodes are not fixed, shape (nodes, block size)."""
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    free = np.ones(index_map.size_local * bs, dtype=bool)
    for condition in conditions:
        dofs, owned = condition.dof_indices()
        free[dofs[:owned]] = False
    return free.reshape(-1, bs)


def prescribed_values(space: fem.FunctionSpace, conditions: Sequence[fem.DirichletBC]) -> Array:
    """Return the prescribed values of the owned nodes, 0 where free, (nodes, block size)."""
    values = fem.Function(space)
    for condition in conditions:
        condition.set(values.x.array)
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    return np.asarray(values.x.array[: index_map.size_local * bs].reshape(-1, bs))
