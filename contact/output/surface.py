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
from contact.mesh.owners import ALONE, Owners
from contact.output.formats import Grid, Table, Values
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
    """Return the contact part, the same on all ranks, or in pieces the facets of this one.

    Collective.
    """
    problem, d = solution.problem, solution.problem.dim
    body, comm, whole = problem.equilibrium, problem.comm, not solution.in_pieces
    size = body.space.dofmap.index_map.size_global
    # A node of two contacts is one of each.
    own = [
        k * size + surface_of(problem.domain, body.space, entry.on).nodes
        for k, entry in enumerate(problem.entries)
    ]
    facets = np.concatenate(
        [n for own_k in own for n in (comm.allgather(own_k) if whole else [own_k])]
    )
    known, cells = np.unique(facets, return_inverse=True)
    points, x = (_at_nodes if whole else _near_nodes)(solution, known % size)
    owner = (known // size).astype(np.int32)
    rigid = np.array([contact.against is None for contact in problem.contacts], dtype=np.int32)
    fields = {"displacement": x[:, :d], "entry": owner, "rigid": rigid[owner]}
    if problem.piezoelectric:
        fields["potential"] = body.phi_scale * x[:, d]
    listed = solution.listed_contact
    numbers = listed.entry * size + listed.node
    for name, values in values_of(SURFACE, listed).items():
        if whole:
            fields[name] = _at(known, numbers, values)
        else:
            fields[name] = _of_owners(solution, known, size, numbers, values)
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


def _at(known: NDArray[np.int64], numbers: NDArray[np.int64], values: Values) -> Values:
    """Return values by numbers at some that are known: NaN, or -1, where there is none."""
    none = np.nan if values.dtype.kind == "f" else -1
    found = np.full((len(known), *values.shape[1:]), none, dtype=values.dtype)
    order = np.argsort(numbers)
    place = np.searchsorted(numbers, known, sorter=order)
    there = place < numbers.size
    there[there] = numbers[order[place[there]]] == known[there]
    found[there] = values[order[place[there]]]
    return found


def _of_owners(
    solution: Solution,
    known: NDArray[np.int64],
    size: int,
    numbers: NDArray[np.int64],
    values: Values,
) -> Values:
    """Return values as `_at`, those of nodes of other ranks from these. Collective."""
    problem = solution.problem
    owners = Owners.of(problem.equilibrium.layout.index_map, problem.comm)
    found = _at(known, numbers, values)
    for k in range(len(problem.entries)):

        def of(given: NDArray[np.int64], begin: int = k * size) -> Values:
            return _at(begin + given, numbers, values)

        here = known // size == k
        found[here] = owners.values(known[here] % size, of)
    return found


def _near_nodes(solution: Solution, nodes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return points and unknowns as `_at_nodes`, each from the owner of the node. Collective."""
    problem, body = solution.problem, solution.problem.equilibrium
    owners, points = Owners.of(body.layout.index_map, problem.comm), body.layout.points
    values = np.concatenate([points, body.nodal(solution.state.x)[: len(points)]], axis=1)
    found = owners.values(nodes, lambda given: values[given - owners.begin])
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
