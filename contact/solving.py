"""Solve a problem by the method that is asked for, and say what the result is worth."""

from __future__ import annotations

import signal
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.build import REPLACEMENTS, build_problem, named
from contact.case.digest import check_digest, digest
from contact.case.file import Case, load_case
from contact.case.replaced import replaced_by
from contact.case.text import to_toml
from contact.errors import InputError
from contact.evolving import check_options, check_times, solve_steps
from contact.kinds import expect
from contact.methods.every import METHODS
from contact.methods.interrupt import SIGNALLED, stop_on_signal
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor
from contact.methods.steps import solve_step
from contact.nesting import nested_start, pays
from contact.output.folder import on_root
from contact.output.resume import Checkpoints, kept_digest, read_steps
from contact.output.review import announce
from contact.output.solution import Solution
from contact.problem.consistent import check_problem
from contact.problem.held import check_potential
from contact.problem.problem import ContactProblem
from contact.problem.state import State

#: What a start is called that is given as such.
GIVEN = "the state that was given"


class SolveInterrupted(SystemExit):
    """A SIGINT (Ctrl-C) or SIGTERM has ended a solve, on all ranks after the same iteration.

    A program that does not catch it ends with the status 130 or 143: that is what a SystemExit is
    for. That of Ctrl-C is a KeyboardInterrupt too; of that of SIGTERM Python would make 130.

    Parameters
    ----------
    solution
        What was reached; `solution.outcome.signal` is the number of the signal.
    """

    def __init__(self, solution: Solution) -> None:
        super().__init__(solution.outcome.reason)
        self.solution = solution
        self.code = SIGNALLED + solution.outcome.signal


class _Pressed(SolveInterrupted, KeyboardInterrupt):
    """Ctrl-C."""


def solve(
    case: Case | ContactProblem | str | Path,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    folder: Path | None = None,
    restart: Path | None = None,
    start: State | Solution | None = None,
    times: Sequence[float] | None = None,
    **replacements: Any,
) -> Solution:
    """Build and solve a case, in steps if it says so. Collective.

    Parameters
    ----------
    case
        A case, the name of a case file, or a problem that is built already.
    settings
        Method and tolerances; those of the case by default.
    monitor
        Told of every outer iteration.
    comm
        Communicator of the mesh.
    folder
        Where checkpoints of an evolution's steps are kept until its results are written.
    restart
        A folder with checkpoints of the same case, to go on from.
    start
        An earlier solution on the same mesh to start from, or its state; from rest by default.
    times
        Of a problem that is built already: the ends of load steps, as of `evolve`. The solution's
        `steps` then say what each has come to.
    replacements
        Objects that take the place of parts of the case; see `build.build_problem`.

    Raises
    ------
    InputError
        If the case does not fit its mesh, the body is not held, or something is given that would
        be ignored.
    SolveInterrupted
        After a SIGINT or SIGTERM, with what was reached; a second signal ends the program.
    """
    return _uninterrupted(
        _solve(case, settings, monitor, comm, folder, restart, start, times, **replacements)
    )


def _uninterrupted(solution: Solution) -> Solution:
    if solution.outcome.signal:
        ended = _Pressed if solution.outcome.signal == signal.SIGINT else SolveInterrupted
        raise ended(solution)
    return solution


def _solve(
    case: Case | ContactProblem | str | Path,
    settings: Options | None,
    monitor: Monitor | None,
    comm: MPI.Intracomm,
    folder: Path | None,
    restart: Path | None,
    start: State | Solution | None,
    times: Sequence[float] | None = None,
    **replacements: Any,
) -> Solution:
    """Solve as `solve` does; what a signal has ended is a solution like others."""
    begin = time.perf_counter()
    check_options(settings, monitor)
    if isinstance(start, Solution):
        start = start.state
    fits = isinstance(start, State | None)
    expect("start", start, "an earlier solution of the same problem, or its state", fits)
    fits = isinstance(case, Case | ContactProblem | str | Path)
    expect("solve", case, "a case, the name of a case file, or a Problem", fits)
    for name in replacements.keys() - set(REPLACEMENTS):
        raise InputError(f"{name}: unknown; accepted: {', '.join(REPLACEMENTS)}")
    if isinstance(case, ContactProblem):
        given = {"folder": folder, "restart": restart, **replacements}
        _refuse(given, "a problem that is built already")
        nested = isinstance(settings, NewtonOptions) and settings.nested
        _refuse({"nested": nested or None}, "a problem that is built already")
        if times is not None:
            _refuse({"start": start}, "times; evolve(problem, times, start=state) goes on")
            ends = check_times(case, times, 0.0)
            return solve_steps(case, ends, settings or NewtonOptions(), monitor)
        check_problem(case)
        return _reached(case, settings or NewtonOptions(), monitor, start, GIVEN)
    _refuse({"times": times}, "a case, whose [evolution] says them")
    case = case if isinstance(case, Case) else load_case(case, without=replaced_by(replacements))
    settings = settings or case.solver
    computed_from = on_root(comm, lambda: digest(case)) if case.evolution and folder else None
    if restart is not None and case.evolution is not None:
        on_root(comm, lambda: check_digest(restart, kept_digest(restart), digest(case)))
    problem = build_problem(case, comm, **replacements)
    with named(case.source):
        nested = isinstance(settings, NewtonOptions) and settings.nested
        if isinstance(settings, NewtonOptions) and nested is None and start is None:
            nested = not replacements and pays(case, problem)
        if case.evolution is None:
            _refuse({"restart": restart}, "a case without [evolution]")
            words = GIVEN
            if nested:
                _refuse({"start": start}, "nested = true, which has a start of its own")
                start = nested_start(case, problem, **replacements)
                words = "the solution on a coarser mesh"
            solution = _reached(problem, settings, monitor, start, words)
        else:
            _refuse({"start": start}, "[evolution]; evolve(problem, times, start=state) goes on")
            _refuse({"nested": nested or None}, "[evolution]")
            kept = [] if restart is None else read_steps(restart, problem)
            keep = None
            if folder is not None:
                here = restart is not None and restart.samefile(folder)
                text = to_toml(case, anchored=True)
                keep = Checkpoints(folder, problem, text, kept, here, computed_from).keep
            times, rest = case.evolution.ends, case.evolution.times[0]
            solution = solve_steps(problem, times, settings, monitor, rest, keep, kept)
    solution.title, solution.output, solution.units = case.title, case.output, case.case.units
    if not replacements:
        solution.case = to_toml(case)
    solution.seconds["setup"] += time.perf_counter() - begin - sum(solution.seconds.values())
    return solution


def _refuse(given: Mapping[str, Any], beside: str) -> None:
    """Refuse arguments that would be ignored."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"{name}: given together with {beside}; accepted: one without it")


def solve_problem(
    problem: ContactProblem,
    settings: Options,
    monitor: Monitor | None = None,
    start: State | None = None,
    words: str = GIVEN,
) -> Solution:
    """Solve a problem. Collective.

    Parameters
    ----------
    problem, settings, monitor
        The problem, the method with its tolerances, and who is told of the outer iterations.
    start
        A state of the problem, or of one with the same mesh and contact nodes, to start from.
    words
        What start that is, for what is said of the solution.

    Raises
    ------
    InputError
        If the linear system is singular, the potential is not determined, or the start is that of
        another problem.
    SolveInterrupted
        After a SIGINT or SIGTERM, with what the last outer iteration has left; a second signal
        ends the program.
    """
    return _uninterrupted(_reached(problem, settings, monitor, start, words))


def _reached(
    problem: ContactProblem,
    settings: Options,
    monitor: Monitor | None,
    start: State | None,
    words: str,
) -> Solution:
    """Solve as `solve_problem` does; what a signal has ended is a solution like others."""
    begin = time.perf_counter()
    if start is not None:
        start = _begun(problem, start)
    with stop_on_signal(problem.comm, monitor) as stop:
        method = METHODS[settings.method](problem, settings, stop)
        setup = time.perf_counter() - begin
        state, outcome = solve_step(problem, method, start)
    history, counters = method.history, method.counters
    # Its operators are most of what there is in memory, which what is said of the solution needs.
    del method
    check_potential(problem, state)
    solution = Solution(
        problem=problem,
        state=state,
        outcome=outcome,
        history=history,
        counters=counters,
        method=settings.method,
        start="zero slip" if start is None else words,
        seconds={
            "setup": setup,
            "solve": time.perf_counter() - begin - setup,
            "output": 0.0,
        },
    )
    announce(solution)
    return solution


def _begun(problem: ContactProblem, start: State) -> State:
    """Return a given start with the values that the problem prescribes. Collective."""
    rest, nodes = problem.start(), problem.nodes.nodes.size
    fits = start.x.shape == rest.x.shape and start.forces.pressure.shape == (nodes,)
    if not problem.comm.allreduce(fits, op=MPI.LAND):
        raise InputError(
            "start: given a state of another problem; accepted: one with the same mesh, elements "
            "and contact nodes, on the same ranks"
        )
    x = problem.equilibrium.prescribe(start.x, problem.time)
    return State(x, start.forces, problem.time, problem.history)
