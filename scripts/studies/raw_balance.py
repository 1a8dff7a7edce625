"""Forces out of balance at the nodes, from a solution's numbers alone: NumPy, and no scales.

Stresses and electric displacements are integrated cell by cell, tractions facet by facet, contact
forces and charges are those of the contact table. For a body of one isotropic material, `linear` or
`log`, in plane strain (there also piezoelectric) or in 3-D, under tractions, on one rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import numpy as np
from dolfinx import fem
from scipy.spatial import KDTree

from contact import Solution
from contact.model.material import Material
from contact.tolerances import EPS
from contact.typing import Array

#: Part of an unknown by which it is moved to see the effect of its rounding on the forces.
SHAKE = 1e-9

CELLS = {2: basix.CellType.triangle, 3: basix.CellType.tetrahedron}
FACETS = {2: basix.CellType.interval, 3: basix.CellType.triangle}


@dataclass(frozen=True)
class Imbalance:
    """Residual forces at the free nodes, and the forces on the body."""

    #: Euclidean norms over the nodes: of the forces left; of loads, contact forces, reactions and
    #: the forces of the potential on the undeformed body, added up (force).
    force: float
    applied: float
    #: The same of charges, those of the strain among them, but for charges that flow through nodes
    #: that a support holds; 0 without a potential (charge).
    charge: float
    electrified: float
    #: Effect of the rounding of each unknown on `force` and `charge`: moved up or down at random.
    unsure: tuple[float, float]

    @property
    def all(self) -> tuple[tuple[float, float], ...]:
        """Residuals of forces and of charges, their scales, and the rounding of the former."""
        return (self.force, self.charge), (self.applied, self.electrified), self.unsure


def imbalance(solution: Solution) -> Imbalance:
    """Return the imbalance of the numbers of a solution."""
    problem = solution.problem
    body, d = problem.body, problem.dim
    nodal = body.nodal(solution.state.x)
    phi = body.phi_scale * nodal[:, d] if problem.piezoelectric else np.zeros(len(nodal))
    inner, charges = _internal(solution, nodal[:, :d], phi)
    loads, (touch, flux) = _tractions(solution), _contact(solution)
    left, charge = inner - loads + touch, charges - flux
    free, floating = np.ones(left.shape, dtype=bool), np.full(len(phi), problem.piezoelectric)
    for fixed in problem.description.fixed:
        facets = problem.domain.facets(fixed.on)
        nodes = fem.locate_dofs_topological(body.space, d - 1, facets)
        free[np.ix_(nodes, [*fixed.components])] = False
        floating[nodes] &= fixed.potential is None
    # Nodes that a support holds conduct as well, but are no contact nodes: they have no row.
    for contact in problem.contacts:
        facets = problem.domain.facets(contact.on)
        nodes = fem.locate_dofs_topological(body.space, d - 1, facets)
        floating[np.setdiff1d(nodes, problem.nodes.nodes)] = False
    norm = np.linalg.norm
    of_field, _ = _internal(solution, np.zeros_like(inner), phi)
    _, of_strain = _internal(solution, nodal[:, :d], np.zeros_like(phi))
    applied = norm(loads) + norm(touch) + norm(left[~free]) + norm(of_field)
    electrified = norm(flux) + norm(charge[~floating]) + norm(of_strain)
    up_or_down = 1 + SHAKE * np.random.default_rng(0).choice((-1.0, 1.0), nodal.shape)
    shaken = _internal(solution, (nodal * up_or_down)[:, :d], phi * up_or_down[:, -1])
    unsure = norm((shaken[0] - inner)[free]), norm((shaken[1] - charges)[floating])
    return Imbalance(
        float(norm(left[free])),
        float(applied),
        float(norm(charge[floating])),
        float(electrified),
        (EPS / SHAKE * float(unsure[0]), EPS / SHAKE * float(unsure[1])),
    )


def _internal(solution: Solution, u: Array, phi: Array) -> tuple[Array, Array]:
    """Return the nodal forces of the stresses, and the nodal charges of D."""
    problem = solution.problem
    body, mesh, d = problem.body, problem.domain.mesh, problem.dim
    (material,) = problem.description.materials
    nodes = body.space.dofmap.list
    corners = mesh.geometry.x[mesh.geometry.dofmap][:, :, :d]
    edges = corners[:, 1:] - corners[:, :1]
    degree = 1 if body.degree == 1 else 4
    points, weights = basix.make_quadrature(CELLS[d], degree)
    element = basix.create_element(basix.ElementFamily.P, CELLS[d], body.degree)
    shapes = element.tabulate(1, points)[1:, :, :, 0]
    slopes = np.einsum("iqn,cji->cqnj", shapes, np.linalg.inv(edges))
    volumes = np.abs(np.linalg.det(edges))[:, None] * weights
    strain = np.zeros((*volumes.shape, 3, 3))
    gradient = np.einsum("cqnj,cni->cqij", slopes, u[nodes])
    strain[..., :d, :d] = (gradient + gradient.swapaxes(-1, -2)) / 2
    field = np.einsum("cqnj,cn->cqj", slopes, phi[nodes])
    stress, displaced = _material(material, strain, field)
    forces, charges = np.zeros_like(u), np.zeros_like(phi)
    of_nodes = np.einsum("cq,cqij,cqnj->cni", volumes, stress[..., :d, :d], slopes)
    np.add.at(forces, nodes, of_nodes)
    np.add.at(charges, nodes, np.einsum("cq,cqj,cqnj->cn", volumes, displaced, slopes))
    return forces, charges


def _material(material: Material, strain: Array, field: Array) -> tuple[Array, Array]:
    """Return stress (1.9), (7.8), (1.23) and electric displacement, at each point."""
    law, piezo = material.law, material.piezo
    bulk, shear = law.young / (3 - 6 * law.poisson), law.young / (2 + 2 * law.poisson)
    trace = np.einsum("...ii", strain)
    size = np.sqrt(np.maximum(np.sum(strain**2, axis=(-1, -2)) - trace**2 / 3, 0.0))
    g = np.full_like(size, shear)
    if hasattr(law, "yield_strain"):
        over = np.maximum(size / law.yield_strain, 1.0)
        g *= (np.log(over) + 1) / over
    stress = 2 * g[..., None, None] * strain
    stress += ((bulk - 2 * g / 3) * trace)[..., None, None] * np.eye(3)
    displaced = np.zeros_like(field)
    if piezo is not None:
        # Of the plane of X_2 and X_3.
        e, beta = np.asarray(piezo.e)[:2, :2, :2], np.asarray(piezo.beta)[:2, :2]
        stress[..., :2, :2] += np.einsum("ijk,...i->...jk", e, field)
        displaced = np.einsum("ijk,...jk->...i", e, strain[..., :2, :2]) - field @ beta
    return stress, displaced


def _tractions(solution: Solution) -> Array:
    """Return the nodal forces of the tractions."""
    problem = solution.problem
    body, mesh, d = problem.body, problem.domain.mesh, problem.dim
    space, x = body.space, mesh.geometry.x
    forces = np.zeros((len(body.nodal(solution.state.x)), d))
    points, weights = basix.make_quadrature(FACETS[d], 6)
    element = basix.create_element(basix.ElementFamily.P, FACETS[d], body.degree)
    shapes = element.tabulate(0, points)[0, :, :, 0]
    local = basix.create_element(basix.ElementFamily.P, CELLS[d], body.degree).entity_closure_dofs
    mesh.topology.create_connectivity(d - 1, d)
    mesh.topology.create_connectivity(d, d - 1)
    cells_of = mesh.topology.connectivity(d - 1, d)
    facets_of = mesh.topology.connectivity(d, d - 1)
    for load in problem.description.loads:
        for facet in problem.domain.facets(load.on):
            cell = cells_of.links(facet)[0]
            which = int(np.flatnonzero(facets_of.links(cell) == facet)[0])
            nodes = space.dofmap.list[cell][local[d - 1][which]]
            corners = x[mesh.geometry.dofmap[cell][np.delete(np.arange(d + 1), which)]]
            edges = corners[1:] - corners[0]
            area = np.sqrt(np.linalg.det(edges @ edges.T))
            at = corners[0] + points @ edges
            traction = np.column_stack(
                [np.broadcast_to(f.numpy(at), len(at)) for f in load.density]
            )
            forces[nodes] += area * np.einsum("q,qn,qi->ni", weights, shapes, traction)
    return forces


def _contact(solution: Solution) -> tuple[Array, Array]:
    """Return the body's forces on the foundation at its nodes, and the charge that leaves it."""
    problem, table = solution.problem, solution.contact
    body, nodes, d = problem.body, problem.nodes, problem.dim
    _, row = KDTree(table.points).query(nodes.points)
    given = np.zeros((len(row), body.block_size))
    given[:, :d] = (table.weight[:, None] * table.traction)[row]
    if table.charge is not None:
        given[:, d] = (table.weight * table.charge)[row]
    spread = np.zeros(solution.state.x.size)
    nodes.add_jump_transposed(given, spread)
    spread = body.nodal(spread)
    return spread[:, :d], spread[:, d] if problem.piezoelectric else np.zeros(len(spread))
