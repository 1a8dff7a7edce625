"""Damaged files of checkpoints, sweeps and results: a message, or a restart that says from where.

`python3 -m scripts.studies.damaged_files [--out DIR] [--coarse] [--count N] [--only NUMBER]`.
A file of a folder that a run, a sweep or a killed evolution has left is cut off, has a bit turned,
is emptied, replaced by another file or by a folder, lacks arrays, members, lines or columns, or is
gone. Each command on it runs in a process of its own: it ends with one message and leaves all files
as they are, or succeeds; a traceback is a fault.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import solve
from contact.case.file import parse_case
from contact.case.text import to_toml
from contact.cli.main import main as command_line
from scripts.reporting import Report, append, parser
from scripts.studies.mutations import fault, started

COUNT, SEED = 200, 7

CASE: dict[str, Any] = {
    "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [6, 3]},
    "material": {"law": "linear", "young": 1.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": ["0.01*t", "-0.01*t"]}],
    "contact": {"on": "bottom"},
    "friction": {"law": "coulomb", "mu": 0.3},
    "evolution": {"times": [0.0, 1.0], "steps": [3]},
}

#: Command -> the files of its folder that are damaged.
FILES = {
    "restart": [
        "checkpoints/00001.npz", "checkpoints/00002.npz", "checkpoints/00003.npz",
        "checkpoints/nodes.npz", "checkpoints/case.toml", "checkpoints/manifest.json",
    ],
    "sweep": ["sweep.csv", "sweep.toml"],
    "plot": [
        "summary.json", "contact.csv", "steps.csv", "contact-steps.csv", "history.csv",
        "fields.vtu", "contact.vtu",
    ],
    "solve": ["summary.json", "contact.csv", "fields.pvd"],
}  # fmt: skip

Rng = np.random.Generator
Damage = Callable[[Path, Rng], None]


def truncate(path: Path, rng: Rng) -> None:
    """Leave the beginning of a file."""
    data = path.read_bytes()
    path.write_bytes(data[: int(rng.integers(len(data)))])


def flip(path: Path, rng: Rng) -> None:
    """Turn one bit."""
    data = bytearray(path.read_bytes())
    data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)


def empty(path: Path, rng: Rng) -> None:
    """Leave nothing of a file."""
    path.write_bytes(b"")


def gone(path: Path, rng: Rng) -> None:
    """Remove a file."""
    path.unlink()


def folder(path: Path, rng: Rng) -> None:
    """Put a folder in the place of a file."""
    path.unlink()
    path.mkdir()


def other(path: Path, rng: Rng) -> None:
    """Put another file there: of another kind, or of the same folder."""
    beside = [file.read_bytes() for file in sorted(path.parent.iterdir()) if file.is_file()]
    choices = [b"\x89PNG\r\n\x1a\n" + bytes(40), b"x = 1\n", b"[1, 2]", b"a,b\n1\n", *beside]
    path.write_bytes(choices[int(rng.integers(len(choices)))])


def noise(path: Path, rng: Rng) -> None:
    """Write some bytes over others."""
    data = bytearray(path.read_bytes())
    begin = int(rng.integers(max(1, len(data) - 8)))
    data[begin : begin + 8] = rng.bytes(8)
    path.write_bytes(data)


def members(path: Path, rng: Rng) -> None:
    """Take out, or replace, a member: an array, a key, a column or a line. Checksums are mended."""
    if path.suffix == ".npz":
        arrays = dict(np.load(path))
        name = sorted(arrays)[int(rng.integers(len(arrays)))]
        kept = {key: array for key, array in arrays.items() if key != name}
        if rng.random() < 0.5:
            kept[name] = np.zeros(int(rng.integers(4)))
        file = io.BytesIO()
        np.savez(file, **kept)
        path.write_bytes(file.getvalue())
    elif path.suffix == ".json":
        table = json.loads(path.read_text())
        key = sorted(table)[int(rng.integers(len(table)))]
        new = [None, 3, "x", [], {}][int(rng.integers(5))]
        table[key] = new
        if rng.random() < 0.4:
            del table[key]
        path.write_text(json.dumps(table))
    elif path.suffix == ".csv":
        with path.open(newline="") as stream:
            rows = list(csv.reader(stream))
        k = int(rng.integers(len(rows[0])))
        for row in rows if rng.random() < 0.5 else rows[1:]:
            del row[k]
        path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    else:
        lines = path.read_text().splitlines()
        del lines[int(rng.integers(len(lines)))]
        path.write_text("\n".join(lines) + "\n")
    manifest = path.with_name("manifest.json")
    if manifest.exists() and path != manifest:
        listed = json.loads(manifest.read_text())
        listed["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
        manifest.write_text(json.dumps(listed))


DAMAGES: tuple[Damage, ...] = (truncate, flip, empty, gone, folder, other, noise, members, members)


def templates(place: Path) -> dict[str, Path]:
    """Write the folders that are damaged, and the case beside them; return them by command."""
    case = parse_case(CASE)
    file = place / "case.toml"
    file.write_text(to_toml(case))
    found = {command: place / command for command in FILES}
    solve(case, comm=MPI.COMM_SELF, folder=found["restart"])
    for command in ("plot", "solve"):
        command_line(["solve", str(file), "--out", str(found[command]), "--quiet"])
    command_line([*_sweep(file, found["sweep"]), "--quiet"])
    return found


def _sweep(file: Path, folder: Path) -> list[str]:
    return ["sweep", str(file), "--over", "friction.mu=0.1,0.3", "--out", str(folder)]


def contents(place: Path) -> dict[str, bytes | None]:
    """Return all files of a folder by their names; None for folders."""
    return {
        str(path.relative_to(place)): path.read_bytes() if path.is_file() else None
        for path in place.rglob("*")
    }


def tried(number: int, made: dict[str, Path], scratch: Path) -> tuple[str, int | str, str, str]:
    """Damage a file, run its command; return both in words, the status, the fault, and the text."""
    rng = np.random.default_rng([SEED, number])
    command = str(rng.choice(list(FILES), p=[0.45, 0.25, 0.2, 0.1]))
    name = FILES[command][int(rng.integers(len(FILES[command])))]
    damage = DAMAGES[int(rng.integers(len(DAMAGES)))]
    place = scratch / str(number)
    shutil.copytree(made[command], place)
    if (place / name).exists():
        damage(place / name, rng)
    before, file = contents(place), made[command].parent / "case.toml"
    arguments = {
        "restart": ["solve", "--restart", str(place), "--quiet"],
        "sweep": [*_sweep(file, place), "--quiet"],
        "plot": ["plot", str(place)],
        "solve": ["solve", str(file), "--out", str(place), "--quiet"],
    }[command]
    status, said, _ = started(arguments)
    after, wrong = contents(place), fault(status, said)
    lost = sorted(set(before) - set(after))
    if command == "restart" and status == 0:  # checkpoints make room for results
        lost = [name for name in lost if not name.startswith("checkpoints")]
    if status == 2 and before != after:
        lost += sorted(key for key in before if before[key] != after.get(key, b""))
    if lost and not wrong:
        wrong = f"lost or changed: {', '.join(lost)}"
    shutil.rmtree(place)
    return f"{command} {name} {damage.__name__}", status, wrong, said


def main(arguments: Sequence[str] | None = None) -> int:
    """Damage files, run the commands, and list endings that are not accepted."""
    command = parser(__doc__, "damaged_files")
    command.add_argument("--count", type=int, help="number of damaged files")
    command.add_argument("--only", type=int, help="number of one of them")
    given = command.parse_args(arguments)
    numbers = range(given.count or (10 if given.coarse else COUNT))
    rows: dict[str, list[Any]] = {name: [] for name in ("number", "damage", "status", "fault")}
    ends = Counter[str]()
    with tempfile.TemporaryDirectory() as scratch:
        made = templates(Path(scratch))
        for number in numbers if given.only is None else [given.only]:
            words, status, wrong, said = tried(number, made, Path(scratch))
            ends[f"{words.split()[0]} {status}"] += 1
            if wrong or given.only is not None:
                append(rows, number, words, str(status), wrong)
                print(number, words, status, wrong, said.strip()[-1500:], sep="\n  ", flush=True)
    table = {"command and exit status": sorted(ends), "files": [ends[end] for end in sorted(ends)]}
    report = Report(given.out)
    report.table("damaged-files", f"Ends of {len(numbers)} damaged files", table)
    report.numbers("damaged-files-faults", rows)
    return 1 if any(rows["fault"]) else 0


if __name__ == "__main__":
    sys.exit(main())
