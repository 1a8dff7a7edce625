"""Solve a case or a problem: one step, or one load step after the other.

    solve > build_problem                       a case becomes a `ContactProblem`
          > solve_problem                       makes a method; criteria of uniqueness
            > solve_static                      or `solve_in_steps` > `LoadStepping`
              > solve_step > Method.solve       by `contact.methods` or `contact.thesis`
                           > evaluated          all residuals from scratch
          > reviewed                            warnings

The calls from there to the linear solve are in docs/architecture.md.
"""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from numbers import Real
from pathlib import Path
from typing import TypeAlias, Unpack

import numpy as np
from mpi4py import MPI

from contact._compat import destroy_unused
from contact.arguments import expect
from contact.case.build import REPLACEMENTS, Replacements, build_problem, naming_case
from contact.case.file import Case, load_case, to_toml
from contact.errors import InputError
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS, Method, solve_step
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor, Outcome, Record, tell
from contact.methods.signals import SIGNALLED, stop_on_signal
from contact.problem.checks import check_potential, check_problem, check_supports
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.refining import adapted, default_start
from contact.results.fields import check_variables
from contact.results.remarks import announce
from contact.results.solution import Results, StepRecord, StepRecorder
from contact.results.uniqueness import uniqueness
from contact.solution import Solution
from contact.typing import Array

logger = logging.getLogger("contact.steps")

#: Names of initial guesses, for messages about the solution.
ZERO, GIVEN = "the zero initial guess", "the state that was given"
BEFORE, COARSE = "the step before", "the solution on a coarser mesh"

#: Solves a problem by a method.
Solver: TypeAlias = Callable[[ContactProblem, Method], Solution]


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


class _CtrlC(SolveInterrupted, KeyboardInterrupt):
    """Ctrl-C."""


class NotConvergedError(RuntimeError):
    """A load step has not converged, even after it was halved."""


def solve(
    case: Case | ContactProblem | str | Path,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    start: State | Solution | None = None,
    **replacements: Unpack[Replacements],
) -> Solution:
    """Build and solve a case, in load steps where it has them, or solve a problem. Collective.

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
    start
        An earlier solution on the same mesh, or its state, as initial guess; by default zero, or,
        of a large static case, a solution on coarser meshes.
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
    start = start.state if isinstance(start, Results) else start
    case, options = _checked(case, settings, monitor, start, replacements)
    if isinstance(case, ContactProblem):
        start = None if start is None else _prescribed(case, start)
        return reviewed(solve_problem(case, options, monitor, partial(solve_static, start=start)))
    with naming_case(case.source):
        if case.adapt is not None:
            solution = solve_adapted(case, comm, options, monitor)
        else:
            problem, guess = build_problem(case, comm, **replacements), GIVEN
            if start is not None:
                start = _prescribed(problem, start)
            else:
                chosen = case.model_copy(update={"solver": options})
                start, guess = default_start(chosen, problem, **replacements), COARSE
            solution = solve_problem(problem, options, monitor, solver_of(case, start, guess))
        return reviewed(solution, case, clock, described=not replacements)


def solve_steps(
    problem: ContactProblem,
    times: Sequence[float] | Array,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    kept: Sequence[StepRecord] = (),
    keep: Callable[[StepRecord], None] | None = None,
) -> Solution:
    """Load a problem in steps, as `evolve` does, and review the solution. Collective.

    Parameters
    ----------
    problem, times, settings, monitor
        As `evolve` takes them.
    kept
        Steps of an earlier run, to continue from: the `steps` of its solution.
    keep
        Called with the record of each step that has converged.

    Returns
    -------
    The solution of the last step that has converged, with the results of each in its `steps`.

    Raises
    ------
    InputError, SolveInterrupted
        As `evolve` and `solve` raise them.
    """
    expect("solve_steps", problem, "a Problem", isinstance(problem, ContactProblem))
    _check_types(settings, monitor)
    for record in kept[-1:]:
        _check_state("kept", problem, record.state)
    ends = _checked_times(problem, times, 0.0)
    steps = partial(solve_in_steps, times=(0.0, *ends), kept=kept, keep=keep)
    return reviewed(solve_problem(problem, settings or NewtonOptions(), monitor, steps))


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
    start = start.state if isinstance(start, Results) else start
    expect("evolve", problem, "a Problem", isinstance(problem, ContactProblem))
    _check_types(settings, monitor, start)
    earlier = before is None or (isinstance(before, State) and start is not None)
    expect("before", before, "the state before start", earlier)
    for name, state in (("start", start), ("before", before)):
        if state is not None:
            _check_state(name, problem, state)
    begin = 0.0 if start is None else start.time
    ends = _checked_times(problem, times, begin)
    check_variables(problem.body)
    settings = settings or NewtonOptions()
    method = METHODS[settings.method](problem, settings, monitor)
    for state, outcome in LoadStepping(problem, method, start, before).steps(ends, begin):
        if not outcome.converged:
            raise NotConvergedError(
                f"no step to {state.time:g}: {outcome.reason}; the states before remain"
            )
        yield state


def solve_static(
    problem: ContactProblem, method: Method, start: State | None = None, guess: str = GIVEN
) -> Solution:
    """Solve the step to a problem's own time. Collective.

    `start` is the initial guess, None for zero, and `guess` its name in messages.
    """
    state, outcome = solve_step(problem, method, start)
    history, name = [*outcome.records], method.options.method
    words = ZERO if start is None else guess
    return Solution(problem, state, outcome, history, method.counters, name, {}, start=words)


def solve_in_steps(
    problem: ContactProblem,
    method: Method,
    times: Sequence[float],
    kept: Sequence[StepRecord] = (),
    keep: Callable[[StepRecord], None] | None = None,
) -> Solution:
    """Solve load steps; `times` are their begin and ends. Collective.

    `kept` are the records of the steps of an earlier run, to continue from, and `keep` is called
    with that of each step. A signal or a step that fails ends the steps; all complete ones remain.
    The solution is the last of them, or the iterate of the first step if there is none, with the
    outcome of the step that has ended them and the outer iterations of all.
    """
    records = [*kept]
    recorder = StepRecorder(problem, records[-1] if records else None)
    history, outcome, begin, end = list[Record](), None, times[0], times[-1]
    states = [record.state for record in records[-1:-3:-1]]
    tell(logger, 0.0, "steps to t = %g", end)
    stepping = LoadStepping(problem, method, *states)
    for state, outcome in stepping.steps(times[1:], begin):
        now, taken = state.time, outcome.records
        history += [replace(r, note=f"t = {now:g} {r.note}".strip()) for r in taken]
        if outcome.converged:
            records.append(recorder.record(state, outcome))
            if keep is not None:
                keep(records[-1])
            share = (now - begin) / (end - begin)
            words = "t = %g of %g: iterations %d, residual %.1e"
            tell(logger, share, words, now, end, len(taken), outcome.residuals.largest)
    reached = 0.0
    if records:
        state, reached = records[-1].state, records[-1].state.time
    here = problem.at(state.time, state.history)
    if outcome is None:  # all were there already
        outcome = Outcome(evaluate(here, state), method.options.allowed)
    elif not outcome.converged:
        words = outcome.ended or outcome.criterion or f"the one to {now:g} fails"
        ended = f"the steps end at t = {reached:g} of {end:g}: {words}"
        outcome = replace(outcome, ended=ended)
    counters, name, guess = method.counters, method.options.method, BEFORE if records else ZERO
    return Solution(here, state, outcome, history, counters, name, {}, start=guess, steps=records)


def solve_adapted(
    case: Case, comm: MPI.Intracomm, options: Options, monitor: Monitor | None = None
) -> Solution:
    """Solve a case on finer and finer meshes, by its `[mesh.adapt]`; not reviewed. Collective."""
    return adapted(
        case,
        comm,
        lambda problem, start: solve_problem(problem, options, monitor, solver_of(case, start)),
    )


def solver_of(case: Case, start: State | None = None, guess: str = COARSE) -> Solver:
    """Return the solver of a case: of its load steps, or from an initial guess."""
    if case.evolution is not None:
        return partial(solve_in_steps, times=case.evolution.step_times)
    return partial(solve_static, start=start, guess=guess)


def solve_problem(
    problem: ContactProblem,
    settings: Options,
    monitor: Monitor | None = None,
    solver: Solver = solve_static,
) -> Solution:
    """Solve a problem by a new method, and evaluate the criteria of uniqueness; not reviewed.

    Collective.
    """
    clock = time.perf_counter()
    check_variables(problem.body)
    with stop_on_signal(problem.comm, monitor) as stop:
        method = METHODS[settings.method](problem, settings, stop)
        setup = time.perf_counter() - clock
        solution = solver(problem, method)
    solved = time.perf_counter() - clock - setup
    solution.seconds = {"setup": setup, "solve": solved, "output": 0.0}
    here, state = solution.problem, solution.state
    body = method.condensed_steps.condensation if isinstance(method, Newton) else None
    if solution.converged:
        solution.critical_factor, solution.jammed = uniqueness(here, state, body)
    # The review needs the memory that the method's operators take.
    del method, body
    destroy_unused(problem.comm, problem.domain.mesh.comm)
    check_potential(here, state)
    return solution


def reviewed(
    solution: Solution, case: Case | None = None, clock: float | None = None, described: bool = True
) -> Solution:
    """Return a solution with its warnings, and the titles of its case. Collective.

    Setup began at `clock`. A case with objects in place of its parts is not fully `described`.
    If a signal has ended the solve, `SolveInterrupted` is raised with the solution.
    """
    announce(solution)
    if case is not None:
        solution.title, solution.output, solution.units = case.title, case.output, case.case.units
    if case is not None and described:
        solution.case, solution.source = to_toml(case), case
    if clock is not None:
        solution.seconds["setup"] += time.perf_counter() - clock - sum(solution.seconds.values())
    if solution.outcome.signal:
        ended = _CtrlC if solution.outcome.signal == signal.SIGINT else SolveInterrupted
        raise ended(solution)
    return solution


def _prescribed(problem: ContactProblem, start: State) -> State:
    """Return an initial guess with the values that the problem prescribes. Collective."""
    _check_state("start", problem, start)
    x = problem.body.prescribe(start.x, problem.time)
    return State(x, start.multipliers, problem.time, problem.history)


def _check_state(name: str, problem: ContactProblem, state: State) -> None:
    """Refuse a state of another problem. Collective."""
    unknowns, nodes = problem.start().x.shape, problem.nodes.nodes.size
    fits = state.x.shape == unknowns and state.multipliers.contact.shape == (nodes,)
    if not problem.comm.allreduce(fits, op=MPI.LAND):
        raise InputError(
            f"{name}: given a state of another problem; accepted: one with the same mesh, elements "
            "and contact nodes, on the same ranks",
            "start",
        )


def _check_types(settings: object, monitor: object, start: object = None) -> None:
    """Refuse arguments of other types."""
    accepted = "NewtonOptions(), FixedPointOptions(), PenaltyOptions()"
    expect("settings", settings, accepted, isinstance(settings, Options | None))
    accepted = "a function of a record, called after each outer iteration"
    expect("monitor", monitor, accepted, monitor is None or callable(monitor))
    accepted = "an earlier solution of the same problem, or its state"
    expect("start", start, accepted, isinstance(start, State | None))


def _checked(
    case: Case | ContactProblem | str | Path,
    settings: Options | None,
    monitor: Monitor | None,
    start: State | None,
    replacements: Mapping[str, object],
) -> tuple[Case | ContactProblem, Options]:
    """Return the case or problem, and options; refuse wrong or ignored arguments. Collective."""
    fits = isinstance(case, Case | ContactProblem | str | Path)
    expect("solve", case, "a case, the name of a case file, or a Problem", fits)
    _check_types(settings, monitor, start)
    for name in replacements.keys() - set(REPLACEMENTS):
        accepted = f"{', '.join(REPLACEMENTS)}; a method as settings, times by solve_steps"
        raise InputError(f"{name}: unknown; accepted: {accepted}", "no-such-name")
    if not isinstance(case, Case | ContactProblem):
        case = load_case(case)
    options = settings or (case.solver if isinstance(case, Case) else NewtonOptions())
    nested = getattr(options, "nested", None) or None  # of Newton's method alone
    ignored: dict[str, object] = {"start": start, "nested": nested}
    if isinstance(case, ContactProblem):
        ignored, beside = {"nested": nested, **replacements}, "a problem that is built already"
        check_problem(case)
    elif case.adapt is not None:
        ignored, beside = {**ignored, **replacements}, "[mesh.adapt]"
    elif case.evolution is not None:
        beside = "[evolution]; evolve(problem, times, start=state) goes on"
    else:
        ignored = {} if nested is None else {"start": start}
        beside = "nested = true, which makes an initial guess of its own"
    for name in (name for name, value in ignored.items() if value is not None):
        words = f"{name}: given together with {beside}; accepted: one without it"
        raise InputError(words, "ignored-argument")
    return case, options


def _checked_times(
    problem: ContactProblem, times: Sequence[float] | Array, begin: float
) -> tuple[float, ...]:
    """Return the ends of steps; refuse times that do not increase. Collective.

    Supports that contradict each other at one of them, and a problem that `check_problem` refuses
    at the last, are refused too.
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
    check_problem(problem, ends[-1:])
    return ends
