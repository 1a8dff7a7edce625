"""Evolutions in Python: the states of a problem in time, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from contact.errors import InputError
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor
from contact.methods.steps import Evolution
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.solving import METHODS


class NotConvergedError(RuntimeError):
    """A step of an evolution has not converged, however short."""


def evolve(
    problem: ContactProblem,
    times: Sequence[float],
    settings: Options | None = None,
    monitor: Monitor | None = None,
    start: State | None = None,
) -> Iterator[State]:
    """Load a problem in steps, and give the state at the end of each. Collective.

    Friction acts on what slips in a step. Loads and prescribed values are multiplied by their
    amplitudes; those without one grow with time, from nothing at time 0 to all at time 1.

    Parameters
    ----------
    problem
        The problem; how it stands at a state, `problem.at(state.time, state.history)` says.
    times
        Ends of the steps, increasing. A step that fails is halved, so that states in between
        may be given too.
    settings
        Method and tolerances; Newton's by default.
    monitor
        Told of every outer iteration.
    start
        A state that was given before, to go on from; from rest at time 0 by default.

    Raises
    ------
    InputError
        If times do not increase, or a linear system is singular.
    NotConvergedError
        If a step fails; the states before have been given.
    """
    begin = 0.0 if start is None else start.time
    ends = [float(time) for time in times]
    if not np.all(np.isfinite(ends)) or np.any(np.diff([begin, *ends]) <= 0):
        raise InputError(
            f"times: given {', '.join(f'{time:g}' for time in ends)}; accepted: numbers that "
            f"increase, the first above {begin:g}"
        )
    settings = in_steps(settings or NewtonOptions())
    method = METHODS[settings.method](problem, settings, monitor)
    for step in Evolution(problem, method, start).run(ends, begin):
        if not step.outcome.converged:
            raise NotConvergedError(
                f"no step to {step.problem.time:g}: {step.outcome.reason}; what was given before "
                "remains"
            )
        yield step.state


def in_steps(settings: Options) -> Options:
    """Return the options of a method whose steps are halved where they fail."""
    if isinstance(settings, NewtonOptions):
        return replace(settings, load_steps=False)
    return settings
