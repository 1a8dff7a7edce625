"""Residuals of the discrete contact problem, computed from scratch.

They alone decide whether a run has converged, whatever the method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.residuals import interface_residuals
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.tolerances import EPS
from contact.typing import Array

#: How far unknowns are moved to see what rounding does, over their size.
SHAKE = 1e-8

#: Rounding that is allowed for, over what moving all unknowns by rounding does to the forces.
#: Residuals that fall no further are 0.6 to 1 of that; solves leave a few times as much.
MARGIN = 4.0


@dataclass(frozen=True)
class KKT:
    """Relative residuals of equilibrium, contact and friction.

    Attributes
    ----------
    equilibrium
        |F(u) + contact forces| on free unknowns, less `rounding`, over the sum of the norms of
        loads, contact forces and reactions; mechanical and (scaled) electric unknowns together.
    contact
        |p - max(0, p + c (u_nu - rho))| / |p| in L2(Gamma_3), c = E/length with
        the modulus of what touches.
    friction
        |lambda_f - proj(lambda_f + c u_tau)| / |p| with the final bound s.
    rounding
        What has been subtracted from the first, over the same: `_rounding`, but not more than the
        `most_rounding` of the body. Zero where no load acts and nothing touches: all forces are
        rounding then, and there is nothing to compare it with.
    """

    equilibrium: float
    contact: float
    friction: float
    rounding: float = 0.0

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
    """Return what rounding may leave of the forces. Collective.

    Unknowns are known to `EPS` of their size. The stresses around a node of a slender body, or of
    one that is moved far, cancel but for far smaller forces, and what they owe to the rounding of
    each unknown remains: seen by moving all of them, up and down at random. No backward stable
    method leaves less (Rigal and Gaches, J. ACM 14 (1967) 543).
    """
    body, own = problem.equilibrium, problem.equilibrium.owned_part(state.x)
    # All ranks hold the global unknowns behind those of the nodes.
    step = np.full(own.size, SHAKE)
    step[: body.owned] *= np.random.default_rng(0).choice((-1.0, 1.0), body.owned)
    change = body.internal_forces(body.moved(state.x, step * own)) - body.internal_forces(state.x)
    return MARGIN * EPS / SHAKE * body.norm(body.unbalanced(change))


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
    unbalanced = body.norm(body.unbalanced(residual))
    rounding, most, acted = 0.0, body.most_rounding * scale, loads > 0
    if not acted or unbalanced <= most:
        rounding = _rounding(problem, state)
        acted = acted or pushes > rounding
        # Of a body that flies away all forces are rounding.
        rounding = min(rounding, most) if acted else rounding
    rounding = min(rounding, unbalanced)
    equilibrium = (unbalanced - rounding) / (scale or 1.0)
    bound = interface.bound(nodal, state.forces)
    laws = interface_residuals(interface, nodal, state.forces, bound)
    return KKT(equilibrium, *laws, rounding / scale if acted else 0.0)
