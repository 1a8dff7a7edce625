"""Sizes of the parts and regions of a mesh, as `contact check` prints them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import counted
from contact.mesh.cells import rule, shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import cells_at
from contact.mesh.geometry import geometry_nodes, integration_weights, outward, volumes
from contact.typing import Array

#: Length of the mean of a part's normals from which on the part counts as flat, and below which
#: they cancel.
FLAT, CLOSED = 1 - 1e-6, 1e-6


def parts(domain: Domain) -> list[str]:
    """Return a line for each part: its facets, area, centroid and mean normal. Collective."""
    rows, inside = [], []
    for name in sorted(domain.parts):
        count, area, centroid, mean = _sizes(domain, domain.parts[name])
        if not area > 0:  # facets on the axis of revolution
            rows.append([name, counted(count, "facet"), "on the axis", "", ""])
            continue
        length = float(np.linalg.norm(mean))
        across = f"normal {vector(mean)}"
        if length < CLOSED:
            across = "not plane, normals that cancel"
        elif length < FLAT:
            across = f"not plane, mean normal {vector(mean / length)}"
        rows.append([*_row(domain, name, count, area, centroid), across])
    for name in sorted(domain.inside):
        count, area, centroid, _ = _sizes(domain, domain.inside[name])
        inside.append(_row(domain, name, count, area, centroid))
    return [
        "# parts of its boundary:",
        *table(rows),
        *(["# parts inside of it:"] if inside else []),
        *table(inside),
    ]


def _row(domain: Domain, name: str, count: int, area: float, centroid: Array) -> list[str]:
    extent = "area" if domain.dim == 3 or domain.revolved else "length"
    place = f"centroid {vector(domain.resultant(centroid))}"
    return [name, counted(count, "facet"), f"{extent} {area:.6g}", place]


def _sizes(domain: Domain, facets: Indices) -> tuple[int, float, Array, Array]:
    """Return number, area, centroid and mean normal of facets, of the whole body. Collective."""
    cells, place = cells_at(domain.mesh, facets)
    shape, order, behind = shape_of(domain.mesh), domain.order, geometry_nodes(domain, cells)
    nodes = np.take_along_axis(behind, shape.facet_nodes(order)[place][:, :, None], axis=1)
    at, weights = rule(shape.facet, 4 * order)
    areas = integration_weights(domain.revolved, shape.facet, nodes, at, weights)
    points = np.einsum("qk,fkd->fqd", shape.facet.lagrange(order, at), nodes)
    normal = outward(shape.facet, nodes, behind.mean(axis=1), at)
    normal = normal / np.linalg.norm(normal, axis=2, keepdims=True)
    both = np.concatenate([points, np.broadcast_to(normal, points.shape)], axis=2)
    local = np.array([facets.size, areas.sum(), *np.einsum("fq,fqd->d", areas, both)])
    count, area, *sums = domain.comm.allreduce(local, op=MPI.SUM)
    centroid, mean = np.reshape(sums, (2, domain.dim)) / (area if area > 0 else 1.0)
    return round(count), float(area), centroid, mean


def regions(domain: Domain) -> list[str]:
    """Return a line for each region: its cells and volume. Collective."""
    rows, size = [], volumes(domain)
    word = "volume" if domain.dim == 3 or domain.revolved else "area"
    for name in sorted(domain.regions):
        cells = domain.regions[name]
        local = np.array([cells.size, size[cells].sum()])
        count, volume = domain.comm.allreduce(local, op=MPI.SUM)
        rows.append([name, counted(round(count), "cell"), f"{word} {volume:.6g}"])
    return ["# regions:", *table(rows)]


def vector(values: NDArray[np.floating]) -> str:
    """Return a vector, without the rounding of its zeros."""
    values = np.where(np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0), 0.0, values)
    return f"({', '.join(f'{value:.6g}' for value in values)})"


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Give the rows with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "#   " + "  ".join(cells).rstrip()
