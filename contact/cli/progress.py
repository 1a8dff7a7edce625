"""The console output of a run: a table of iterations, or a line a step; a bar; a log."""

from __future__ import annotations

import logging
import platform
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.report import Monitor, Record
from contact.ranks import on_root

#: Loggers of iterations, load steps and the cases of a sweep: one of them is shown.
INNER, OUTER, STEPS, SWEEP = "contact.inner", "contact.solver", "contact.steps", "contact.sweep"
#: The bar of one solve, and of the finished share of many.
COUNT = "iterations: {n_fmt}, {elapsed}"
SHARES = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
#: Head of the table of iterations: linear solves, residuals, and numbers of nodes that are open,
#: stick and slip. Newton iterations on the condensed problem, within step 2, are 2.1, 2.2, ...
HEAD = "   step solves  equilibrium  contact friction   open  stick   slip  note"


@contextmanager
def progress(
    comm: MPI.Intracomm,
    quiet: bool = False,
    log: str | None = None,
    over: str = OUTER,
) -> Iterator[Monitor | None]:
    """Show iterations, steps or cases on rank 0, as `over` says, and yield their monitor."""
    handlers: list[logging.Handler] = [logging.NullHandler()] if comm.rank > 0 else []
    on_root(comm, lambda: handlers.append(_log(log)) if log is not None else None)
    monitor = None
    if comm.rank == 0:
        bar = None
        if not quiet and sys.stderr.isatty():
            from tqdm import tqdm

            total, words = (None, COUNT) if over == OUTER else (1, SHARES)
            bar = tqdm(file=sys.stderr, leave=False, total=total, bar_format=words)
        monitor = Console(over, quiet, bar)
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
    """Prints the table of iterations, or the lines that a run is over, above a bar of tqdm."""

    def __init__(self, over: str, quiet: bool, bar: Any = None) -> None:
        super().__init__(logging.WARNING if quiet else logging.INFO)
        self._over, self._bar = over, bar
        self._table = over == OUTER and not quiet
        self._headed = False

    def __call__(self, record: Record) -> None:
        """Show an outer iteration in the table."""
        if not self._table:
            return
        for line in ([] if self._headed else [HEAD]) + rows_of(record):
            self._write(line)
        self._headed = True
        if self._bar is not None:
            self._bar.update(1)

    def emit(self, record: logging.LogRecord) -> None:
        """Show a line: a warning, or one that the run is over."""
        text, name = record.getMessage(), record.name
        if record.levelno >= logging.WARNING:
            self._write(f"warning: {text}")
        elif name == self._over != OUTER and self._bar is not None:
            self._bar.n = getattr(record, "share", self._bar.n)
            self._bar.set_postfix_str(text)
        elif name == self._over != OUTER or name not in (INNER, OUTER, STEPS, SWEEP):
            self._write(text)

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


def rows_of(record: Record, within: str = "") -> list[str]:
    """Return the rows of an outer iteration and of those within it, below `HEAD`."""
    if not shown(record.iteration):
        return []
    kkt, sets = record.residuals, record.sizes or ("", "", "")
    number = f"{within}{record.iteration}"
    row = (
        f"{number:>7} {record.inner:6}  {kkt.equilibrium:11.1e} {kkt.contact:8.1e} "
        f"{kkt.friction:8.1e} {sets[0]:6} {sets[1]:6} {sets[2]:6}  {record.note}"
    )
    inner = [line for step in record.steps for line in rows_of(step, f"{number}.")]
    return [*inner, row.rstrip()]


def shown(iteration: int) -> bool:
    """Tell whether an iteration has a row: all up to 30, then each tenth, from 100 each 100th."""
    return iteration <= 30 or iteration % 10 ** (len(str(iteration)) - 1) == 0


def _log(name: str) -> logging.Handler:
    """Open a log, and write the command line and its process there."""
    try:
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
