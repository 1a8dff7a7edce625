"""What the command line shows of a solve: a bar on a terminal, plain lines elsewhere, a log."""

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

#: Seconds between two words on inner iterations: on a terminal, and in plain lines.
OFTEN, SELDOM = 0.2, 10.0
#: Loggers of what is within another: the iterations of a solve, its steps, the cases of a sweep.
RANKS = ("contact.inner", "contact.solver", "contact.steps", "contact.sweep")
OUTER = "contact.solver"
#: The bar of many solves.
SHARES = "{percentage:3.0f}%|{bar}| {elapsed}<{remaining}{postfix}"


@contextmanager
def progress(
    comm: MPI.Intracomm, quiet: bool = False, log: str | None = None
) -> Iterator[Monitor | None]:
    """Show the logs of ``contact`` on rank 0 and yield a monitor for the outer iterations.

    Parameters
    ----------
    comm
        Communicator of the solve.
    quiet
        Show warnings alone.
    log
        A file, to whose end all of it is written with the time, inner iterations too.

    Raises
    ------
    InputError
        If the log cannot be written.
    """
    handlers: list[logging.Handler] = [logging.NullHandler()] if comm.rank > 0 else []
    on_root(comm, lambda: handlers.append(_log(log)) if log is not None else None)
    bar = None
    if comm.rank == 0 and not quiet and sys.stderr.isatty():
        from tqdm import tqdm

        bar = _Bar(tqdm(unit=" iterations", file=sys.stderr))
        handlers.append(bar)
    elif comm.rank == 0:
        handlers.append(_Lines(quiet))
    logger = logging.getLogger("contact")
    level = logger.level
    for handler in handlers:
        logger.addHandler(handler)
    detailed = comm.rank == 0 and (log is not None or not quiet)
    logger.setLevel(logging.DEBUG if detailed else logging.WARNING)
    try:
        yield bar
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
    """Follows what leads, the highest of the loggers in `RANKS` that has spoken so far."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.setFormatter(_Named())
        self._lead = RANKS.index(OUTER)
        self._last = time.monotonic()

    def _leads(self, name: str) -> bool:
        """Note who speaks; tell whether it is what leads, or none of the ranks."""
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


class _Lines(_Ranked):
    """Plain lines; of iterations within what leads one now and then, where nothing else is said."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(logging.WARNING if quiet else logging.DEBUG)

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        leads = self._leads(record.name) and record.levelno >= logging.INFO
        if self._silent_for(0.0 if leads else SELDOM) and (leads or record.name in RANKS):
            print(self.format(record), file=sys.stderr, flush=True)


class _Bar(_Ranked):
    """A bar over outer iterations, or over the share of many solves that is done."""

    def __init__(self, bar: Any) -> None:
        super().__init__(logging.DEBUG)
        self._bar = bar

    def __call__(self, record: Record) -> None:
        """Show an outer iteration."""
        kkt = record.kkt
        self._bar.set_postfix_str(
            f"{record.inner} solves, residuals {kkt.equilibrium:.1e} {kkt.contact:.1e} "
            f"{kkt.friction:.1e} {record.note}",
            refresh=False,
        )
        self._bar.update(1 if RANKS[self._lead] == OUTER else 0)

    def emit(self, record: logging.LogRecord) -> None:
        """Show in the bar what leads and what is within it, and other lines above it."""
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
    """Open a log, and write who runs what where."""
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
