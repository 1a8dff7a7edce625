"""Data oscillation: the part of the loads that the linear functions of a mesh do not see.

Verfürth, A Posteriori Error Estimation Techniques for Finite Element Methods, 2013, section 1.4:
sum over facets of h |t - t_h|^2 and over cells of h^2 |f - f_h|^2, here with t_h and f_h of the
mean loads at the nodes. Recovered stresses know of the loads at the nodes alone.
"""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem, la
from numpy.typing import NDArray

from contact import _compat
from contact.model.fields import constant
from contact.body.loads import expression
from contact.mesh.cells import rule, shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import cells_at
from contact.mesh.geometry import geometry_nodes, measures
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Degrees of the rules on facets, far above that of the loads' own, and in cells, which are many.
ON_FACETS, IN_CELLS = 9, 4


def oscillation(problem: ContactProblem, time: float) -> Array:
    """Return the square of the oscillation of the owned cells, shape (cells,). Collective.

    Over a modulus it is an energy. The constants are those of Poincaré's inequality, h/pi; of
    several loads on a part the squares are added. Charges do not count.

    Parameters
    ----------
    problem, time
        The problem, and the time of its loads.
    """
    domain = problem.domain
    mesh, d = domain.mesh, domain.dim
    squares = np.zeros(mesh.topology.index_map(d).size_local)
    whole = shape_of(mesh)
    facets, x, now = whole.facet_corners, ufl.SpatialCoordinate(mesh), constant(mesh, time)
    vertices = _compat.geometry_dofmap(mesh)[:, : whole.corners]
    for number, load in enumerate(problem.equilibrium.body.loads):
        varying = {
            name: field
            for name, field in load.named.items()
            if not (
                getattr(field, "is_constant", False) or name.startswith("force") or "charge" in name
            )
        }
        if not varying:
            continue
        shape = whole
        cells: Indices = np.arange(len(squares), dtype=np.int32)
        place: NDArray[np.intp] = np.zeros(len(squares), dtype=np.intp)
        if load.on is not None:
            shape = whole.facet
            cells, place = cells_at(mesh, domain.facets(load.on))
        of, corners = geometry_nodes(domain, cells), vertices[cells]
        at, weights = rule(shape, IN_CELLS if load.on is None else ON_FACETS)
        points = at
        if load.on is not None:
            points = np.concatenate([whole.on_facet(k, at) for k in range(len(facets))])
        key = f"load.{number}"
        given = [expression(domain, f, x, now, f"{key}.{name}") for name, f in varying.items()]
        made = fem.Expression(ufl.as_vector(given), points)
        shown = len(cells), len(points) // len(at), len(at), len(given)
        values = np.asarray(made.eval(mesh, cells)).reshape(shown)
        found = load.factor(time) * values[np.arange(len(cells)), place]
        if load.on is not None:
            nodes = whole.facet_nodes(domain.order)[place]
            of = np.take_along_axis(of, nodes[..., None], axis=1)
            corners = np.take_along_axis(corners, facets[place], axis=1)
        sizes = measures(domain.revolved, shape, of, at, weights)
        unseen = found - _seen(domain, corners, shape.lagrange(1, at), sizes, found)
        area = measures(False, shape, of, at, weights).sum(axis=1)
        share = (area ** (1 / shape.dim) / np.pi) ** (1 + (load.on is None))
        np.add.at(squares, cells, share * np.einsum("nq,nqc->n", sizes, unseen**2))
    return squares


def _seen(
    domain: Domain, corners: NDArray[np.integer], hats: Array, sizes: Array, values: Array
) -> Array:
    """Return the linear functions of the mean values around vertices, as the values. Collective.

    Parameters
    ----------
    domain, corners
        The mesh, and the vertices of facets or cells, shape (n, corners).
    hats, sizes, values
        The linear functions at the points, (q, corners), weights, (n, q), and values, (n, q, c).
    """
    index_map = domain.mesh.geometry.index_map()
    total = la.vector(index_map, values.shape[2] + 1)
    sums = total.array.reshape(-1, values.shape[2] + 1)
    with_ones = np.concatenate([values, np.ones((*sizes.shape, 1))], axis=2)
    np.add.at(sums, corners, np.einsum("nq,qk,nqc->nkc", sizes, hats, with_ones))
    total.scatter_reverse(la.InsertMode.add)
    total.scatter_forward()
    found = sums[corners]
    # On the axis of revolution there is no area.
    means = found[..., :-1] / np.where(found[..., -1:] > 0, found[..., -1:], 1.0)
    return np.asarray(hats @ means)
