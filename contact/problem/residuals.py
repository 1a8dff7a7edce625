"""Residuals of the discrete contact problem, computed from scratch, and the energies of a step.

The residuals decide convergence.

The energy balance (`Balance`): the work is that of loads, supports, electrodes, layer and
conductive foundation on the body, by the trapezoidal rule. Per step

    work - change of energy = dissipation + plastic dissipation + O(step^2).

The dissipation sum w lambda_f . Delta j_tau, with the friction at the end of the step, is never
negative; nor is the plastic one, which the material states, like its stored energy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from contact.interface.complementarity import interface_residuals, worst
from contact.interface.interface import Interface
from contact.interface.multipliers import constraint_active
from contact.problem.condensed import AnyProblem
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.tolerances import EPS
from contact.typing import Array

#: Relative perturbation of the unknowns in estimates of rounding errors.
PERTURBATION = EPS**0.5

#: Factor of the estimated rounding error that is accepted. Residuals fall to 0.6 to 1 of the
#: estimate by iteration, and to a few times that by solves.
MARGIN = 4.0


@dataclass(frozen=True)
class Residuals:
    """Relative residuals of equilibrium, contact and friction.

    They are accepted where r_i <= max(tol_i, floor_i) for each of the three (`unmet`); `granted`
    names one with tol_i < r_i <= floor_i. The tolerances tol_i are `Residuals` too.

    Attributes
    ----------
    equilibrium
        |G(x, lambda)| on free unknowns over the sum of the norms of loads, contact forces
        and reactions; the largest of all connected components, and of forces and charges. The
        coupling forces of the potential and charges of the strain count as loads. Without any
        force the reference is the residual of the zero initial guess, and rounding counts as 0.
    contact
        |lambda_c - max(0, lambda_c + c_r (u_nu - rho))| in L2(Gamma_3) over
        max(|p|, 1e-4 E/L |g|), p = -sigma_nu, g the gaps up to the displacements
        (`interface_residuals`); the largest of all connected components. c_r = `Interface.c_r`,
        L the extent of the smaller body of the contact.
    friction
        |lambda_f - proj_s(lambda_f + c_r u_tau)| over the same, with the final bound s.
    floors
        Rounding floors of the three: `rounding_forces` up to the `rounding_limit` of the body, and
        these forces as pressures.
    equilibrium_rounding
        Largest residual of equilibrium that is accepted as rounding; 0 where no force acts.
    pressure_rounding
        The rounding errors of equilibrium as pressures, over |p|: accuracy of the contact forces.
        0 without contact.
    """

    equilibrium: float
    contact: float
    friction: float
    floors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    equilibrium_rounding: float = 0.0
    pressure_rounding: float = 0.0

    @property
    def largest(self) -> float:
        """The largest of the three; infinity for NaN."""
        values = self._values
        return max(values) if np.all(np.isfinite(values)) else np.inf

    @property
    def significant(self) -> float:
        """The largest of those above their rounding floors, or 0; infinity for NaN."""
        pairs = zip(self._values, self.floors, strict=True)
        values = [value for value, floor in pairs if not value <= floor]
        return max(values, default=0.0) if np.all(np.isfinite(values)) else np.inf

    @property
    def _values(self) -> tuple[float, float, float]:
        return self.equilibrium, self.contact, self.friction

    def unmet(self, allowed: Residuals) -> str:
        """Name the residual farthest above its tolerance, or floor if that is larger; or ""."""
        ratios = {
            name: getattr(self, name) / max(getattr(allowed, name), floor)
            for name, floor in zip(("equilibrium", "contact", "friction"), self.floors, strict=True)
        }
        worst = max(ratios, key=lambda name: np.nan_to_num(ratios[name], nan=np.inf))
        if ratios[worst] <= 1:
            return ""
        value, limit = getattr(self, worst), getattr(allowed, worst)
        return f"the {worst} residual is {value:.2e}, above {limit:g}"

    def granted(self, allowed: Residuals) -> str:
        """Name the residual farthest above its tolerance but below its floor; "" if none is."""
        values = {
            name: (getattr(self, name), floor)
            for name, floor in zip(("equilibrium", "contact", "friction"), self.floors, strict=True)
            if getattr(allowed, name) < getattr(self, name) <= floor
        }
        if not values:
            return ""
        worst = max(values, key=lambda name: values[name][0] / getattr(allowed, name))
        value, floor = values[worst]
        return f"the {worst} residual is {value:.2e}, its floor {floor:.2e}"


@dataclass(frozen=True)
class EvaluatedState:
    """A state with its residuals and the internal forces F(x) on the owned unknowns."""

    state: State
    residuals: Residuals
    internal: Array


def residual_forces(problem: AnyProblem, state: State, internal: Array | None = None) -> Array:
    """Return G(x, lambda) = F(x) - f + T^T W lambda on the owned unknowns. Collective.

    The residual of the body with contact. In (15) of docs/residuals.md lambda includes layer and
    charge; `state.multipliers` does not. At fixed unknowns G is the reaction of the support on the
    body. The internal forces F(x) are those of the material law by default.
    """
    body = problem.body
    if internal is None:
        internal = body.internal_forces(state)
    residual = internal - body.external(state.time)
    problem.interface.add_forces(residual, state.x, state.multipliers)
    return residual


#: Perturbed unknowns, and the internal forces there.
_Perturbed = tuple[Array, Array]


@lru_cache(maxsize=2)  # whole body and condensed body
def _random_signs(size: int) -> Array:
    """Return relative perturbations with random signs."""
    return PERTURBATION * np.random.default_rng(0).choice((-1.0, 1.0), size)


def rounding_forces(
    problem: AnyProblem, state: State, internal: Array, perturbed: _Perturbed | None = None
) -> Array:
    """Return norms of the rounding errors of forces and charges, by component. Collective.

    |K| |x| EPS, estimated by a random perturbation of x: large where forces cancel, in slender
    bodies, after far motions, or in potentials across a contact with a large psi. No backward
    stable method leaves less (Rigal and Gaches, J. ACM 14 (1967) 543).
    """
    body, (moved, moved_forces) = problem.body, perturbed or _perturbed(problem, state)
    change = moved_forces - internal
    problem.interface.add_charge(change, state.x, moved - state.x, state.multipliers)
    return MARGIN * EPS / PERTURBATION * body.norms(body.unbalanced(change))


def _perturbed(problem: AnyProblem, state: State) -> _Perturbed:
    """Return perturbed unknowns, and the internal forces there. Collective."""
    body, unknowns = problem.body, problem.body.owned_part(state.x)
    # Global unknowns, behind those of the nodes, have the same sign on all ranks.
    step = np.full(unknowns.size, PERTURBATION)
    step[: body.owned] = _random_signs(body.owned)
    moved = body.updated(state.x, step * unknowns)
    return moved, body.internal_forces(replace(state, x=moved))


def _as_pressures(interface: Interface, forces: Array) -> Array:
    """Return norms in L2(Gamma_3) of pressures for given norms of nodal forces. Collective."""
    count, area = interface.extents
    return forces * np.sqrt(np.divide(count, area, out=np.zeros_like(area), where=area > 0))


def residual_as_pressures(problem: AnyProblem, state: State, residual: Array) -> float:
    """Return the residual forces as pressures, over the contact pressures. Collective."""
    body, interface = problem.body, problem.interface
    unbalanced = body.norms(body.unbalanced(residual))[0]
    return _over_pressed(interface, state, _as_pressures(interface, unbalanced))


def _over_pressed(interface: Interface, state: State, pressures: Array) -> float:
    """Return the largest ratio of norms of pressures to |p| on a component. Collective.

    Multipliers at open nodes, and pressures that are rounding, do not count as contact.
    """
    jump, multiplier = interface.nodes.jump(state.x), state.multipliers.contact
    rounding_stress = interface.rounding_stress(jump)
    on = constraint_active(multiplier, interface.normal_gap(jump), interface.c_b, rounding_stress)
    pressed = interface.norms(interface.pressure(jump, state.multipliers) - multiplier * ~on)
    in_contact = (pressed > 0) & (pressed > EPS * pressed.max())
    return float(np.divide(pressures, pressed, out=np.zeros_like(pressed), where=in_contact).max())


def evaluate(problem: AnyProblem, state: State) -> Residuals:
    """Return the residuals of a state; NaN where numbers overflow. Collective."""
    return evaluate_state(problem, state).residuals


@np.errstate(over="ignore", invalid="ignore")
def evaluate_state(problem: AnyProblem, state: State) -> EvaluatedState:
    """Return a state with its residuals and the internal forces there. Collective."""
    body, interface = problem.body, problem.interface
    loads = body.load_norms(state.time)
    # Before the forces of the state, since laws with history keep their last response.
    perturbed = None if (loads > 0).all() else _perturbed(problem, state)
    internal = body.internal_forces(state)
    on_contact = np.zeros_like(internal)
    interface.add_forces(on_contact, state.x, state.multipliers)
    residual = internal - body.external(state.time) + on_contact
    exerted = body.norms(on_contact) + body.piezo_norms(state)
    reactions = body.norms(body.reactions(residual))
    scale = loads + exerted + reactions
    unbalanced = body.norms(body.unbalanced(residual))
    limit, loaded = body.rounding_limit * scale, loads > 0
    small = ~loaded | (unbalanced <= limit)
    rounding_force, rounding_on_contact = (
        np.zeros_like(scale),
        np.zeros(interface.connected_components),
    )
    if small.any():
        estimate = rounding_forces(problem, state, internal, perturbed)
        rounding_force = np.where(small, estimate, 0.0)
        rounding_on_contact = np.minimum(rounding_force, limit)[0]
        loaded |= exerted > rounding_force
        # Without loads on a component all of its forces are rounding, its own or that of others.
        largest = rounding_force.max(axis=1, keepdims=True)
        rounding_force = np.where(loaded, np.minimum(rounding_force, limit), largest)
        vanishes = ~loaded & (unbalanced <= rounding_force)
        unbalanced, rounding_force = (
            np.where(vanishes, 0.0, norms) for norms in (unbalanced, rounding_force)
        )
        if not loaded.any():
            # Reference of free motions: the residual of the zero initial guess, where supports
            # react that of the component, beside which those of a stiffer one may be large.
            first = body.norms(residual_forces(problem, problem.start()))
            scale = scale + np.where(reactions > 0, first, first.max(axis=1, keepdims=True))
            body.internal_forces(state)  # laws with history keep their last response
    # Least reference of a component without loads, and of charges (in the unit of forces).
    scale = np.maximum(scale, EPS * scale.max())
    reference = np.where(scale > 0, scale, 1.0)
    balance = worst(
        (unbalanced / reference).reshape(1, -1), (rounding_force / reference).reshape(1, -1)
    )
    jump = interface.nodes.jump(state.x)
    bound = interface.bound(jump, state.multipliers)
    pressures = _as_pressures(interface, rounding_on_contact)
    laws = interface_residuals(interface, jump, state.multipliers, bound, pressures)
    accepted = np.where(loaded, np.minimum(rounding_force, unbalanced) / reference, 0.0)
    equilibrium_rounding = float(accepted.max())
    residuals, floors = (
        (float(first), float(contact), float(friction))
        for (first,), (contact, friction) in zip(balance, laws, strict=True)
    )
    pressure_rounding = _over_pressed(interface, state, pressures)
    evaluated = Residuals(*residuals, floors, equilibrium_rounding, pressure_rounding)
    return EvaluatedState(state, evaluated, internal)


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
    stated
        Stored energy at its end of the laws with internal variables that state it.
    x, external, internal
        Local unknowns at its end; forces and charges on the owned ones, by loads and by stresses.
    """

    work: float
    energy: float
    dissipation: float
    plastic: float | None
    enthalpy: float
    stated: float
    x: Array
    external: Array
    internal: Array

    @staticmethod
    def rest(problem: ContactProblem) -> Balance:
        """Return the balance of the reference configuration."""
        x = problem.body.zero_displacement()
        zero = np.zeros_like(problem.body.owned_part(x))
        return Balance(
            work=0.0,
            energy=0.0,
            dissipation=0.0,
            plastic=None,
            enthalpy=0.0,
            stated=0.0,
            x=x,
            external=zero,
            internal=zero,
        )


def working_forces(problem: ContactProblem, state: State) -> tuple[Array, Array]:
    """Return external forces and charges on the owned unknowns, and internal ones. Collective."""
    body, interface = problem.body, problem.interface
    external = body.external(state.time)
    residual = residual_forces(problem, state)
    foundation = np.zeros_like(residual)
    interface.add_forces(foundation, state.x, state.multipliers)
    internal = residual + external - foundation
    vectors = interface.nodes.weight[:, None] * state.multipliers.vectors(interface.nodes)
    interface.nodes.add_jump_transposed(-vectors, foundation)
    return external - foundation + body.reactions(residual), internal


def dissipated(
    problem: ContactProblem, state: State, nodes: NDArray[np.bool_] | None = None
) -> float:
    """Return the dissipation by friction in a step, at some nodes (n,) or all. Collective."""
    interface = problem.interface
    slip = interface.slip(problem.nodal(state))
    work = np.einsum("ni,ni->n", state.multipliers.friction, slip)
    return interface.nodes.sum(work if nodes is None else np.where(nodes, work, 0.0))


def stored(problem: ContactProblem, state: State) -> float:
    """Return the stored energy of a state. Collective.

    The work of the stresses on a straight path; for materials with internal variables the energy
    that they state, NaN if they do not.
    """
    body, x = problem.body, problem.body.owned_part(state.x)
    energy = 0.0
    if body.laws.initial is not None:
        stated = body.laws.energies(state)[1]
        energy = np.nan if stated is None else stated
    forces = body.forces_without_history(state)
    electric = body.product(np.where(body.component_norms.mechanical, 0.0, x), forces)
    if body.linear:
        return energy + body.product(0.5 * forces, x) - electric
    for part, share in zip(_WAY, _SHARES, strict=True):
        part_forces = body.forces_without_history(replace(state, x=part * state.x))
        energy += share * body.product(part_forces, x)
    return energy - electric


def balance(problem: ContactProblem, state: State, before: Balance) -> Balance:
    """Return the energies of a step that follows another one. Collective."""
    body = problem.body
    external, internal = working_forces(problem, state)
    x, x_before = body.owned_part(state.x), body.owned_part(before.x)
    plastic, stored = body.laws.energies(state)
    forces_at: Callable[[State], Array] = body.internal_forces
    if stored is None:
        gained = -plastic
    else:
        # Not of the old strain: internal variables may change while it does not.
        forces_at, gained = body.forces_without_history, stored - before.stated
    if body.linear:
        power = 0.5 * (internal + before.internal)
    else:
        path = [0.5 * ((1 - s) * before.x + (1 + s) * state.x) for s in _POINTS]
        power = 0.5 * _WEIGHTS @ np.array([forces_at(replace(state, x=x)) for x in path])
    enthalpy = before.enthalpy + body.product(power, x - x_before) + gained
    mechanical = body.component_norms.mechanical
    # Mechanical work f.du; electric work phi dq, from the enthalpy's -q dphi.
    work = np.where(
        mechanical,
        0.5 * (external + before.external) * (x - x_before),
        -0.5 * (x + x_before) * (external - before.external),
    )
    return Balance(
        work=body.product(work, np.ones_like(work)),
        energy=enthalpy - body.product(np.where(mechanical, 0.0, x), internal),
        dissipation=dissipated(problem, state),
        plastic=plastic if body.laws.initial is not None else None,
        enthalpy=enthalpy,
        stated=stored or 0.0,
        x=state.x,
        external=external,
        internal=internal,
    )


def undeformed_equilibrium(problem: AnyProblem, tolerance: float) -> EvaluatedState | None:
    """Return `problem.start()` if it is in equilibrium, else None. Collective.

    That is zero displacement but for the prescribed values; of a whole problem each free foundation
    is moved by its force to the first touch. Residuals are relative to the forces that act:
    approaching a state without forces, none becomes small. With friction there may be other
    solutions, so a method asks for this where it fails.
    """
    evaluated = evaluate_state(problem, problem.start())
    return evaluated if evaluated.residuals.significant <= tolerance else None
