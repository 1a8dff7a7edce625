"""Local Neumann problems for the error of quadratic elements, cell by cell.

Bank and Weiser, Math. Comp. 44, 1985. In each cell the error is sought among the cubics that vanish
at the nodes: M strain(e) : strain(v) = work of the loads - flux : strain(v) + work of the mean flux
through the facets. The flux is sigma, with D where there is coupling, and the strain eps, with
E = -grad phi. Recovery of the stress, which serves degree 1, follows that of degree 2 into its
singularities, and sees half of the error there.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
from dolfinx import la
from numpy.typing import NDArray

from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.domain import Indices
from contact.mesh.simplices import (
    barycentric,
    corners,
    inverse_jacobians,
    lagrange,
    measures,
    rule,
)
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array
from forms.crystal import VOIGT

#: Cells that are solved at once.
CHUNK = 10_000


@cache
def surplus(degree: int, dim: int) -> tuple[Array, Array]:
    """Return the cubics without values at nodes at the points of a rule, and their derivatives.

    One an edge, L_i L_j (L_i - L_j), and one a triangle, L_i L_j L_k; shapes (q, n), (q, n, dim).
    """
    at, _ = rule(dim, degree)
    return cubics(at), _derivatives(at)


def cubics(at: Array) -> Array:
    """Return the cubics without values at nodes, shape (q, n), at barycentric coordinates."""
    size = range(at.shape[1])
    edges = [at[:, i] * at[:, j] * (at[:, i] - at[:, j]) for i, j in combinations(size, 2)]
    faces = [at[:, i] * at[:, j] * at[:, k] for i, j, k in combinations(size, 3)]
    return np.stack(edges + faces, axis=1)


def _derivatives(at: Array) -> Array:
    """Return the derivatives of `cubics` by the coordinates of the reference cell."""
    size = at.shape[1]
    by = np.zeros((len(at), cubics(at).shape[1], size))
    for n, (i, j) in enumerate(combinations(range(size), 2)):
        by[:, n, i] = at[:, j] * (2 * at[:, i] - at[:, j])
        by[:, n, j] = at[:, i] * (at[:, i] - 2 * at[:, j])
    first = size * (size - 1) // 2
    for n, face in enumerate(combinations(range(size), 3), first):
        for i in face:
            by[:, n, i] = np.prod(at[:, [k for k in face if k != i]], axis=1)
    return by[..., 1:] - by[..., :1]


class LocalProblems:
    """The local problems of a body at a state. Collective to make.

    Parameters
    ----------
    problem, state
        The problem, of degree 2, and its state.
    flux
        Stress in the basis of Mandel, with D where there is coupling, at the nodes of the owned
        cells, shape (cells, nodes, 6 or 9).
    """

    def __init__(self, problem: ContactProblem, state: State, flux: Array) -> None:
        body = self._body = problem.equilibrium
        self._flux, self._corners = flux, corners(body.domain)
        self._inverse, self._det = inverse_jacobians(self._corners)
        first = -self._inverse.sum(axis=1, keepdims=True)
        #: Gradients of the barycentric coordinates: of the facets opposite, inner normals.
        self._gradients = np.concatenate([first, self._inverse], axis=1)
        d = body.dim
        layout = body.space.dofmap.dof_layout
        #: The nodes of each facet, as nodes of its cell.
        self._closures = np.array([layout.entity_closure_dofs(d - 1, i) for i in range(d + 1)])
        self._loads = _loads(body, state.time)
        self._through, self._held = self._facets(problem, state)

    def _normal_flux(self) -> Array:
        """Return the flux out of each cell at the nodes of its facets, (cells, d + 1, m, b).

        That of the charge is -D . n, as it works on the potential.
        """
        d, flux = self._body.dim, self._flux[:, self._closures]
        lengths = np.linalg.norm(self._gradients, axis=2, keepdims=True)
        normal = (-self._gradients / lengths)[:, :, None]
        found = np.zeros((*flux.shape[:3], self._body.block_size))
        for m, (i, j) in enumerate(VOIGT):
            if i < d and j < d:
                value = flux[..., m] if i == j else flux[..., m] / np.sqrt(2)
                found[..., i] += value * normal[..., j]
                if i != j:
                    found[..., j] += value * normal[..., i]
        if self._body.piezoelectric:
            found[..., d] = -np.sum(flux[..., 6 : 6 + d] * normal, axis=-1)
        return found

    def _facets(self, problem: ContactProblem, state: State) -> tuple[Array, NDArray[np.bool_]]:
        """Return the flux into each cell through its facets, and which of its components are held.

        Inside it is the mean of both sides. On the boundary it is among the loads, where these are
        known; at a contact that touches, the flux itself. Held components have no error.
        """
        body, d = self._body, self._body.dim
        mesh, space = body.domain.mesh, body.space
        nodes = space.dofmap.list[: len(self._flux), self._closures]
        numbers = space.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32))
        order = np.argsort(numbers.reshape(nodes.shape), axis=2)
        out = self._normal_flux()
        topology = mesh.topology
        topology.create_connectivity(d, d - 1)
        facets = topology.connectivity(d, d - 1).array.reshape(-1, d + 1)[: len(self._flux)]
        ordered = np.take_along_axis(out, order[..., None], axis=2)
        ordered = ordered.reshape(*facets.shape, int(np.prod(out.shape[2:])))
        total = la.vector(topology.index_map(d - 1), ordered.shape[2] + 1)
        sums = total.array.reshape(-1, ordered.shape[2] + 1)
        np.add.at(sums, facets, np.concatenate([ordered, np.ones((*facets.shape, 1))], axis=2))
        total.scatter_reverse(la.InsertMode.add)
        total.scatter_forward()
        inside = sums[facets, -1] > 1.5
        back = np.argsort(order, axis=2)[..., None]
        jump = np.take_along_axis(sums[facets, :-1].reshape(out.shape), back, axis=2)
        forces = np.zeros(body.owned + body.global_unknowns.size)
        problem.interface.add_forces(forces, state.x, state.forces)
        touch = np.any(body.nodal(body.local(forces)) != 0, axis=1)[nodes].any(axis=2)
        # The traction of an elastic support is none of the loads either.
        for support in body.body.elastic:
            touch |= np.isin(facets, body.domain.facets(support.on))
        own = np.zeros(body.owned + body.global_unknowns.size)
        own[: body.owned] = body.free.ravel()
        free = body.nodal(body.local(own))[nodes].any(axis=2)
        sides = [body.domain.facets(load.on) for load in body.body.loads if load.on]
        loaded = np.isin(facets, np.concatenate([[], *sides]))
        known = ~(inside | touch)[..., None, None]
        through = np.where(known, 0.0, out - np.where(inside[..., None, None], jump / 2, 0.0))
        held = ~inside[..., None] & ((free == 0) | (touch & loaded)[..., None])
        return through, held

    def squares(self, cells: Indices, moduli: Array) -> Array:
        """Return the square of the energy norm of the errors in some of the owned cells.

        Parameters
        ----------
        cells
            The cells.
        moduli
            From strains to fluxes, shape (cells, 6 or 9, 6 or 9), or one for all.
        """
        # Of a material without a field those of a field are zero.
        whole = np.zeros((len(cells), *2 * (9 if self._body.piezoelectric else 6,)))
        whole[:, : moduli.shape[1], : moduli.shape[2]] = moduli
        found = np.zeros(len(cells))
        for first in range(0, len(cells), CHUNK):  # a rank may have none
            piece = slice(first, first + CHUNK)
            found[piece] = self._solved(cells[piece], whole[piece])
        return found

    def _solved(self, cells: Indices, moduli: Array) -> Array:
        body, d = self._body, self._body.dim
        # Strains of the test functions have these components alone.
        kept = [0, 1, 2, 5] if d == 2 else list(range(6))
        kept += [6, 7, 8][:d] * body.piezoelectric
        moduli = moduli[:, kept][:, :, kept]
        degree = 4 + body.domain.revolved
        (at, weights), (values, derivatives) = rule(d, degree), surplus(degree, d)
        volumes = measures(body.domain, self._corners[cells], at, weights, self._det[cells])
        gradients = np.einsum("qak,ckj->cqaj", derivatives, self._inverse[cells], optimize=True)
        strains = np.zeros((*gradients.shape[:3], body.block_size, len(kept)))
        for m, component in enumerate(kept):
            if component >= 6:
                strains[..., d, m] = -gradients[..., component - 6]
                continue
            i, j = VOIGT[component]
            if i == j and i < d:
                strains[..., i, m] = gradients[..., i]
            elif j < d:
                strains[..., i, m] = gradients[..., j] / np.sqrt(2)
                strains[..., j, m] = gradients[..., i] / np.sqrt(2)
            elif body.domain.revolved and i == j:
                strains[..., 0, m] = values / (self._corners[cells][..., 0] @ at.T)[..., None]
        count = len(cells)
        strains = strains.reshape(count, len(weights), -1, len(kept)).swapaxes(2, 3)
        weighted = (volumes[:, :, None, None] * strains).reshape(count, -1, strains.shape[3])
        fluxes = moduli[:, None] @ strains
        matrix = weighted.swapaxes(1, 2) @ fluxes.reshape(weighted.shape)
        known = (lagrange(2, at) @ self._flux[cells])[..., kept].reshape(count, -1, 1)
        right = self._loads[cells] - (weighted.swapaxes(1, 2) @ known)[..., 0].reshape(
            count, -1, body.block_size
        )
        held = np.zeros(right.shape, dtype=bool)
        at, weights = rule(d - 1, 5)
        for facet in range(d + 1):
            there = np.insert(at, facet, 0.0, axis=1)
            values = cubics(there)
            size = np.linalg.norm(self._gradients[cells, facet], axis=1) * self._det[cells]
            areas = measures(body.domain, self._corners[cells], there, weights, size)
            flux = lagrange(2, at) @ self._through[cells, facet]
            right += values.T @ (areas[..., None] * flux)
            acts = np.abs(values).max(axis=0) > 0
            held |= acts[None, :, None] & self._held[cells, facet][:, None]
        if body.piezoelectric:
            held[..., d] |= (moduli[:, -1, -1] == 0)[:, None]
        held, right = held.reshape(count, -1), right.reshape(count, -1)
        right[held] = 0.0
        matrix[held[:, :, None] | held[:, None, :]] = 0.0
        places = np.arange(held.shape[1])
        matrix[:, places, places] += held
        errors = np.linalg.solve(matrix, right[..., None])[..., 0]
        return np.asarray(np.sum(errors * right, axis=1))


def _loads(body: BodyEquilibrium, time: float) -> Array:
    """Return the loads on the cubics of the owned cells, shape (cells, n, b)."""
    space, loads = body.loads_by_cell
    values = loads.at(time).reshape(-1, body.block_size)
    points = space.sub(0).element.basix_element.points
    nodes = space.dofmap.list[: body.domain.mesh.topology.index_map(body.dim).size_local]
    found = cubics(barycentric(points)).T @ values[nodes]
    if body.piezoelectric:
        # The potential is scaled there, and its test function negated.
        found[..., body.dim] /= -body.phi_scale
    return np.asarray(found)
