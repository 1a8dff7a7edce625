"""Sizes and integrals over a domain, its parts and regions, by quadrature in NumPy."""

import numpy as np
from mpi4py import MPI

from contact.mesh.cells import rule, shape_of
from contact.mesh.entities import cells_at
from contact.mesh.geometry import area, geometry_nodes, outward
from contact.mesh.geometry import integration_weights as weights_of

#: Degree of the rule.
DEGREE = 8


def integral(domain, of=1.0, part=None, region=None):
    """Return the integral of a number or function over a body, part or region. Collective."""
    shape = shape_of(domain.mesh)
    if part is None:
        cells = None if region is None else domain.cells(region)
        nodes = geometry_nodes(domain, cells)
        given = ()
    else:
        cells, place = cells_at(domain.mesh, domain.facets(part))
        whole = geometry_nodes(domain, cells)
        ends = shape.facet_nodes(domain.order)[place]
        shape, nodes = shape.facet, np.take_along_axis(whole, ends[:, :, None], axis=1)
    at, weights = rule(shape, DEGREE)
    points = shape.lagrange(domain.order, at) @ nodes
    if part is not None:
        across = outward(shape, nodes, whole.mean(axis=1), at)
        normals = across / np.linalg.norm(across, axis=2, keepdims=True)
        given = (np.broadcast_to(normals, points.shape).T,)
    values = of(points.T, *given) if callable(of) else of
    own = np.sum(weights_of(domain.revolved, shape, nodes, at, weights).T * values)
    return domain.comm.allreduce(float(own), op=MPI.SUM)


def sizes_of_parts(domain):
    """Return the length or area of each part."""
    return {name: area(domain, name) for name in domain.parts}
