"""Damaged case files: each has to end with status 0, 1 or 2, in one line, within its time.

Or to say beforehand that it takes long: a mesh of millions of cells may be wanted.

`python3 -m scripts.studies.mutations [--out DIR] [--coarse] [--count N] [--seed S] [--first K]`.
The shipped cases, on small meshes, are damaged by one to three random mutations each, and solved.
Every run is a process of its own, forked from one that has the libraries loaded.
"""

from __future__ import annotations

import os
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contact.cli.main import main as command_line
from scripts.reporting import Report, append, parser

COUNT, COARSE_COUNT, SEED = 9000, 60, 19
#: Seconds that a run may compute, and last on a busy machine.
LIMIT, LONGEST = 60, 900.0

CASES = sorted(Path(__file__).parents[1].glob("cases/*.toml"))
#: Changes that make the shipped meshes small.
SMALL = (
    (re.compile(r"^cells = \[\d+, \d+\]", re.M), "cells = [12, 4]"),
    (re.compile(r"^cells = \[\d+, \d+, \d+\]", re.M), "cells = [4, 2, 2]"),
    (re.compile(r"^(contact_)?size = 0\.\d+", re.M), r"\1size = 0.8"),
    (re.compile(r"^(contact_size) = [\d.]+", re.M), r"\1 = 0.8"),
)
#: The words before a mesh is made that takes long.
FORESEEN = re.compile(r"^warning: mesh: .* take", re.M)
TOO_LONG = "too long"

NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?([eE][-+]?\d+)?(?![\w.])")
STRING = re.compile(r'"[^"\n]*"')
KEY = re.compile(r"^[A-Za-z_]\w*(?= *=)", re.M)

NUMBERS = (
    *("0", "-1", "1", "2.5", "0.5", "-0.5", "3", "7", "1e-3", "1e3", "1e-9", "1e9", "1e-300"),
    *("1e300", "1e999", "5e-324", "nan", "inf", "-inf", "9" * 40, "9" * 400, "0x" + "f" * 500),
    *(
        '"0.3"',
        '"free"',
        '""',
        "true",
        "[]",
        "[1.0]",
        "[0, 0, 0, 0]",
        "{}",
        "{ a = 1 }",
        "1979-05-27",
    ),
)
STRINGS = (
    *('""', '"none"', '"x"', '"left"', '"bottom"', '"top"', '"linear"', '"log"', '"free"', '"\\n"'),
    *('"sin(x)"', '"1/0"', '"x +"', '"y**-1"', '"sqrt(-1 - x**2)"', '"log(0*x)"', '"t"', '"1e400"'),
    *(
        "\"__import__('os')\"",
        '"' + "a" * 4000 + '"',
        '"' + "(" * 400 + '"',
        "3",
        "[]",
        "true",
        '"\u00e9"',
    ),
)
INSERTED = (
    *(
        "unknown = 1",
        "[unknown]",
        "[[load]]",
        "[[fixed]]",
        "[contact]",
        "[solver]",
        "= 3",
        "[",
        "]]",
    ),
    *(
        'on = "left"',
        "young = 2.0",
        "\x00",
        "\u2028",
        "a" * 3000,
        '"" = 1',
        '"a\\nb" = 2',
        "a.b.c = 1",
    ),
    *("[solver]\nmethod = 'uzawa'", "[solver]\nmethod = 'penalty'", "[friction]\nlaw = 'tresca'"),
    *("[electric]\nlaw = 'ramp'", "[space]\ndegree = 2", "[space]\ndegree = 3", "[material.piezo]"),
)


def _replace(pattern: re.Pattern[str], choices: tuple[str, ...]) -> Callable[..., str]:
    def mutate(text: str, rng: np.random.Generator) -> str:
        found = list(pattern.finditer(text))
        if not found:
            return text
        at = found[rng.integers(len(found))]
        return text[: at.start()] + choices[rng.integers(len(choices))] + text[at.end() :]

    return mutate


def _scale(text: str, rng: np.random.Generator) -> str:
    """Multiply a number, but for those of cells, by a power of ten or minus one."""
    found = [m for m in NUMBER.finditer(text) if "cells" not in text[: m.end()].rsplit("\n", 1)[-1]]
    if not found:
        return text
    at = found[rng.integers(len(found))]
    factor = float(rng.choice([-1.0, 1e-6, 1e-2, 0.1, 10.0, 1e2, 1e6]))
    return text[: at.start()] + repr(float(at.group()) * factor) + text[at.end() :]


def _misspell(text: str, rng: np.random.Generator) -> str:
    found = list(KEY.finditer(text))
    if not found:
        return text
    at = found[rng.integers(len(found))]
    word = at.group()
    i = int(rng.integers(len(word)))
    wrong = str(rng.choice([word[:i] + word[i + 1 :], word[: i + 1] + word[i:], word.upper()]))
    return text[: at.start()] + wrong + text[at.end() :]


def _lines(text: str, rng: np.random.Generator) -> str:
    """Leave out, repeat, exchange or insert a line, or end the file there."""
    lines = text.splitlines()
    if not lines:
        return text
    i, j = (int(k) for k in rng.integers(len(lines), size=2))
    match rng.choice(["drop", "repeat", "swap", "insert", "end"], p=[0.4, 0.1, 0.2, 0.25, 0.05]):
        case "drop":
            del lines[i]
        case "repeat":
            lines.insert(j, lines[i])
        case "swap":
            lines[i], lines[j] = lines[j], lines[i]
        case "insert":
            lines.insert(i, INSERTED[rng.integers(len(INSERTED))])
        case _:
            return "\n".join(lines[:i]) + lines[i][: len(lines[i]) // 2]
    return "\n".join(lines) + "\n"


def _byte(text: str, rng: np.random.Generator) -> str:
    i = int(rng.integers(len(text) + 1))
    return text[:i] + chr(int(rng.integers(256))) + text[i + 1 :]


MUTATIONS: tuple[Callable[..., str], ...] = (
    _replace(NUMBER, NUMBERS),
    _replace(NUMBER, NUMBERS),
    _replace(STRING, STRINGS),
    _scale,
    _scale,
    _misspell,
    _lines,
    _lines,
    _byte,
)


def damaged(number: int, seed: int) -> tuple[str, str]:
    """Return the name of a shipped case and its text with one to three mutations."""
    rng = np.random.default_rng([seed, number])
    path = CASES[rng.integers(len(CASES))]
    text = path.read_text()
    for pattern, small in SMALL:
        text = pattern.sub(small, text)
    for _ in range(int(rng.integers(1, 4))):
        text = MUTATIONS[rng.integers(len(MUTATIONS))](text, rng)
    return path.stem, text


def run(file: Path, folder: Path) -> tuple[int | str, str, float]:
    """Solve a case in a child; return its status or its signal, its messages and seconds."""
    return started(["solve", str(file), "--out", str(folder), "--quiet"])


def started(arguments: Sequence[str]) -> tuple[int | str, str, float]:
    """Run a command in a child; return its status or its signal, its messages and seconds."""
    begin = time.monotonic()
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            sys.stdout = sys.stderr = os.fdopen(1, "w", buffering=1)
            status = 70
            resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))
            try:
                status = command_line([*arguments])
            except SystemExit as ended:
                status = int(ended.code or 0)
            finally:
                sys.stderr.flush()
                os._exit(status)
        while True:
            done, code = os.waitpid(child, os.WNOHANG)
            if done or time.monotonic() - begin > LONGEST:
                break
            time.sleep(0.005)
        if not done:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        said.seek(0)
        text = said.read().decode(errors="replace")
    seconds = time.monotonic() - begin
    if not done:
        return TOO_LONG, text, seconds
    if os.WIFSIGNALED(code) and os.WTERMSIG(code) in (signal.SIGXCPU, signal.SIGKILL):
        return TOO_LONG, text, seconds
    return (-os.WTERMSIG(code) if os.WIFSIGNALED(code) else os.WEXITSTATUS(code)), text, seconds


def fault(status: int | str, text: str) -> str:
    """Return the fault of an ending; nothing if it is one of those that are accepted."""
    if status == TOO_LONG and FORESEEN.search(text):
        return ""
    if status not in (0, 1, 2):
        return f"status {status}"
    if "Traceback" in text:
        return "a traceback"
    refused = [line for line in text.splitlines() if line.startswith("contact: ")]
    if status == 2 and len(refused) != 1:
        return f"{len(refused)} messages"
    if status == 2 and len(text.strip().splitlines()[-1]) > 2000:
        return "a message too long to be read"
    return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Damage cases, solve them, and list endings that are not accepted."""
    command = parser(__doc__, "mutations")
    command.add_argument("--count", type=int, help="number of damaged cases")
    command.add_argument("--seed", type=int, default=SEED)
    command.add_argument("--first", type=int, default=0, help="number of the first case")
    given = command.parse_args(arguments)
    count = given.count or (COARSE_COUNT if given.coarse else COUNT)
    given.out.mkdir(parents=True, exist_ok=True)
    columns = ("number", "case", "fault", "seconds", "last words")
    rows: dict[str, list[Any]] = {name: [] for name in columns}
    ends = Counter[str]()
    with tempfile.TemporaryDirectory() as scratch:
        for number in range(given.first, count):
            name, text = damaged(number, given.seed)
            file, folder = Path(scratch, "case.toml"), Path(scratch, str(number))
            file.write_text(text, encoding="utf-8", errors="replace")
            status, said, seconds = run(file, folder)
            ends[str(status)] += 1
            wrong = fault(status, said)
            if wrong:
                (given.out / f"mutation-{number}.toml").write_bytes(file.read_bytes())
                row = (number, name, wrong, round(seconds, 1), " ".join(said.split())[-160:])
                print(*row, flush=True)
                append(rows, *row)
    print("endings:", dict(sorted(ends.items())))
    Report(given.out).table("mutations", f"Faults among {count - given.first} damaged cases", rows)
    return 1 if rows["number"] else 0


if __name__ == "__main__":
    sys.exit(main())
