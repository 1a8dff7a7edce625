"""Derivatives of results by parameters, through contact and friction.

At a solution the consistent Newton matrix J gives them: with z the unknowns and contact forces, h
the history at the beginning of a step, and R(z, h; m) = 0 the equations of its active set,

    dz/dm = -J^-1 (dR/dm + dR/dh dh/dm)                              (tangent),
    dQ/dm = dQ/dm|_z - w . dR/dm,    J^T w = (dQ/dz)^T               (adjoint),

one back-substitution a parameter and step, or one a quantity and step. The tangent is carried
forwards through the steps of an evolution with the history, the adjoint backwards. dR/dm is a
central difference of residuals at the fixed solution (semi-analytical sensitivities: nothing is
solved again), so that any number of a case may be the parameter, sizes of the mesh too.

References
----------
Haftka and Adelman, Recent developments in structural sensitivity analysis, Struct. Optim. 1 (1989).
Michaleris, Tortorelli and Vidal, Tangent operators and design sensitivity formulations for
transient non-linear coupled problems, Int. J. Numer. Methods Engrg. 37 (1994).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from mpi4py import MPI

from contact.arguments import expect
from contact.case.build import build_problem
from contact.case.text import number_at, with_number
from contact.errors import InputError
from contact.history import History
from contact.interface.jump import SlipHistory
from contact.linear.operator import Counters
from contact.methods.options import NewtonOptions
from contact.methods.parameters import complementarity_parameters
from contact.output.differentiable import Differentiable, Quantity, named_quantities
from contact.output.solution import Solution
from contact.problem.linearised import (
    Equations,
    Linearised,
    equations,
    moved_state,
    weakly_active,
)
from contact.problem.problem import SLIP, ContactProblem
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.sensitivity")

#: Relative change of parameters in central differences: their error and that of rounding are some
#: 1e-10 then.
STEP = 1e-5

#: Problems and states a little above and below a parameter.
_Sides = list[tuple[ContactProblem, State]]

#: Methods of `sensitivity`.
AUTO, TANGENT, ADJOINT = "auto", "tangent", "adjoint"


@dataclass(frozen=True)
class Parameter:
    """A number that a problem depends on.

    Attributes
    ----------
    value
        The number.
    problem
        Returns the problem of another number, with the same mesh, spaces and contact nodes.
    """

    value: float
    problem: Callable[[float], ContactProblem]


class Sensitivities(dict[str, dict[str, float]]):
    """Quantity -> parameter -> derivative, at the end of the last step.

    Attributes
    ----------
    steps
        Quantity -> parameter -> derivatives at the end of each step, shape (steps,); empty for the
        adjoint, which gives those of the last step alone.
    weakly_active
        Points of contact nodes at the border of two states in a step, shape (n, d). There the
        derivatives are one-sided: those of the active set of the solution.
    counters
        Factorisations and back-substitutions that they took.
    method
        "tangent" or "adjoint".
    by_gap
        Of the adjoint: quantity -> its derivatives by the gap at the nodes of this rank; see
        `gap_gradient`.
    """

    def __init__(self, method: str, counters: Counters, weakly_active: Array) -> None:
        super().__init__()
        self.method, self.counters, self.weakly_active = method, counters, weakly_active
        self.steps: dict[str, dict[str, Array]] = {}
        self.by_gap: dict[str, Array] = {}


def sensitivity(
    solution: Solution,
    quantities: Sequence[str] | Mapping[str, Quantity],
    parameters: Sequence[str] | Mapping[str, Parameter],
    method: str = AUTO,
) -> Sensitivities:
    """Return the derivatives of results by parameters, through all load steps. Collective.

    Parameters
    ----------
    solution
        A converged solution.
    quantities
        Columns of ``steps.csv``: ``contact_force_x``, ``max_pressure``, ``max_displacement``,
        ``rigid_x``, ``rigid_rotation``, ``rigid_force_x``, ``potential_PART``, ``charge_PART``,
        ``charge_foundation``; and ``reactions.PART.x``. Or functions of problem and state, by name;
        the adjoint asks these for a `gradient` (`contact.output.differentiable`).
    parameters
        Keys of the case with a number: ``material.young``, ``friction.mu``, ``contact.gap``,
        ``load.0.traction.1``. Or `Parameter` by name, for problems that were built in Python.
    method
        "tangent", "adjoint", or "auto": the one with fewer back-substitutions.

    Returns
    -------
    The derivatives, by quantity and parameter.

    Raises
    ------
    InputError
        If the solution has not converged, a name is not known, a parameter has no number or changes
        the contact nodes, or the adjoint is asked for where the material has a history.

    Examples
    --------
    >>> found = sensitivity(solution, ["contact_force_x"], ["friction.mu"])  # doctest: +SKIP
    >>> found["contact_force_x"]["friction.mu"]  # doctest: +SKIP
    -0.00062189744
    """
    expect("solution", solution, "a Solution", isinstance(solution, Solution))
    if not solution.converged:
        raise InputError(f"solution: {solution.outcome.reason}; accepted: one that has converged")
    accepted = f"{AUTO!r}, {TANGENT!r} or {ADJOINT!r}"
    expect("method", method, accepted, method in (AUTO, TANGENT, ADJOINT))
    path = _Path(solution)
    asked = _quantities(solution, quantities)
    families = {name: path.family(name, given) for name, given in _parameters(solution, parameters)}
    reason = _no_adjoint(path, asked)
    if method == ADJOINT and reason:
        raise InputError(f"method: given 'adjoint'; {reason}; accepted: 'tangent'")
    fewer = len(asked) < len(families)
    adjoint = method == ADJOINT or (method == AUTO and fewer and not reason)
    found = Sensitivities(ADJOINT if adjoint else TANGENT, path.counters, path.weakly_active())
    (_adjoint if adjoint else _tangent)(path, asked, families, found)
    if found.weakly_active.size:
        logger.warning(
            "%d contact nodes are between two states, the first at %s: derivatives are one-sided",
            len(found.weakly_active),
            np.round(found.weakly_active[0], 6).tolist(),
        )
    return found


def gap_gradient(solution: Solution, quantity: str) -> Array:
    """Return the derivatives of a result by the gap at each contact node. Collective.

    One adjoint gives them all: the gradient for the shape of a foundation.

    Parameters
    ----------
    solution
        A converged solution; of an evolution the gap is that of all steps.
    quantity
        As of `sensitivity`; no layer or conductive foundation may depend on the gap.

    Returns
    -------
    Those of the nodes of this rank, in the order of ``solution.problem.nodes``, shape (n,).

    Raises
    ------
    InputError
        As `sensitivity`, and where a layer or a current depends on the gap.

    Examples
    --------
    >>> gradient = gap_gradient(solution, "max_pressure")  # doctest: +SKIP
    >>> points = solution.problem.nodes.points  # doctest: +SKIP
    """
    law = solution.problem.interface.law
    if law.layer is not None or law.follows_gap:
        raise InputError("gap_gradient: the layer or current depends on the gap; accepted: neither")
    found = sensitivity(solution, [quantity], {}, ADJOINT)
    return found.by_gap[quantity]


def _quantities(
    solution: Solution, given: Sequence[str] | Mapping[str, Quantity]
) -> Mapping[str, Quantity]:
    if isinstance(given, Mapping):
        return given
    known = named_quantities(solution.problem)
    for name in given:
        accepted = ", ".join(known) + "; or a function of problem and state"
        expect("quantities", name, accepted, name in known)
    return {name: known[name] for name in given}


def _parameters(
    solution: Solution, given: Sequence[str] | Mapping[str, Parameter]
) -> list[tuple[str, Parameter]]:
    if isinstance(given, Mapping):
        return [*given.items()]
    case = solution.source
    if case is None:
        raise InputError(
            "parameters: given keys of a case, for a problem that was built in Python; accepted: "
            "{name: Parameter(value, problem)}"
        )
    domain, comm = solution.problem.domain, solution.problem.comm

    def build(key: str, value: float) -> ContactProblem:
        kept = None if key.split(".")[0] == "mesh" else domain
        return build_problem(with_number(case, key, value), comm, domain=kept)

    return [(key, Parameter(number_at(case, key), partial(build, key))) for key in given]


@dataclass(frozen=True)
class _Family:
    """The problems at two values of a parameter, that far away from its own."""

    problems: tuple[ContactProblem, ContactProblem]
    ways: tuple[float, float]

    def slope(self, ahead: Array, behind: Array) -> Array:
        """Return the difference quotient of values at both."""
        return np.asarray((ahead - behind) / self.over, dtype=np.float64)

    @property
    def over(self) -> float:
        """The distance between them."""
        return self.ways[0] - self.ways[1]


class _Path:
    """The steps that have led to a solution."""

    def __init__(self, solution: Solution) -> None:
        base = solution.problem
        states = [record.state for record in solution.steps] or [solution.state]
        self.steps = [(base.at(state.time, state.history), state) for state in states]
        self.base, self.counters = base, Counters()
        gamma = NewtonOptions().gamma
        self._parameters = complementarity_parameters(base.scales, gamma)

    def linearised(self, index: int) -> Linearised:
        """Return the linearised equations at the end of a step. Collective."""
        return Linearised(*self.steps[index], self._parameters, self.counters)

    def weakly_active(self) -> Array:
        """Return the points of weakly active nodes of all steps. Collective."""
        return np.unique(np.concatenate([weakly_active(*step) for step in self.steps]), axis=0)

    def family(self, name: str, parameter: Parameter) -> _Family:
        """Return the problems beside that of a parameter. Collective."""
        step = STEP * (abs(parameter.value) or 1.0)
        problems, ways = [], []
        for way in (step, -step):
            try:
                problems.append(parameter.problem(parameter.value + way))
            except InputError:  # 0 may be the least that is accepted
                problems.append(parameter.problem(parameter.value))
                way = 0.0
            ways.append(way)
        ours = self.base.nodes.nodes, self.base.equilibrium.rest().size
        for problem in problems:
            theirs = problem.nodes.nodes, problem.equilibrium.rest().size
            same = np.array_equal(ours[0], theirs[0]) and ours[1] == theirs[1]
            if not self.base.comm.allreduce(same, op=MPI.LAND):
                raise InputError(
                    f"{name}: {parameter.value:g} is a border at which the contact nodes or the "
                    "mesh change; accepted: a parameter that leaves them"
                )
        return _Family((problems[0], problems[1]), (ways[0], ways[1]))


def _no_adjoint(path: _Path, quantities: Mapping[str, Quantity]) -> str:
    """Say why there is no adjoint; nothing where there is one."""
    blind = [name for name, given in quantities.items() if not isinstance(given, Differentiable)]
    if blind:
        return f"the quantity {blind[0]!r} has no gradient"
    if len(path.steps) > 1 and set(path.base.initial) != {SLIP}:
        return "the material has a history"
    if not path.base.interface.friction.local:
        return "friction is non-local"
    return ""


@dataclass
class _Direction:
    """Changes with a parameter: of unknowns, contact forces and history, per unit of it."""

    x: Array
    forces: Array
    history: dict[str, Array] = field(default_factory=dict)


def _beside(family: _Family, state: State, direction: _Direction) -> _Sides:
    """Return problems and states at both sides of a parameter, moved along a direction.

    Collective.
    """
    found = []
    for way, problem in zip(family.ways, family.problems, strict=True):
        history = _moved_history(state.history, direction.history, way)
        here = problem.at(state.time, history)
        there = moved_state(here, state, way * direction.x, way * direction.forces)
        x = here.equilibrium.prescribe(there.x, state.time)
        found.append((here, replace(there, x=x, history=history)))
    return found


def _moved_history(history: History, change: Mapping[str, Array], way: float) -> History:
    arrays = history.arrays()
    return history.replaced(
        {k: v + way * change[k] if k in change else v for k, v in arrays.items()}
    )


def _explicit(
    family: _Family, state: State, linearised: Linearised, history: dict[str, Array]
) -> tuple[Equations, _Sides]:
    """Return dR/dm + dR/dh dh/dm at the fixed state, and the problems beside it. Collective."""
    zero = np.zeros_like(linearised.problem.equilibrium.owned_part(state.x))
    still = _Direction(zero, np.zeros_like(linearised.problem.nodes.normal), history)
    sides = _beside(family, state, still)
    ahead, behind = (equations(*side, linearised.active) for side in sides)
    change = Equations(
        family.slope(ahead.forces, behind.forces),
        family.slope(ahead.conditions, behind.conditions),
    )
    return change, sides


def _tangent(
    path: _Path,
    quantities: Mapping[str, Quantity],
    families: Mapping[str, _Family],
    found: Sensitivities,
) -> None:
    """Carry the derivatives by each parameter forwards through the steps. Collective."""
    rows: dict[str, dict[str, list[float]]] = {
        name: {key: [] for key in families} for name in quantities
    }
    histories: dict[str, dict[str, Array]] = {key: {} for key in families}
    for index, (problem, state) in enumerate(path.steps):
        linearised = path.linearised(index)
        gradients = {
            name: given.gradient(problem, state)
            for name, given in quantities.items()
            if isinstance(given, Differentiable)
        }
        for key, family in families.items():
            change, still = _explicit(family, state, linearised, histories[key])
            x, forces = linearised.solve(change)
            sides = _beside(family, state, _Direction(x, forces, histories[key]))
            for name, quantity in quantities.items():
                # Where the gradient is known, the difference has nothing but the explicit part.
                ahead, behind = (
                    quantity(*side) for side in (still if name in gradients else sides)
                )
                value = (ahead - behind) / family.over
                if name in gradients:
                    by_x, by_force = gradients[name]
                    value += problem.equilibrium.product(by_x, x) + _total(
                        problem, by_force, forces
                    )
                rows[name][key].append(value)
            if index + 1 < len(path.steps):
                ends = [problem.commit(end).arrays() for problem, end in sides]
                histories[key] = {
                    part: family.slope(ends[0][part], ends[1][part]) for part in ends[0]
                }
    for name, columns in rows.items():
        found.steps[name] = {key: np.array(values) for key, values in columns.items()}
        found[name] = {key: values[-1] for key, values in columns.items()}


def _adjoint(
    path: _Path,
    quantities: Mapping[str, Quantity],
    families: Mapping[str, _Family],
    found: Sensitivities,
) -> None:
    """Carry the derivatives of each quantity backwards through the steps. Collective."""
    for name, quantity in quantities.items():
        assert isinstance(quantity, Differentiable)
        found[name] = dict.fromkeys(families, 0.0)
    backwards: dict[str, SlipHistory] = {}
    for index in reversed(range(len(path.steps))):
        problem, state = path.steps[index]
        linearised = path.linearised(index)
        last = index == len(path.steps) - 1
        adjoints = {}
        for name, quantity in quantities.items():
            assert isinstance(quantity, Differentiable)
            if last:
                by_x, by_force = quantity.gradient(problem, state)
            else:
                by_x = np.zeros_like(problem.equilibrium.owned_part(state.x))
                by_force = np.zeros_like(problem.nodes.normal)
            after, before = backwards.get(name), None
            if after is not None:
                by_jump, before = _slip_transposed(problem, state, after)
                problem.nodes.transpose(by_jump, by_x)
            x, c = linearised.solve_transposed(by_x, by_force)
            adjoints[name] = x, c, after
            found.by_gap[name] = found.by_gap.get(name, 0.0) + linearised.by_gap(x, c)
            backwards[name] = _history_transposed(linearised, c, before)
        for key, family in families.items():
            change, sides = _explicit(family, state, linearised, {})
            for name, (x, c, after) in adjoints.items():
                found[name][key] -= problem.equilibrium.product(x, change.forces)
                found[name][key] -= _total(problem, c, change.conditions)
                if after is None:
                    ahead, behind = (quantities[name](*side) for side in sides)
                    found[name][key] += (ahead - behind) / family.over
                    continue
                one, other = (_slip(here.commit(there)) for here, there in sides)
                moved = _total(problem, after.jump, one.jump - other.jump)
                moved += _total(problem, after.accumulated, one.accumulated - other.accumulated)
                found[name][key] += moved / family.over


def _slip(history: History) -> SlipHistory:
    part = history[SLIP]
    assert isinstance(part, SlipHistory)
    return part


def _total(problem: ContactProblem, one: Array, other: Array) -> float:
    """Return the inner product of values at the contact nodes of all ranks. Collective."""
    return float(problem.comm.allreduce(float(np.sum(one * other)), op=MPI.SUM))


def _slip_transposed(
    problem: ContactProblem, state: State, after: SlipHistory
) -> tuple[Array, SlipHistory]:
    """Return the derivatives by jump and history of a step from those by the history after it."""
    jump, nodal = problem.nodes, problem.nodal(state)
    slip = problem.interface.slip(nodal)
    length = np.linalg.norm(slip, axis=1)
    along = slip / np.maximum(length, np.finfo(float).tiny)[:, None]
    by_slip = after.accumulated[:, None] * along
    by_jump = np.zeros_like(nodal)
    by_jump[:, : jump.dim] = jump.tangential_component(after.jump) + by_slip
    return by_jump, SlipHistory(-by_slip, after.accumulated.copy())


def _history_transposed(
    linearised: Linearised, conditions: Array, before: SlipHistory | None
) -> SlipHistory:
    """Return the derivatives by the history at the beginning of a step, given the adjoint."""
    jump = np.einsum("nji,nj->ni", linearised.by_slip, conditions)
    accumulated = -np.einsum("ni,ni->n", linearised.by_length, conditions)
    if before is not None:
        jump, accumulated = jump + before.jump, accumulated + before.accumulated
    return SlipHistory(jump, accumulated)
