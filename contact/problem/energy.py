"""The energy balance of a step: work, stored energy, and dissipation by friction and plastic flow.

The work is that of loads, supports, electrodes, layer and conductive foundation on the body, by the
trapezoidal rule. Per step

    work - change of energy = dissipation + plastic dissipation + O(step^2).

The dissipation sum w lambda_f . Delta j_tau, with the friction at the end of the step, is never
negative; nor is the plastic one, which the material states, like its stored energy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.typing import Array

#: Gauss points of the stress power in a step of a nonlinear material.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)

#: The same on sixteen parts of the straight path to a state.
_WAY = ((np.arange(16)[:, None] + 0.5 + 0.5 * _POINTS) / 16).ravel()
_SHARES = np.tile(_WEIGHTS / 32, 16)


@dataclass(frozen=True)
class Balance:
    """Energies of a step (force times length; in the plane by unit thickness), and its end.

    Attributes
    ----------
    work, dissipation
        Work of the loads, and dissipation by friction, in the step.
    plastic
        Plastic dissipation in the step; None without internal variables.
    energy, enthalpy
        Stored energy at its end; less charges times potentials of a piezoelectric body.
    x, given, internal
        Local unknowns at its end; forces and charges on the owned ones, by loads and by stresses.
    """

    work: float
    energy: float
    dissipation: float
    plastic: float | None
    enthalpy: float
    x: Array
    given: Array
    internal: Array

    @staticmethod
    def rest(problem: ContactProblem) -> Balance:
        """Return that of the reference configuration."""
        x = problem.equilibrium.rest()
        zero = np.zeros_like(problem.equilibrium.owned_part(x))
        return Balance(0.0, 0.0, 0.0, None, 0.0, x, zero, zero)


def working_forces(problem: ContactProblem, state: State) -> tuple[Array, Array]:
    """Return external forces and charges on the owned unknowns, and internal ones. Collective."""
    body, interface = problem.equilibrium, problem.interface
    external = body.external(state.time)
    residual = residual_forces(problem, state)
    foundation = np.zeros_like(residual)
    interface.add_forces(foundation, state.x, state.forces)
    internal = residual + external - foundation
    vectors = interface.nodes.weight[:, None] * state.forces.vectors(interface.nodes)
    interface.nodes.transpose(-vectors, foundation)
    return external - foundation + body.reactions(residual), internal


def dissipated(
    problem: ContactProblem, state: State, nodes: NDArray[np.bool_] | None = None
) -> float:
    """Return the dissipation by friction in the step of a state, at some nodes (n,) or all.

    Collective.
    """
    interface = problem.interface
    slip = interface.slip(problem.nodal(state))
    work = np.einsum("ni,ni->n", state.forces.friction, slip)
    return interface.nodes.sum(work if nodes is None else np.where(nodes, work, 0.0))


def stored(problem: ContactProblem, state: State) -> float:
    """Return the stored energy of a state. Collective.

    The work of the stresses on a straight path; for materials with internal variables the energy
    that they state, NaN if they do not.
    """
    body, x = problem.equilibrium, problem.equilibrium.owned_part(state.x)
    own = 0.0
    if body.laws.initial is not None:
        stated = body.laws.energies(state)[1]
        own = np.nan if stated is None else stated
    forces = body.forces_without_history(state)
    electric = body.product(np.where(body.component_norms.mechanical, 0.0, x), forces)
    if body.linear:
        return own + body.product(0.5 * forces, x) - electric
    for part, share in zip(_WAY, _SHARES, strict=True):
        way = body.forces_without_history(replace(state, x=part * state.x))
        own += share * body.product(way, x)
    return own - electric


def balance(problem: ContactProblem, state: State, before: Balance) -> Balance:
    """Return the energies of a step that follows another one. Collective."""
    body = problem.equilibrium
    given, internal = working_forces(problem, state)
    x, x_before = body.owned_part(state.x), body.owned_part(before.x)
    plastic, stored = body.laws.energies(state)
    forces_at: Callable[[State], Array] = body.internal_forces
    if stored is None:
        gained = -plastic
    else:
        _, at_first = body.laws.energies(replace(state, x=before.x))
        assert at_first is not None
        forces_at, gained = body.forces_without_history, stored - at_first
    if body.linear:
        power = 0.5 * (internal + before.internal)
    else:
        way = [0.5 * ((1 - s) * before.x + (1 + s) * state.x) for s in _POINTS]
        power = 0.5 * _WEIGHTS @ np.array([forces_at(replace(state, x=x)) for x in way])
    enthalpy = before.enthalpy + body.product(power, x - x_before) + gained
    mechanical = body.component_norms.mechanical
    # Mechanical work f.du; electric work phi dq, from the enthalpy's -q dphi.
    work = np.where(
        mechanical,
        0.5 * (given + before.given) * (x - x_before),
        -0.5 * (x + x_before) * (given - before.given),
    )
    charged = body.product(np.where(mechanical, 0.0, x), internal)
    dissipation = dissipated(problem, state)
    done = body.product(work, np.ones_like(work))
    flow = plastic if body.laws.initial is not None else None
    return Balance(done, enthalpy - charged, dissipation, flow, enthalpy, state.x, given, internal)
