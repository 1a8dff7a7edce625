"""The console output of a solve: a table of its iterations, a bar on a terminal, and a log."""

from __future__ import annotations

import logging
import platform
import shlex
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.report import Monitor, Record
from contact.output.folder import on_root

#: Seconds between two reports of inner iterations: on a terminal, and in plain lines.
OFTEN, SELDOM = 0.2, 10.0
#: Loggers, each within the next: the iterations of a solve, its steps, the cases of a sweep.
RANKS = ("contact.inner", "contact.solver", "contact.steps", "contact.sweep")
OUTER = "contact.solver"
#: The bar of many solves.
SHARES = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"
#: Head of the table of iterations: linear solves, residuals and sizes of the active sets. Newton
#: iterations on the condensed problem, within step 2, are 2.1, 2.2, ...
HEAD = "   step solves  equilibrium  contact friction   open  stick   slip  note"


def table(record: Record, within: str = "") -> list[str]:
    """Return the rows of an outer iteration and of those within it, below `HEAD`."""
    if not shown(record.iteration):
        return []
    kkt, sets, number = record.kkt, record.sizes or ("", "", ""), f"{within}{record.iteration}"
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
    comm: MPI.Intracomm, quiet: bool = False, log: str | None = None
) -> Iterator[Monitor | None]:
    """Show the logs of ``contact`` on rank 0 and yield the monitor that shows the iterations.

    Parameters
    ----------
    comm
        Communicator of the solve.
    quiet
        Show warnings alone.
    log
        A file, to whose end all records are written with the time, inner iterations too.

    Raises
    ------
    InputError
        If the log cannot be written.
    """
    handlers: list[logging.Handler] = [logging.NullHandler()] if comm.rank > 0 else []
    on_root(comm, lambda: handlers.append(_log(log)) if log is not None else None)
    monitor: _Bar | _Lines | None = None
    if comm.rank == 0 and not quiet and sys.stderr.isatty():
        from tqdm import tqdm

        monitor = _Bar(tqdm(unit=" iterations", file=sys.stderr))
    elif comm.rank == 0:
        monitor = _Lines(quiet)
    handlers += [monitor] if monitor is not None else []
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


class _Named(logging.Formatter):
    """Calls a warning one."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record."""
        text = super().format(record)
        return f"warning: {text}" if record.levelno >= logging.WARNING else text


class _Ranked(logging.Handler):
    """Follows the leading logger: the highest of those in `RANKS` that has spoken so far."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.setFormatter(_Named())
        self._lead = RANKS.index(OUTER)
        self._last = time.monotonic()
        self._rows = 0

    def _leads(self, name: str) -> bool:
        """Note a logger that speaks; tell whether it leads, or is none of the ranks."""
        if name not in RANKS:
            return True
        self._lead = max(self._lead, RANKS.index(name))
        return name == RANKS[self._lead]

    def _silent_for(self, seconds: float) -> bool:
        """Tell whether nothing has been said for so long; if so, something is now."""
        now = time.monotonic()
        silent = now - self._last >= seconds
        if silent:
            self._last = now
        return silent

    def _table(self, record: Record) -> list[str]:
        """Return the lines of the table for an iteration, where iterations lead."""
        if RANKS[self._lead] != OUTER:
            return []
        self._rows += 1
        return [*[HEAD] * (self._rows == 1), *table(record)]


class _Lines(_Ranked):
    """Plain lines; of iterations within a step or case one now and then, in long silence."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(logging.WARNING if quiet else logging.DEBUG)
        self._quiet = quiet

    def __call__(self, record: Record) -> None:
        """Show an outer iteration."""
        if not self._quiet:
            for line in self._table(record):
                print(line, file=sys.stderr, flush=True)

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line; that of a leading iteration stands in the table."""
        leads = self._leads(record.name) and record.levelno >= logging.INFO
        if leads and record.name == OUTER and record.levelno < logging.WARNING:
            self._last = time.monotonic()
        elif self._silent_for(0.0 if leads else SELDOM) and (leads or record.name in RANKS):
            print(self.format(record), file=sys.stderr, flush=True)


class _Bar(_Ranked):
    """A bar over outer iterations below their table, or over the finished share of many solves."""

    def __init__(self, bar: Any) -> None:
        super().__init__(logging.DEBUG)
        self._bar = bar

    def __call__(self, record: Record) -> None:
        """Show an outer iteration."""
        for line in self._table(record):
            self._bar.write(line, file=sys.stderr)
        self._bar.update(1 if RANKS[self._lead] == OUTER else 0)

    def emit(self, record: logging.LogRecord) -> None:
        """Show the leading logger and those within it in the bar, and other lines above it."""
        leads = self._leads(record.name)
        if record.name not in RANKS:
            if record.levelno >= logging.INFO:
                self._bar.write(self.format(record), file=sys.stderr)
        elif leads and hasattr(record, "share"):
            self._bar.total, self._bar.bar_format = 1.0, SHARES
            self._bar.n = record.share
            self._bar.set_postfix_str(record.getMessage())
        elif record.name != OUTER and self._silent_for(OFTEN):
            self._bar.set_postfix_str(record.getMessage())

    def close(self) -> None:
        """Leave the bar as it is."""
        self._bar.close()
        super().close()


def _log(name: str) -> logging.Handler:
    """Open a log, and write the command line and its process there."""
    try:
        handler = logging.FileHandler(name, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise InputError(
            f"--log {name}: {error.strerror or error}; accepted: a file to write to the end of"
        ) from None
    handler.setFormatter(logging.Formatter("%(asctime)s %(name)s: %(message)s"))
    who = f"{shlex.join(sys.argv)}, process on {platform.node()}"
    handler.handle(logging.makeLogRecord({"name": "contact", "msg": who}))
    return handler
