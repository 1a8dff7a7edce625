"""The contact nodes of all ranks as arrays, and on the facets of the contact part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.mesh.entities import cells_at
from contact.output.quantities import SURFACE, values_of
from contact.output.solved import Solved
from contact.output.table import Table, contact_table, tangent_of
from contact.output.vtu import VTU, Grid, Values
from contact.problem.problem import ContactProblem
from contact.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult:
    """The contact nodes of all ranks, on each of them, in the order of ``contact.csv``.

    Attributes
    ----------
    points
        Places in the reference configuration, shape (n, d) (length).
    weight
        Area that each node stands for, shape (n,).
    normal
        Contact direction, out of the body, shape (n, d).
    gap, opening
        Initial and present distance to the foundation along it, shape (n,) (length).
    pressure
        Contact pressure -sigma_nu, shape (n,) (stress).
    traction
        Stress of the body on the foundation, shape (n, d).
    friction_bound
        Shape (n,) (stress).
    slip
        Tangential displacement, shape (n, d) (length).
    status
        "open", "stick" or "slip", shape (n,).
    potential, charge
        Of a piezoelectric body: potential, and charge that leaves through the foundation, shape
        (n,); else None.
    """

    points: Array
    weight: Array
    normal: Array
    gap: Array
    opening: Array
    pressure: Array
    traction: Array
    friction_bound: Array
    slip: Array
    status: NDArray[Any]
    potential: Array | None
    charge: Array | None
    _problem: ContactProblem

    def __repr__(self) -> str:
        """Return how many nodes there are, and how many of them touch."""
        closed = np.count_nonzero(self.status != "open")
        largest = self.pressure.max(initial=0.0)
        return (
            f"<ContactResult: {self.status.size} nodes, {closed} in contact, pressure up to "
            f"{largest:.4g}>"
        )

    def function(self, name: str) -> fem.Function:
        """Return one of the arrays as a function on a mesh of the contact surface. Collective.

        It is NaN at nodes that are held, and hence no contact nodes.

        Parameters
        ----------
        name
            For instance "pressure" or "traction".

        Raises
        ------
        InputError
            If there is no such array of numbers.
        """
        arrays = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        known = {k: v for k, v in arrays.items() if v.dtype.kind == "f"}
        if name not in known:
            raise InputError(f"contact.function({name!r}): accepted: {', '.join(known)}")
        values = known[name]
        domain, degree = self._problem.domain, self._problem.equilibrium.degree
        parts = [domain.facets(contact.on) for contact in self._problem.contacts]
        surface = dmesh.create_submesh(
            domain.mesh, domain.dim - 1, np.unique(np.concatenate(parts))
        )[0]
        space = fem.functionspace(surface, ("Lagrange", degree, values.shape[1:]))
        made = fem.Function(space, name=name)
        places = space.tabulate_dof_coordinates()[:, : domain.dim]
        distance, nearest = KDTree(self.points).query(places)
        found = np.where(distance < 1e-9 * domain.size, nearest, -1)
        rows = np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[found]
        made.x.array[:] = rows.ravel()
        return made


def contact_result(solution: Solved) -> ContactResult:
    """Return the contact nodes of all ranks. Collective."""
    return _result(solution.problem, solution.problem.comm.bcast(contact_table(solution)))


def _result(problem: ContactProblem, table: Table) -> ContactResult:
    """Return the contact nodes of a table."""
    axes = "xyz"[: problem.dim]
    normal = np.column_stack([table[f"nu_{axis}"] for axis in axes])
    if problem.dim == 2:
        tangent = tangent_of(normal)
        slip, friction = table["u_t"][:, None] * tangent, table["tau"][:, None] * tangent
    else:
        slip = np.column_stack([table[f"u_t{axis}"] for axis in axes])
        friction = np.column_stack([table[f"tau_{axis}"] for axis in axes])
    return ContactResult(
        points=np.column_stack([table[axis] for axis in axes]),
        weight=table["weight"],
        normal=normal,
        gap=table["gap"],
        opening=table["gap"] - table["u_n"],
        pressure=table["pressure"],
        traction=table["pressure"][:, None] * normal + friction,
        friction_bound=table["bound"],
        slip=slip,
        status=table["status"],
        potential=table.get("phi"),
        charge=table.get("d_n"),
        _problem=problem,
    )


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


def _fields(
    problem: ContactProblem, table: Table, names: NDArray[np.int64], x: Array
) -> dict[str, Values]:
    """Return the fields at nodes of given global names and unknowns."""
    d, size = problem.dim, problem.equilibrium.space.dofmap.index_map.size_global
    rows = np.searchsorted(names, table["entry"] * size + table["node"])
    fields: dict[str, Values] = {"displacement": x[:, :d]}
    if problem.piezoelectric:
        fields["potential"] = problem.equilibrium.phi_scale * x[:, d]
    for name, values in values_of(SURFACE, _result(problem, table)).items():
        none = np.nan if values.dtype.kind == "f" else -1
        fields[name] = np.full((len(names), *values.shape[1:]), none, dtype=values.dtype)
        fields[name][rows] = values
    return fields


def _completed(values: Values, grid: Grid) -> Values:
    """Give the corners of facets of degree 2 in 3-D the mean of the nodes beside them.

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
