"""Norms of the difference between two displacements, by quadrature in NumPy.

The dual norm of pressures, and the norms of the space of displacements and potentials.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.elements import kinematics_of
from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState
from contact.linear.operator import SparseOperator
from contact.mesh.cells import rule, shape_of
from contact.mesh.entities import Indices
from contact.mesh.geometry import geometry_nodes, integration_weights
from contact.model.fields import constant
from contact.model.material import Material
from contact.problem.problem import ContactProblem
from contact.typing import Array
from forms.elasticity import Anisotropic, mandel
from forms.history import PAIRS, components, to_vector
from forms.kinematics import Strained, strain
from forms.plane_stress import ACROSS, HenckyAtPoints, PlaneStressHistory


@dataclass(frozen=True)
class Errors:
    """Norms of the difference between two displacements."""

    #: Norm in L2(Omega), and |grad(.)| in L2(Omega).
    l2: float
    h1: float
    #: sqrt(B(u; e, e)) with the secant form of the finer solution u: the norm in which Cea's lemma
    #: holds for a linear material. In a piezoelectric body with E . beta E besides. Strains of u
    #: are those of its element: of the mean dilatation the error is that of the pressure. In plane
    #: stress strains across are those at which e has no stress there.
    energy: float

    def __truediv__(self, other: Errors) -> Errors:
        """Return relative errors."""
        return Errors(self.l2 / other.l2, self.h1 / other.h1, self.energy / other.energy)


def errors(
    body: BodyEquilibrium,
    x: Array,
    other: fem.Function | Callable[[ufl.SpatialCoordinate], Expr] | None,
) -> Errors:
    """Return the norms of the displacement's distance to another one. Collective."""
    domain, d, bs = body.domain, body.dim, body.block_size
    mesh, shape, kinematics = domain.mesh, shape_of(domain.mesh), domain.kinematics
    own = kinematics_of(domain, body.element)
    at, weights = rule(shape, 2 * body.degree + 4)
    solution = body.nodal(x).ravel()
    error, known = solution, None
    if isinstance(other, fem.Function):
        error = solution - other.x.array
    elif other is not None:
        every = other(ufl.SpatialCoordinate(mesh))
        given = ufl.as_vector([every[i] for i in range(d)])
        potential = every[d] if body.piezoelectric else None
        known = fem.Expression(ufl.as_vector(_values(given, potential, kinematics)), at)

    def linear(function: fem.Function) -> Expr:
        u, phi = body.split(function)
        eps = to_vector(strain(u, own), components(d))
        return ufl.as_vector([*_values(u, phi, kinematics), *(eps[i] for i in range(len(eps)))])

    body.laws.fit(BodyState(x))
    totals, gradient, field = np.zeros(3), slice(d, d + 9), slice(d + 9, 9 + bs * d)
    for material, cells_of in zip(body.description.materials, body.cells, strict=True):
        chunks = (
            body.pointwise.values("errors", linear, at, values, cells_of)
            for values in (solution, error)
        )
        for (cells, all_of), (_, off) in zip(*chunks, strict=True):
            count = all_of.shape[2] - components(d)
            e, eps = off[..., :count], off[..., count:]
            if known is not None:
                exact = _sampled(known, mesh, cells, len(at))
                e, eps = e - exact, eps - _strains(exact[..., gradient], d)
            volumes = integration_weights(
                domain.revolved, shape, geometry_nodes(domain, cells), at, weights
            )
            energy = _elastic(body, material, cells, at, all_of[..., count:], eps)
            if material.piezo is not None:
                beta = np.asarray(material.piezo.beta)[:d, :d]
                energy += np.einsum("cqi,ij,cqj->cq", e[..., field], beta, e[..., field])
            squares = np.sum(e[..., :d] ** 2, axis=2), np.sum(e[..., gradient] ** 2, axis=2), energy
            totals += [np.sum(volumes * square) for square in squares]
    body.comm.Allreduce(MPI.IN_PLACE, totals, op=MPI.SUM)
    return Errors(*(float(np.sqrt(max(total, 0.0))) for total in totals))


def _values(u: Expr, phi: Expr | None, kinematics: Strained) -> list[Expr]:
    """Return the components of u, of its gradient, and of grad phi."""
    d, gradient = len(u), kinematics.gradient(u)
    field = [] if phi is None else [ufl.grad(phi)[i] for i in range(d)]
    return [*(u[i] for i in range(d)), *(gradient[i] for i in np.ndindex(3, 3)), *field]


def _sampled(expression: fem.Expression, mesh: dmesh.Mesh, cells: Indices, count: int) -> Array:
    """Return the values of an expression at its points, shape (cells, count, components)."""
    found = np.asarray(expression.eval(mesh, cells))
    return found.reshape(len(cells), count, expression.value_size)


def _strains(gradient: Array, dim: int) -> Array:
    """Return the strains of gradients of shape (..., 9) in the basis of Mandel."""
    g = gradient.reshape(*gradient.shape[:-1], 3, 3)
    found = [
        g[..., i, j] if i == j else (g[..., i, j] + g[..., j, i]) / 2**0.5
        for i, j in PAIRS[components(dim)]
    ]
    return np.stack(found, axis=-1)


def _elastic(
    body: BodyEquilibrium,
    material: Material,
    cells: Indices,
    at: Array,
    frozen: Array,
    eps: Array,
) -> Array:
    """Return eps : C eps at points of cells, C being the secant stiffness at a frozen strain."""
    mesh, law, factor = body.domain.mesh, material.law, 1.0
    if material.factor is not None:
        # It may be a number.
        given = material.factor.ufl(ufl.SpatialCoordinate(mesh)) * constant(mesh, 1.0)
        factor = _sampled(fem.Expression(given, at), mesh, cells, len(at))[..., 0]
    if isinstance(law, Anisotropic):
        kept = [0, 1, 2, 5] if body.dim == 2 else range(6)
        stiffness = mandel(law.stiffness)[np.ix_(kept, kept)]
        return factor * np.einsum("cqi,ij,cqj->cq", eps, stiffness, eps)
    across = isinstance(law, PlaneStressHistory)
    if across:
        assert isinstance(law.base, HenckyAtPoints)
        law, frozen, eps = law.base.base, frozen.copy(), eps.copy()
        thinner = fem.Expression(body.laws.fits[ACROSS], at)
        frozen[..., 2] += _sampled(thinner, mesh, cells, len(at))[..., 0]
    trace = frozen[..., :3].sum(axis=2)
    g = np.asarray(law.secant_modulus(np.sum(frozen**2, axis=2) - trace**2 / 3))
    if across:  # the strain at which the error has no stress across
        spared = (law.bulk - 2 * g / 3) / (law.bulk + 4 * g / 3)
        eps[..., 2] -= spared * eps[..., :3].sum(axis=2)
    trace = eps[..., :3].sum(axis=2)
    return factor * ((law.bulk - 2 * g / 3) * trace**2 + 2 * g * np.sum(eps**2, axis=2))


class DualNorm:
    """sup <q, v_nu> / |v|_V over the discrete displacements v, with |v|_V the linear energy.

    The supremum is reached by the displacement w under the pressure q alone, and is its energy:
    |q|^2 = <q, w_nu>. On Gamma_3 that is the inverse of the body condensed onto it, the discrete
    Steklov operator, and as that is one of order 1/2, a norm of H^-1/2.

    Parameters
    ----------
    problem
        Whose contact nodes carry the pressures.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        body, size = problem.body, problem.interface.nodes.block_size
        self._rest = body.zero_displacement()
        coupled = problem.interface.operator_nodes
        self._operator = SparseOperator(body, coupled)
        self._operator.update("secant", BodyState(self._rest), np.zeros((coupled.size, size, size)))

    def pressure(self, q: Array) -> float:
        """Return the norm of nodal pressures, shape (n,). Collective."""
        body, nodes = self.problem.body, self.problem.interface.nodes
        load = np.zeros(body.owned)
        vectors = np.zeros((q.size, nodes.block_size))
        vectors[:, : nodes.dim] = (nodes.weight * q)[:, None] * nodes.normal
        nodes.add_jump_transposed(vectors, load)
        load = np.where(body.free.ravel(), load, 0.0)
        return self._root(load, self._operator.solve(load))

    def compliance(self, loads: Sequence[Array]) -> Array:
        """Return the work of loads on each other's displacements, shape (n, n). Collective."""
        free = self.problem.body.free.ravel()
        acting = np.array([np.where(free, load, 0.0) for load in loads])
        moved = np.array([self._operator.solve(load) for load in acting])
        work = self.problem.comm.allreduce(acting @ moved[:, : free.size].T, op=MPI.SUM)
        return np.asarray((work + work.T) / 2)

    def displacement(self, x: Array, other: Array) -> float:
        """Return |u - v|_V of local unknowns, the energy of the linear body. Collective."""
        body = self.problem.body
        forces = (body.secant_forces(BodyState(y, secant_at=self._rest)) for y in (x, other))
        difference = (x - other)[: body.owned]
        free = np.where(body.free.ravel(), np.subtract(*forces), 0.0)
        return self._root(free, difference)

    def _root(self, force: Array, displacement: Array) -> float:
        total = self.problem.comm.allreduce(float(force @ displacement), op=MPI.SUM)
        return float(np.sqrt(max(total, 0.0)))


class ProductNorm:
    """The norms of X = V x W, (5.15): |eps(u)| and |grad(phi)| in L2(Omega).

    Parameters
    ----------
    problem
        Whose local unknowns are measured.
    """

    def __init__(self, problem: ContactProblem) -> None:
        body = self._body = problem.body
        self._x = fem.Function(body.space)
        u, phi = body.split(self._x)
        parts = [ufl.inner(strain(u), strain(u))]
        if phi is not None:
            parts.append(ufl.inner(ufl.grad(phi), ufl.grad(phi)))
        self._forms = [fem.form(part * problem.domain.dx) for part in parts]
        self._comm = problem.comm

    def __call__(self, x: Array) -> tuple[float, ...]:
        """Return the norms in V and, with a potential, W of local unknowns. Collective."""
        self._x.x.array[:] = self._body.nodal(x).ravel()
        squares = [self._comm.allreduce(fem.assemble_scalar(form)) for form in self._forms]
        return tuple(float(np.sqrt(square)) for square in squares)
