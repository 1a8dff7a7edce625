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
OUTER, INNER = "contact.solver", "contact.inner"


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


class _Lines(logging.StreamHandler[Any]):
    """Plain lines; of inner iterations one now and then, where nothing else is said."""

    def __init__(self, quiet: bool) -> None:
        super().__init__(sys.stderr)
        self.setLevel(logging.WARNING if quiet else logging.DEBUG)
        self._last = time.monotonic()

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        now = time.monotonic()
        if record.levelno < logging.INFO and (record.name != INNER or now - self._last < SELDOM):
            return
        self._last = now
        super().emit(record)


class _Bar(logging.Handler):
    """A bar that counts the outer iterations and says where the inner ones are."""

    def __init__(self, bar: Any) -> None:
        super().__init__(logging.DEBUG)
        self._bar = bar
        self._last = 0.0

    def __call__(self, record: Record) -> None:
        """Show an outer iteration."""
        kkt = record.kkt
        self._bar.set_postfix_str(
            f"{record.inner} solves, residuals {kkt.equilibrium:.1e} {kkt.contact:.1e} "
            f"{kkt.friction:.1e} {record.note}",
            refresh=False,
        )
        self._bar.update()

    def emit(self, record: logging.LogRecord) -> None:
        """Show inner iterations in the bar, and write other lines above it."""
        if record.name == INNER:
            now = time.monotonic()
            if now - self._last > OFTEN:
                self._last = now
                self._bar.set_postfix_str(record.getMessage())
        elif record.levelno >= logging.INFO and record.name != OUTER:
            self._bar.write(self.format(record), file=sys.stderr)

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
