"""The contact part as a surface of its own: its facets, with what the contact nodes say."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.mesh.entities import cells_at
from contact.output.quantities import SURFACE, values_of
from contact.output.solved import Solved
from contact.output.table import Table, tangent_of
from contact.output.vtu import VTU, Grid, Values
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Status of a node -> its number in the file.
STATUS = {"none": -1, "open": 0, "stick": 1, "slip": 2}


def _facet_nodes(problem: ContactProblem, part: str) -> NDArray[np.int32]:
    """Return the local nodes of each owned facet of a part, corners first, shape (m, k)."""
    domain, space, d = problem.domain, problem.equilibrium.space, problem.dim
    cells, place = cells_at(domain.mesh, domain.facets(part))
    layout = space.dofmap.dof_layout
    closure = np.array([sorted(layout.entity_closure_dofs(d - 1, i)) for i in range(d + 1)])
    return np.take_along_axis(space.dofmap.list[cells], closure[place], axis=1)


def contact_surface(solution: Solved, table: Table | None) -> VTU | None:
    """Return the contact part on rank 0, None elsewhere. Collective.

    Parameters
    ----------
    solution
        The solution.
    table
        Its contact table, None on ranks other than 0.
    """
    problem, comm, d = solution.problem, solution.problem.comm, solution.problem.dim
    body = problem.equilibrium
    index_map = body.space.dofmap.index_map
    shares = []
    for i, entry in enumerate(problem.entries):
        facets = _facet_nodes(problem, entry.on)
        nodes, inverse = np.unique(facets, return_inverse=True)
        # A node of two contacts is one of each.
        names = i * index_map.size_global + index_map.local_to_global(nodes.astype(np.int32))
        x = body.nodal(solution.state.x)[nodes]
        points = body.space.tabulate_dof_coordinates()[nodes, :d]
        shares.append((names[inverse.reshape(facets.shape)], names, points, x))
    gathered = comm.gather([np.concatenate(arrays) for arrays in zip(*shares, strict=True)])
    if table is None or gathered is None:
        return None
    cells, names, points, x = (np.concatenate(arrays) for arrays in zip(*gathered, strict=True))
    names, first = np.unique(names, return_index=True)
    grid = Grid(points[first], np.searchsorted(names, cells), d - 1)
    fields = _fields(problem, table, names, x[first])
    owner = (names // index_map.size_global).astype(np.int32)
    rigid = [contact.against is None for contact in problem.contacts]
    fields |= {"entry": owner, "rigid": np.array(rigid, dtype=np.int32)[owner]}
    return VTU(grid, {name: _completed(values, grid) for name, values in fields.items()}, {})


def slip_and_friction(table: Table, normal: Array) -> tuple[Array, Array]:
    """Return u_tau and lambda_f of a contact table as vectors, both of shape (n, d)."""
    if normal.shape[1] == 2:
        tangent = tangent_of(normal)
        return table["u_t"][:, None] * tangent, table["tau"][:, None] * tangent
    return (
        np.column_stack([table[f"u_t{axis}"] for axis in "xyz"]),
        np.column_stack([table[f"tau_{axis}"] for axis in "xyz"]),
    )


@dataclass(frozen=True)
class Facets:
    """The contact nodes as the quantities of the surface see them: their table."""

    table: Table

    @cached_property
    def normal(self) -> Array:
        """Contact directions, shape (n, d)."""
        return np.column_stack([self.table[k] for k in ("nu_x", "nu_y", "nu_z") if k in self.table])

    @property
    def slip(self) -> Array:
        """Tangential displacements u_tau, shape (n, d)."""
        return slip_and_friction(self.table, self.normal)[0]

    @property
    def traction(self) -> Array:
        """Stresses on the foundation, shape (n, d)."""
        friction = slip_and_friction(self.table, self.normal)[1]
        return np.asarray(self.table["pressure"][:, None] * self.normal + friction)

    @property
    def status(self) -> NDArray[np.int32]:
        """Numbers of the status."""
        return np.array([STATUS[name] for name in self.table["status"]], dtype=np.int32)

    @property
    def rows(self) -> NDArray[np.int32]:
        """Rows in the table."""
        return np.arange(len(self.table["status"]), dtype=np.int32)


def _fields(
    problem: ContactProblem, table: Table, names: NDArray[np.int64], x: Array
) -> dict[str, Values]:
    """Return the fields at nodes of given global names and unknowns."""
    d, size = problem.dim, problem.equilibrium.space.dofmap.index_map.size_global
    rows = np.searchsorted(names, table["entry"] * size + table["node"])
    fields: dict[str, Values] = {"displacement": x[:, :d]}
    if problem.piezoelectric:
        fields["potential"] = problem.equilibrium.phi_scale * x[:, d]
    for name, values in values_of(SURFACE, Facets(table)).items():
        none = np.nan if values.dtype.kind == "f" else -1
        fields[name] = np.full((len(names), *values.shape[1:]), none, dtype=values.dtype)
        fields[name][rows] = values
    return fields


def _completed(values: Values, grid: Grid) -> Values:
    """Give the corners of facets of degree 2 in space the mean of the nodes beside them.

    They are no contact nodes, as their basis functions have no mean on a facet, and one
    with unknown corners could not be drawn.
    """
    if grid.cells.shape[1] < 6 or values.dtype.kind != "f":
        return values
    sums, counts = np.zeros_like(values), np.zeros_like(values)
    for corner, beside in enumerate(([4, 5], [3, 5], [3, 4])):
        near = values[grid.cells[:, beside]]
        np.add.at(sums, grid.cells[:, corner], np.nansum(near, axis=1))
        np.add.at(counts, grid.cells[:, corner], np.isfinite(near).sum(axis=1))
    missing = np.isnan(values) & (counts > 0)
    return np.where(missing, sums / np.maximum(counts, 1), values)
