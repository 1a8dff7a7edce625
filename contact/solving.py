"""Solve a problem by the method that is asked for, and say what the result is worth."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.build import build_problem, named
from contact.case.file import Case, load_case
from contact.case.replaced import replaced_by
from contact.case.text import anchored, to_toml
from contact.evolving import solve_steps
from contact.methods.every import METHODS
from contact.methods.interrupt import stop_on_signal
from contact.methods.nested import prolong
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor
from contact.methods.steps import solve_step
from contact.nesting import coarse_solution
from contact.output.resume import Checkpoints, read_steps
from contact.output.review import announce
from contact.output.solution import Solution
from contact.problem.held import check_held, check_potential
from contact.problem.problem import ContactProblem
from contact.problem.state import State


def solve(
    case: Case | ContactProblem | str | Path,
    settings: Options | None = None,
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    folder: Path | None = None,
    restart: Path | None = None,
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
    replacements
        Objects that take the place of parts of the case; see `build.build_problem`.

    Raises
    ------
    InputError
        If the case does not fit its mesh, or the body is not held.
    """
    begin = time.perf_counter()
    if isinstance(case, ContactProblem):
        check_held(case)
        return solve_problem(case, settings or NewtonOptions(), monitor)
    case = case if isinstance(case, Case) else load_case(case, without=replaced_by(replacements))
    settings = settings or case.solver
    problem = build_problem(case, comm, **replacements)
    with named(case.source):
        nested = isinstance(settings, NewtonOptions) and settings.nested
        start = coarse_solution(case, comm, **replacements) if nested else None
        if case.evolution is None:
            solution = solve_problem(problem, settings, monitor, start)
        else:
            kept = [] if restart is None else read_steps(restart, problem)
            keep = None
            if folder is not None:
                here = restart is not None and restart.samefile(folder)
                keep = Checkpoints(folder, problem, to_toml(anchored(case)), kept, here).keep
            times, rest = case.evolution.ends, case.evolution.times[0]
            solution = solve_steps(problem, times, settings, monitor, rest, keep, kept)
    solution.title, solution.output, solution.units = case.title, case.output, case.case.units
    if not replacements:
        solution.case = to_toml(case)
    solution.seconds["setup"] += time.perf_counter() - begin - sum(solution.seconds.values())
    return solution


def solve_problem(
    problem: ContactProblem,
    settings: Options,
    monitor: Monitor | None = None,
    start: tuple[ContactProblem, State] | None = None,
) -> Solution:
    """Solve a problem. Collective.

    Parameters
    ----------
    problem, settings, monitor
        The problem, the method with its tolerances, and who is told of the outer iterations.
    start
        A problem on a coarser mesh and its solution, to start from.

    An interrupt (Ctrl-C, or SIGTERM from a batch system) ends the solve after the running
    iteration and keeps what the last outer one left; a second one ends the program.

    Raises
    ------
    InputError
        If the linear system is singular, or the potential is not determined.
    """
    begin = time.perf_counter()
    with stop_on_signal(problem.comm, monitor) as stop:
        method = METHODS[settings.method](problem, settings, stop)
        setup = time.perf_counter() - begin
        begun = None if start is None else prolong(*start, problem)
        state, outcome = solve_step(problem, method, begun)
    check_potential(problem, state)
    solution = Solution(
        problem=problem,
        state=state,
        outcome=outcome,
        history=method.history,
        counters=method.counters,
        method=settings.method,
        start="zero slip" if start is None else "the solution on a coarser mesh",
        seconds={
            "setup": setup,
            "solve": time.perf_counter() - begin - setup,
            "output": 0.0,
        },
    )
    announce(solution)
    return solution
