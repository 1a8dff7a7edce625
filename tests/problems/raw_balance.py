"""Forces out of balance at the nodes, from a solution's numbers alone: NumPy, and no scales.

Stresses and electric displacements are integrated cell by cell, contact forces and charges are
those of the contact table. For triangles of degree 1 of one isotropic piezoelectric material in
plane strain, on one rank.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from scipy.spatial import KDTree

from contact import Solution
from contact._compat import geometry_dofmap
from contact.typing import Array
from scripts.studies.robustness.check import Mesh, external_forces, gradients, internal_forces


@dataclass(frozen=True)
class Imbalance:
    """Residual forces at the free nodes, and the forces on the body: Euclidean norms."""

    #: Of the forces left; of loads, contact forces, reactions and those of the potential on the
    #: undeformed body, added up.
    force: float
    applied: float
    #: The same of charges, those of the strain among them, but for charges that flow through nodes
    #: that a support holds.
    charge: float
    electrified: float


def imbalance(solution: Solution, tables: Mapping[str, Any]) -> Imbalance:
    """Return the imbalance of the numbers of a solution of a case."""
    body, mesh, norm = solution.problem.body, mesh_of(solution), np.linalg.norm
    nodal = body.nodal(solution.state.x)
    u, phi = nodal[:, :2], body.phi_scale * nodal[:, 2]
    elastic = internal_forces(mesh, [tables["material"] | {"on": "body"}], u)
    of_field, charges, of_strain = piezoelectric(mesh, solution, u, phi)
    loads, (touch, flux) = external_forces(mesh, tables), contact_forces(solution)
    left, charge = elastic + of_field - loads + touch, charges - flux
    free, floating = np.ones(left.shape, dtype=bool), np.ones(len(phi), dtype=bool)
    for fixed in tables["fixed"]:
        nodes = mesh.nodes(fixed["on"])
        free[nodes] &= "displacement" not in fixed
        floating[nodes] &= "potential" not in fixed
    # Nodes that a support holds conduct as well, but are no contact nodes: they have no row.
    nodes = mesh.nodes(tables["contact"]["on"])
    floating[np.setdiff1d(nodes, solution.problem.nodes.nodes)] = False
    applied = norm(loads) + norm(touch) + norm(left[~free]) + norm(of_field)
    electrified = norm(flux) + norm(charge[~floating]) + norm(of_strain)
    return Imbalance(*map(float, (norm(left[free]), applied, norm(charge[floating]), electrified)))


def mesh_of(solution: Solution) -> Mesh:
    """Return the mesh of a body, its nodes in the order of the unknowns."""
    domain, cells = solution.problem.domain, solution.problem.body.space.dofmap.list
    geometry = domain.mesh.geometry
    number = np.empty(len(geometry.x), dtype=np.intp)
    number[geometry_dofmap(domain.mesh)] = cells
    points = np.empty((len(number), 2))
    points[number] = geometry.x[:, :2]
    domain.mesh.topology.create_connectivity(1, 2)
    parts = {
        name: number[dmesh.entities_to_geometry(domain.mesh, 1, domain.facets(name))]
        for name in domain.parts
    }
    return Mesh(points, cells, np.zeros(len(cells), dtype=np.intp), ["body"], parts)


def piezoelectric(mesh: Mesh, solution: Solution, u: Array, phi: Array) -> tuple[Array, ...]:
    """Return the forces e^T grad(phi), the charges e eps - beta grad(phi), and those of e eps."""
    (material,) = solution.problem.description.materials
    e, beta = (np.asarray(x) for x in (material.piezo.e, material.piezo.beta))
    e, beta = e[:2, :2, :2], beta[:2, :2]
    slopes, areas = gradients(mesh)
    field = np.einsum("mai,ma->mi", slopes, phi[mesh.triangles])
    strain = np.einsum("mai,maj->mij", u[mesh.triangles], slopes)  # e is symmetric in both
    forces, charges = np.zeros_like(u), np.zeros((2, len(phi)))
    nodal = np.einsum("m,kij,mk,maj->mai", areas, e, field, slopes)
    np.add.at(forces, mesh.triangles, nodal)
    of_strain = np.einsum("ijk,mjk->mi", e, strain)
    for found, displaced in zip(charges, (of_strain - field @ beta, of_strain), strict=True):
        np.add.at(found, mesh.triangles, np.einsum("m,mi,mai->ma", areas, displaced, slopes))
    return forces, *charges


def contact_forces(solution: Solution) -> tuple[Array, Array]:
    """Return the body's forces on the foundation at its nodes, and the charge that leaves it."""
    table, nodes = solution.contact, solution.problem.nodes
    _, row = KDTree(table.points).query(nodes.points)
    given = table.weight[:, None] * np.column_stack([table.traction[:, :2], table.charge])
    spread = np.zeros(solution.state.x.size)
    nodes.add_jump_transposed(given[row], spread)
    spread = solution.problem.body.nodal(spread)
    return spread[:, :2], spread[:, 2]
