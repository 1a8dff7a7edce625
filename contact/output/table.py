"""The contact nodes of all ranks in one table, sorted along Gamma_3."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from contact.interface.mortar.surface import surface_of
from contact.output.quantities import NODES, quantities, values_of
from contact.output.solved import Solved
from contact.problem.problem import ContactProblem

Table = Mapping[str, NDArray[Any]]


def contact_table(solution: Solved) -> Table | None:
    """Return a column a quantity on rank 0 and None elsewhere. Collective.

    These are the columns of ``contact.csv`` (`csv_columns`), the contact direction ``nu_x``...
    and the numbers of the node, over all ranks, and of the contact: ``node``, ``entry``.

    In 2-D the rows follow Gamma_3 from node to node, each connected piece from its end
    with the smaller x (then y), and ``u_t`` and ``tau`` are the components of u_tau and
    lambda_f = -sigma_tau along `tangent_of` the contact direction. In 3-D they are vectors
    and the rows are sorted by x, then y, then z. Of several contacts the rows of one follow
    those of another.
    """
    problem, nodes = solution.problem, solution.problem.nodes
    columns: dict[str, NDArray[Any]] = values_of(NODES, solution)
    columns |= {f"nu_{axis}": nodes.normal[:, i] for i, axis in enumerate("xyz"[: problem.dim])}
    columns |= {
        "node": problem.equilibrium.layout.index_map.local_to_global(nodes.nodes),
        "entry": solution.entry,
    }
    order = _order(problem)
    gathered = {name: problem.comm.gather(values) for name, values in columns.items()}
    if order is None:
        return None
    whole = {name: np.concatenate(values)[order] for name, values in gathered.items()}
    by_entry = np.argsort(whole["entry"], kind="stable")
    return {name: values[by_entry] for name, values in whole.items()}


def csv_columns(table: Table) -> Table:
    """Return the columns of ``contact.csv``: all but contact direction and numbers."""
    known = quantities(NODES)
    return {name: v for name, v in table.items() if any(q.fits(name) for q in known)}


def write_table(columns: Table, path: Path) -> None:
    """Write columns. On one rank."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_csv(path, columns, rows)


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table, numbers to the last digit. On one rank."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def _order(problem: ContactProblem) -> NDArray[np.intp] | None:
    """Return the order of the gathered contact nodes, on rank 0."""
    nodes, comm = problem.nodes, problem.comm
    index_map = problem.equilibrium.layout.index_map
    names = comm.gather(index_map.local_to_global(nodes.nodes))
    points = comm.gather(nodes.points)
    links = comm.gather(_links(problem)) if problem.dim == 2 else None
    if names is None or points is None:
        return None
    where = np.concatenate(points)
    # Coordinates that differ by rounding alone must not change the order.
    rounded = np.round(where / (1e-9 * problem.domain.size))
    sorted_points = np.lexsort(rounded.T[::-1])
    if links is None:
        return sorted_points
    return _along_chain(np.concatenate(names), sorted_points, np.concatenate(links))


def _links(problem: ContactProblem) -> NDArray[np.int64]:
    """Return the global numbers of neighbours on the owned facets of Gamma_3, shape (m, 2)."""
    space = problem.equilibrium.space
    parts = [surface_of(problem.domain, space, contact.on).nodes for contact in problem.contacts]
    nodes = np.concatenate(parts)
    # Both ends, then the middle node if there is one.
    chain = nodes if nodes.shape[1] == 2 else nodes[:, [0, 2, 1]]
    return np.concatenate([chain[:, k : k + 2] for k in range(chain.shape[1] - 1)])


def _along_chain(
    names: NDArray[np.int64], by_position: NDArray[np.intp], links: NDArray[np.int64]
) -> NDArray[np.intp]:
    """Follow the links from node to node; pieces come in the order of their first ends."""
    both = np.isin(links, names).all(axis=1)
    # Number the nodes by position, so that every choice below is one of position.
    rank = np.empty_like(by_position)
    rank[by_position] = np.arange(by_position.size)
    sorter = np.argsort(names)
    edges = rank[sorter[np.searchsorted(names, links[both], sorter=sorter)]]
    n = names.size
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(n, n)).tocsr()
    graph = graph + graph.T
    degree = np.diff(graph.indptr)
    count, piece = csgraph.connected_components(graph, directed=False)
    # The end of a piece; a closed curve has none and begins at its first node.
    first = np.lexsort((np.arange(n), degree > 1, piece))
    starts = first[np.searchsorted(piece[first], np.arange(count))]
    chains = [
        csgraph.depth_first_order(graph, start, directed=False, return_predecessors=False)
        for start in np.sort(starts)
    ]
    return np.asarray(by_position[np.concatenate(chains)])
