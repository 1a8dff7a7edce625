"""Both sides of contacts as tables and as surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from contact.interface.entries import Entry
from contact.interface.mortar.coupling import Coupling
from contact.interface.mortar.lumping import Lumping
from contact.interface.mortar.surface import Surface, surface_of
from contact.mesh.cells import shape_of
from contact.mesh.entities import owned_among
from contact.mesh.owners import ALONE
from contact.output.formats import Grid, Table
from contact.output.quantities import AGAINST, NODES, SURFACE, values_of
from contact.output.solution import Solution
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Nodes with less than this share of the mean area have none but by rounding.
LEAST_AREA = 1e-9


def contact_table(solution: Solution) -> Table:
    """Return the columns of ``contact.csv``, the same on all ranks. Collective.

    In 2-D ``u_t`` and ``tau`` are the components of u_tau and lambda_f = -sigma_tau along
    `tangent_of` the contact direction; in 3-D they are vectors.
    """
    return values_of(NODES, solution.contact)


def contact_surface(solution: Solution) -> Grid:
    """Return the contact part, the same on all ranks. Collective."""
    problem, d = solution.problem, solution.problem.dim
    body, comm = problem.equilibrium, problem.comm
    size = body.space.dofmap.index_map.size_global
    # A node of two contacts is one of each.
    facets = np.concatenate(
        [
            nodes
            for k, entry in enumerate(problem.entries)
            for nodes in comm.allgather(
                k * size + surface_of(problem.domain, body.space, entry.on).nodes
            )
        ]
    )
    known, cells = np.unique(facets, return_inverse=True)
    points, x = _at_nodes(solution, known % size)
    owner = (known // size).astype(np.int32)
    rigid = np.array([contact.against is None for contact in problem.contacts], dtype=np.int32)
    fields = {"displacement": x[:, :d], "entry": owner, "rigid": rigid[owner]}
    if problem.piezoelectric:
        fields["potential"] = body.phi_scale * x[:, d]
    rows = np.searchsorted(known, solution.contact.entry * size + solution.contact.node)
    for name, values in values_of(SURFACE, solution.contact).items():
        none = np.nan if values.dtype.kind == "f" else -1
        fields[name] = np.full((len(known), *values.shape[1:]), none, dtype=values.dtype)
        fields[name][rows] = values
    return Grid(points, cells.reshape(facets.shape), shape_of(problem.domain.mesh).facet, fields)


def _at_nodes(solution: Solution, nodes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return points and unknowns, (n, d) and (n, k), of nodes by global numbers. Collective."""
    problem, body = solution.problem, solution.problem.equilibrium
    points = body.layout.points
    values = np.concatenate([points, body.nodal(solution.state.x)[: len(points)]], axis=1)
    here, local = owned_among(body.layout.index_map, nodes)
    found = np.zeros((nodes.size, values.shape[1]))
    found[here] = values[local]
    problem.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.SUM)
    return found[:, : problem.dim], found[:, problem.dim :]


def opposite_surface(solution: Solution) -> Grid | None:
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
        surface = _whole(surface_of(problem.domain, body.space, against))
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
    return Grid(
        fields.pop("points"), np.concatenate(cells), shape_of(problem.domain.mesh).facet, fields
    )


def _whole(surface: Surface) -> Surface:
    """Return the facets of all ranks, as if there were one. Collective."""
    size, facets = surface.owners.comm.size, np.arange(surface.count)
    every = surface.sent(np.tile(facets, size), np.repeat(np.arange(size), surface.count))
    return replace(every, owners=ALONE)


def _acting(
    problem: ContactProblem, entry: Entry, coupling: Coupling, lumped: Lumping, own: Array
) -> Array:
    """Return the stresses of all contact nodes on the other side, shape (m, k). Collective.

    Those given are of this rank's nodes.
    """
    on_nodes = np.zeros((lumped.nodes.size, own.shape[1]))
    forces = entry.nodes.weight[:, None] * own
    on_nodes[np.searchsorted(lumped.nodes, coupling.masters)] = coupling.other.T @ forces
    problem.comm.Allreduce(MPI.IN_PLACE, on_nodes, op=MPI.SUM)
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
