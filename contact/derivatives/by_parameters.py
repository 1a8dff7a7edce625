"""Derivatives of results by parameters, through contact and friction.

At a solution the consistent Newton matrix J gives them: with z the unknowns and contact forces, h
the history at the beginning of a step, and G(z, h; m) = 0 the equations of its active set,

    dz/dm = -J^-1 (dG/dm + dG/dh dh/dm)                              (tangent),
    dQ/dm = dQ/dm|_z - w . dG/dm,    J^T w = (dQ/dz)^T               (adjoint),

one back-substitution per parameter and step, or per quantity and step. The tangent is carried
forwards through the steps of an evolution with the history, the adjoint backwards. dG/dm is a
central difference of residuals at the fixed solution (semi-analytical sensitivities), so that any
number of a case may be the parameter, sizes of the mesh too. The free unknowns are fixed; tied
ones, and moments about the centre of a rigid part, are those of the other parameter.

The step of the difference is relative to the parameter, or chosen by the change of the equations at
the fixed solution: far above rounding, far below their size (Gill et al.). So the parameter may be
0, and needs no unit.

References
----------
Gill, Murray, Saunders and Wright, SIAM J. Sci. Stat. Comput. 4 (1983).
Haftka and Adelman, Recent developments in structural sensitivity analysis, Struct. Optim. 1 (1989).
Michaleris, Tortorelli and Vidal, Tangent operators and design sensitivity formulations for
transient non-linear coupled problems, Int. J. Numer. Methods Engrg. 37 (1994).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from mpi4py import MPI

from contact.arguments import expect
from contact.case.build import build_problem
from contact.case.file import Case, number_at, with_number
from contact.errors import InputError, counted
from contact.history import History
from contact.linear.operator import Counters
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.solution_jacobian import (
    Equations,
    SolutionJacobian,
    active_set,
    before_along,
    before_transposed,
    commit_along,
    commit_transposed,
    equations,
    moved_state,
    reference_norms,
    weakly_active,
)
from contact.problem.state import State
from contact.ranks import summed
from contact.results.functionals import Differentiable, Functional, Largest, Reaction
from contact.results.quantities import named_functionals
from contact.solution import Solution
from contact.tolerances import EPS
from contact.typing import Array

logger = logging.getLogger("contact.sensitivity")

#: Problems and states above and below a parameter.
_Sides = list[tuple[ContactProblem, State]]

#: Sections of a case without derivatives.
WITHOUT = "case", "solver", "output", "evolution"

#: Numbers of [friction] at whose 0 friction begins.
BEGIN = "mu", "bound", "radius"

#: Method of other equations.
PENALTY = "penalty"

#: Methods of `sensitivity`.
AUTO, TANGENT, ADJOINT = "auto", "tangent", "adjoint"

#: Relative step of difference quotients: truncation and rounding errors are about 1e-10.
STEP = 2e-6

#: Least and largest accepted change of the equations, and that of a new step.
LEAST, MOST, AIM = 1e-8, 1e-4, 3e-7

#: Change of a gap with a parameter, over the largest of all, that is told from rounding.
SEEN = 1e-3

#: Difference of the equations at a parameter's value from those of the solution, over their change
#: by a step, that is told from the curvature, and the least.
OTHER, SOME = 10.0, 1e-5

#: Most choices of a step, and largest factor.
TRIES, FACTOR = 6, 1e4


class Sensitivities(dict[str, dict[str, float]]):
    """Quantity -> parameter -> derivative, at the end of the last step.

    Attributes
    ----------
    steps
        Quantity -> parameter -> derivatives at the end of each step, shape (steps,); empty for the
        adjoint, which gives those of the last step alone.
    weakly_active
        Points of contact nodes at the border of two states in a step, shape (n, d). There results
        have a kink, and derivatives are those of the active set of the solution.
    counters
        Factorisations and back-substitutions that they took.
    method
        "tangent" or "adjoint".
    """

    def __init__(self, method: str, counters: Counters, weakly_active: Array) -> None:
        super().__init__()
        self.method, self.counters, self.weakly_active = method, counters, weakly_active
        self.steps: dict[str, dict[str, Array]] = {}


def sensitivity(
    solution: Solution,
    quantities: Sequence[str] | Mapping[str, Functional],
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
        ``reaction_x_PART``, ``driven_y``, ``rigid_x``, ``rigid_rotation``, ``rigid_force_x``,
        ``potential_PART``, ``charge_PART``, ``charge_foundation``, ``bolt_shortening_PART``; and
        ``energy``, ``dissipation`` and ``driven_force_x`` by the tangent. Or functions of problem
        and state, by name; the adjoint asks these for a `gradient`, as that of
        `contact.results.functionals.Integral`.
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
        the contact nodes, or the adjoint is asked for where a quantity has no gradient.

    Examples
    --------
    >>> found = sensitivity(solution, ["contact_force_x"], ["friction.mu"])  # doctest: +SKIP
    >>> found["contact_force_x"]["friction.mu"]  # doctest: +SKIP
    -0.00062189744
    """
    accepted = f"{AUTO!r}, {TANGENT!r} or {ADJOINT!r}"
    expect("method", method, accepted, method in (AUTO, TANGENT, ADJOINT))
    path = LoadPath(solution)
    functionals = quantities_of(solution, quantities)
    named = parameters_of(solution, parameters)
    families = {name: family_of(name, parameter, path.steps) for name, parameter in named}
    smooth = _with_gradients(functionals)
    blind = [name for name in functionals if name not in smooth]
    if method == ADJOINT and blind:
        raise InputError(
            f"method: given 'adjoint'; the quantity {blind[0]!r} has no gradient; accepted: "
            "'tangent'",
            "value",
        )
    adjoint = method == ADJOINT or (
        method == AUTO and len(functionals) < len(families) and not blind
    )
    sensitivities = Sensitivities(
        ADJOINT if adjoint else TANGENT, path.counters, path.weakly_active()
    )
    if adjoint:
        _adjoint(path, smooth, families, sensitivities)
    else:
        _tangent(path, functionals, families, sensitivities)
    if sensitivities.weakly_active.size:
        logger.warning(
            "%s between two states, the first at %s: results have a kink there, and derivatives "
            "may be those of neither side",
            counted(len(sensitivities.weakly_active), "contact node"),
            np.round(sensitivities.weakly_active[0], 6).tolist(),
        )
    return sensitivities


def quantities_of(
    solution: Solution, quantities: Sequence[str] | Mapping[str, Functional]
) -> Mapping[str, Functional]:
    """Return quantities by name. Collective."""
    if isinstance(quantities, Mapping):
        return quantities
    functionals = named_functionals(solution.problem)
    for name in quantities:
        accepted = ", ".join(functionals) + "; or a function of problem and state"
        expect("quantities", name, accepted, name in functionals)
    return {name: functionals[name] for name in quantities}


def parameters_of(
    solution: Solution, parameters: Sequence[str] | Mapping[str, Parameter]
) -> list[tuple[str, Parameter]]:
    """Return parameters with their names."""
    if isinstance(parameters, Mapping):
        return [*parameters.items()]
    case = solution.source
    if not isinstance(case, Case):
        raise InputError(
            "parameters: given keys of a case, for a problem that was built in Python; accepted: "
            "{name: Parameter(value, problem)}",
            "value",
        )
    domain, comm = solution.problem.domain, solution.problem.comm
    for key in parameters:
        sections, value = key.split("."), number_at(case, key)
        accepted = "a number of the mesh, materials, supports, loads, contact or rigid parts"
        expect("parameters", key, accepted, sections[0] not in WITHOUT)
        if sections[0] == "mesh" and case.adapt is not None:
            raise InputError(
                f"parameters: given {key!r}; accepted: a number of the mesh where that is not "
                "adapted",
                "adapted-mesh",
            )
        accepted = "a number above 0: friction begins at 0, and derivatives are one-sided there"
        begins = "friction" in sections[:-1] and sections[-1] in BEGIN
        expect(f"parameters: {key}", value, accepted, value != 0 or not begins)

    def build(key: str, value: float) -> ContactProblem:
        kept = None if key.split(".")[0] == "mesh" else domain
        return build_problem(with_number(case, key, value), comm, domain=kept)

    return [(key, Parameter(number_at(case, key), partial(build, key))) for key in parameters]


@dataclass(frozen=True)
class Parameter:
    """A parameter of a problem.

    Attributes
    ----------
    value
        Its value.
    problem
        The problem of another value, with the same mesh, spaces and contact nodes.
    """

    value: float
    problem: Callable[[float], ContactProblem]


@dataclass(frozen=True)
class Family:
    """Problems at the differences `ways` from a parameter's value.

    The difference quotient of values at the problems is sum factors * values / over.
    """

    problems: tuple[ContactProblem, ...]
    ways: tuple[float, ...]
    factors: tuple[float, ...]
    over: float

    def slope(self, values: Sequence[Array]) -> Array:
        """Return the difference quotient of the values at the problems."""
        total = sum(factor * value for factor, value in zip(self.factors, values, strict=True))
        return np.asarray(total / self.over, dtype=np.float64)


def family_of(
    name: str, parameter: Parameter, steps: Sequence[tuple[ContactProblem, State]]
) -> Family:
    """Return the problems beside a parameter, for the steps of a solution. Collective.

    InputError if no value beside it is accepted, contact nodes, mesh or internal variables change,
    or the problem at the value is not that of the solution.
    """
    base, step, family, fault = steps[0][0], STEP * (abs(parameter.value) or 1.0), None, None
    for _ in range(TRIES):
        try:
            trial = _difference(name, parameter, (step, -step), base)
        except InputError as error:
            fault = fault or error
            if family is not None:
                break
            step /= FACTOR
            continue
        if family is not None and len(trial.problems) > len(family.problems):
            break  # across a border
        family, change = trial, _change(trial, steps)
        # Steps in proportion to a number as small as 1e-12 are lost in rounding.
        if LEAST <= change <= MOST or (change == 0 and step >= STEP and parameter.value != 0):
            break
        step *= np.clip(AIM / change, 1 / FACTOR, FACTOR) if change > 0 else FACTOR
    if family is None:
        assert fault is not None
        raise fault
    _check_value(name, parameter, family, steps[-1])
    closing = _closing(base, family)
    if not closing:
        return family
    apart = [way for way in family.ways if way not in closing]
    if not apart:
        raise InputError(
            f"{name}: bodies touch, and overlap beside {parameter.value:g}; accepted: bodies that "
            "are apart, or a given gap",
            "border",
        )
    return _difference(name, parameter, apart, base)


def _difference(
    name: str, parameter: Parameter, ways: Sequence[float], base: ContactProblem
) -> Family:
    """Return a central difference, or a one-sided one at a border. Collective."""
    problems, faults = dict[float, ContactProblem](), list[InputError]()
    for way in ways:
        try:
            problems[way] = parameter.problem(parameter.value + way)
        except InputError as error:
            faults.append(error)
    if not problems:
        raise faults[0]
    factors: tuple[float, ...] = 1.0, -1.0
    over = ways[0] - ways[-1]
    if len(problems) == 1:
        # One-sided, of second order.
        (way,) = problems
        factors, over = (4.0, -3.0, -1.0), 2 * way
        for other in (0.0, 2 * way):
            problems[other] = parameter.problem(parameter.value + other)
    for problem in problems.values():
        same = np.array_equal(base.nodes.nodes, problem.nodes.nodes)
        same = same and base.body.zero_displacement().size == problem.body.zero_displacement().size
        same = same and base.initial.arrays().keys() == problem.initial.arrays().keys()
        if not base.comm.allreduce(same, op=MPI.LAND):
            raise InputError(
                f"{name}: {parameter.value:g} is a border at which the contact nodes, the mesh or "
                "the variables of the material change; accepted: a parameter that leaves them",
                "border",
            )
    return Family((*problems.values(),), (*problems,), factors, over)


def _closing(base: ContactProblem, family: Family) -> list[float]:
    """Return the ways of a central difference along which touching bodies overlap. Collective."""
    # Overlaps of rounding are gaps of 0, which do not change with the parameter.
    if len(family.problems) > 2:
        return []
    facing = np.isfinite(base.nodes.gap)
    rises = [np.abs(problem.nodes.gap - base.nodes.gap)[facing] for problem in family.problems]
    most = np.maximum(*rises)
    least = SEEN * base.comm.allreduce(float(most.max(initial=0.0)), op=MPI.MAX)
    least = max(least, EPS * base.domain.size)
    return [
        way
        for way, rise in zip(family.ways, rises, strict=True)
        if base.comm.allreduce(bool(np.any((most > least) & (rise < most / 2))), op=MPI.LOR)
    ]


def _check_value(
    name: str, parameter: Parameter, family: Family, last: tuple[ContactProblem, State]
) -> None:
    """Refuse a parameter whose problem at its value is not that of the solution. Collective."""
    beside, change = family.problems[0], _apart(family.problems[0], family.problems[-1], last)
    if _apart(beside, last[0], last) > OTHER * max(change, SOME):
        raise InputError(
            f"{name}: the problem at {parameter.value:g} is not that of the solution; accepted: "
            "the value of the solution, and a function that returns its problem there",
            "value",
        )


def _apart(one: ContactProblem, other: ContactProblem, step: tuple[ContactProblem, State]) -> float:
    """Return the relative change of the equations between problems at a step. Collective."""
    base, state = step
    active, norms = active_set(base, state), reference_norms(base, state)
    here, there = (equations(*at(problem, state), active) for problem in (one, other))
    forces = base.body.norm(here.forces - there.forces) / norms[0]
    return max(forces, base.nodes.norm(here.conditions - there.conditions) / norms[1])


def _change(family: Family, steps: Sequence[tuple[ContactProblem, State]]) -> float:
    """Return the largest relative change of the equations of all steps. Collective."""
    largest = 0.0
    for step in reversed(steps):
        largest = max(largest, _apart(family.problems[0], family.problems[-1], step))
        if largest >= LEAST:  # large enough: no earlier steps
            break
    return largest


def at(problem: ContactProblem, state: State) -> tuple[ContactProblem, State]:
    """Return step and state of another problem, with its prescribed values. Collective."""
    step_problem = problem.at(state.time, state.history)
    return step_problem, replace(state, x=step_problem.body.prescribe(state.x, state.time))


class LoadPath:
    """The load steps of a solution.

    InputError if it has not converged, or its equations have no derivatives here.
    """

    def __init__(self, solution: Solution) -> None:
        expect("solution", solution, "a Solution", isinstance(solution, Solution))
        if not solution.converged:
            reason = solution.outcome.reason
            raise InputError(
                f"solution: {reason}; accepted: one that has converged", "no-derivative"
            )
        if solution.method == PENALTY:
            raise InputError(
                "solution: a penalty lets the body penetrate, and derivatives are those of contact "
                "without; accepted: method 'newton' or 'uzawa'",
                "penalised",
            )
        base = solution.problem
        body = base.body
        if not body.symmetric and body.global_unknowns.free.any():
            raise InputError(
                "sensitivity: the stiffness of the material is not symmetric, and a foundation or "
                "part moves freely; accepted: kinematic hardening without recovery, or prescribed "
                "motions",
                "no-derivative",
            )
        states = [record.state for record in solution.steps] or [solution.state]
        self.steps = [(base.at(state.time, state.history), state) for state in states]
        self.base, self.counters = base, Counters()
        gamma = NewtonOptions().gamma
        self._parameters = base.scales.complementarity_parameters(gamma)

    def jacobian(self, index: int) -> SolutionJacobian:
        """Return the linearised equations at the end of a step. Collective."""
        return SolutionJacobian(*self.steps[index], self._parameters, self.counters)

    def weakly_active(self) -> Array:
        """Return the points of weakly active nodes of all steps. Collective."""
        return np.unique(np.concatenate([weakly_active(*step) for step in self.steps]), axis=0)


def _with_gradients(quantities: Mapping[str, Functional]) -> dict[str, Differentiable]:
    """Return the quantities with a gradient."""
    return {name: it for name, it in quantities.items() if isinstance(it, Differentiable)}


def _moved(family: Family, state: State, x: Array, forces: Array, change: History) -> _Sides:
    """Return the problems and states beside a parameter, with dz/dm and dh/dm. Collective."""
    sides = []
    for way, problem in zip(family.ways, family.problems, strict=True):
        moved = moved_state(problem, state, way * x, way * forces)
        sides.append(at(problem, replace(moved, history=_sum(state.history, way, change))))
    return sides


def _sum(history: History, factor: float, change: History) -> History:
    """Return h + factor dh."""
    more = change.arrays()
    return history.replaced({k: v + factor * more[k] for k, v in history.arrays().items()})


def _explicit(family: Family, state: State, jacobian: SolutionJacobian) -> tuple[Equations, _Sides]:
    """Return dG/dm at fixed z and h, and the problems and states of the difference. Collective."""
    sides = [at(problem, state) for problem in family.problems]
    by_side = [equations(*side, jacobian.active) for side in sides]
    change = Equations(
        family.slope([one.forces for one in by_side]),
        family.slope([one.conditions for one in by_side]),
    )
    return change, sides


def _explicit_history(family: Family, sides: _Sides) -> History:
    """Return dH/dm at fixed z and h. Collective."""
    histories = [problem.commit(state) for problem, state in sides]
    arrays = [one.arrays() for one in histories]
    return histories[0].replaced({k: family.slope([one[k] for one in arrays]) for k in arrays[0]})


def _slope_of(family: Family, quantity: Functional, sides: _Sides) -> float:
    """Return dQ/dm by a difference quotient. Collective."""
    return float(family.slope([np.asarray(quantity(*side)) for side in sides]))


def _located(quantity: Functional, problem: ContactProblem, state: State) -> Functional:
    """Return a largest value at its node: other nodes may be as large."""
    return quantity.located(problem, state) if isinstance(quantity, Largest) else quantity


def _tangent(
    path: LoadPath,
    quantities: Mapping[str, Functional],
    families: Mapping[str, Family],
    sensitivities: Sensitivities,
) -> None:
    """Carry the tangent of each parameter forwards through the steps. Collective."""
    rows: dict[str, dict[str, list[float]]] = {
        name: {key: [] for key in families} for name in quantities
    }
    first = path.steps[0][0].history
    histories = dict.fromkeys(families, _sum(first, -1.0, first))
    for index, (problem, state) in enumerate(path.steps):
        jacobian, body = path.jacobian(index), problem.body
        gradients = {
            name: quantity.gradient(problem, state)
            for name, quantity in _with_gradients(quantities).items()
        }
        for key, family in families.items():
            change, still = _explicit(family, state, jacobian)
            by_history = before_along(jacobian, histories[key])
            x, forces = jacobian.solve(change + by_history)
            for name, quantity in quantities.items():
                if name not in gradients:
                    moved = _moved(family, state, x, forces, histories[key])
                    rows[name][key].append(_slope_of(family, quantity, moved))
                    continue
                by_x, by_force = gradients[name]
                value = _slope_of(family, _located(quantity, problem, state), still)
                value += body.product(by_x, x)
                value += _total(problem, by_force, forces)
                if isinstance(quantity, Reaction):
                    value += body.product(quantity.weights(problem), by_history.forces)
                rows[name][key].append(value)
            if index + 1 < len(path.steps):
                ends = commit_along(jacobian, x, histories[key])
                histories[key] = _sum(ends, 1.0, _explicit_history(family, still))
    for name, columns in rows.items():
        sensitivities.steps[name] = {key: np.array(values) for key, values in columns.items()}
        sensitivities[name] = {key: values[-1] for key, values in columns.items()}


@dataclass(frozen=True)
class Adjoint:
    """The adjoint w of a step and quantity, as of `SolutionJacobian.solve_transposed`."""

    x: Array
    conditions: Array
    #: Derivatives by the internal forces: -x, plus the weights of a reaction, a sum of such forces.
    along: Array
    #: Derivatives by the history at the end of the step; None for the last step.
    after: History | None


def backwards(
    path: LoadPath, quantities: Mapping[str, Differentiable]
) -> Iterator[tuple[SolutionJacobian, dict[str, Adjoint]]]:
    """Yield equations and adjoints of the steps, from the last to the first. Collective."""
    after: dict[str, History | None] = dict.fromkeys(quantities)
    for index in reversed(range(len(path.steps))):
        problem, state = path.steps[index]
        jacobian, adjoints = path.jacobian(index), {}
        for name, quantity in quantities.items():
            end = after[name]
            if end is None:
                by_x, by_force = quantity.gradient(problem, state)
            else:
                by_x = commit_transposed(problem, state, end)
                by_force = np.zeros_like(problem.nodes.normal)
            x, conditions = jacobian.solve_transposed(by_x, by_force)
            weights = (
                quantity.weights(problem) if isinstance(quantity, Reaction) and not end else 0.0
            )
            adjoints[name] = Adjoint(x, conditions, weights - x, end)
        yield jacobian, adjoints
        if index > 0:
            after = {
                name: before_transposed(jacobian, one.along, one.conditions, one.after)
                for name, one in adjoints.items()
            }


def _adjoint(
    path: LoadPath,
    quantities: Mapping[str, Differentiable],
    families: Mapping[str, Family],
    sensitivities: Sensitivities,
) -> None:
    """Carry the adjoint of each quantity backwards through the steps. Collective."""
    for name in quantities:
        sensitivities[name] = dict.fromkeys(families, 0.0)
    for jacobian, adjoints in backwards(path, quantities):
        problem, state = jacobian.problem, jacobian.state
        for key, family in families.items():
            change, sides = _explicit(family, state, jacobian)
            for name, one in adjoints.items():
                sensitivities[name][key] -= problem.body.product(one.x, change.forces)
                sensitivities[name][key] -= _total(problem, one.conditions, change.conditions)
                if one.after is None:
                    quantity = _located(quantities[name], problem, state)
                    sensitivities[name][key] += _slope_of(family, quantity, sides)
                    continue
                ends = _explicit_history(family, sides).arrays()
                for part, weights in one.after.arrays().items():
                    sensitivities[name][key] += _total(problem, weights, ends[part])


def _total(problem: ContactProblem, one: Array, other: Array) -> float:
    """Return the inner product of values of all ranks. Collective."""
    return float(summed(problem.comm, np.sum(one * other)))
