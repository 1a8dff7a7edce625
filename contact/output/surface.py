"""The contact nodes of all ranks as arrays, and both sides of contacts as surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.interface.entries import Entry
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Lumping
from contact.interface.mortar.surface import surface_of
from contact.mesh.entities import owned_among
from contact.output.quantities import AGAINST, SURFACE, values_of
from contact.output.solved import Solved, tangent_of
from contact.output.table import Table
from contact.output.vtu import Grid
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Nodes with less than this share of the mean area have none but by rounding.
LEAST_AREA = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class ContactResult:
    """The contact nodes of all ranks, on each of them, in the order of ``contact.csv``.

    Attributes
    ----------
    points, weight
        Places in the reference configuration, shape (n, d), and the areas they stand for, (n,).
    normal
        Contact direction, out of the body, shape (n, d).
    gap, opening
        Initial and present distance to the foundation along it, shape (n,) (length).
    pressure, traction
        Contact pressure -sigma_nu, (n,), and stress of the body on the foundation, (n, d).
    friction_bound, slip
        Shape (n,) (stress); and tangential displacement, shape (n, d) (length).
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
        words = f"{self.status.size} nodes, {closed} in contact"
        return f"<ContactResult: {words}, pressure up to {self.pressure.max(initial=0.0):.4g}>"

    def function(self, name: str) -> fem.Function:
        """Return one of the arrays as a function on a mesh of the contact surface. Collective.

        It is NaN at nodes that are held, and hence no contact nodes.

        Raises
        ------
        InputError
            If there is no such array of numbers.
        """
        arrays = {k: v for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        known = {k: v for k, v in arrays.items() if v.dtype.kind == "f"}
        if name not in known:
            raise InputError(f"contact.function({name!r}): accepted: {', '.join(known)}")
        values, domain = known[name], self._problem.domain
        facets = np.concatenate([domain.facets(contact.on) for contact in self._problem.contacts])
        surface = dmesh.create_submesh(domain.mesh, domain.dim - 1, np.unique(facets))[0]
        element = ("Lagrange", self._problem.equilibrium.degree, values.shape[1:])
        made = fem.Function(fem.functionspace(surface, element), name=name)
        places = made.function_space.tabulate_dof_coordinates()[:, : domain.dim]
        distance, nearest = KDTree(self.points).query(places)
        rows = values[nearest]
        rows[distance > 1e-9 * domain.size] = np.nan
        made.x.array[:] = rows.ravel()
        return made


def contact_result(problem: ContactProblem, table: Table) -> ContactResult:
    """Return the contact nodes of a table."""

    def vectors(name: str) -> Array:
        return np.column_stack([table[name.format(axis)] for axis in "xyz"[: problem.dim]])

    normal = vectors("nu_{}")
    if problem.dim == 2:
        tangent = tangent_of(normal)
        slip, friction = table["u_t"][:, None] * tangent, table["tau"][:, None] * tangent
    else:
        slip, friction = vectors("u_t{}"), vectors("tau_{}")
    return ContactResult(
        points=vectors("{}"),
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


def contact_surface(solution: Solved, table: Table | None) -> Grid | None:
    """Return the contact part on rank 0, where its table is; None elsewhere. Collective."""
    problem, d = solution.problem, solution.problem.dim
    body, comm = problem.equilibrium, problem.comm
    size = body.space.dofmap.index_map.size_global
    # A node of two contacts is one of each.
    facets = np.concatenate(
        [
            k * size + surface_of(problem.domain, body.space, entry.on).gathered(comm).nodes
            for k, entry in enumerate(problem.entries)
        ]
    )
    known, cells = np.unique(facets, return_inverse=True)
    points, x = _at_nodes(solution, known % size)
    if table is None:
        return None
    owner = (known // size).astype(np.int32)
    rigid = np.array([contact.against is None for contact in problem.contacts], dtype=np.int32)
    fields = {"displacement": x[:, :d], "entry": owner, "rigid": rigid[owner]}
    if problem.piezoelectric:
        fields["potential"] = body.phi_scale * x[:, d]
    rows = np.searchsorted(known, table["entry"] * size + table["node"])
    for name, values in values_of(SURFACE, contact_result(problem, table)).items():
        none = np.nan if values.dtype.kind == "f" else -1
        fields[name] = np.full((len(known), *values.shape[1:]), none, dtype=values.dtype)
        fields[name][rows] = values
    return Grid(points, cells.reshape(facets.shape), d - 1, fields)


def _at_nodes(solution: Solved, nodes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return points and unknowns, (n, d) and (n, k), of nodes by global numbers. Collective."""
    problem, body = solution.problem, solution.problem.equilibrium
    points = body.layout.points
    values = np.concatenate([points, body.nodal(solution.state.x)[: len(points)]], axis=1)
    here, local = owned_among(body.layout.index_map, nodes)
    found = np.zeros((nodes.size, values.shape[1]))
    found[here] = values[local]
    problem.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.SUM)
    return found[:, : problem.dim], found[:, problem.dim :]


def opposite_surface(solution: Solved) -> Grid | None:
    """Return the parts `against` with the stresses there, the same on all ranks. Collective.

    Multipliers live on the other side. Here the forces int N_l lambda act, which belong to nodes of
    this one; divided by the areas of these they are stresses again. A constant pressure is the same
    constant here, and forces are the same on both sides.

    None where all obstacles are rigid.
    """
    problem, d = solution.problem, solution.problem.dim
    body = problem.equilibrium
    stresses = np.column_stack([solution.pressure, solution.forces.vectors(problem.nodes)])
    ends = np.cumsum([entry.nodes.nodes.size for entry in problem.entries])[:-1]
    sides, cells, count = [], [], 0
    for i, own in enumerate(np.split(stresses, ends)):
        against, entry = problem.contacts[i].against, problem.entries[i]
        if against is None or entry.coupling is None:
            continue
        surface = surface_of(problem.domain, body.space, against).gathered(problem.comm)
        lumped = Lumping.of(surface)
        acting = _acting(problem, entry, entry.coupling, lumped, own)
        points, x = _at_nodes(solution, lumped.nodes)
        sides.append(
            {
                "points": points,
                "displacement": x[:, :d],
                "pressure": acting[:, 0],
                "traction": acting[:, 1:],
                "normal": lumped.normal / np.linalg.norm(lumped.normal, axis=1)[:, None],
                "weight": lumped.weight,
                "entry": np.full(lumped.nodes.size, i, dtype=np.int32),
            }
        )
        cells.append(count + np.searchsorted(lumped.nodes, surface.nodes))
        count += lumped.nodes.size
    if not sides:
        return None
    fields = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    return Grid(fields.pop("points"), np.concatenate(cells), d - 1, fields)


def _acting(
    problem: ContactProblem, entry: Entry, coupling: Coupling, lumped: Lumping, own: Array
) -> Array:
    """Return the stresses of this rank's contact nodes on the other side, shape (m, k)."""
    names = problem.equilibrium.layout.index_map.local_to_global(entry.nodes.nodes)
    forces = np.zeros((coupling.nodes.size, own.shape[1]))
    forces[np.searchsorted(coupling.nodes, names)] = entry.nodes.weight[:, None] * own
    problem.comm.Allreduce(MPI.IN_PLACE, forces, op=MPI.SUM)
    on_nodes = np.zeros((lumped.nodes.size, own.shape[1]))
    on_nodes[np.searchsorted(lumped.nodes, coupling.masters)] = coupling.other.T @ forces
    if lumped.mixing is not None:
        # Forces on coefficients S u, given those on u.
        on_nodes = splu(lumped.mixing.own.T.tocsc()).solve(on_nodes)
    some = lumped.weight > LEAST_AREA * lumped.weight.mean()
    return np.where(some[:, None], on_nodes / np.where(some, lumped.weight, 1.0)[:, None], np.nan)


def opposite_table(problem: ContactProblem, surface: Grid) -> Table:
    """Return the rows of ``contact-against.csv``: nodes with an area, contact by contact."""
    fields, size = surface.at_points, problem.domain.size
    # Mesh generators leave coordinates such as -3e-19.
    points = np.where(np.abs(surface.points) < 1e-15 * size, 0.0, surface.points)
    names = np.array([contact.against or "" for contact in problem.contacts])
    columns = values_of(AGAINST, {"on": names[fields["entry"]], "x": points, **fields})
    rounded = np.round(points / (1e-9 * size))
    order = np.lexsort((*rounded.T[::-1], fields["entry"]))
    order = order[np.isfinite(columns["pressure"][order])]
    return {name: values[order] for name, values in columns.items()}
