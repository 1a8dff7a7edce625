"""An estimate of the discretisation error in the energy norm, from recovered stresses.

eta_K^2 = int_K (G sigma - sigma) : S : (G sigma - sigma) (Zienkiewicz and Zhu): G sigma is the
stress recovered inside each material, S the compliance of the last linearisation, that of the
secant modulus. In a piezoelectric body sigma is the pair (sigma, D), and S that of
[F, -e^T; e, beta], whose energy is eps : F eps + E . beta E. At the contact, where recovery sees
nothing, pressures times gaps between the nodes are added, and friction times slip that is not
dissipated (Krause, Veeser and Walloth, Numer. Math. 130, 2015).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import basix
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.description import Material
from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.together import members, part
from contact.output.fields import Point, nodal_function
from contact.output.recovery import Recovery, barycentric
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array
from forms.crystal import VOIGT
from forms.elasticity import Anisotropic, mandel
from forms.hencky import Hencky, is_linear
from forms.history import HistoryLaw
from forms.kinematics import deviator_squared
from forms.piezo import Piezo

#: Degree of the recovered polynomials: of P1 nodal means.
RECOVERED = {1: 0, 2: 2}


@dataclass(frozen=True)
class Estimate:
    """The estimated discretisation error of a solution.

    Attributes
    ----------
    squares
        eta_K^2 of the owned cells, shape (cells,) (work).
    contact
        The part of their sum that is from the contact.
    energy
        The square of the energy norm of the solution, over all ranks.
    total
        The sum of eta_K^2 over all ranks.
    stiffness_ratio
        Mean of bulk over secant shear modulus, weighted by the energy; None for a crystal.
    """

    squares: Array
    contact: float
    energy: float
    total: float
    stiffness_ratio: float | None

    @property
    def cells(self) -> Array:
        """eta_K of the owned cells over the same norm: the sum of its squares is `relative`^2."""
        whole = self.energy + self.total
        return np.sqrt(self.squares / whole) if whole > 0 else np.zeros_like(self.squares)

    @property
    def relative(self) -> float:
        """The estimated error over the norm of the exact solution, by Pythagoras."""
        whole = self.energy + self.total
        return float(np.sqrt(self.total / whole)) if whole > 0 else 0.0


def estimated(problem: ContactProblem, state: State) -> Estimate:
    """Estimate the error of a state. Collective."""
    body = problem.equilibrium
    mesh, d = body.domain.mesh, body.dim
    squares = np.zeros(mesh.topology.index_map(d).size_local)
    sums = np.zeros(3)
    x = body.nodal(state.x).flatten()
    body.laws.fit(state, x)
    secant = body.laws.secant_shear(state, x)
    for index in range(len(body.cells)):
        squares[body.cells[index]], parts = _of_material(body, index, x, secant)
        sums += parts
    at_contact = _at_contact(problem, state)
    squares += at_contact
    sums = body.comm.allreduce(np.append(sums, [squares.sum(), at_contact.sum()]), op=MPI.SUM)
    energy, locked, known, total, contact = sums
    ratio = float(locked / known) if known > 0 else None
    return Estimate(squares, float(contact), float(energy), float(total), ratio)


def _of_material(body: BodyEquilibrium, index: int, x: Array, secant: Array) -> tuple[Array, Array]:
    """Return eta_K^2 in the cells of a material; its energy, that times k/g, and where k/g is."""
    material, cells, d = body.body.materials[index], body.cells[index], body.dim
    cell = basix.CellType.triangle if d == 2 else basix.CellType.tetrahedron
    points, weights = basix.make_quadrature(cell, 2 * body.degree)
    # Of degree 1 the stress is constant in the cell.
    samples = points if body.degree == 2 else points.mean(axis=0, keepdims=True)
    chunks = body.pointwise.values(
        ("error", index), partial(_fluxes, body, material), samples, x, cells
    )
    components = 7 if material.piezo is None else 10
    none = np.zeros((0, len(samples), components))  # a rank may have no cells of a material
    values = np.concatenate([none, *(found for _, found in chunks)])
    flux, law = values[..., :-1], material.law
    if isinstance(law, Anisotropic | HistoryLaw):
        shear = secant[cells]
    else:
        shear = np.asarray(law.secant_modulus(np.maximum(values[..., -1], 0.0))).mean(axis=1)
    recovery = Recovery(body.domain, cells, RECOVERED[body.degree])
    at = barycentric(points)
    smooth = recovery.recovered(barycentric(samples), flux, at)
    volume = recovery.volumes(at, weights)
    compliance = _compliance(material, shear)
    error, energy = (
        np.einsum("cq,cqi,cij,cqj->c", volume, f, compliance, f, optimize=True)
        for f in (smooth - flux, np.broadcast_to(flux, smooth.shape))
    )
    if isinstance(law, Anisotropic):
        return error, np.array([energy.sum(), 0.0, 0.0])
    return error, np.array([energy.sum(), energy @ (_bulk(law) / shear), energy.sum()])


def _bulk(law: Hencky | HistoryLaw) -> float:
    """Return the bulk modulus."""
    return float(law.young) / (3 - 6 * float(law.poisson))


def _fluxes(body: BodyEquilibrium, material: Material, at: fem.Function) -> Expr:
    """Return the stress in the basis of Mandel, D where there is coupling, and |dev eps|^2."""
    point = Point(body, material, at)
    factors = [1.0] * 3 + [float(np.sqrt(2.0))] * 3
    flux = [f * point.stress[i, j] for f, (i, j) in zip(factors, VOIGT, strict=True)]
    if material.piezo is not None:
        charge: Any = point.electric_displacement
        flux += [charge[i] if i < body.dim else ufl.as_ufl(0.0) for i in range(3)]
    return ufl.as_vector([*flux, deviator_squared(point.strain)])


def _compliance(material: Material, shear: Array) -> Array:
    """Return the compliance of each cell, shape (cells, 6, 6), with coupling (cells, 9, 9)."""
    law = material.law
    if isinstance(law, Anisotropic):
        stiffness = np.broadcast_to(mandel(law.stiffness), (shear.size, 6, 6))
    else:
        volumetric = np.zeros((6, 6))
        volumetric[:3, :3] = 1 / 3
        stiffness = 3 * _bulk(law) * volumetric + 2 * shear[:, None, None] * (
            np.eye(6) - volumetric
        )
    if material.piezo is not None:
        stiffness = _coupled(stiffness, material.piezo)
    if is_linear(law):
        return np.broadcast_to(np.linalg.inv(stiffness[:1]), stiffness.shape)
    return np.asarray(np.linalg.inv(stiffness))


def _coupled(stiffness: Array, piezo: Piezo) -> Array:
    """Return the matrix from (eps, E) to (sigma, D), shape (cells, 9, 9)."""
    factors = np.array([1.0] * 3 + [np.sqrt(2.0)] * 3)
    coupling = np.array([np.asarray(piezo.e)[:, j, k] for j, k in VOIGT]).T * factors
    whole = np.zeros((len(stiffness), 9, 9))
    whole[:, :6, :6], whole[:, 6:, 6:] = stiffness, np.asarray(piezo.beta)
    whole[:, :6, 6:], whole[:, 6:, :6] = -coupling.T, coupling
    return whole


def _at_contact(problem: ContactProblem, state: State) -> Array:
    """Return the share of contact in eta_K^2 of the owned cells, shape (cells,). Collective.

    Between its nodes, all values linear: p |u_n - g| and s |u_t| - lambda_f . u_t, where
    complementarity holds at the nodes alone.
    """
    body, interface = problem.equilibrium, problem.interface
    mesh, d, nodal = body.domain.mesh, body.dim, problem.nodal(state)
    slip, friction = interface.slip(nodal), state.forces.friction
    opening, bound = interface.opening(nodal), interface.bound(nodal, state.forces)
    columns = [state.forces.pressure, opening, bound]
    index_map = body.space.dofmap.index_map
    values = np.zeros((index_map.size_local + index_map.num_ghosts, 3 + 2 * d))
    values[interface.jump.nodes] = np.column_stack([*columns, slip, friction])
    at = nodal_function("contact", body.space, values, (3 + 2 * d,))
    u_t, stress = (ufl.as_vector([at[3 + i + j] for i in range(d)]) for j in (0, d))
    density = at[0] * abs(at[1]) + abs(at[2] * ufl.sqrt(ufl.dot(u_t, u_t)) - ufl.dot(stress, u_t))
    piece = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0)))
    sides = tuple(dict.fromkeys(name for c in problem.contacts for name in members(c.on)))
    measure = body.domain.ds(part(sides))(metadata={"quadrature_degree": 4})
    found = fem.assemble_vector(fem.form(density * piece * measure)).array
    return np.asarray(found[: mesh.topology.index_map(d).size_local])
