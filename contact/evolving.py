"""Evolutions: the states of a problem in time, one after the other."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from numbers import Real

import numpy as np

from contact.errors import InputError
from contact.kinds import expect
from contact.methods.every import METHODS
from contact.methods.interrupt import stop_on_signal
from contact.methods.method import Method
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import History, Monitor, Outcome, tell
from contact.methods.steps import Evolution, LoadStep
from contact.output.record import StepRecord
from contact.output.review import announce
from contact.output.solution import Solution
from contact.output.steps import StepRecorder
from contact.problem.consistent import check_problem, check_supports
from contact.problem.held import check_potential
from contact.problem.kkt import evaluate
from contact.problem.problem import ContactProblem
from contact.problem.state import State

logger = logging.getLogger("contact.steps")


class NotConvergedError(RuntimeError):
    """A step of an evolution has not converged, however short."""


def evolve(
    problem: ContactProblem,
    times: Sequence[float],
    settings: Options | None = None,
    monitor: Monitor | None = None,
    start: State | Solution | None = None,
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
        If times do not increase, loads and supports contradict each other or leave the body
        free, or a linear system is singular.
    NotConvergedError
        If a step fails; the states before have been given.
    """
    check_options(settings, monitor)
    if isinstance(start, Solution):
        start = start.state
    expect("start", start, "an earlier state, or solution", isinstance(start, State | None))
    expect("evolve", problem, "a Problem", isinstance(problem, ContactProblem))
    begin = 0.0 if start is None else start.time
    ends = check_times(problem, times, begin)
    settings = settings or NewtonOptions()
    method = METHODS[settings.method](problem, settings, monitor)
    for step in Evolution(problem, method, start).run(ends, begin):
        if not step.outcome.converged:
            raise NotConvergedError(
                f"no step to {step.problem.time:g}: {step.outcome.reason}; what was given before "
                "remains"
            )
        yield step.state


def check_times(problem: ContactProblem, times: Sequence[float], begin: float) -> list[float]:
    """Return the ends of steps, and refuse what is none, or loads that contradict each other there.

    Collective.

    Raises
    ------
    InputError
        As of `evolve`.
    """
    given = [*times] if isinstance(times, Iterable) and not isinstance(times, str) else []
    numbers = len(given) > 0 and all(isinstance(time, Real) for time in given)
    expect("times", times, "a list of times, the ends of the steps", numbers)
    ends = [float(time) for time in given]
    if not np.all(np.isfinite(ends)) or np.any(np.diff([begin, *ends]) <= 0):
        raise InputError(
            f"times: given {', '.join(f'{time:g}' for time in ends)}; accepted: numbers that "
            f"increase, the first above {begin:g}"
        )
    for end in ends:
        check_supports(problem.at(end))
    for end in ends[-1:]:
        check_problem(problem.at(end))
    return ends


def check_options(settings: Options | None, monitor: Monitor | None) -> None:
    """Refuse what are no options of a method, or no function.

    Raises
    ------
    InputError
        If they are not.
    """
    accepted = "NewtonOptions(), FixedPointOptions(), PenaltyOptions()"
    expect("settings", settings, accepted, isinstance(settings, Options | None))
    accepted = "a function of a record, called after each outer iteration"
    expect("monitor", monitor, accepted, monitor is None or callable(monitor))


def solve_steps(
    problem: ContactProblem,
    times: Sequence[float],
    settings: Options,
    monitor: Monitor | None = None,
    begin: float = 0.0,
    keep: Callable[[StepRecord], None] | None = None,
    kept: Sequence[StepRecord] = (),
) -> Solution:
    """Solve a problem in steps, and keep what there is to say of each. Collective.

    An interrupt ends it after the running iteration: all complete steps remain, as where a step
    fails.

    Parameters
    ----------
    problem, times, settings, monitor
        As those of `evolve`.
    begin
        Time at rest.
    keep
        Told of every step.
    kept
        The records of an earlier run's steps, to go on from.

    Returns
    -------
    The last step that has converged, with the outcome of the one that has ended it all.

    Raises
    ------
    InputError
        If a linear system is singular, or the potential is not determined.
    """
    clock = time.perf_counter()
    history, records = History(), list(kept)
    with stop_on_signal(problem.comm, monitor) as stop:
        method = METHODS[settings.method](problem, settings, stop)
        setup = time.perf_counter() - clock
        recorder = StepRecorder(problem, records[-1] if records else None)
        states = [record.state for record in records[-1:-3:-1]]
        step: LoadStep | None = None
        tell(logger, 0.0, "steps to t = %g", times[-1])
        for step in Evolution(problem, method, *states).run(times, begin):
            note = f"t = {step.problem.time:g}"
            history.records += [
                replace(record, note=f"{note} {record.note}".strip())
                for record in step.history.records
            ]
            if not step.outcome.converged:
                break
            records.append(recorder.record(step))
            if keep is not None:
                keep(records[-1])
            tell(
                logger,
                (step.problem.time - begin) / (times[-1] - begin),
                "%s of %g: iterations %d, residual %.1e",
                *(note, times[-1], len(step.history.records), step.outcome.kkt.largest),
            )
    here, state = _end(problem, records, step)
    check_potential(here, state)
    solution = Solution(
        problem=here,
        state=state,
        outcome=_outcome(here, state, step, method, times[-1]),
        history=history,
        counters=method.counters,
        method=settings.method,
        start="the step before" if records else "rest",
        seconds={"setup": setup, "solve": time.perf_counter() - clock - setup, "output": 0.0},
        steps=records,
    )
    if records and records[-1].unloaded > 0:
        solution.warnings.append(
            f"{records[-1].unloaded:.1%} of the body unload from beyond the yield strain in a "
            "step: Hencky's law is nonlinear elasticity, and they come back the way they went; a "
            "metal would keep a part of its strain"
        )
    announce(solution)
    return solution


def _end(
    problem: ContactProblem, records: Sequence[StepRecord], step: LoadStep | None
) -> tuple[ContactProblem, State]:
    """Return the last step that is complete; what the first one has come to, if none is."""
    if not records:
        assert step is not None  # there is one step at least
        return step.problem, step.state
    state = records[-1].state
    return problem.at(state.time, state.history), state


def _outcome(
    problem: ContactProblem, state: State, step: LoadStep | None, method: Method, end: float
) -> Outcome:
    """Say how an evolution ended: with its last step, or where that has failed. Collective."""
    if step is None:  # all were there already
        return Outcome(evaluate(problem, state), method.options.allowed)
    if step.outcome.converged:
        return step.outcome
    reached = problem.time if state is not step.state else 0.0
    words = f"the steps end at t = {reached:g} of {end:g}"
    ended = f"{words}: {step.outcome.ended or f'the one to {step.problem.time:g} fails'}"
    return replace(step.outcome, ended=ended)
