"""Runs that are ended by signals: the earlier result or the new one is there whole, always.

`python3 -m scripts.studies.signals [--out DIR] [--coarse] [--count N]`. One bar is solved again and
again into one folder, each time under another load, on one rank and on two. Half of the runs get
their signal (SIGINT, SIGTERM or SIGKILL, with two ranks sent to the launcher) at a random time,
half while they write. Each result is then held against its own load, and no process may be left.
"""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from contact.output import transaction
from scripts.reporting import Report, append, parser

COUNT, COARSE_COUNT, SEED = 120, 8, 23
CASE = Path(__file__).parents[1] / "cases/bar.toml"
SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGKILL
#: Seconds that a run may need to end after its signal, and a whole one.
GRACE, LIMIT = 60.0, 300.0


def command(folder: Path, number: int, ranks: int) -> list[str]:
    """Return the command that solves the bar under its load."""
    launcher = [] if ranks == 1 else ["mpirun", "--oversubscribe", "-n", str(ranks)]
    settings = {
        "title": f"run {number}",
        "mesh.cells": "[32, 8]",
        "load.0.traction.1": repr(load_of(number)),
        "friction.mu": "0.3",
        "solver.method": "newton",
    }
    pairs = [f"--set={key}={value}" for key, value in settings.items()]
    run = [sys.executable, "-m", "contact", "solve", str(CASE), "--out", str(folder), *pairs]
    return [*launcher, *run, "--quiet", "--plot", "--overwrite"]


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
    while process.poll() is None and not (folder / transaction.STAGE).exists():
        time.sleep(0.001)


def disturbed(
    folder: Path, number: int, ranks: int, kind: signal.Signals, writing: bool, delay: float
) -> tuple[int, int]:
    """Run and send a signal; return the status and how many processes are left after it."""
    started = command(folder, number, ranks)
    process = subprocess.Popen(
        started, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    if writing:
        wait_until_writing(process, folder)
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
    """Say what is wrong with what stands in a folder; nothing if it is one run's whole result."""
    transaction.recover(folder)
    try:
        summary = json.loads((folder / transaction.SUMMARY).read_text())
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Disturb runs and look at what they leave."""
    options = parser(__doc__, "signals")
    options.add_argument("--count", type=int, help="number of signals")
    given = options.parse_args(arguments)
    count = given.count or (COARSE_COUNT if given.coarse else COUNT)
    rng, folder = np.random.default_rng(SEED), given.out / "runs"
    begin = time.monotonic()
    subprocess.run(command(folder, 0, 1), check=True, stdout=subprocess.DEVNULL)
    seconds, before = time.monotonic() - begin, 0
    columns = ("run", "ranks", "signal", "writing", "status", "fault")
    rows: dict[str, list[Any]] = {name: [] for name in columns}
    ends = Counter[str]()
    for number in range(1, count + 1):
        ranks, kind = 1 + number % 2, SIGNALS[number // 2 % 3]
        writing = bool(number // 6 % 2)
        delay = float(rng.uniform(0.0, 0.5 if writing else seconds))
        status, left = disturbed(folder, number, ranks, kind, writing, delay)
        wrong = fault(folder, {before, number}) or (f"{left} processes left" if left else "")
        before = int(json.loads((folder / "summary.json").read_text())["title"].split()[1])
        what = "new result" if before == number else "earlier result"
        ends[f"{ranks} rank(s), {kind.name}, status {status}, {what}"] += 1
        if wrong:
            row = (number, ranks, kind.name, writing, status, wrong)
            print(*row, flush=True)
            append(rows, *row)
    for end, times in sorted(ends.items()):
        print(f"{times:4d}  {end}")
    Report(given.out).table("signals", f"Faults after {count} signals", rows)
    return 1 if rows["run"] else 0


if __name__ == "__main__":
    sys.exit(main())
