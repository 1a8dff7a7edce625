"""Sizes of the parts and regions of a mesh, as `contact check` prints them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import _compat
from contact.body.rollers import SMOOTH
from contact.errors import counted
from contact.mesh.cells import rule, shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import cells_at
from contact.mesh.geometry import facet_normals, measures
from contact.typing import Array

#: Length of the mean of a part's normals from which on the part counts as flat, and below which
#: they cancel.
FLAT, CLOSED = 1 - 1e-6, 1e-6

#: Most directions of plane faces, as of a polyhedron with edges, and at smaller angles, if each of
#: them has so many facets.
MOST, FACES, FACETS = 12, 3, 4


def parts(domain: Domain) -> list[str]:
    """Return a line for each part: its facets, area, centroid and mean normal. Collective."""
    d, mesh = domain.dim, domain.mesh
    x, normal = ufl.SpatialCoordinate(mesh), ufl.FacetNormal(mesh)
    values = [1.0, *(x[i] for i in range(d)), *(normal[i] for i in range(d))]
    rows = []
    for name in sorted(domain.parts):
        facets = domain.parts[name]
        data = [(1, _compat.facet_entities(mesh, facets))]
        measure = ufl.Measure("ds", domain=mesh, subdomain_data=data)(1)
        area, *rest = _integrals(domain, values, measure)
        count = domain.comm.allreduce(facets.size, op=MPI.SUM)
        if not area > 0:  # facets on the axis of revolution
            rows.append([name, counted(count, "facet"), "on the axis", "", ""])
            continue
        centroid, mean = np.reshape(rest, (2, d)) / area
        length = float(np.linalg.norm(mean))
        faces = 1 if length >= FLAT else plane_faces(domain, name, count)
        across = f"normal {vector(mean)}"
        if length < CLOSED:
            across = "normals that cancel"
        elif length < FLAT:
            across = f"mean normal {vector(mean / length)}"
        if faces != 1:
            across = f"{f'plane faces in {faces} directions' if faces else 'curved'}, {across}"
        place = f"centroid {vector(domain.resultant(centroid))}"
        rows.append([name, counted(count, "facet"), f"{_extent(domain)} {area:.6g}", place, across])
    inside = [*table([_inside(domain, name) for name in sorted(domain.inside)])]
    return [
        "# parts of its boundary:",
        *table(rows),
        *(["# parts inside of it:"] if inside else []),
        *inside,
    ]


def plane_faces(domain: Domain, part: str, count: int) -> int:
    """Return how many directions the plane faces of a part have, 0 if it is curved. Collective.

    Between plane faces are edges. At most `FACES` may also meet at smaller angles, for they have
    several facets each: a curved part has as many directions as facets, or as rows of these.

    Parameters
    ----------
    domain, part
        The mesh, and a part of its boundary.
    count
        How many facets it has.
    """
    normal = facet_normals(domain, part, domain.order)[2].reshape(-1, domain.dim)
    unit = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    own = np.unique(np.round(unit, 6) + 0.0, axis=0)[: MOST + 1]
    every = np.unique(np.concatenate(domain.comm.allgather(own)), axis=0)
    apart = every @ every.T - 2 * np.eye(len(every))
    edges = len(every) <= MOST and apart.max(initial=-1.0) < SMOOTH
    few = len(every) <= FACES and count >= FACETS * len(every)
    return len(every) if edges or few else 0


def _inside(domain: Domain, name: str) -> list[str]:
    """Return the facets, area and centroid of a part inside of the body. Collective."""
    facets, d, order = domain.inside[name], domain.dim, domain.order
    cells, place = cells_at(domain.mesh, facets)
    shape = shape_of(domain.mesh)
    x = domain.mesh.geometry.x[_compat.geometry_dofmap(domain.mesh)[cells]][:, :, :d]
    nodes = np.take_along_axis(x, shape.facet_nodes(order)[place][:, :, None], axis=1)
    at, weights = rule(shape.facet, 2 * order)
    areas = measures(domain.revolved, shape.facet, nodes, at, weights)
    points = np.einsum("qk,fkd->fqd", shape.facet.lagrange(order, at), nodes)
    local = np.array([facets.size, areas.sum(), *np.einsum("fq,fqd->d", areas, points)])
    count, area, *moment = domain.comm.allreduce(local, op=MPI.SUM)
    centroid = vector(domain.resultant(np.array(moment) / area if area > 0 else np.zeros(d)))
    return [
        name,
        counted(round(count), "facet"),
        f"{_extent(domain)} {area:.6g}",
        f"centroid {centroid}",
    ]


def regions(domain: Domain) -> list[str]:
    """Return a line for each region: its cells and volume. Collective."""
    rows = []
    for name in sorted(domain.regions):
        cells = domain.regions[name]
        measure = ufl.Measure("dx", domain=domain.mesh, subdomain_data=[(1, cells)])(1)
        (volume,) = _integrals(domain, [1.0], measure)
        count = domain.comm.allreduce(cells.size, op=MPI.SUM)
        word = "volume" if domain.dim == 3 or domain.revolved else "area"
        rows.append([name, counted(count, "cell"), f"{word} {volume:.6g}"])
    return ["# regions:", *table(rows)]


def _integrals(domain: Domain, values: Sequence[Any], measure: ufl.Measure) -> Array:
    """Return the integrals of values, of the whole body. Collective.

    The factors are constants, so that one form is compiled for all parts.
    """
    mesh = domain.mesh
    factors = [fem.Constant(mesh, 0.0) for _ in values]
    extent = domain.kinematics.extent(ufl.SpatialCoordinate(mesh))
    integrand = sum(factor * value for factor, value in zip(factors, values, strict=True))
    form = fem.form((integrand if extent is None else extent * integrand) * measure)
    found = []
    for factor in factors:
        factor.value = 1.0
        found.append(fem.assemble_scalar(form))
        factor.value = 0.0
    return np.asarray(domain.comm.allreduce(np.array(found), op=MPI.SUM))


def _extent(domain: Domain) -> str:
    return "area" if domain.dim == 3 or domain.revolved else "length"


def vector(values: Array) -> str:
    """Return a vector, without the rounding of its zeros."""
    values = np.where(np.abs(values) < 1e-12 * np.abs(values).max(initial=0.0), 0.0, values)
    return f"({', '.join(f'{value:.6g}' for value in values)})"


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Give the rows with aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        yield "#   " + "  ".join(cells).rstrip()
