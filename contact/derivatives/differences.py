"""Central differences by a parameter: the problems beside it, and the step.

The step is relative to the parameter, or chosen by the change of the equations at the fixed
solution: far above rounding, far below their size (Gill, Murray, Saunders and Wright, SIAM J. Sci.
Stat. Comput. 4 (1983)). So the parameter may be 0, and needs no unit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from contact.errors import InputError
from contact.problem.linearised import active_set, equations, reference_norms
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Relative step of difference quotients: truncation and rounding errors are about 1e-10.
STEP = 2e-6

#: Least and largest accepted change of the equations, and that of a new step.
LEAST, MOST, AIM = 1e-8, 1e-4, 3e-7

#: Most choices of a step, and largest factor.
TRIES, FACTOR = 6, 1e4


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
    """Problems beside a parameter; the difference quotient is sum factors * values / over.

    Attributes
    ----------
    problems, ways
        The problems, and the differences of their parameter.
    factors, over
        Coefficients of the quotient.
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
    """Return the problems beside a parameter. Collective.

    Parameters
    ----------
    name, parameter
        The parameter and its name.
    steps
        Problem and state of each step of a solution.

    Raises
    ------
    InputError
        If no value beside it is accepted, or contact nodes, mesh or internal variables change.
    """
    step, found, fault = STEP * (abs(parameter.value) or 1.0), None, None
    for _ in range(TRIES):
        try:
            made = _made(name, parameter, step, steps[0][0])
        except InputError as error:
            fault = fault or error
            if found is not None:
                break
            step /= FACTOR
            continue
        if found is not None and len(made.problems) > len(found.problems):
            break  # across a border
        found, change = made, _change(made, steps)
        if LEAST <= change <= MOST or (change == 0 and parameter.value != 0):
            break
        step *= np.clip(AIM / change, 1 / FACTOR, FACTOR) if change > 0 else FACTOR
    if found is None:
        assert fault is not None
        raise fault
    return found


def _made(name: str, parameter: Parameter, step: float, base: ContactProblem) -> Family:
    """Return a central difference, or a one-sided one at a border. Collective."""
    problems, faults = dict[float, ContactProblem](), list[InputError]()
    for way in (step, -step):
        try:
            problems[way] = parameter.problem(parameter.value + way)
        except InputError as error:
            faults.append(error)
    if not problems:
        raise faults[0]
    factors: tuple[float, ...] = 1.0, -1.0
    over = 2 * step
    if len(problems) == 1:
        # One-sided, of second order.
        (way,) = problems
        factors, over = (4.0, -3.0, -1.0), 2 * way
        for other in (0.0, 2 * way):
            problems[other] = parameter.problem(parameter.value + other)
    for problem in problems.values():
        same = np.array_equal(base.nodes.nodes, problem.nodes.nodes)
        same = same and base.equilibrium.rest().size == problem.equilibrium.rest().size
        same = same and base.initial.arrays().keys() == problem.initial.arrays().keys()
        if not base.comm.allreduce(same, op=MPI.LAND):
            raise InputError(
                f"{name}: {parameter.value:g} is a border at which the contact nodes, the mesh or "
                "the variables of the material change; accepted: a parameter that leaves them",
                "border",
            )
    return Family((*problems.values(),), (*problems,), factors, over)


def _change(family: Family, steps: Sequence[tuple[ContactProblem, State]]) -> float:
    """Return the largest relative change of the equations of all steps. Collective."""
    found = 0.0
    for base, state in reversed(steps):
        active, norms = active_set(base, state), reference_norms(base, state)
        one, other = (
            equations(*at(problem, state), active)
            for problem in (family.problems[0], family.problems[-1])
        )
        forces = base.equilibrium.norm(one.forces - other.forces) / norms[0]
        conditions = base.nodes.norm(one.conditions - other.conditions) / norms[1]
        found = max(found, forces, conditions)
        if found >= LEAST:  # large enough: no earlier steps
            break
    return found


def at(problem: ContactProblem, state: State) -> tuple[ContactProblem, State]:
    """Return step and state of another problem, with its prescribed values. Collective."""
    here = problem.at(state.time, state.history)
    return here, replace(state, x=here.equilibrium.prescribe(state.x, state.time))
