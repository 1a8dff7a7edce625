"""Golden numbers: small problems of all kinds, compared with a stored table to nine digits.

`python3 -m scripts.golden [--only NAME ...] [--renew] [--processes N]`, also under mpirun, where
all ranks solve each problem together. NAME may have the wild cards of a shell. The table is
`scripts/golden.csv`, the problems are in `scripts/golden_problems.py`, their values in
`scripts/golden_values.py`. A refactoring does not move these numbers. Stored values change, by
--renew, in a commit of their own that says why; values within the tolerance stay as they are.
Another version of Gmsh than that of the table makes other meshes: problems on these are named, and
not compared.
"""

from __future__ import annotations

import argparse
import csv
import logging
import math
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatchcase
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

from scripts.golden_problems import PROBLEMS
from scripts.golden_values import Value, Values

TABLE = Path(__file__).with_suffix(".csv")

#: Largest difference relative to the scale of a quantity.
TOLERANCE = 1e-9

#: Version of Gmsh that has made the meshes of the table.
GMSH = "4.13"

#: Digits of a stored value: some more than the tolerance has.
DIGITS = 13


class Difference(NamedTuple):
    """A row of the report."""

    problem: str
    quantity: str
    stored: str
    now: str
    relative: str


def compare(stored: Mapping[str, Values], found: Mapping[str, Values]) -> list[Difference]:
    """Return all differences: of values, and rows that the table or the problems have alone."""
    differences = []
    for problem in sorted({*stored, *found}):
        old, new = stored.get(problem, {}), found.get(problem, {})
        if "failed" in new:  # which tells more than all values that are missing
            old = {}
        for quantity in sorted({*old, *new}):
            relative = difference(old.get(quantity), new.get(quantity))
            if not relative <= TOLERANCE:
                texts = [text(values.get(quantity)) for values in (old, new)]
                told = "" if math.isnan(relative) or math.isinf(relative) else f"{relative:.1e}"
                differences.append(Difference(problem, quantity, *texts, told))
    return differences


def on_other_meshes(stored: Mapping[str, Values], found: Mapping[str, Values]) -> set[str]:
    """Return the problems whose meshes another version of Gmsh has made than that of the table."""
    import gmsh

    if gmsh.__version__.startswith(f"{GMSH}."):
        return set()
    pairs = (
        (name, stored[name].get("mesh"), found[name].get("mesh")) for name in stored.keys() & found
    )
    return {name for name, old, new in pairs if old and new and old != new}


def difference(stored: Value | None, now: Value | None) -> float:
    """Return a difference relative to the scale; infinity where no number tells it."""
    if stored is None or now is None:
        return math.inf
    numbers = [value.value for value in (stored, now) if isinstance(value.value, float)]
    if len(numbers) < 2 or not stored.scale:
        return 0.0 if stored.value == now.value else math.inf
    return abs(numbers[1] - numbers[0]) / stored.scale


def text(value: Value | None) -> str:
    """Return a value as the table has it."""
    if value is None:
        return "none"
    return f"{value.value:.{DIGITS - 1}e}" if isinstance(value.value, float) else str(value.value)


def read(path: Path) -> dict[str, dict[str, Value]]:
    """Return the stored values by problem and quantity."""
    found: dict[str, dict[str, Value]] = {}
    if path.exists():
        with path.open(encoding="utf-8", newline="") as stream:
            for row in csv.DictReader(stream):
                found.setdefault(row["problem"], {})[row["quantity"]] = _parsed(
                    row["value"], row["scale"]
                )
    return found


def _parsed(value: str, scale: str) -> Value:
    """Return a value of the table: a number has a scale, a count or a word none."""
    if scale:
        return Value(float(value), float(scale))
    return Value(int(value) if value.lstrip("-").isdigit() and len(value) < 12 else value)


def write(values: Mapping[str, Values], path: Path) -> None:
    """Write the table."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["problem", "quantity", "value", "scale"])
        for problem in sorted(values):
            for quantity, value in sorted(values[problem].items()):
                scale = f"{value.scale:.3e}" if isinstance(value.value, float) else ""
                writer.writerow([problem, quantity, text(value), scale])


def renewed(
    stored: Mapping[str, Values], found: Mapping[str, Values]
) -> dict[str, dict[str, Value]]:
    """Return the values found, those of the table where they are the same."""
    kept: dict[str, dict[str, Value]] = {}
    for problem, values in found.items():
        old = stored.get(problem, {})
        kept[problem] = {
            quantity: old[quantity] if difference(old.get(quantity), value) <= TOLERANCE else value
            for quantity, value in values.items()
        }
    return kept


def values_of(name: str) -> tuple[dict[str, Value], float]:
    """Solve a problem; return its values, and the seconds. Collective."""
    logging.getLogger("contact").setLevel(logging.ERROR)
    begin = time.perf_counter()
    try:
        values = PROBLEMS[name]()
    except Exception as error:  # one problem that fails leaves the others
        values = {"failed": Value(f"{type(error).__name__}: {error}")}
    return values, time.perf_counter() - begin


def _solved(names: Sequence[str], processes: int) -> Iterator[tuple[str, dict[str, Value], float]]:
    """Return name, values and seconds of each problem as it is solved."""
    if processes == 1:
        for name in names:
            yield name, *values_of(name)
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(values_of, name): name for name in names}
        for done in as_completed(waiting):
            yield waiting[done], *done.result()


def chosen(patterns: Sequence[str], known: Sequence[str]) -> list[str]:
    """Return the problems of some names or patterns; all of them without."""
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in known):
            raise ValueError(f"--only {pattern}: no such problem; accepted: {', '.join(known)}")
    return [
        name
        for name in known
        if not patterns or any(fnmatchcase(name, pattern) for pattern in patterns)
    ]


def report(differences: Sequence[Difference]) -> str:
    """Return the differences as a table."""
    rows = [Difference("problem", "quantity", "stored", "now", "relative"), *differences]
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = ("  ".join(x.ljust(w) for x, w in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(line.rstrip() for line in lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve the problems, and compare them with the table, or renew it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", action="extend", default=[], metavar="NAME")
    parser.add_argument("--renew", action="store_true", help="store the values of these problems")
    parser.add_argument("--processes", type=int, default=min(2, os.cpu_count() or 1))
    given = parser.parse_args(arguments)
    if given.processes < 1:
        parser.error(f"--processes {given.processes}; accepted: a whole number from 1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # before anything loads the BLAS
    from mpi4py import MPI

    ranks, root = MPI.COMM_WORLD.size, MPI.COMM_WORLD.rank == 0
    try:
        names = chosen(given.only, list(PROBLEMS))
    except ValueError as error:
        parser.error(str(error))
    found: dict[str, dict[str, Value]] = {}
    begin = time.perf_counter()
    for name, values, seconds in _solved(names, given.processes if ranks == 1 else 1):
        found[name] = values
        if root:
            print(f"{seconds:6.1f} s  {name}", flush=True)
    stored = read(TABLE)
    others = {k: v for k, v in stored.items() if k not in found and (given.only or k in PROBLEMS)}
    stored_here = {k: v for k, v in stored.items() if k not in others}
    remeshed = on_other_meshes(stored_here, found)
    differences = [row for row in compare(stored_here, found) if row.problem not in remeshed]
    status = 0
    if root:
        count = sum(map(len, found.values()))
        if remeshed:
            names = ", ".join(sorted(remeshed))
            print(f"not compared, as this version of Gmsh is not {GMSH}: meshes of {names}")
        print(f"{len(found)} problems, {count} values: {time.perf_counter() - begin:.0f} s")
        if differences:
            print(report(differences))
            print(f"{len(differences)} values differ by more than {TOLERANCE:g}")
            status = 1
        if given.renew:
            failed = {name for name, values in found.items() if "failed" in values}
            if failed or remeshed:
                names = ", ".join(sorted(failed | remeshed))
                print(f"stored values stay, for these failed or are on other meshes: {names}")
            stay = {k: v for k, v in stored_here.items() if k in failed | remeshed}
            new = {k: v for k, v in found.items() if k not in failed | remeshed}
            write({**others, **renewed(stored_here, new), **stay}, TABLE)
            status = bool(failed)
    return MPI.COMM_WORLD.bcast(int(status))


if __name__ == "__main__":
    sys.exit(main())
