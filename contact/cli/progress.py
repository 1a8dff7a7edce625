"""The console output of a solve: a table of its iterations, a bar on a terminal, and a log."""

from __future__ import annotations

import logging
import os
import platform
import re
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.report import Monitor, Record
from contact.ranks import on_root

#: Seconds between two reports of inner iterations: on a terminal, and in plain lines.
OFTEN, SELDOM = 0.2, 10.0
#: Loggers, each within the next: the iterations of a solve, its steps, the cases of a sweep.
RANKS = ("contact.inner", "contact.solver", "contact.steps", "contact.sweep")
OUTER = "contact.solver"
#: The bar of one solve, the bar of many, and its size where the terminal does not tell its own.
COUNT = "iterations: {n_fmt}, {elapsed}{postfix}"
SHARES = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
WIDTH, HEIGHT = 80, 20
#: Head of the table of iterations: linear solves, residuals, and numbers of nodes that are open,
#: stick and slip. Newton iterations on the condensed problem, within step 2, are 2.1, 2.2, ...
HEAD = "   step solves  equilibrium  contact friction   open  stick   slip  note"


def table(record: Record, within: str = "") -> list[str]:
    """Return the rows of an outer iteration and of those within it, below `HEAD`."""
    if not shown(record.iteration):
        return []
    kkt, sets, number = (
        record.residuals,
        record.sizes or ("", "", ""),
        f"{within}{record.iteration}",
    )
    row = (
        f"{number:>7} {record.inner:6}  {kkt.equilibrium:11.1e} {kkt.contact:8.1e} "
        f"{kkt.friction:8.1e} {sets[0]:6} {sets[1]:6} {sets[2]:6}  {record.note}"
    )
    inner = [line for step in record.steps for line in table(step, f"{number}.")]
    return [*inner, row.rstrip()]


def shown(iteration: int) -> bool:
    """Tell whether an iteration has a row: all up to 30, then each tenth, from 100 each 100th."""
    return iteration <= 30 or iteration % 10 ** (len(str(iteration)) - 1) == 0


@contextmanager
def progress(
    comm: MPI.Intracomm, quiet: bool = False, log: str | None = None, verbose: bool = False
) -> Iterator[Monitor | None]:
    """Show the logs of ``contact`` on rank 0 and yield the monitor that shows the iterations.

    If `quiet` warnings alone are shown, if `verbose` all records with the time, which are written
    to the end of a `log` too.
    """
    handlers: list[logging.Handler] = [logging.NullHandler()] if comm.rank > 0 else []
    on_root(comm, lambda: handlers.append(_log(log)) if log is not None else None)
    monitor = bar = None
    if comm.rank == 0:
        if not (quiet or verbose) and sys.stderr.isatty():
            from tqdm import tqdm

            # tqdm takes a terminal that does not tell its size for one of size 0.
            columns, lines = os.get_terminal_size(sys.stderr.fileno())
            bar = tqdm(
                file=sys.stderr,
                ncols=columns or WIDTH,
                nrows=lines or HEIGHT,
                bar_format=COUNT,
                leave=False,
            )
        monitor = Console(quiet, bar, verbose)
        handlers.append(monitor)
    logger = logging.getLogger("contact")
    level = logger.level
    for handler in handlers:
        logger.addHandler(handler)
    detailed = comm.rank == 0 and (log is not None or not quiet)
    logger.setLevel(logging.DEBUG if detailed else logging.WARNING)
    try:
        yield monitor
    finally:
        logger.setLevel(level)
        for handler in handlers:
            logger.removeHandler(handler)
            handler.close()


class Console(logging.Handler):
    """Shows the table of iterations and the lines of the leading logger, or a bar instead of these.

    The leading one is the highest of those in `RANKS` that has spoken so far; the others are heard
    in long silence. tqdm's bar, on a terminal, is over outer iterations, or over the finished share
    of many solves.
    """

    def __init__(self, quiet: bool = False, bar: Any = None, verbose: bool = False) -> None:
        super().__init__(logging.WARNING if quiet else logging.DEBUG)
        self._quiet, self._bar, self._verbose = quiet, bar, verbose
        self._lead = RANKS.index(OUTER)
        self._last = time.monotonic()
        self._headed = False

    def __call__(self, record: Record) -> None:
        """Show an outer iteration, where iterations lead."""
        if self._quiet or self._verbose or RANKS[self._lead] != OUTER:
            return
        for line in ([] if self._headed else [HEAD]) + table(record):
            self._write(line)
        self._headed = True
        if self._bar is not None:
            self._bar.update(1)

    def emit(self, record: logging.LogRecord) -> None:
        """Show a line of the leading logger, or of none of the ranks; others now and then."""
        if self._verbose:
            self._write(f"{time.strftime('%H:%M:%S')} {_told(record)}")
            return
        rank = RANKS.index(record.name) if record.name in RANKS else None
        self._lead = max(self._lead, rank or 0)
        leads, warns = rank in (None, self._lead), record.levelno >= logging.WARNING
        silent = time.monotonic() - self._last >= (SELDOM if self._bar is None else OFTEN)
        in_table = record.name == OUTER and leads and not warns
        if in_table:
            self._last = time.monotonic()
        elif self._bar is not None and rank is not None:
            if leads and hasattr(record, "share"):
                self._bar.total, self._bar.bar_format, self._bar.n = 1.0, SHARES, record.share
            elif not silent:
                return
            self._bar.set_postfix_str(record.getMessage())
            self._last = time.monotonic()
        elif (leads and record.levelno >= logging.INFO) or (rank is not None and silent):
            self._write(_told(record))
            self._last = time.monotonic()

    def _write(self, line: str) -> None:
        if self._bar is None:
            print(line, file=sys.stderr, flush=True)
        else:
            self._bar.write(line, file=sys.stderr)

    def close(self) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.close()
        super().close()


def _told(record: logging.LogRecord) -> str:
    """Return a record as it is shown."""
    return ("warning: " if record.levelno >= logging.WARNING else "") + record.getMessage()


def _log(name: str) -> logging.Handler:
    """Open a log, and write the command line and its process there."""
    try:
        if (path := Path(name)).is_file():
            with path.open("rb") as file:
                begin = file.read(5)
            if begin and not re.fullmatch(rb"\d{4}-", begin):
                raise InputError(
                    f"--log {name}: given no log; accepted: a new file, or a log", "log-file"
                )
        handler = logging.FileHandler(name, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(
            f"--log {name}: {error.strerror or error}; accepted: a file to write to the end of",
            "cannot-write",
        ) from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s"))
    who = f"{shlex.join(sys.argv)}, process on {platform.node()}"
    handler.handle(logging.makeLogRecord({"name": "contact", "msg": who}))
    return handler
