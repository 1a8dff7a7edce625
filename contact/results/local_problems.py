"""Local Neumann problems for the error of quadratic elements, cell by cell.

Bank and Weiser, Math. Comp. 44, 1985. In each cell the error is sought among the cubics that vanish
at the nodes: M strain(e) : strain(v) = work of the loads - flux : strain(v) + work of the flux
through the facets, the mean of both sides, at a contact of the multipliers (Weiss and Wohlmuth,
Math. Comp. 78, 2009). The flux is sigma, with D where there is coupling, and the strain eps, with
E = -grad phi. Recovery of the stress, which serves degree 1, follows that of degree 2 into its
singularities, and sees half of the error there.

Fluxes are brought into balance with the cells (Ainsworth and Oden, Numer. Math. 65, 1993): mean
fluxes leave a residual on the linear functions of each cell, which the solution has not; around
each corner the residuals of the cells add up to nothing, and the smallest moments through the
facets there that are opposite on both sides take them away. Without them the error of smooth
solutions of degree 2 is overestimated by two thirds on tetrahedra, and that at corners with
infinite stresses underestimated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import csr_array

from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.cells import INTERVAL, Shape, barycentric, rule, shape_of
from contact.mesh.entities import Indices, accumulated, cell_facets, with_ghosts
from contact.mesh.geometry import geometry_nodes, integration_weights, inverse, jacobians
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.tolerances import ROUNDING
from contact.typing import Array
from forms.crystal import VOIGT

#: Cells that are solved at once.
CHUNK = 10_000

#: Added to the diagonal: constants around a corner, which are no flux, would have nothing.
SHIFT = 1e-3

#: Residual of the conjugate gradients, and the most of them: patches are small.
EXACT, MOST = 1e-10, 200


def cubics(shape: Shape, at: Array) -> Array:
    """Return the cubics without values at nodes, shape (q, n), at points of the reference cell."""
    # Of simplices L_i L_j (L_i - L_j) of edges, L_i L_j L_k of triangles; of others that of an
    # interval along each axis, times quadratics along the others.
    if shape.simplex:
        at = barycentric(at)
        size = range(at.shape[1])
        edges = [at[:, i] * at[:, j] * (at[:, i] - at[:, j]) for i, j in combinations(size, 2)]
        faces = [at[:, i] * at[:, j] * at[:, k] for i, j, k in combinations(size, 3)]
        return np.stack(edges + faces, axis=1)
    cubic = (at * (1 - at) * (1 - 2 * at))[:, :, None]
    quadratic = INTERVAL.lagrange(2, at.reshape(-1, 1)).reshape(*at.shape, 3)
    found = []
    for axis in range(shape.dim):
        product = np.ones((len(at), 1))
        for k in range(shape.dim):
            factor = (cubic if k == axis else quadratic)[:, k]
            product = (product[:, :, None] * factor[:, None, :]).reshape(len(at), -1)
        found.append(product)
    return np.concatenate(found, axis=1)


def _derivatives(shape: Shape, at: Array) -> Array:
    """Return the derivatives of `cubics` by the coordinates of the reference cell, (q, n, dim)."""
    at_nodes = cubics(shape, shape.nodes(3))  # which tell them: they are of degree 3
    return np.asarray(np.einsum("qkr,kn->qnr", shape.gradients(3, at), at_nodes))


class Basis(NamedTuple):
    """Functions on the reference cell, (q, n), and their derivatives, (q, n, dim)."""

    values: Callable[[Shape, Array], Array]
    derivatives: Callable[[Shape, Array], Array]


class Work(NamedTuple):
    """Points of a rule, strains of functions there, (cells, q, k, n b), and these by weights."""

    at: Array
    strains: Array
    weighted: Array


CUBICS = Basis(cubics, _derivatives)
HATS = Basis(lambda shape, at: shape.lagrange(1, at), lambda shape, at: shape.gradients(1, at))


class LocalProblems:
    """Local problems of degree 2, given fluxes at nodes, (cells, nodes, 6 or 9). Collective."""

    def __init__(self, problem: ContactProblem, state: State, flux: Array) -> None:
        body = self._body = problem.body
        self._flux, self._nodes = flux, geometry_nodes(body.domain)
        shape = self._shape = shape_of(body.domain.mesh)
        #: The nodes of each facet, as nodes of its cell.
        self._closures = shape.facet_nodes(2)
        self._loads, self._load_points = _loads(body, state.time)
        self._through, self._constrained, unknown = self._facets(problem, state)
        self._through += balancing(body, self._out_of_balance(), unknown)

    def _out_of_balance(self) -> Array:
        """Return the residuals of the linear functions of the owned cells, (cells, corners, b)."""
        found = np.zeros((len(self._flux), self._shape.corners, self._body.block_size))
        for cells in self._pieces(np.arange(len(found), dtype=np.int32)):
            found[cells] = self._residual(cells, HATS, self._work(cells, HATS))[0]
        return found

    def _pieces(self, cells: Indices) -> Iterator[Indices]:
        """Yield some of the cells after the other: none where there are none."""
        size = CHUNK if self._shape.simplex else CHUNK // 10
        for first in range(0, len(cells), size):
            yield cells[first : first + size]

    def _normal_flux(self) -> Array:
        """Return the flux out of each cell at the nodes of its facets, (cells, facets, m, b)."""
        # That of the charge is -D . n, as it works on the potential.
        d, shape, flux = self._body.dim, self._shape, self._flux[:, self._closures]
        jacobian = jacobians(shape, self._nodes, shape.nodes(2))
        every = np.broadcast_to(jacobian, (*self._flux.shape[:2], d, d))[:, self._closures]
        # Along the gradient of the coordinate that grows out of the facet.
        normal = np.einsum("fr,cfmrd->cfmd", shape.facet_normals, inverse(every))
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
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

    def _facets(
        self, problem: ContactProblem, state: State
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the flux into each cell through its facets, and two flags of its components."""
        # Inside it is the mean of both sides. On the boundary it is among the loads, where these
        # are known; at a contact that touches, that of the multipliers, and the flux itself where
        # there are none: of charge, on the other side. The flags are those of components that are
        # constrained, without any error, and of those whose flux is unknown.
        body, d = self._body, self._body.dim
        sides, out = Sides(body, self._closures), self._normal_flux()
        facets, nodes, inside = sides.facets, sides.nodes, sides.inside
        forces = np.zeros(body.owned + body.global_unknowns.size)
        problem.interface.add_forces(forces, state.x, state.multipliers)
        touch = np.any(body.nodal(body.local(forces)) != 0, axis=1)[nodes].any(axis=2)
        slave, master = (
            np.isin(facets, np.concatenate([[], *map(body.domain.facets, names)]))
            for names in (
                [c.on for c in problem.contacts],
                [c.against for c in problem.contacts if c.against],
            )
        )
        touch &= slave | master
        # The traction of an elastic support is none of the loads either, nor is that of a roller.
        rollers = [fixed.on for fixed in body.description.fixed if fixed.normal is not None]
        for part in [*(support.on for support in body.description.elastic), *rollers]:
            touch |= np.isin(facets, body.domain.facets(part))
        own = np.zeros(body.owned + body.global_unknowns.size)
        own[: body.owned] = body.free.ravel()
        free = body.nodal(body.local(own))[nodes].any(axis=2)
        loads = [body.domain.facets(load.on) for load in body.description.loads if load.on]
        loaded = np.isin(facets, np.concatenate([[], *loads]))
        # Facets inside that are fixed, or an electrode, have a jump, of charges for instance.
        names = [
            *(fixed.on for fixed in body.description.fixed),
            *(group.part for group in body.global_unknowns.groups),
        ]
        parts = [body.domain.facets_anywhere(name) for name in names]
        boundary = ~inside[..., None]
        split = boundary | np.isin(facets, np.concatenate([[], *parts]))[..., None]
        constrained = split & (free == 0)
        unknown = constrained | (boundary & touch[..., None])
        one_sided = (unknown | boundary)[:, :, None]
        mean = np.where(one_sided, out, out - sides.sums(out) / 2)
        through = np.where((unknown | ~boundary)[:, :, None], mean, 0.0)
        traction = _contact_traction(problem, state)[nodes]
        pressed = (touch & slave)[..., None, None] & np.isfinite(traction)
        through[..., :d] = np.where(pressed, traction, through[..., :d])
        constrained = constrained | (boundary & (touch & loaded & ~slave)[..., None])
        return through, constrained, unknown

    def squares(self, cells: Indices, moduli: Array) -> Array:
        """Return squares of the energy norm of errors; moduli (cells, 6 or 9, 6 or 9), or one."""
        # Of a material without a field those of a field are zero.
        whole = np.zeros((len(cells), *2 * (9 if self._body.piezoelectric else 6,)))
        whole[:, : moduli.shape[1], : moduli.shape[2]] = moduli
        pieces = self._pieces(np.arange(len(cells), dtype=np.int32))
        found = [self._solved(cells[piece], whole[piece]) for piece in pieces]
        return np.concatenate([np.zeros(0), *found])

    def _solved(self, cells: Indices, moduli: Array) -> Array:
        body, count = self._body, len(cells)
        work = self._work(cells, CUBICS)
        moduli = moduli[..., self._kept, :][..., self._kept]
        fluxes = (moduli[:, None] @ work.strains).reshape(work.weighted.shape)
        matrix = work.weighted.swapaxes(1, 2) @ fluxes
        right, constrained = self._residual(cells, CUBICS, work)
        if body.piezoelectric:
            constrained[..., body.dim] |= (moduli[:, -1, -1] == 0)[:, None]
        constrained, right = constrained.reshape(count, -1), right.reshape(count, -1)
        right[constrained] = 0.0
        matrix[constrained[:, :, None] | constrained[:, None, :]] = 0.0
        places = np.arange(constrained.shape[1])
        matrix[:, places, places] += constrained
        errors = np.linalg.solve(matrix, right[..., None])[..., 0]
        return np.asarray(np.sum(errors * right, axis=1))

    @property
    def _kept(self) -> list[int]:
        """The components that strains of the test functions have."""
        d = self._body.dim
        kept = [0, 1, 2, 5] if d == 2 else list(range(6))
        return kept + [6, 7, 8][:d] * self._body.piezoelectric

    def _work(self, cells: Indices, basis: Basis) -> Work:
        """Return the strains of functions in cells."""
        body, d, shape, of, kept = (
            self._body, self._body.dim, self._shape, self._nodes[cells], self._kept
        )  # fmt: skip
        order = body.domain.order
        degree = (4 if shape.simplex else 6) + 2 * (order - 1) + body.domain.revolved
        at, weights = rule(shape, degree)
        values, derivatives = basis.values(shape, at), basis.derivatives(shape, at)
        volumes = integration_weights(body.domain.revolved, shape, of, at, weights)
        back = np.broadcast_to(inverse(jacobians(shape, of, at)), (len(of), len(at), d, d))
        gradients = derivatives @ back
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
                strains[..., 0, m] = values / (of[..., 0] @ shape.lagrange(order, at).T)[..., None]
        count = len(cells)
        strains = strains.reshape(count, len(weights), -1, len(kept)).swapaxes(2, 3)
        weighted = (volumes[:, :, None, None] * strains).reshape(count, -1, strains.shape[3])
        return Work(at, strains, weighted)

    def _residual(
        self, cells: Indices, basis: Basis, work: Work
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return the residuals of functions in cells, (cells, n, b), and which are constrained."""
        body, shape, of, count = self._body, self._shape, self._nodes[cells], len(cells)
        flux = shape.lagrange(2, work.at) @ self._flux[cells]
        known = flux[..., self._kept].reshape(count, -1, 1)
        inner = (work.weighted.swapaxes(1, 2) @ known)[..., 0]
        right = basis.values(shape, self._load_points).T @ self._loads[cells]
        right = right - inner.reshape(right.shape)
        constrained = np.zeros(right.shape, dtype=bool)
        at, weights = rule(shape.facet, 5)
        for facet, ends in enumerate(shape.facet_nodes(body.domain.order)):
            values = basis.values(shape, shape.on_facet(facet, at))
            areas = integration_weights(body.domain.revolved, shape.facet, of[:, ends], at, weights)
            flux = shape.facet.lagrange(2, at) @ self._through[cells, facet]
            right += values.T @ (areas[..., None] * flux)
            acts = np.abs(values).max(axis=0) > ROUNDING
            constrained |= acts[None, :, None] & self._constrained[cells, facet][:, None]
        return right, constrained


def _contact_traction(problem: ContactProblem, state: State) -> Array:
    """Return the traction of the multipliers and layers at the nodes, shape (n, d). Collective."""
    # Weiss and Wohlmuth, Math. Comp. 78, 2009. No numbers at nodes without a multiplier.
    body, interface = problem.body, problem.interface
    pressure = interface.pressure(problem.nodal(state), state.multipliers)
    found = np.full_like(body.nodal(state.x)[:, : body.dim], np.nan)
    found[interface.nodes.nodes] = (
        -pressure[:, None] * interface.nodes.normal - state.multipliers.friction
    )
    return with_ghosts(body.space.dofmap.index_map, found)


def _loads(body: BodyEquilibrium, time: float) -> tuple[Array, Array]:
    """Return the loads on the cubics of Lagrange in the owned cells, (cells, n, b); their nodes."""
    space, loads = body.loads_by_cell
    values = loads.at(time).reshape(-1, body.block_size)
    points = space.sub(0).element.basix_element.points
    nodes = space.dofmap.list[: body.domain.mesh.topology.index_map(body.dim).size_local]
    found = values[nodes]
    if body.piezoelectric:
        # The potential is scaled there, and its test function negated.
        found[..., body.dim] /= -body.phi_scale
    return np.asarray(found), np.asarray(points)


class Sides:
    """Sums over both sides of facets of values at nodes of cells, (facets, m). Collective."""

    def __init__(self, body: BodyEquilibrium, closures: NDArray[np.intp]) -> None:
        mesh, space, d = body.domain.mesh, body.space, body.dim
        mesh.topology.create_connectivity(d, d - 1)
        self._index_map = mesh.topology.index_map(d - 1)
        owned = mesh.topology.index_map(d).size_local
        #: Facets of the owned cells, (cells, facets), and nodes there, (cells, facets, m).
        self.facets = cell_facets(mesh)[:owned]
        self.nodes = space.dofmap.list[:owned][:, closures]
        numbers = space.dofmap.index_map.local_to_global(self.nodes.ravel().astype(np.int32))
        numbers = numbers.reshape(self.nodes.shape)
        self._count = self._index_map.size_local + self._index_map.num_ghosts
        # Both sides list the nodes by their global numbers.
        order = np.argsort(np.argsort(numbers, axis=2), axis=2)
        #: The place of each node among those of all facets, (cells, facets, m).
        self.places = self.facets[..., None] * closures.shape[1] + order
        #: Which facets have two sides.
        self.inside = self.sums(np.ones((*self.places.shape, 1)))[:, :, 0, 0] > 1.5

    def exchanged(self, rows: Array) -> Array:
        """Return the sums over all ranks of values by place, (facets m, b). Collective."""
        by_facet = rows.reshape(self._count, -1)
        return np.asarray(accumulated(self._index_map, by_facet).reshape(rows.shape))

    def sums(self, values: Array) -> Array:
        """Return the sums, as the values of shape (cells, facets, m, b). Collective."""
        flat, places = values.reshape(-1, values.shape[3]), self.places.ravel()
        entries = np.ones(places.size), (places, np.arange(places.size))
        onto = csr_array(entries, shape=(self._count * self.places.shape[2], places.size))
        return self.exchanged(onto @ flat)[places].reshape(values.shape)

    def across(self, closures: NDArray[np.intp], corners: int) -> csr_array:
        """Return the matrix from values at corners of cells to places between two cells."""
        cells = np.arange(len(self.places))[:, None, None] * corners
        columns = np.broadcast_to(cells + closures, self.places.shape)[self.inside].ravel()
        rows = self.places[self.inside].ravel()
        shape = self._count * self.places.shape[2], len(self.places) * corners
        return csr_array((np.ones(rows.size), (rows, columns)), shape=shape)


def balancing(body: BodyEquilibrium, residual: Array, unknown: NDArray[np.bool_]) -> Array:
    """Return fluxes at nodes into cells, (cells, facets, nodes, b), that balance them. Collective.

    `residual`: of the linear functions of the owned cells, (cells, corners, b). `unknown`: whether
    the flux through facets of the boundary is unknown, and that through others is not the same on
    both sides, (cells, facets, b).
    """
    shape = shape_of(body.domain.mesh)
    corners, of = shape.facet_corners, geometry_nodes(body.domain)
    at, weights = rule(shape.facet, 4)
    hats = shape.facet.lagrange(1, at)
    areas = np.stack(
        [
            integration_weights(body.domain.revolved, shape.facet, of[:, ends], at, weights)
            for ends in shape.facet_nodes(body.domain.order)
        ],
        axis=1,
    )
    sides, size = Sides(body, corners), areas.sum(axis=2)
    # Through the axis of a body of revolution there is no flux.
    outside = unknown & (size > 0)[..., None]
    onto = sides.across(corners, shape.corners)
    back = onto.T.tocsr()
    coupled = sides.inside[..., None] & ~unknown
    diagonal = np.full(residual.shape, SHIFT)
    for facet, ends in enumerate(corners):
        diagonal[:, ends] += (2.0 * coupled[:, facet] + outside[:, facet])[:, None]
    pairs = np.zeros((onto.shape[0], residual.shape[2]))
    pairs[sides.places] = coupled[:, :, None]
    weight = diagonal.reshape(-1, residual.shape[2])

    def image(of_cells: Array) -> Array:
        """Return the moments into each cell of the differences of both sides."""
        return np.asarray(weight * of_cells - back @ (pairs * sides.exchanged(onto @ of_cells)))

    found = _solved(body.comm, image, residual.reshape(weight.shape)).reshape(residual.shape)
    own = found[:, corners]
    between = 2 * own - sides.sums(own)
    through = np.where(coupled[:, :, None], between, outside[:, :, None] * own)
    mass = np.einsum("cfq,qi,qj->cfij", areas, hats, hats)
    mass[size == 0] = np.eye(hats.shape[1])
    to_nodes = shape.facet.lagrange(1, shape.facet.nodes(2))
    return np.asarray(-to_nodes @ np.linalg.solve(mass, through))


def _solved(comm: MPI.Intracomm, image: Callable[[Array], Array], right: Array) -> Array:
    """Solve by conjugate gradients, each component by itself: they have units. Collective."""

    def dot(one: Array, other: Array) -> Array:
        return np.asarray(comm.allreduce(np.einsum("nb,nb->b", one, other), op=MPI.SUM))

    found, left, along = np.zeros_like(right), right, right
    size = first = dot(left, left)
    for _ in range(MOST):
        if np.all(size <= EXACT**2 * first):
            break
        towards = image(along)
        step = size / np.where(size > 0, dot(along, towards), 1.0)
        found, left = found + step * along, left - step * towards
        before, size = size, dot(left, left)
        along = left + size / np.where(before > 0, before, 1.0) * along
    return found
