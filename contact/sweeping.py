"""Sweeps: a case for each of several values of some of its keys, one row per value.

Each solve has the solution before it as warm start; where loads and friction alone change, the
factorisation is kept. Rows that are there already are not computed again, provided that they were
computed from the same input.
"""

from __future__ import annotations

import itertools
import logging
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact.case.build import build_problem, naming_case
from contact.case.digest import check_files, check_same, digest
from contact.case.file import Case, literal, load_case, to_toml
from contact.errors import InputError, counted, nearest
from contact.io.folder import write_whole
from contact.io.tables import read_rows, write_csv
from contact.mesh.domain import Domain
from contact.methods.load_stepping import predicted
from contact.methods.method import METHODS, Method
from contact.methods.options import NewtonOptions, Options
from contact.methods.report import Monitor, tell
from contact.methods.signals import Interrupted, stop_on_signal
from contact.model.messages import listed
from contact.problem.checks import check_potential
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import on_root
from contact.results.quantities import contact_key, quantities, values_of
from contact.results.quantity import CONTACTS, SUMMARY, SWEEP, is_of
from contact.results.remarks import evaluate_extremes
from contact.solution import Solution
from contact.solving import solve_adapted, solve_problem, solve_static, solver_of
from contact.typing import Array

logger = logging.getLogger("contact.sweep")

#: Names of the table and of the case that was swept.
TABLE, CASE = "sweep.csv", "sweep.toml"

#: Column with the digests of the files that the case of a row reads.
INPUT = "input"

#: Columns that every table has.
COLUMNS = ("converged", "kkt", "seconds", INPUT)

#: Keys of the summary with lists of fixed length -> names of the entries.
_ENTRIES = {given.name: given.entries for given in quantities(SUMMARY) if given.component}
_ENTRIES_OF_CONTACT = {
    contact_key(given): given.entries for given in quantities(CONTACTS) if given.component
}

#: Sections that may change without another matrix or other contact nodes.
LIGHT = ("title", "load", "output", "friction", "fixed")


@dataclass(frozen=True)
class Axis:
    """A key of the case file and the values that it takes, as texts."""

    key: str
    values: tuple[str, ...]

    @staticmethod
    def of(text: str) -> Axis:
        """Read ``key=v1,v2,...``: TOML values or bare words."""
        key, _, given = text.partition("=")
        try:
            values = tomllib.loads(f"values = [{given}]")["values"]
            # Each in one way: a row is found again by its texts.
            texts = [literal(value) for value in values]
        except ValueError:  # bare words
            texts = values = [value.strip() for value in given.split(",")]
        if not key.strip() or not values or "" in values:
            raise InputError(f"--over {text}: accepted: path.to.key=value,value,...", "over")
        if any(one == other for one, other in itertools.combinations(values, 2)):
            raise InputError(
                f"--over {text}: a value stands there twice; accepted: each once", "over"
            )
        return Axis(key.strip(), tuple(texts))


def summary_columns(solution: Solution, names: Sequence[str]) -> dict[str, float]:
    """Return keys of the summary as columns, an entry of a list each. Collective.

    ``error.energy`` is a key of a table; a table alone stands for all its numbers and vectors.
    """
    found: dict[str, float] = {}
    for name in names:
        top = name.partition(".")[0]
        known = _numbers(values_of(SUMMARY, solution, top))
        own = {key: x for key, x in known.items() if f"{key}.".startswith(f"{name}.")}
        if not own:
            if not known:  # another quantity is meant, or one that this case has not
                known = _numbers(values_of(SUMMARY, solution))
            begins = next((key for key in known if key.startswith(top)), "")
            hint = nearest(name, known) or nearest(begins, known)
            raise InputError(
                f"--columns {name}: no number, vector or table of these in this case's "
                f"summary.json{hint}; accepted: {listed(known)}",
                "columns",
            )
        for key, numbers in own.items():
            ends = _ends(key)
            columns = [f"{key}_{end}" for end in ends] if numbers.size > 1 else [key]
            found |= {column: float(x) for column, x in zip(columns, numbers.flat, strict=False)}
    return found


def _ends(key: str) -> Sequence[str]:
    """Return the ends of the columns of a vector in the summary, or in `contacts` of it."""
    first, last = key.split(".")[0], key.split(".")[-1]
    return _ENTRIES_OF_CONTACT.get(last, ()) if first == "contacts" else _ENTRIES.get(first, ())


def _numbers(table: Mapping[str, Any], before: str = "") -> dict[str, Array]:
    """Return the numbers and lists of fixed length in a table and those in it, by dotted keys."""
    found: dict[str, Array] = {}
    for name, entry in table.items():
        key = f"{before}{name}"
        if isinstance(entry, Mapping):
            found |= _numbers(entry, f"{key}.")
        elif entry is not None:
            numbers = np.asarray(entry)
            fixed = not numbers.ndim or (numbers.ndim == 1 and len(_ends(key)) > 0)
            if numbers.dtype.kind in "biuf" and fixed and numbers.size:
                found[key] = numbers
    return found


def _check_columns(names: Sequence[str]) -> None:
    """Refuse names that no key of a summary has."""
    known, written = ([one.name for one in quantities(file)] for file in (SUMMARY, SWEEP))
    for name in names:
        top = name.partition(".")[0]
        if top not in known:
            words = "a column of each sweep" if top in written else "no key of summary.json"
            raise InputError(
                f"--columns {name}: {words}{nearest(top, known)}; accepted: {', '.join(known)}",
                "columns",
            )


def sweep(
    path: str | Path,
    axes: Sequence[Axis],
    folder: Path,
    overrides: Sequence[str] = (),
    monitor: Monitor | None = None,
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    warm: bool = True,
    columns: Sequence[str] = (),
) -> list[dict[str, Any]]:
    """Solve a case for all combinations of values; write a row of ``sweep.csv`` after each.

    The `overrides` replace values of the case file, and the last one of the `axes` varies fastest.
    If `warm`, each solve has the solution before as warm start; `columns` are further ones, as in
    `summary_columns`. Returns the rows; after a signal, which raises `Interrupted`, those before it
    are in the table. InputError if a value is not accepted, or the folder has a sweep of other
    input, or files that no sweep has left. Collective.
    """
    _check_columns(columns)
    names = [axis.key for axis in axes]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"--over {name}: stands there twice; accepted: each key once, with all its values",
                "over",
            )
    points = [
        dict(zip(names, values, strict=True))
        for values in itertools.product(*(axis.values for axis in axes))
    ]

    def load(point: Mapping[str, str], file: str | Path | None = None) -> Case:
        given = [*([] if file else overrides), *_set(point)]
        return load_case(file or path, given, folder=Path(path).parent)

    # All of them before the first is solved.
    cases = on_root(comm, lambda: [load(point) for point in points])
    inputs = on_root(comm, lambda: [_input(case) for case in cases])
    kept = on_root(comm, lambda: _kept_rows(folder, names, columns, points[0], load))
    rows: list[dict[str, Any]] = []
    tell(logger, 0.0, "%s", counted(len(cases), "case"))
    with stop_on_signal(comm, monitor) as stop:
        runner = _Runner(comm, stop, warm)
        for point, case, given in zip(points, cases, inputs, strict=True):
            row = kept.pop(tuple(point.values()), None)
            if row is None or row["converged"] != "True":
                begin = time.perf_counter()
                with naming_case(", ".join(_set(point))):
                    solution = runner.solve(case)
                if solution.outcome.signal:
                    raise Interrupted(solution.outcome.signal)
                seconds = comm.bcast(time.perf_counter() - begin)
                evaluate_extremes(solution, whole=len(columns) > 0)
                row = {**point, **values_of(SWEEP, solution)}
                more = summary_columns(solution, columns)
                row |= {name: value for name, value in more.items() if name not in row}
                row["seconds"] = seconds
                row[INPUT] = given
                said = f"{', '.join(_set(point))}: {solution.outcome.reason}"
                tell(logger, (len(rows) + 1) / len(cases), said)
            rows.append(row)
            # Rows that come later, or are not asked for, remain.
            on_root(comm, lambda: _write(folder, [*rows, *kept.values()], cases[0]))
    return rows


def _set(point: Mapping[str, str]) -> list[str]:
    return [f"{key}={value}" for key, value in point.items()]


def _input(case: Case) -> str:
    """Return short digests of the files that a case reads. On one rank."""
    return " ".join(f"{key}={value[:12]}" for key, value in digest(case).items())


def _kept_rows(
    folder: Path,
    names: list[str],
    columns: Sequence[str],
    first: Mapping[str, str],
    load: Callable[..., Case],
) -> dict[tuple[str, ...], dict[str, Any]]:
    """Return the rows that are there already, by the values of the keys. On one rank.

    Those of another sweep are refused: of other keys, files or columns, or another case, that of
    the `first` values; `load` returns the case of values, from the case file or from another.
    """
    table, before, where = folder / TABLE, folder / CASE, f"--out {folder}"
    header, rows = read_rows(table) if table.exists() else (COLUMNS, [])
    if not {*COLUMNS} <= {*header}:
        raise _refused(f"{table}: damaged, or no table of a sweep of this version")
    swept = [*itertools.takewhile(lambda column: column != "converged", rows[0] if rows else names)]
    if swept != names:
        raise _refused(
            f"{where}: given a sweep over other keys", f"one over {', '.join(swept)}, or "
        )
    for name in columns if rows else ():
        if not any(is_of(column, name) for column in rows[0]):
            words = f"--columns {name}: the rows of {table} have other columns"
            raise _refused(words, "columns that they have, or ")
    if before.exists():
        stored, given = (to_toml(load(first, file), anchored=True) for file in (before, None))
        check_same(where, "a sweep", stored, given, "the same, or another folder", frozenset())
    elif table.exists():
        raise _refused(f"{where}: given a {TABLE} without the {CASE} that a sweep leaves beside it")
    for row in rows:
        point = {name: row[name] for name in names}
        then, now = (
            dict(pair.partition("=")[::2] for pair in text.split())
            for text in (row[INPUT], _input(load(point)))
        )
        check_files(where, f"the row {', '.join(_set(point))} was computed", then, now)
    return {tuple(row[name] for name in names): row for row in rows}


def _refused(words: str, accepted: str = "") -> InputError:
    return InputError(f"{words}; accepted: {accepted}another folder", "sweep-table")


def _write(folder: Path, rows: Sequence[Mapping[str, Any]], first: Case) -> None:
    """Write the table, and the case of its first row before that, once there is one."""
    if any([*row] != [*rows[0]] for row in rows):
        raise _refused(
            f"{folder / TABLE}: its rows have other columns than those of this version, or other "
            "--columns"
        )
    if not (folder / CASE).exists():
        text = to_toml(first, anchored=True)
        write_whole(folder / CASE, lambda draft: draft.write_text(text, encoding="utf-8"))
    values = (row.values() for row in rows)
    write_whole(folder / TABLE, lambda draft: write_csv(draft, rows[0], values))


class _Runner:
    """Solves one case after the other, each with the mesh and factorisation of the last."""

    def __init__(self, comm: MPI.Intracomm, monitor: Monitor, warm: bool) -> None:
        self._comm, self._monitor, self._warm = comm, monitor, warm
        self._case: Case | None = None
        self._domain: Domain | None = None
        self._method: Method | None = None
        self._ends: list[tuple[ContactProblem, State]] = []

    def solve(self, case: Case) -> Solution:
        """Solve a case. Collective."""
        before, self._case = (self._case if self._warm else None), case
        with naming_case(case.source):
            if case.adapt is not None:
                return solve_adapted(case, self._comm, case.solver, self._monitor)
            if case.mesh is not None and (before is None or before.mesh != case.mesh):
                self._domain = case.mesh.build(self._comm)
            problem = build_problem(case, self._comm, domain=self._domain)
            if case.evolution is not None:
                solver = solver_of(case)
                return solve_problem(problem, case.solver, self._monitor, solver)
            method = self._method
            alike = method is not None and method.problem.frictional == problem.frictional
            if method is not None and before is not None and alike and _alike(before, case):
                method.set_load_step(problem)
            else:
                made = METHODS[case.solver.method]
                self._method = method = made(problem, self._settings(case), self._monitor)
                self._ends = []
            return self._static(problem, method)

    def _settings(self, case: Case) -> Options:
        """Return the method's options: the factorisation of a case may serve the next one."""
        if self._warm and isinstance(case.solver, NewtonOptions):
            return case.solver.model_copy(update={"reuse": "across"})
        return case.solver

    def _static(self, problem: ContactProblem, method: Method) -> Solution:
        """Solve a static case from those before it, and from zero where that fails. Collective."""
        counted, ends = replace(method.counters), self._ends
        solution = solve_static(problem, method, predicted(problem, ends) if ends else None)
        if ends and not solution.converged and not solution.outcome.signal:
            solution = solve_static(problem, method)
        self._ends = [*ends[-1:], (problem, solution.state)] if solution.converged else []
        check_potential(problem, solution.state)
        solution.counters = method.counters - counted
        return solution


def _alike(before: Case, case: Case) -> bool:
    """Tell whether two cases differ in loads, prescribed values and coefficients alone."""
    one, two = (
        given.model_dump(exclude=set(LIGHT))
        | {
            "friction": None if given.friction is None else given.friction.law,
            "fixed": [(fixed.on, [*fixed.given]) for fixed in given.fixed],
        }
        for given in (before, case)
    )
    return bool(one == two)
