"""Residuals of the discrete contact problem, computed from scratch.

They alone decide whether a run has converged, whatever the method.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from contact.interface.active_set import touching
from contact.interface.complementarity import interface_residuals, worst
from contact.interface.interface import Interface
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.tolerances import EPS
from contact.typing import Array

#: How far unknowns are moved to see the effect of rounding, over their size.
PERTURBATION = EPS**0.5

#: Rounding that is allowed for, over the change of forces by moving all unknowns by rounding.
#: Residuals that fall no further are 0.6 to 1 of that; solves leave a few times as much.
MARGIN = 4.0


@dataclass(frozen=True)
class Residuals:
    """Relative residuals of equilibrium, contact and friction.

    Attributes
    ----------
    equilibrium
        |F(u) + contact forces| on free unknowns over the sum of the norms of loads, contact forces
        and reactions; zero where nothing acts and all forces are rounding, and beside the forces of
        the prescribed displacements on undeformed bodies where nothing acts. Of bodies that nothing
        connects the largest, each over the forces on itself. Of a piezoelectric body the larger one
        of forces and of charges, each over those of its own kind: to these belong the forces of the
        potential on the undeformed body, and the charges of the strain.
    contact
        |p - max(0, p - c (gap - u_nu))| / |p| in L2(Gamma_3), c = E/length with
        the modulus of the touching bodies, and the length of the body, less as many times as cells
        behind Gamma_3 are longer than twice their facets (`contact.mesh.entities.elongation`); the
        largest of those of bodies that nothing connects.
    friction
        |lambda_f - proj(lambda_f + c u_tau)| / |p| with the final bound s.
    floors
        Rounding floors of the three, over the same: `force_rounding`, but not more than the
        `most_rounding` of the body, and these forces as pressures: no contact force is known better
        than equilibrium knows it. A residual below its floor is accepted.
    rounding
        The largest residual of equilibrium that is accepted as rounding. Zero where no load acts,
        nothing touches and the other field exerts nothing: all forces are rounding then, and there
        is nothing to compare with.
    unknown
        These forces as pressures over |p|: contact forces are known to that. Zero where nothing
        presses.
    """

    equilibrium: float
    contact: float
    friction: float
    floors: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rounding: float = 0.0
    unknown: float = 0.0

    @property
    def largest(self) -> float:
        """The largest of the three; infinity if any is not a number."""
        values = self._values
        return max(values) if np.all(np.isfinite(values)) else np.inf

    @property
    def significant(self) -> float:
        """The largest of those above their rounding floors; zero if none is."""
        pairs = zip(self._values, self.floors, strict=True)
        values = [value for value, floor in pairs if not value <= floor]
        return max(values, default=0.0) if np.all(np.isfinite(values)) else np.inf

    @property
    def _values(self) -> tuple[float, float, float]:
        return self.equilibrium, self.contact, self.friction

    def excess(self, allowed: Residuals) -> str:
        """Name the residual that is farthest above its limit, or its floor where that is larger.

        Nothing if none is.
        """
        ratios = {
            name: getattr(self, name) / max(getattr(allowed, name), floor)
            for name, floor in zip(("equilibrium", "contact", "friction"), self.floors, strict=True)
        }
        # A residual that is no number is above everything.
        worst = max(ratios, key=lambda name: np.nan_to_num(ratios[name], nan=np.inf))
        if ratios[worst] <= 1:
            return ""
        value, limit = getattr(self, worst), getattr(allowed, worst)
        return f"the {worst} residual is {value:.2e}, above {limit:g}"

    def granted(self, allowed: Residuals) -> str:
        """Name the residual farthest above its limit that is below its rounding floor.

        Nothing if none is.
        """
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
    """Return F(x) - loads + contact and foundation forces on the owned unknowns. Collective.

    Its entries at fixed unknowns are minus the reactions of the supports.

    Parameters
    ----------
    problem, state
        The problem, and where it is.
    secant_at
        Unknowns at which the secant modulus of the material is taken; those of the state by
        default.
    internal
        The internal forces, where they are known already.
    """
    body = problem.equilibrium
    if internal is None:
        internal = body.internal_forces(state, secant_at)
    residual = internal - body.external(state.time)
    problem.interface.add_forces(residual, state.x, state.forces)
    return residual


#: Unknowns beside those of a state, and the internal forces there.
_Beside = tuple[Array, Array]


@lru_cache(maxsize=2)  # of the body, and of its contact nodes
def _perturbation(size: int) -> Array:
    """Return relative perturbations of unknowns, with random signs."""
    return PERTURBATION * np.random.default_rng(0).choice((-1.0, 1.0), size)


def force_rounding(
    problem: Problem, state: State, internal: Array, beside: _Beside | None = None
) -> Array:
    """Return the rounding of the forces, and of the charges, by component. Collective.

    Unknowns are known to `EPS` of their size. The stresses around a node of a slender body, or of
    one that is moved far, cancel but for far smaller forces, and so do potentials on both sides of
    a contact that conducts far better than the bodies. Their parts by the rounding of each
    unknown remains: seen by moving all of them, up and down at random. No backward stable method
    leaves less (Rigal and Gaches, J. ACM 14 (1967) 543).
    """
    body, (moved, there) = problem.equilibrium, beside or _beside(problem, state)
    change = there - internal
    problem.interface.add_current(change, state.x, moved - state.x, state.forces)
    return MARGIN * EPS / PERTURBATION * body.norms(body.unbalanced(change))


def _beside(problem: Problem, state: State) -> _Beside:
    """Return unknowns that are a little moved, and the internal forces there. Collective."""
    body, own = problem.equilibrium, problem.equilibrium.owned_part(state.x)
    # All ranks hold the global unknowns behind those of the nodes.
    step = np.full(own.size, PERTURBATION)
    step[: body.owned] = _perturbation(body.owned)
    moved = body.moved(state.x, step * own)
    return moved, body.internal_forces(replace(state, x=moved))


def _as_pressures(interface: Interface, forces: Array) -> Array:
    """Return the norms in L2(Gamma_3) of pressures with forces of given norms. Collective."""
    count, area = interface.extents
    return forces * np.sqrt(np.divide(count, area, out=np.zeros_like(area), where=area > 0))


def left_as_pressures(problem: Problem, state: State, residual: Array) -> float:
    """Return the residual forces, as pressures over those that press. Collective."""
    body, interface = problem.equilibrium, problem.interface
    left = body.norms(body.unbalanced(residual))[0]
    return _over_pressed(interface, state, _as_pressures(interface, left))


def _over_pressed(interface: Interface, state: State, pressures: Array) -> float:
    """Return the largest of norms of pressures over the pressure on each component. Collective.

    The remainder of a multiplier at open nodes presses nothing, and neither does
    rounding beside the pressures on other components, or of the displacements.
    """
    nodal, own = interface.jump.apply(state.x), state.forces.pressure
    rounding = interface.rounding(nodal)
    on = touching(own, interface.opening(nodal), interface.stiffness, rounding)
    pressed = interface.norms(interface.pressure(nodal, state.forces) - own * ~on)
    much = (pressed > 0) & (pressed > EPS * pressed.max())
    return float(np.divide(pressures, pressed, out=np.zeros_like(pressed), where=much).max())


def evaluate(problem: Problem, state: State) -> Residuals:
    """Return the residuals of a state. Collective; nothing is changed by it.

    Those of a body that flies away are no numbers, which is all there is to say of them.
    """
    return evaluate_forces(problem, state)[0]


@np.errstate(over="ignore", invalid="ignore")
def evaluate_forces(problem: Problem, state: State) -> tuple[Residuals, Array]:
    """Return the residuals of a state, and the internal forces there. Collective."""
    body, interface = problem.equilibrium, problem.interface
    loads = body.load_norms(state.time)
    # Asked for first: laws with history keep their last response, which is then that of the state.
    beside = None if (loads > 0).all() else _beside(problem, state)
    internal = body.internal_forces(state)
    on_contact = np.zeros_like(internal)
    interface.add_forces(on_contact, state.x, state.forces)
    residual = internal - body.external(state.time) + on_contact
    answers = body.norms(on_contact) + body.exchanged(state)
    scale = loads + answers + body.norms(body.reactions(residual))
    unbalanced = body.norms(body.unbalanced(residual))
    most, acted = body.most_rounding * scale, loads > 0
    asked = ~acted | (unbalanced <= most)
    rounding, unknown = np.zeros_like(scale), np.zeros(interface.components)
    if asked.any():
        found = force_rounding(problem, state, internal, beside)
        rounding = np.where(asked, found, 0.0)
        unknown = np.minimum(rounding, most)[0]
        acted |= answers > rounding
        # Where nothing acts on a body all of its forces are rounding, its own or that of others.
        largest = rounding.max(axis=1, keepdims=True)
        rounding = np.where(acted, np.minimum(rounding, most), largest)
        nothing = ~acted & (unbalanced <= rounding)
        unbalanced, rounding = (np.where(nothing, 0.0, norms) for norms in (unbalanced, rounding))
        if not acted.any():
            # Bodies that have moved freely: beside the forces that would have held them.
            held = body.norms(residual_forces(problem, problem.start()))
            scale = scale + held.max(axis=1, keepdims=True)
            body.internal_forces(state)  # laws with history keep their last response
    # Of a component on which nothing acts there is the rounding of the others, and of charges, in
    # units of forces by the scale of the potential, that of a body without a field.
    scale = np.maximum(scale, EPS * scale.max())
    size = np.where(scale > 0, scale, 1.0)
    balance = worst((unbalanced / size).reshape(1, -1), (rounding / size).reshape(1, -1))
    nodal = interface.jump.apply(state.x)
    bound, pressures = interface.bound(nodal, state.forces), _as_pressures(interface, unknown)
    laws = interface_residuals(interface, nodal, state.forces, bound, pressures)
    granted = float(np.max(np.where(acted, np.minimum(rounding, unbalanced) / size, 0.0)))
    residuals, floors = (
        (float(first), float(contact), float(friction))
        for (first,), (contact, friction) in zip(balance, laws, strict=True)
    )
    known_to = _over_pressed(interface, state, pressures)
    return Residuals(*residuals, floors, granted, known_to), internal
