"""Residuals of the discrete contact problem, computed from scratch: they decide convergence."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from contact.interface.active_set import constraint_active
from contact.interface.complementarity import interface_residuals, worst
from contact.interface.interface import Interface
from contact.problem.protocols import Problem
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

    Attributes
    ----------
    equilibrium
        |F(u) + contact forces| on free unknowns over the sum of the norms of loads, contact forces
        and reactions; the largest of all connected components, and of forces and charges. The
        coupling forces of the potential and charges of the strain count as loads. Without any
        force the reference is the residual of the zero initial guess, and rounding counts as 0.
    contact
        |p - max(0, p - c (gap - u_nu))| / |p| in L2(Gamma_3), the largest of all connected
        components; c = c_0 = E/length of the touching bodies, times the elongation >= 1 of the
        cells behind Gamma_3 (`contact.mesh.entities.elongation`).
    friction
        |lambda_f - proj(lambda_f + c u_tau)| / |p| with the final bound s.
    floors
        Rounding floors of the three: a residual below its floor is accepted. `force_rounding` up to
        the `rounding_limit` of the body, and these forces as pressures.
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

    def excess(self, allowed: Residuals) -> str:
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


def residual_forces(
    problem: Problem,
    state: State,
    secant_at: Array | None = None,
    internal: Array | None = None,
) -> Array:
    """Return R = F(x) - loads + contact and foundation forces, on the owned unknowns. Collective.

    At fixed unknowns R is minus the reactions of the supports.

    Parameters
    ----------
    problem, state
        The problem and its state.
    secant_at
        Unknowns of the secant modulus; those of the state by default.
    internal
        Internal forces F(x), if known.
    """
    body = problem.equilibrium
    if internal is None:
        internal = body.internal_forces(state, secant_at)
    residual = internal - body.external(state.time)
    problem.interface.add_forces(residual, state.x, state.forces)
    return residual


#: Perturbed unknowns, and the internal forces there.
_Perturbed = tuple[Array, Array]


@lru_cache(maxsize=2)  # whole body and condensed body
def _random_signs(size: int) -> Array:
    """Return relative perturbations with random signs."""
    return PERTURBATION * np.random.default_rng(0).choice((-1.0, 1.0), size)


def force_rounding(
    problem: Problem, state: State, internal: Array, perturbed: _Perturbed | None = None
) -> Array:
    """Return norms of the rounding errors of forces and charges, by component. Collective.

    |K| |x| EPS, estimated by a random perturbation of x: large where forces cancel, in slender
    bodies, after far motions, or in potentials across a contact of high conductivity. No backward
    stable method leaves less (Rigal and Gaches, J. ACM 14 (1967) 543).
    """
    body, (moved, there) = problem.equilibrium, perturbed or _perturbed(problem, state)
    change = there - internal
    problem.interface.add_current(change, state.x, moved - state.x, state.forces)
    return MARGIN * EPS / PERTURBATION * body.norms(body.unbalanced(change))


def _perturbed(problem: Problem, state: State) -> _Perturbed:
    """Return perturbed unknowns, and the internal forces there. Collective."""
    body, own = problem.equilibrium, problem.equilibrium.owned_part(state.x)
    # Global unknowns, behind those of the nodes, have the same sign on all ranks.
    step = np.full(own.size, PERTURBATION)
    step[: body.owned] = _random_signs(body.owned)
    moved = body.moved(state.x, step * own)
    return moved, body.internal_forces(replace(state, x=moved))


def _as_pressures(interface: Interface, forces: Array) -> Array:
    """Return norms in L2(Gamma_3) of pressures for given norms of nodal forces. Collective."""
    count, area = interface.extents
    return forces * np.sqrt(np.divide(count, area, out=np.zeros_like(area), where=area > 0))


def residual_as_pressures(problem: Problem, state: State, residual: Array) -> float:
    """Return the residual forces as pressures, over the contact pressures. Collective."""
    body, interface = problem.equilibrium, problem.interface
    left = body.norms(body.unbalanced(residual))[0]
    return _over_pressed(interface, state, _as_pressures(interface, left))


def _over_pressed(interface: Interface, state: State, pressures: Array) -> float:
    """Return the largest ratio of norms of pressures to |p| on a component. Collective.

    Multipliers at open nodes, and pressures that are rounding, do not count as contact.
    """
    nodal, own = interface.nodes.apply(state.x), state.forces.pressure
    rounding = interface.rounding(nodal)
    on = constraint_active(own, interface.normal_gap(nodal), interface.c_0, rounding)
    pressed = interface.norms(interface.pressure(nodal, state.forces) - own * ~on)
    much = (pressed > 0) & (pressed > EPS * pressed.max())
    return float(np.divide(pressures, pressed, out=np.zeros_like(pressed), where=much).max())


def evaluate(problem: Problem, state: State) -> Residuals:
    """Return the residuals of a state; NaN where numbers overflow. Collective."""
    return evaluate_forces(problem, state)[0]


@np.errstate(over="ignore", invalid="ignore")
def evaluate_forces(problem: Problem, state: State) -> tuple[Residuals, Array]:
    """Return the residuals of a state, and the internal forces there. Collective."""
    body, interface = problem.equilibrium, problem.interface
    loads = body.load_norms(state.time)
    # First, as laws with history keep their last response: it is to be that of the state.
    perturbed = None if (loads > 0).all() else _perturbed(problem, state)
    internal = body.internal_forces(state)
    on_contact = np.zeros_like(internal)
    interface.add_forces(on_contact, state.x, state.forces)
    residual = internal - body.external(state.time) + on_contact
    exerted = body.norms(on_contact) + body.exchanged(state)
    scale = loads + exerted + body.norms(body.reactions(residual))
    unbalanced = body.norms(body.unbalanced(residual))
    limit, loaded = body.rounding_limit * scale, loads > 0
    small = ~loaded | (unbalanced <= limit)
    rounding, contact_rounding = np.zeros_like(scale), np.zeros(interface.components)
    if small.any():
        found = force_rounding(problem, state, internal, perturbed)
        rounding = np.where(small, found, 0.0)
        contact_rounding = np.minimum(rounding, limit)[0]
        loaded |= exerted > rounding
        # Without loads on a component all of its forces are rounding, its own or that of others.
        largest = rounding.max(axis=1, keepdims=True)
        rounding = np.where(loaded, np.minimum(rounding, limit), largest)
        vanishes = ~loaded & (unbalanced <= rounding)
        unbalanced, rounding = (np.where(vanishes, 0.0, norms) for norms in (unbalanced, rounding))
        if not loaded.any():
            # Reference of free motions: the residual of the zero initial guess.
            first = body.norms(residual_forces(problem, problem.start()))
            scale = scale + first.max(axis=1, keepdims=True)
            body.internal_forces(state)  # laws with history keep their last response
    # Least reference of a component without loads, and of charges (in the unit of forces).
    scale = np.maximum(scale, EPS * scale.max())
    reference = np.where(scale > 0, scale, 1.0)
    balance = worst((unbalanced / reference).reshape(1, -1), (rounding / reference).reshape(1, -1))
    nodal = interface.nodes.apply(state.x)
    bound = interface.bound(nodal, state.forces)
    pressures = _as_pressures(interface, contact_rounding)
    laws = interface_residuals(interface, nodal, state.forces, bound, pressures)
    accepted = np.where(loaded, np.minimum(rounding, unbalanced) / reference, 0.0)
    equilibrium_rounding = float(accepted.max())
    residuals, floors = (
        (float(first), float(contact), float(friction))
        for (first,), (contact, friction) in zip(balance, laws, strict=True)
    )
    pressure_rounding = _over_pressed(interface, state, pressures)
    return Residuals(*residuals, floors, equilibrium_rounding, pressure_rounding), internal
