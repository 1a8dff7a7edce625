"""Residuals of the discrete contact problem, computed from scratch.

They alone decide whether a run has converged, whatever the method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.interface.projections import project_disc, project_half_line
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.typing import Array


@dataclass(frozen=True)
class KKT:
    """Relative residuals of equilibrium, contact and friction.

    Attributes
    ----------
    equilibrium
        |F(u) + contact forces| on free unknowns, over the sum of the norms of loads, contact
        forces and reactions; mechanical and (scaled) electric unknowns together. Without loads
        and contact, reactions of the size of rounding do not count.
    contact
        |p - max(0, p + c (u_nu - rho))| / |p| in L2(Gamma_3), c = E/length.
    friction
        |lambda_f - proj(lambda_f + c u_tau)| / |p| with the final bound s.
    """

    equilibrium: float
    contact: float
    friction: float

    @property
    def largest(self) -> float:
        """The largest of the three; infinity if any is not a number."""
        values = (self.equilibrium, self.contact, self.friction)
        return max(values) if np.all(np.isfinite(values)) else np.inf

    def excess(self, allowed: KKT) -> str:
        """Name the residual that is farthest above what is allowed; nothing if none is."""
        ratios = {
            name: getattr(self, name) / getattr(allowed, name)
            for name in ("equilibrium", "contact", "friction")
        }
        # What is no number is above everything.
        worst = max(ratios, key=lambda name: np.nan_to_num(ratios[name], nan=np.inf))
        if ratios[worst] <= 1:
            return ""
        value, limit = getattr(self, worst), getattr(allowed, worst)
        return f"the {worst} residual is {value:.2e}, above {limit:g}"


def stiffness_scale(problem: ContactProblem) -> float:
    """Return c = E / (size of the body): the scale between displacements and stresses."""
    return float(problem.body.law.young) / problem.domain.size


def residual_forces(problem: ContactProblem, forces: Multipliers) -> Array:
    """Return F(x) - loads + contact and foundation forces, owned unknowns, after `freeze`.

    Its entries at fixed unknowns are minus the reactions of the supports.
    """
    trace, nodal = problem.trace, nodal_iterate(problem)
    residual = problem.internal_forces() - problem.external
    trace.add(residual, trace.weight[:, None] * forces.vectors(problem))
    pressure = total_pressure(problem, nodal, forces)
    trace.add(residual, trace.weight[:, None] * problem.response.force(nodal, pressure))
    if problem.held is not None:
        problem.held.add_force(residual, problem.unknowns)
    return residual


def interface_residuals(
    problem: ContactProblem, nodal: Array, forces: Multipliers, bound: Array
) -> tuple[float, float]:
    """Return the relative contact and friction residuals at nodal unknowns. Collective."""
    trace, c = problem.trace, stiffness_scale(problem)
    opening = trace.normal_component(nodal) - trace.gap
    contact = forces.pressure - project_half_line(forces.pressure + c * opening)
    trial = forces.friction + c * trace.tangential_component(nodal)
    friction = forces.friction - project_disc(trial, bound)
    # Where next to nothing presses, rounding is compared with the stress that closing would take.
    closing = c * trace.norm(np.minimum(np.abs(opening), problem.domain.size))
    scale = max(trace.norm(total_pressure(problem, nodal, forces)), 1e-4 * closing) or 1.0
    return trace.norm(contact) / scale, trace.norm(friction) / scale


def _least_force(problem: ContactProblem) -> float:
    """Return 1e-6 of the forces that would hold each node alone at the prescribed displacement.

    Rounding is some 1e-15 of those, so that it passes for nothing at any sensible tolerance.
    """
    law, dim, comm = problem.body.law, problem.dim, problem.comm
    prescribed = problem.unknowns[: problem.owned][~problem.free.ravel()]
    largest = comm.allreduce(float(np.abs(prescribed).max(initial=0.0)), op=MPI.MAX)
    nodes = comm.allreduce(problem.free.shape[0], op=MPI.SUM)
    spacing = problem.domain.size / nodes ** (1 / dim)
    stiffness = (float(law.bulk) + 4 / 3 * float(law.shear)) * spacing ** (dim - 2)
    return 1e-6 * stiffness * largest * float(np.sqrt(nodes))


def evaluate(problem: ContactProblem, forces: Multipliers) -> KKT:
    """Return the residuals of the iterate `problem.x` and the contact forces. Collective."""
    problem.freeze()
    residual = residual_forces(problem, forces)
    free = problem.free.ravel()
    trace, nodal = problem.trace, nodal_iterate(problem)
    contact_forces = np.zeros_like(residual)
    vectors = total_pressure(problem, nodal, forces)[:, None] * trace.normal + forces.friction
    trace.add(contact_forces, trace.weight[:, None] * vectors)
    loads, pushes = problem.load_size, problem.norm(contact_forces)
    scale = loads + pushes + problem.norm(np.where(free, 0.0, residual))
    # Supports that move an untouched body rigidly leave rounding, in the reactions as well.
    least = _least_force(problem)
    if loads == 0 and pushes <= 1e-6 * least:
        scale = max(scale, least)
    equilibrium = problem.norm(np.where(free, residual, 0.0)) / (scale or 1.0)
    bound = bound_of(problem, nodal, forces)
    return KKT(equilibrium, *interface_residuals(problem, nodal, forces, bound))
