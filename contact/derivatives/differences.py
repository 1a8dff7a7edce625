"""The problems beside a parameter, and the difference quotients of values at them.

The step of a quotient is relative to the parameter, unless that says nothing of the problem: at 0,
near it, or far from it. Then it is chosen by its effect: the equations at the fixed solution change
by far more than rounding and far less than themselves (Gill, Murray, Saunders and Wright, SIAM J.
Sci. Stat. Comput. 4 (1983)). That asks for no unit, so that any number of a case may be one.
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

#: Relative change of parameters in difference quotients: their error, largest with plastic flow,
#: and that of rounding are some 1e-10 then.
STEP = 2e-6

#: Relative changes of the equations between which a step remains as it is, and the one that another
#: step is to make.
LEAST, MOST, AIM = 1e-8, 1e-4, 3e-7

#: How often a step is chosen anew, and by how much at once at most.
TRIES, FACTOR = 6, 1e4


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


@dataclass(frozen=True)
class Family:
    """Problems at numbers beside a parameter, and the difference quotient of values at them.

    Attributes
    ----------
    problems, ways
        The problems, and how far away their numbers are.
    factors, over
        The quotient is the sum of the values times the factors, over this.
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
    """Return the problems beside that of a parameter. Collective.

    Parameters
    ----------
    name, parameter
        The parameter, and its name for messages.
    steps
        Problems and states at the end of each step of a solution.

    Raises
    ------
    InputError
        If no number beside its own is accepted, or contact nodes, mesh or the variables of the
        material change with it.
    """
    step, found, fault = STEP * (abs(parameter.value) or 1.0), None, None
    for _ in range(TRIES):
        try:
            made = _made(name, parameter, step, steps[0][0])
        except InputError as error:
            fault = fault or error
            if found is not None:
                break
            step /= FACTOR  # it may have gone too far
            continue
        if found is not None and len(made.problems) > len(found.problems):
            break  # beyond a border
        found, change = made, _change(made, steps)
        if LEAST <= change <= MOST or (change == 0 and parameter.value != 0):
            break
        step *= np.clip(AIM / change, 1 / FACTOR, FACTOR) if change > 0 else FACTOR
    if found is None:
        assert fault is not None
        raise fault
    return found


def _made(name: str, parameter: Parameter, step: float, base: ContactProblem) -> Family:
    """Return the problems of a central difference; at a border, of a one-sided one. Collective."""
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
        # Of second order too.
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
    """Return how far the equations at the ends change, relative to their norms. Collective.

    The largest of all steps; those before one where it is enough are not asked.
    """
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
        if found >= LEAST:
            break
    return found


def at(problem: ContactProblem, state: State) -> tuple[ContactProblem, State]:
    """Return the step of a state of another problem, with the values prescribed there. Collective.

    Unknowns that follow a rigid part or an electrode do so as that problem has it.
    """
    here = problem.at(state.time, state.history)
    return here, replace(state, x=here.equilibrium.prescribe(state.x, state.time))
