"""Sweeps: a case for each of several values of some of its keys, one row a value.

Each solve starts from the solution before it, and where loads and friction alone change what has
been factorised is kept. Rows that are there already are not computed again.
"""

from __future__ import annotations

import csv
import itertools
import logging
import os
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.build import build_problem, named
from contact.case.file import Case, load_case
from contact.case.overrides import read_value
from contact.case.text import literal, to_toml
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.methods.every import METHODS
from contact.methods.interrupt import Interrupted, stop_on_signal
from contact.methods.method import Method
from contact.methods.options import NewtonOptions, Options
from contact.methods.predictor import Reached, predicted
from contact.methods.report import Monitor, tell
from contact.methods.steps import since, solve_step
from contact.output.folder import on_root
from contact.output.quantities import SWEEP, values_of
from contact.output.rerun import difference
from contact.output.results import Results
from contact.output.solution import Solution
from contact.output.table import contact_table, write_csv
from contact.problem.held import check_potential
from contact.problem.problem import ContactProblem
from contact.solving import Schedule, run_schedule

logger = logging.getLogger("contact.sweep")

#: Names of the table and of the case that was swept.
TABLE, CASE = "sweep.csv", "sweep.toml"

#: Sections that may change without another matrix or other contact nodes.
LIGHT = ("title", "load", "output", "friction", "fixed")


@dataclass(frozen=True)
class Axis:
    """A key of the case file and the values that it takes, as texts."""

    key: str
    values: tuple[str, ...]

    @staticmethod
    def of(text: str) -> Axis:
        """Read ``key=v1,v2,...``; commas in lists and texts separate nothing.

        Raises
        ------
        InputError
            If it is not that.
        """
        key, equals, given = text.partition("=")
        texts = [value.strip() for value in _split(given)]
        if not equals or not key.strip() or not all(texts):
            raise InputError(f"--over {text}: accepted: path.to.key=value,value,...")
        values = [read_value(key.strip(), value, "--over") for value in texts]
        if any(one == other for one, other in itertools.combinations(values, 2)):
            raise InputError(f"--over {text}: a value stands there twice; accepted: each once")
        # Numbers in one way: a row is found again by its texts.
        texts = [
            literal(value) if isinstance(value, int | float) else text
            for value, text in zip(values, texts, strict=True)
        ]
        return Axis(key.strip(), tuple(texts))


def _split(text: str) -> Iterator[str]:
    """Split at the commas outside of brackets and quotes."""
    depth, quote, begin = 0, "", 0
    for i, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter == "," and depth == 0:
            yield text[begin:i]
            begin = i + 1
        depth += (letter in "[{") - (letter in "]}") if not quote else 0
    yield text[begin:]


def sweep(
    path: str | Path,
    axes: Sequence[Axis],
    folder: Path,
    overrides: Sequence[str] = (),
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    warm: bool = True,
) -> list[dict[str, Any]]:
    """Solve a case for all combinations of values; write a row of ``sweep.csv`` after each.

    Parameters
    ----------
    path, overrides
        The case file, and values that replace some of its own.
    axes
        What is varied; the last one fastest.
    folder
        Where the table is, or goes to.
    monitor
        Told of all outer iterations.
    comm
        Communicator of the mesh.
    warm
        Whether each solve starts from the one before.

    Returns
    -------
    The rows. Collective.

    Raises
    ------
    Interrupted
        After a signal; the rows before it are in the table.
    InputError
        If a value is not accepted, or the folder has the sweep of another case.
    """
    names = [axis.key for axis in axes]
    points = [
        dict(zip(names, values, strict=True))
        for values in itertools.product(*(axis.values for axis in axes))
    ]
    # All of them before the first is solved.
    cases = on_root(comm, lambda: [load_case(path, [*overrides, *_set(p)]) for p in points])
    text = to_toml(load_case(path, [*overrides, *_set(points[0])]))
    kept = on_root(comm, lambda: _begin(folder, names, text))
    rows: list[dict[str, Any]] = []
    tell(logger, 0.0, "%d cases", len(cases))
    with stop_on_signal(comm, monitor) as stop:
        runner = _Runner(comm, stop, warm)
        for point, case in zip(points, cases, strict=True):
            row = kept.pop(tuple(point.values()), None)
            if row is None or row["converged"] != "True":
                begin = time.perf_counter()
                solution = runner.solve(case)
                if solution.outcome.signal:
                    raise Interrupted(solution.outcome.signal)
                seconds = comm.bcast(time.perf_counter() - begin)
                results = Results(solution, contact_table(solution))
                row = {**point, **values_of(SWEEP, results), "seconds": seconds}
                said = f"{', '.join(_set(point))}: {solution.outcome.reason}"
                tell(logger, (len(rows) + 1) / len(cases), said)
            rows.append(row)
            # What has not come up yet, or is not asked for, remains.
            on_root(comm, lambda: _write(folder, [*rows, *kept.values()]))
    return rows


def _set(point: Mapping[str, str]) -> list[str]:
    return [f"{key}={value}" for key, value in point.items()]


def _begin(folder: Path, names: list[str], text: str) -> dict[tuple[str, ...], dict[str, Any]]:
    """Return the rows that are there already. On one rank."""
    rows: list[dict[str, Any]] = []
    if (folder / TABLE).is_file():
        with (folder / TABLE).open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    swept = list(itertools.takewhile(lambda column: column != "converged", rows[0] if rows else ()))
    if rows and swept != names:
        raise InputError(
            f"--out {folder}: given a sweep over other keys; accepted: one over "
            f"{', '.join(swept)}, or another folder"
        )
    before = folder / CASE
    if (folder / TABLE).exists() and not before.is_file():
        raise InputError(
            f"--out {folder}: given a {TABLE} without the {CASE} that a sweep leaves beside it; "
            "accepted: another folder"
        )
    if before.is_file():
        place = difference(*(_without(t, names) for t in (before.read_text("utf-8"), text)))
        if place is not None:
            raise InputError(
                f"--out {folder}: given a sweep of another case: there {place}; accepted: the same "
                "case, or another folder"
            )
    else:
        before.write_text(text, encoding="utf-8")
    return {tuple(row[name] for name in names): dict(row) for row in rows}


def _without(text: str, names: list[str]) -> dict[str, Any]:
    """Return a case without the keys that are swept."""
    data = tomllib.loads(text)
    for name in names:
        *parents, last = name.split(".")
        place: Any = data
        for key in parents:
            place = place[int(key)] if isinstance(place, list) else place.get(key, {})
        if isinstance(place, list):
            place[int(last)] = 0
        else:
            place.pop(last, None)
    return data


def _write(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    draft = folder / f".contact-{TABLE}"
    write_csv(draft, rows[0], (row.values() for row in rows))
    os.replace(draft, folder / TABLE)


class _Runner:
    """Solves one case after the other, with what is left of the one before."""

    def __init__(self, comm: MPI.Intracomm, monitor: Monitor, warm: bool) -> None:
        self._comm, self._monitor, self._warm = comm, monitor, warm
        self._case: Case | None = None
        self._domain: Domain | None = None
        self._method: Method | None = None
        self._reached: list[Reached] = []

    def solve(self, case: Case) -> Solution:
        """Solve a case. Collective."""
        before, self._case = (self._case if self._warm else None), case
        if before is None or before.mesh != case.mesh:
            self._domain = None
        problem = build_problem(case, self._comm, domain=self._domain)
        self._domain = problem.domain
        with named(case.source):
            if case.evolution is not None:
                schedule = Schedule(case.evolution.ends, case.evolution.times[0])
                return run_schedule(problem, case.solver, self._monitor, schedule)
            if self._method is None or before is None or not _alike(before, case):
                self._method = METHODS[case.solver.method](
                    problem, self._settings(case), self._monitor
                )
                self._reached = []
            else:
                self._method.turn_to(problem)
            return self._static(problem, case.solver.method, self._method)

    def _settings(self, case: Case) -> Options:
        """Return the method's options: what is factorised for one case may do for the next."""
        if self._warm and isinstance(case.solver, NewtonOptions):
            return replace(case.solver, keep="across")
        return case.solver

    def _static(self, problem: ContactProblem, name: str, method: Method) -> Solution:
        counted, ends = replace(method.counters), self._reached
        start = predicted(problem, ends[-1], ends[0] if len(ends) > 1 else None) if ends else None
        state, outcome = solve_step(problem, method, start)
        if start is not None and not outcome.converged and not outcome.signal:
            state, outcome = solve_step(problem, method, None)
        end = Reached.of(problem, state)
        self._reached = [*ends[-1:], end] if outcome.converged else []
        check_potential(problem, state)
        counters = since(method.counters, counted)
        return Solution(problem, state, outcome, method.history, counters, name, seconds={})


def _alike(before: Case, case: Case) -> bool:
    """Tell whether two cases differ in loads, prescribed values and coefficients alone."""
    one, two = (
        given.model_dump(exclude=set(LIGHT))
        | {
            "friction": None if given.friction is None else given.friction.law,
            "fixed": [
                (f.on, [c == "free" for c in f.displacement or ()], f.potential is None)
                for f in given.fixed
            ],
        }
        for given in (before, case)
    )
    return bool(one == two)
