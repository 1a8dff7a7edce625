"""Supports: prescribed displacements and potentials as Dirichlet conditions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from dolfinx.la import InsertMode
from numpy.typing import NDArray

from contact.body.amplitude import Amplitude, Moving, steady, values_at
from contact.body.description import Body, Field
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.typing import Array


@dataclass(frozen=True)
class Support:
    """A prescribed component of the unknowns on a part, as a function of time.

    Attributes
    ----------
    condition
        The Dirichlet condition; its values are those without the amplitude.
    amplitude
        Factor as a function of time.
    field
        What is prescribed; None for nothing but zero.
    values
        Where the condition takes its values from.
    dofs, points
        Which of these, shape (n,), and their coordinates, shape (n, d).
    scale
        Unit of the component in the unknowns.
    """

    condition: fem.DirichletBC
    amplitude: Amplitude
    field: Field | Moving | None
    values: fem.Function
    dofs: NDArray[np.int32]
    points: Array
    scale: float

    def evaluate(self, time: float) -> None:
        """Give the condition its values at a time. Collective where the field is."""
        if self.field is None:
            return
        given = values_at(self.field, self.points, time)
        self.values.x.array[self.dofs] = given / self.scale

    def set(self, into: Array, time: float) -> None:
        """Put the prescribed values at a time into local unknowns. Collective."""
        if isinstance(self.field, Moving):
            self.evaluate(time)
        self.condition.set(into, None, self.amplitude(time))


def supports_of(domain: Domain, space: fem.FunctionSpace, body: Body) -> list[Support]:
    """Return a body's supports and electrodes, one a component. Collective.

    Raises
    ------
    InputError
        If a part is missing, a vector has the wrong length, or a potential is prescribed for a
        body without.
    """
    supports, dim = [], domain.dim
    domain.mesh.topology.create_connectivity(dim - 1, dim)
    for fixed in body.fixed:
        given: list[Field | Moving | None] = [None] * dim
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
                supports.append(_support(space, component, facets, value, scale, fixed.factor))
    return supports


def _support(
    space: fem.FunctionSpace,
    component: int,
    facets: NDArray[np.int32],
    value: Field | Moving,
    scale: float,
    amplitude: Amplitude,
) -> Support:
    dim = space.mesh.topology.dim
    subspace = space.sub(component)
    scalar, _ = subspace.collapse()
    data = fem.Function(scalar)
    dofs = fem.locate_dofs_topological((subspace, scalar), dim - 1, facets)
    # On the part alone: a formula need not make sense elsewhere.
    points = scalar.tabulate_dof_coordinates()[dofs[1], :dim]
    condition = fem.dirichletbc(data, dofs, subspace)
    made = Support(condition, amplitude, value, data, dofs[1], points, scale)
    made.evaluate(0.0)
    return made


def without_field(space: fem.FunctionSpace, cells: NDArray[np.int32]) -> Support:
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
    zero = fem.Function(scalar)
    condition = fem.dirichletbc(zero, dofs, subspace)
    return Support(condition, steady, None, zero, nodes, np.zeros((nodes.size, 0)), 1.0)


def free_components(space: fem.FunctionSpace, supports: Sequence[Support]) -> NDArray[np.bool_]:
    """Return which components of the owned nodes are not fixed, shape (nodes, block size)."""
    index_map, bs = space.dofmap.index_map, space.dofmap.index_map_bs
    free = np.ones(index_map.size_local * bs, dtype=bool)
    for support in supports:
        dofs, owned = support.condition.dof_indices()
        free[dofs[:owned]] = False
    return free.reshape(-1, bs)
