"""Both sides of contacts as tables and as surfaces."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact.interface.mortar.lumping import Lumping, Mixing
from contact.interface.mortar.surface import surface_of
from contact.mesh.cells import shape_of
from contact.mesh.owners import Owners
from contact.problem.problem import ContactProblem
from contact.results.grid import Grid, Table, Values
from contact.results.quantities import values_of
from contact.results.quantity import AGAINST, NODES, SURFACE
from contact.results.solution import Solution
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
    """Return this rank's share of the contact part. Collective."""
    problem, d = solution.problem, solution.problem.dim
    body = problem.equilibrium
    owners = Owners.of(body.layout.index_map, problem.comm)
    parts = [surface_of(problem.domain, body.space, contact.on) for contact in problem.contacts]
    # A node of two contacts is one of each.
    nodes, cells = _numbered(owners, [part.nodes for part in parts])
    owner = np.repeat(np.arange(len(nodes)), [own.size for own in nodes]).astype(np.int32)
    points, x = _at_nodes(solution, np.concatenate(nodes) - owners.begin)
    rigid = np.array([contact.against is None for contact in problem.contacts], dtype=np.int32)
    fields: dict[str, Values] = {
        "displacement": x[:, :d],
        "entry": owner,
        "rigid": rigid[owner],
    }
    if problem.piezoelectric:
        fields["potential"] = body.phi_scale * x[:, d]
    listed, size = solution.contact, owners.begins[-1]
    known, numbers = owner * size + np.concatenate(nodes), listed.entry * size + listed.node
    for name, values in values_of(SURFACE, listed).items():
        fields[name] = _at(known, numbers, values)
    return Grid(points, cells, shape_of(problem.domain.mesh).facet, fields)


def _numbered(
    owners: Owners, sides: Sequence[NDArray[np.int64]]
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return the nodes of this rank on facets, and the facets by numbers of them. Collective."""
    # The nodes of each side, ascending, and those of the ranks one after the other.
    nodes = [owners.requested(facets.ravel()) for facets in sides]
    begin, cells = owners.comm.exscan(sum(own.size for own in nodes)) or 0, []
    for own, facets in zip(nodes, sides, strict=True):

        def of(given: NDArray[np.int64], own: Values = own, first: int = begin) -> Values:
            return first + np.searchsorted(own, given)

        cells.append(owners.values(facets.ravel(), of).reshape(facets.shape))
        begin += own.size
    return nodes, np.concatenate(cells)


def _at_nodes(solution: Solution, nodes: NDArray[np.int64]) -> tuple[Array, Array]:
    """Return points and unknowns, (n, d) and (n, k), of nodes of this rank."""
    body = solution.problem.equilibrium
    return body.layout.points[nodes], body.nodal(solution.state.x)[nodes]


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


def opposite_surface(solution: Solution) -> Grid | None:
    """Return this rank's share of the parts `against` with the stresses there. Collective.

    Multipliers live on the other side. Here the forces int N_l lambda act, which belong to nodes of
    this one; divided by the areas of these they are stresses again. A constant pressure is the same
    constant here, and forces are the same on both sides.

    None where all obstacles are rigid.
    """
    problem, d = solution.problem, solution.problem.dim
    body = problem.equilibrium
    owners = Owners.of(body.layout.index_map, problem.comm)
    stresses = np.column_stack([solution.pressure, solution.forces.vectors(problem.nodes)])
    ends = np.cumsum([own.nodes.nodes.size for own in problem.geometries])[:-1]
    sides, facets = [], []
    for i, own in enumerate(np.split(stresses, ends)):
        against, geometry = problem.contacts[i].against, problem.geometries[i]
        if against is None or geometry.jumps is None:
            continue
        surface = surface_of(problem.domain, body.space, against)
        lumped = Lumping.of(surface)
        acting = _acting(owners, geometry.jumps, lumped, geometry.nodes.weight[:, None] * own)
        points, x = _at_nodes(solution, lumped.nodes - owners.begin)
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
        facets.append(surface.nodes)
    if not sides:
        return None
    fields = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    _, cells = _numbered(owners, facets)
    return Grid(fields.pop("points"), cells, shape_of(problem.domain.mesh).facet, fields)


def _acting(owners: Owners, jumps: Mixing, lumped: Lumping, forces: Array) -> Array:
    """Return the stresses on nodes of the other side, (m, k), of forces at contact nodes."""
    # Of all ranks, on nodes of this one. Collective.
    on_nodes: Array = np.zeros((lumped.nodes.size, forces.shape[1]))
    nodes, sums = owners.sums(jumps.masters, jumps.M.T @ forces)
    on_nodes[np.searchsorted(lumped.nodes, nodes)] = sums
    if lumped.mixing is not None:
        on_nodes = lumped.mixing.on_coefficients(owners, on_nodes)
    weight = lumped.weight
    area, count = owners.comm.allreduce(np.array([weight.sum(), weight.size]))
    some = weight > LEAST_AREA * area / count
    return np.where(some[:, None], on_nodes / np.where(some, weight, 1.0)[:, None], np.nan)


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
