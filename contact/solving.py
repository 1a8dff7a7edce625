"""Solve a case or a problem: one step, or one load step after the other.

A static solve is an evolution of one step: both are `run_schedule`.
"""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from pathlib import Path
from typing import Unpack

import numpy as np
from mpi4py import MPI

from contact._compat import destroy_unused
from contact.adapting import adapted
from contact.arguments import expect
from contact.case.build import (
    REPLACEMENTS,
    Replacements,
    build_problem,
    named,
    replaced_by,
)
from contact.case.file import Case, load_case
from contact.case.text import to_toml
from contact.errors import InputError
from contact.io.checkpoint import Checkpoints, check_restart, read_steps
from contact.methods.load_stepping import LoadStepping, solve_step
from contact.methods.method import METHODS, Method
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor, Outcome, Record, tell
from contact.methods.signals import SIGNALLED, stop_on_signal
from contact.nesting import default_start, nested_start
from contact.problem.checks import check_potential, check_problem, check_supports
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.ranks import on_root
from contact.results.fields import check_variables
from contact.results.remarks import announce
from contact.results.solution import Solution, StepRecord, StepRecorder
from contact.results.uniqueness import uniqueness
from contact.typing import Array

logger = logging.getLogger("contact.steps")

#: Names of initial guesses, for messages about the solution.
ZERO, GIVEN = "the zero initial guess", "the state that was given"
BEFORE, COARSE = "the step before", "the solution on a coarser mesh"


class SolveInterrupted(SystemExit):
    """A SIGINT (Ctrl-C) or SIGTERM has ended a solve, on all ranks after the same iteration.

    A program that does not catch it ends with the status 130 (SIGINT) or 143 (SIGTERM). After
    Ctrl-C it is a KeyboardInterrupt too.

    Parameters
    ----------
    solution
        The last iterate; `solution.outcome.signal` is the number of the signal.
    """

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.outcome.reason)
        self.solution = solution
        self.code = SIGNALLED + solution.outcome.signal


class _Pressed(SolveInterrupted, KeyboardInterrupt):
    """Ctrl-C."""


class NotConvergedError(RuntimeError):
    """A load step has not converged, even after it was halved."""


@dataclass(frozen=True)
class Schedule:
    """The load steps of a run.

    Attributes
    ----------
    times
        Their ends; none for a single step to the problem's own time.
    begin
        Time of the reference configuration.
    start
        Initial guess of a single step; None for zero.
    guess
        Name of that guess, for messages.
    kept
        Records of the steps of an earlier run, to continue from.
    keep
        Called with the record of each step that has converged.
    """

    times: Sequence[float] = ()
    begin: float = 0.0
    start: State | None = None
    guess: str = GIVEN
    kept: Sequence[StepRecord] = ()
    keep: Callable[[StepRecord], None] | None = None


def solve(
    case: Case | ContactProblem | str | Path,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    folder: str | Path | None = None,
    restart: str | Path | None = None,
    start: State | Solution | None = None,
    times: Sequence[float] | Array | None = None,
    **replacements: Unpack[Replacements],
) -> Solution:
    """Build and solve a case, in load steps where it has them. Collective.

    Parameters
    ----------
    case
        A case, the name of a case file, or a problem.
    settings
        Method and tolerances; those of the case by default.
    monitor
        Called after every outer iteration.
    comm
        Communicator of the mesh.
    folder
        Folder for the checkpoints of an evolution's steps, until its results are written.
    restart
        A folder with checkpoints of the same case, to continue from.
    start
        An earlier solution on the same mesh, or its state, as initial guess; zero by default.
    times
        For a problem: the ends of load steps, as in `evolve`. The solution's `steps` have the
        results of each.
    replacements
        Objects that take the place of parts of the case: `domain`, `law`, `coefficient`,
        `friction`, `foundation`, `layer`; see `build_problem`.

    Returns
    -------
    The solution, whether it has converged or not; of several steps that of the last one, with all
    in its `steps`.

    Raises
    ------
    InputError
        If the case does not fit its mesh, a rigid-body mode is not constrained, the potential is
        not determined, a linear system is singular, or an argument is none of these or would be
        ignored.
    SolveInterrupted
        After a SIGINT or SIGTERM, with the last iterate; a second signal ends the program.
    """
    clock = time.perf_counter()
    _check_options(settings, monitor)
    start = start.state if isinstance(start, Solution) else start
    fits = isinstance(start, State | None)
    expect("start", start, "an earlier solution of the same problem, or its state", fits)
    fits = isinstance(case, Case | ContactProblem | str | Path)
    expect("solve", case, "a case, the name of a case file, or a Problem", fits)
    folder, restart = (None if given is None else Path(given) for given in (folder, restart))
    for name in replacements.keys() - set(REPLACEMENTS):
        accepted = f"{', '.join(REPLACEMENTS)}; a method and its tolerances as settings"
        raise InputError(f"{name}: unknown; accepted: {accepted}", "no-such-name")
    nested = settings.nested if isinstance(settings, NewtonOptions) else None
    if isinstance(case, ContactProblem):
        given = {"folder": folder, "restart": restart, "nested": nested or None, **replacements}
        _refuse(given, "a problem that is built already")
        if times is None:
            check_problem(case)
            schedule = Schedule(start=start)
        else:
            _refuse({"start": start}, "times; evolve(problem, times, start=state) goes on")
            schedule = Schedule(_checked_times(case, times, 0.0))
        return _uninterrupted(run_schedule(case, settings or NewtonOptions(), monitor, schedule))
    _refuse({"times": times}, "a case, whose [evolution] says them")
    case = case if isinstance(case, Case) else load_case(case, without=replaced_by(replacements))
    settings = settings or case.solver
    nested = settings.nested if isinstance(settings, NewtonOptions) else False
    if case.evolution is None:
        _refuse({"restart": restart}, "a case without [evolution]")
        if nested:
            _refuse({"start": start}, "nested = true, which makes an initial guess of its own")
    else:
        _refuse({"start": start}, "[evolution]; evolve(problem, times, start=state) goes on")
        _refuse({"nested": nested or None}, "[evolution]")
    if restart is not None:
        on_root(comm, lambda: check_restart(restart, case))
    adapt = case.mesh.adapt is not None
    if adapt:
        _refuse({"restart": restart, "start": start, "nested": nested or None}, "[mesh.adapt]")
        _refuse(replacements, "[mesh.adapt]")
    evolution = case.evolution
    ends, begin = ((), 0.0) if evolution is None else (evolution.ends, evolution.times[0])

    def run(
        problem: ContactProblem,
        start: State | None = None,
        reviewed: bool = True,
        guess: str = GIVEN,
        kept: Sequence[StepRecord] = (),
        keep: Callable[[StepRecord], None] | None = None,
    ) -> Solution:
        planned = Schedule(ends, begin, start, guess, kept, keep)
        return run_schedule(problem, settings, monitor, planned, reviewed)

    problem = None if adapt else build_problem(case, comm, **replacements)
    with named(case.source):
        if problem is None:
            solution = adapted(case, comm, partial(run, guess=COARSE, reviewed=False))
            announce(solution)
        elif evolution is not None:
            kept = [] if restart is None else read_steps(restart, problem)
            keep = None
            if folder is not None:
                here = restart is not None and restart.samefile(folder)
                keep = Checkpoints(folder, problem, case, kept, here).keep
            solution = run(problem, kept=kept, keep=keep)
        else:
            guess, chosen = GIVEN, case.model_copy(update={"solver": settings})
            if nested:
                start, guess = nested_start(chosen, problem, **replacements), COARSE
            elif nested is None and start is None and not replacements:
                start, guess = default_start(chosen, problem), COARSE
            solution = run(problem, start, guess=guess)
    solution.title, solution.output, solution.units = case.title, case.output, case.case.units
    if not replacements:
        solution.case, solution.source = to_toml(case), case
    solution.seconds["setup"] += time.perf_counter() - clock - sum(solution.seconds.values())
    return _uninterrupted(solution)


def evolve(
    problem: ContactProblem,
    times: Sequence[float] | Array,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    start: State | Solution | None = None,
    before: State | None = None,
) -> Iterator[State]:
    """Load a problem in steps, and give the state at the end of each. Collective.

    Friction is incremental: it acts on the slip of a step. Loads and prescribed values are
    multiplied by their amplitudes; those without one grow with time, from 0 at time 0 to their
    value at time 1.

    Parameters
    ----------
    problem
        The problem; `problem.at(state.time, state.history)` is the problem of a state's step.
    times
        Ends of the steps, increasing. A step that fails is halved, so that states in between
        may be given too.
    settings
        Method and tolerances; Newton's by default.
    monitor
        Called after every outer iteration.
    start
        A state that was given before, to continue from; the reference configuration at time 0 by
        default.
    before
        The state before that: with it the initial guess of the first step is that without the
        interruption, and so are the results, to rounding. Without it, within the tolerance.

    Yields
    ------
    The state at the end of each step, one by one.

    Raises
    ------
    InputError
        If an argument is none of these, times do not increase, loads and supports contradict each
        other or leave a rigid-body mode unconstrained, or a linear system is singular.
    NotConvergedError
        If a step fails; the states before have been given.
    """
    _check_options(settings, monitor)
    start = start.state if isinstance(start, Solution) else start
    expect("start", start, "an earlier state, or solution", isinstance(start, State | None))
    earlier = before is None or (isinstance(before, State) and start is not None)
    expect("before", before, "the state before start", earlier)
    expect("evolve", problem, "a Problem", isinstance(problem, ContactProblem))
    begin = 0.0 if start is None else start.time
    ends = _checked_times(problem, times, begin)
    check_variables(problem.equilibrium)
    settings = settings or NewtonOptions()
    method = METHODS[settings.method](problem, settings, monitor)
    for state, outcome in LoadStepping(problem, method, start, before).run(ends, begin):
        if not outcome.converged:
            raise NotConvergedError(
                f"no step to {state.time:g}: {outcome.reason}; the states before remain"
            )
        yield state


def run_schedule(
    problem: ContactProblem,
    settings: Options,
    monitor: Monitor | None,
    schedule: Schedule,
    reviewed: bool = True,
) -> Solution:
    """Take the steps of a schedule, and return the last one that has converged. Collective.

    A signal or a step that fails ends them; all complete steps remain, with the outcome of the
    one that has ended them. Where it is not `reviewed` the solution has no warnings yet.

    Raises
    ------
    InputError
        If a linear system is singular, the potential is not determined, or the initial guess is
        that of another problem.
    """
    clock = time.perf_counter()
    check_variables(problem.equilibrium)
    start = None if schedule.start is None else _prescribed(problem, schedule.start)
    records = list(schedule.kept)
    with stop_on_signal(problem.comm, monitor) as stop:
        method = METHODS[settings.method](problem, settings, stop)
        setup = time.perf_counter() - clock
        if schedule.times:
            here, state, outcome, history = _steps(problem, method, schedule, records)
        else:
            state, outcome = solve_step(problem, method, start)
            here, history = problem, [*outcome.records]
    solved = time.perf_counter() - clock - setup
    counters = method.counters
    body = method.condensation if isinstance(method, Newton) else None
    critical, jammed = uniqueness(here, state, body) if outcome.converged else (np.inf, False)
    # The review needs the memory that the method's operators take.
    del method, body
    destroy_unused(problem.comm, problem.domain.mesh.comm)
    check_potential(here, state)
    solution = Solution(
        problem=here,
        state=state,
        outcome=outcome,
        history=history,
        counters=counters,
        method=settings.method,
        start=BEFORE if records else ZERO if start is None else schedule.guess,
        seconds={"setup": setup, "solve": solved, "output": 0.0},
        steps=records,
        critical_factor=critical,
        jammed=jammed,
    )
    if reviewed:
        announce(solution)
    return solution


def _steps(
    problem: ContactProblem, method: Method, schedule: Schedule, records: list[StepRecord]
) -> tuple[ContactProblem, State, Outcome, list[Record]]:
    """Take load steps, and append the records of those that converge. Collective.

    Returns
    -------
    The last step that is recorded, or the iterate of the first one if none is; the outcome of the
    last one, with the time that was reached; and the outer iterations of all.
    """
    recorder = StepRecorder(problem, records[-1] if records else None)
    history, outcome, end = list[Record](), None, schedule.times[-1]
    states = [record.state for record in records[-1:-3:-1]]
    tell(logger, 0.0, "steps to t = %g", end)
    steps = LoadStepping(problem, method, *states)
    for state, outcome in steps.run(schedule.times, schedule.begin):
        now, taken = state.time, outcome.records
        history += [replace(r, note=f"t = {now:g} {r.note}".strip()) for r in taken]
        if outcome.converged:
            records.append(recorder.record(state, outcome))
            if schedule.keep is not None:
                schedule.keep(records[-1])
            share = (now - schedule.begin) / (end - schedule.begin)
            words = "t = %g of %g: iterations %d, residual %.1e"
            tell(logger, share, words, now, end, len(taken), outcome.residuals.largest)
    reached = 0.0
    if records:
        state, reached = records[-1].state, records[-1].state.time
    here = problem.at(state.time, state.history)
    if outcome is None:  # all were there already
        return here, state, Outcome(evaluate(here, state), method.options.allowed), history
    if not outcome.converged:
        words = outcome.ended or outcome.criterion or f"the one to {now:g} fails"
        ended = f"the steps end at t = {reached:g} of {end:g}: {words}"
        outcome = replace(outcome, ended=ended)
    return here, state, outcome, history


def _prescribed(problem: ContactProblem, start: State) -> State:
    """Return an initial guess with the values that the problem prescribes. Collective."""
    zero, nodes = problem.start(), problem.nodes.nodes.size
    fits = start.x.shape == zero.x.shape and start.forces.pressure.shape == (nodes,)
    if not problem.comm.allreduce(fits, op=MPI.LAND):
        raise InputError(
            "start: given a state of another problem; accepted: one with the same mesh, elements "
            "and contact nodes, on the same ranks",
            "start",
        )
    x = problem.equilibrium.prescribe(start.x, problem.time)
    return State(x, start.forces, problem.time, problem.history)


def _uninterrupted(solution: Solution) -> Solution:
    """Return a solution; raise `SolveInterrupted` with it if a signal has ended the solve."""
    if solution.outcome.signal:
        ended = _Pressed if solution.outcome.signal == signal.SIGINT else SolveInterrupted
        raise ended(solution)
    return solution


def _refuse(given: Mapping[str, object], beside: str) -> None:
    """Refuse arguments that would be ignored."""
    for name, value in given.items():
        if value is not None:
            raise InputError(
                f"{name}: given together with {beside}; accepted: one without it",
                "ignored-argument",
            )


def _check_options(settings: Options | None, monitor: Monitor | None) -> None:
    """Refuse objects that are no options of a method, or no function."""
    accepted = "NewtonOptions(), FixedPointOptions(), PenaltyOptions()"
    expect("settings", settings, accepted, isinstance(settings, Options | None))
    accepted = "a function of a record, called after each outer iteration"
    expect("monitor", monitor, accepted, monitor is None or callable(monitor))


def _checked_times(
    problem: ContactProblem, times: Sequence[float] | Array, begin: float
) -> tuple[float, ...]:
    """Return the ends of steps; refuse times that do not increase, and contradictory supports.

    Collective.
    """
    given = [*times] if isinstance(times, Iterable) and not isinstance(times, str) else []
    numbers = len(given) > 0 and all(isinstance(time, Real) for time in given)
    expect("times", times, "a list of times, the ends of the steps", numbers)
    ends = tuple(float(time) for time in given)
    if not np.all(np.isfinite(ends)) or np.any(np.diff([begin, *ends]) <= 0):
        raise InputError(
            f"times: given {', '.join(f'{time:g}' for time in ends)}; accepted: numbers that "
            f"increase, the first above {begin:g}",
            "value",
        )
    for end in ends:
        check_supports(problem.at(end))
    check_problem(problem.at(ends[-1]))
    return ends
