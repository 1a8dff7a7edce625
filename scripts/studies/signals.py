"""Runs that are ended by signals: the earlier result or the new one is there whole, always.

`python3 -m scripts.studies.signals [--out DIR] [--coarse] [--count N] [--first K] [--kills N]`. One
bar is solved again and again into one folder, each time under another load, on one rank and on two.
Half of the runs get their signal (SIGINT, SIGTERM or SIGKILL, with two ranks sent to the launcher)
at a random time, half while they write. Each result is then held against its own load, and no
process may be left.

Then evolutions with friction are killed at random times, on one rank and on two, and go on from
their checkpoints on one, two or three; one is killed again and again, on 1, 2 and 3 ranks, and ends
on 1. Others get SIGINT or SIGTERM. Their steps are held against those of a run that nothing
interrupts; the counts of solves are not: who goes on factorises once more.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.io.folder import STAGE, SUMMARY, recover
from scripts.reporting import Report, append, parser

COUNT, COARSE_COUNT, SEED = 120, 8, 23
KILLS, COARSE_KILLS = 20, 2
CASES = Path(__file__).parents[1] / "cases"
SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGKILL
#: Seconds that a run may need to end after its signal, and a whole one.
GRACE, LIMIT = 60.0, 300.0
#: Largest difference between steps with and without a restart, relative to the largest number.
AGREE = 1e-10


def command(folder: Path, number: int, ranks: int) -> list[str]:
    """Return the command that solves the bar under its load."""
    settings = {
        "title": f"run {number}",
        "mesh.cells": "[32, 8]",
        "load.0.traction.1": repr(load_of(number)),
        "friction.mu": "0.3",
        "solver.method": "newton",
    }
    given = [str(CASES / "bar.toml"), "--out", str(folder), "--plot", "--overwrite"]
    return solving(ranks, given, settings)


def solving(ranks: int, given: Sequence[str], settings: Mapping[str, str]) -> list[str]:
    """Return a command that solves on some ranks."""
    launcher = [] if ranks == 1 else ["mpirun", "--oversubscribe", "-n", str(ranks)]
    pairs = [f"--set={key}={value}" for key, value in settings.items()]
    run = [sys.executable, "-m", "contact", "solve", *given, *pairs, "--quiet"]
    return [*launcher, *run]


def evolution(folder: Path, ranks: int) -> list[str]:
    """Return the command that begins an evolution, or goes on with it."""
    if any(folder.glob("checkpoints*/0*.npz")):
        return solving(ranks, ["--restart", str(folder)], {})
    settings = {
        "mesh.cells": "[16, 8]",
        "evolution.steps": "[2, 3, 6, 6]",
        "solver.tolerance": "1e-12",
        "output.fields": '"none"',
    }
    given = [str(CASES / "fretting.toml"), "--out", str(folder), "--overwrite"]
    return solving(ranks, given, settings)


def load_of(number: int) -> float:
    """Return the traction of a run."""
    return -0.001 * (1 + number % 7)


def processes(session: int) -> list[int]:
    """Return the processes of a session that have not ended."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(entry.name))
    return found


def wait_until_writing(process: subprocess.Popen[bytes], folder: Path) -> None:
    """Wait until a run has begun to write."""
    while process.poll() is None and not (folder / STAGE).exists():
        time.sleep(0.001)


def wait_for_step(process: subprocess.Popen[bytes], folder: Path, count: int) -> None:
    """Wait until a run has left some checkpoints."""
    file = folder / "checkpoints" / f"{count:05d}.npz"
    while process.poll() is None and count > 0 and not file.exists():
        time.sleep(0.001)


def disturbed(
    started: list[str],
    kind: signal.Signals,
    delay: float,
    wait: Callable[[subprocess.Popen[bytes]], None] | None = None,
) -> tuple[int, int]:
    """Run and send a signal; return the status and how many processes are left after it."""
    process = subprocess.Popen(
        started, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    if wait is not None:
        wait(process)
    time.sleep(delay)
    if process.poll() is None:
        process.send_signal(kind)
    status = process.wait(timeout=LIMIT)
    end = time.monotonic() + GRACE
    while (left := processes(process.pid)) and time.monotonic() < end:
        time.sleep(0.05)
    for pid in left:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)
    while processes(process.pid):
        time.sleep(0.05)
    return status, len(left)


def fault(folder: Path, accepted: set[int]) -> str:
    """Return the fault of a folder; nothing if it holds one run's whole result."""
    recover(folder)
    try:
        summary = json.loads((folder / SUMMARY).read_text())
    except OSError:
        return "no summary"
    number = int(summary["title"].rpartition(" ")[2])
    if number not in accepted:
        return f"the result of run {number}"
    missing = [name for name in summary["files"] if not (folder / name).exists()]
    if missing:
        return f"{', '.join(missing)} missing"
    with (folder / "contact.csv").open() as stream:
        largest = max(float(row["pressure"]) for row in csv.DictReader(stream))
    if not np.isclose(largest, summary["max_pressure"], rtol=1e-9):
        return "contact.csv of another run"
    return ""


def table(path: Path) -> dict[str, NDArray[Any]]:
    """Return the columns of a CSV file; those of the costs are left out."""
    with path.open() as stream:
        rows = list(csv.DictReader(stream))
    counts = "linear_solves", "factorizations", "kkt"
    return {name: np.array([row[name] for row in rows]) for name in rows[0] if name not in counts}


def difference(one: Path, other: Path) -> float:
    """Return the largest difference between columns of two files, over the largest number there."""
    first, second = table(one), table(other)
    if {name: len(column) for name, column in first.items()} != {
        name: len(column) for name, column in second.items()
    }:
        return np.inf
    largest = 0.0
    for name, column in first.items():
        if name == "status":
            largest = max(largest, float(np.any(column != second[name])))
            continue
        a, b = column.astype(float), second[name].astype(float)
        largest = max(largest, float(np.abs(a - b).max() / (np.abs(a).max() or 1.0)))
    return largest


def converged(folder: Path) -> bool:
    """Whether an evolution has come to its end."""
    with suppress(OSError):
        return bool(json.loads((folder / SUMMARY).read_text())["converged"])
    return False


def ended(folder: Path, count: int, rng: np.random.Generator) -> dict[str, list[Any]]:
    """End evolutions, let them go on, and return how far their steps are from those of one."""
    whole = folder / "whole"
    begin = time.monotonic()
    subprocess.run(evolution(whole, 1), check=True, stdout=subprocess.DEVNULL)
    seconds, most = time.monotonic() - begin, len(table(whole / "steps.csv")["t"])
    rows: dict[str, list[Any]] = {
        name: []
        for name in ("run", "signal", "ranks", "statuses", "steps left", "left", "difference")
    }
    ways = [(signal.SIGKILL, [1 + k % 2, int(rng.integers(1, 4))]) for k in range(count)]
    ways.append((signal.SIGKILL, [1, 2, 3, 1]))
    for k in range(count // 2):
        kind = (signal.SIGINT, signal.SIGTERM)[k // 2 % 2]
        ways.append((kind, [1 + k % 2, int(rng.integers(1, 4))]))
    for number, (kind, way) in enumerate(ways):
        run, statuses, steps, left = folder / f"evolution-{number}", [], [], 0
        for ranks in way[:-1]:
            # Loading the libraries takes most of the time: moments are drawn between steps.
            before = int(rng.integers(most)) if len(way) == 2 else sum(steps[-1:]) + 2
            wait = partial(wait_for_step, folder=run, count=before)
            delay = rng.uniform(0.0, seconds if before == 0 else seconds / most)
            status, remain = disturbed(evolution(run, ranks), kind, delay, wait)
            statuses, left = [*statuses, status], left + remain
            steps.append(len(list(run.glob("checkpoints/0*.npz"))))
        if not converged(run):
            subprocess.run(evolution(run, way[-1]), check=True, stdout=subprocess.DEVNULL)
        far = max(difference(whole / f, run / f) for f in ("steps.csv", "contact-steps.csv"))
        lists = (" ".join(map(str, these)) for these in (way, statuses, steps))
        row = (number, kind.name, *lists, left, far)
        print(*row, flush=True)
        append(rows, *row)
        shutil.rmtree(run)
    return rows


def main(arguments: Sequence[str] | None = None) -> int:
    """Disturb runs and look at their results."""
    options = parser(__doc__, "signals")
    options.add_argument("--count", type=int, help="number of signals to the bar")
    options.add_argument("--first", type=int, default=0, help="number of the first of them")
    options.add_argument("--kills", type=int, help="number of evolutions to kill")
    given = options.parse_args(arguments)
    count = (COARSE_COUNT if given.coarse else COUNT) if given.count is None else given.count
    kills = (COARSE_KILLS if given.coarse else KILLS) if given.kills is None else given.kills
    rng, folder = np.random.default_rng(SEED), given.out / "runs"
    begin = time.monotonic()
    subprocess.run(command(folder, 0, 1), check=True, stdout=subprocess.DEVNULL)
    seconds, before = time.monotonic() - begin, 0
    columns = ("run", "ranks", "signal", "writing", "status", "fault")
    rows: dict[str, list[Any]] = {name: [] for name in columns}
    ends = Counter[str]()
    delays = rng.uniform(size=count)
    for number in range(given.first + 1, count + 1):
        ranks, kind = 1 + number % 2, SIGNALS[number // 2 % 3]
        writing = bool(number // 6 % 2)
        delay = float(delays[number - 1] * (0.5 if writing else seconds))
        wait = partial(wait_until_writing, folder=folder) if writing else None
        status, left = disturbed(command(folder, number, ranks), kind, delay, wait)
        wrong = fault(folder, {before, number}) or (f"{left} processes left" if left else "")
        before = int(json.loads((folder / "summary.json").read_text())["title"].split()[1])
        topic = "new result" if before == number else "earlier result"
        ends[f"{ranks} rank(s), {kind.name}, status {status}, {topic}"] += 1
        if wrong:
            row = (number, ranks, kind.name, writing, status, wrong)
            print(*row, flush=True)
            append(rows, *row)
    for end, times in sorted(ends.items()):
        print(f"{times:4d}  {end}")
    Report(given.out).table("signals", f"Faults after {count - given.first} signals", rows)
    steps = ended(given.out / "evolutions", kills, rng)
    Report(given.out).table("evolutions", f"Evolutions that went on, {kills} after SIGKILL", steps)
    far = max(steps["difference"]) > AGREE or any(steps["left"])
    return 1 if rows["run"] or far else 0


if __name__ == "__main__":
    sys.exit(main())
