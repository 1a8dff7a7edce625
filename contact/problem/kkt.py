"""Residuals of the discrete contact problem, computed from scratch.

They alone decide whether a run has converged, whatever the method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.residuals import interface_residuals
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.typing import Array

#: Forces at a node that count as rounding, over those that hold it alone where it is; and over
#: loads, contact forces and reactions of the body.
ROUNDING, MOST_ROUNDING = 1e-14, 1e-4


@dataclass(frozen=True)
class KKT:
    """Relative residuals of equilibrium, contact and friction.

    Attributes
    ----------
    equilibrium
        |F(u) + contact forces| on free unknowns, less what rounding makes of the stresses around
        the nodes (`_rounding`), over the sum of the norms of loads, contact forces and reactions;
        mechanical and (scaled) electric unknowns together.
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


def residual_forces(problem: Problem, state: State, secant_at: Array | None = None) -> Array:
    """Return F(x) - loads + contact and foundation forces on the owned unknowns. Collective.

    Its entries at fixed unknowns are minus the reactions of the supports.

    Parameters
    ----------
    problem, state
        The problem, and where it is.
    secant_at
        Unknowns at which the secant modulus of the material is taken; those of the state by
        default.
    """
    body = problem.equilibrium
    residual = body.internal_forces(state.x, secant_at) - body.external(state.time)
    problem.interface.add_forces(residual, state.x, state.forces)
    return residual


def _rounding(problem: Problem, state: State) -> float:
    """Return what rounding may leave of the forces that hold each node alone where it is.

    The stresses around a node of a slender body, or of one that is moved without being touched,
    cancel but for far smaller forces, and the rounding of each remains.
    """
    body = problem.equilibrium
    return ROUNDING * problem.scales.stiffness * body.norm(body.owned_part(state.x))


def evaluate(problem: Problem, state: State) -> KKT:
    """Return the residuals of a state. Collective; nothing is changed by it."""
    body, interface = problem.equilibrium, problem.interface
    residual = residual_forces(problem, state)
    jump, nodal = interface.jump, interface.jump.apply(state.x)
    contact_forces = np.zeros_like(residual)
    stress = interface.stress(nodal, state.forces)
    jump.transpose(jump.weight[:, None] * stress, contact_forces)
    loads, pushes = body.load_size(state.time), body.norm(contact_forces)
    scale = loads + pushes + body.norm(body.reactions(residual))
    rounding = _rounding(problem, state)
    if loads > 0 or pushes > rounding:
        # Not more than that: of a body that flies away all forces are rounding.
        rounding = min(rounding, MOST_ROUNDING * scale)
    unbalanced = body.norm(body.unbalanced(residual))
    equilibrium = max(0.0, unbalanced - rounding) / (scale or 1.0)
    bound = interface.bound(nodal, state.forces)
    return KKT(equilibrium, *interface_residuals(interface, nodal, state.forces, bound))
