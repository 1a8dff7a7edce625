"""Stop a solve between its iterations, on all ranks together, and a run anywhere else."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import TYPE_CHECKING

from mpi4py import MPI

if TYPE_CHECKING:  # it loads dolfinx, which PETSc's options have to precede
    from contact.methods.report import Monitor, Record

#: Seconds in which a second signal is taken for an echo of the first.
REPEAT = 2.0

#: Added to the number of the signal that ended a run: its exit status.
SIGNALLED = 128


class Interrupted(Exception):
    """A signal asked for the end of the solve.

    Parameters
    ----------
    number
        Of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted ({signal.Signals(number).name})")
        self.number = number


class Terminated(KeyboardInterrupt):
    """SIGTERM, where SIGINT would raise KeyboardInterrupt."""


@dataclass
class Stop:
    """A monitor that raises `Interrupted` on all ranks after a signal on any.

    Attributes
    ----------
    comm
        Communicator of the problem.
    monitor
        Told of every outer iteration first.
    caught
        The first signal on this rank, or nothing.
    told
        Whether `Interrupted` has been raised for it.
    """

    comm: MPI.Intracomm
    monitor: Monitor | None
    caught: list[int] = field(default_factory=list)
    told: bool = False

    def __call__(self, record: Record) -> None:
        """Pass an outer iteration on, and look for signals. Collective."""
        if self.monitor is not None:
            self.monitor(record)
        self.poll()

    def poll(self) -> None:
        """Look for signals, once an inner iteration. Collective."""
        number = self._first()
        if number:
            self.told = True
            raise Interrupted(number)

    def agree(self) -> None:
        """Take a signal on any rank for one on all of them. Collective."""
        number = self._first()
        if number and not self.caught:
            self.caught.append(number)

    def _first(self) -> int:
        return self.comm.allreduce(self.caught[0] if self.caught else 0, op=MPI.MAX)


@contextmanager
def stop_on_signal(comm: MPI.Intracomm, monitor: Monitor | None) -> Iterator[Stop]:
    """Yield a monitor that raises `Interrupted` on all ranks after a SIGINT or SIGTERM on any.

    Parameters
    ----------
    comm
        Communicator of the problem.
    monitor
        Told of every iteration first.

    Notes
    -----
    The first signal is noted; one that comes more than `REPEAT` seconds later has its usual
    effect (a launcher and its process group may both deliver the same one). So has one for which
    nothing was raised, after the last iteration, in the end and on all ranks. Signals can be
    caught in the main thread alone; in others nothing is changed.
    """
    stop = Stop(comm, monitor)
    since: list[float] = []
    before: dict[int, Callable[[int, FrameType | None], object] | int] = {}

    def note(number: int, frame: FrameType | None) -> None:
        if stop.caught and time.monotonic() - since[0] > REPEAT:
            for ending, handler in before.items():
                signal.signal(ending, handler)
            signal.raise_signal(number)
        if not stop.caught:
            stop.caught.append(number)
            since.append(time.monotonic())

    try:
        if threading.current_thread() is threading.main_thread():
            for ending in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(ending)
                if handler is not None:  # None: not installed from Python, left alone
                    before[ending] = handler
                    signal.signal(ending, note)
                if isinstance(handler, Ending) and handler.caught and not stop.caught:
                    note(handler.caught[0], None)
        yield stop
        stop.agree()
    finally:
        for number, handler in before.items():
            if isinstance(handler, Ending) and stop.told and since:
                handler.deaf_until = since[0] + REPEAT
            signal.signal(number, handler)
        if stop.caught and not stop.told:
            signal.raise_signal(stop.caught[0])


@dataclass
class Ending:
    """Handler of SIGINT and SIGTERM outside of a solve: ends the run by an exception.

    Attributes
    ----------
    caught
        The signals so far. Where the exception is lost, in a library that swallows it, the next
        solve stops for them.
    deaf_until
        Until when a signal is an echo of the one that has stopped a solve (monotonic seconds).
    """

    caught: list[int] = field(default_factory=list)
    deaf_until: float = -math.inf

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note a signal, and raise KeyboardInterrupt or `Terminated`."""
        if time.monotonic() < self.deaf_until:
            return
        self.caught.append(number)
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def signals_held(timeout: float = math.inf) -> Iterator[list[int]]:
    """Let signals wait until the end of the block, which must not be left half done.

    Parameters
    ----------
    timeout
        Seconds after the first signal from which on another one has its effect at once.

    Yields
    ------
    The signals so far. They have their effect in the end, unless the list is cleared. Where
    signals cannot be caught, in other threads than the main one, nothing is changed.
    """
    caught: list[int] = []
    since: list[float] = []
    before: dict[int, Callable[[int, FrameType | None], object] | int] = {}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)
        before.clear()

    def note(number: int, frame: FrameType | None) -> None:
        caught.append(number)
        since.append(time.monotonic())
        if since[-1] - since[0] > timeout:
            caught.clear()
            restore()
            signal.raise_signal(number)

    if threading.current_thread() is threading.main_thread():
        for kind in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            handler = signal.getsignal(kind)
            if handler is not None:  # None: not installed from Python, left alone
                before[kind] = handler
                signal.signal(kind, note)
    try:
        yield caught
    finally:
        restore()
        if caught:
            signal.raise_signal(caught[0])


@contextmanager
def ending_on_signal() -> Iterator[Ending]:
    """Let SIGINT and SIGTERM end a run in words, where Python's own handlers stand."""
    ending = Ending()
    before: dict[int, Callable[[int, FrameType | None], object] | int | None] = {}
    if threading.current_thread() is threading.main_thread():
        for kind in (signal.SIGINT, signal.SIGTERM):
            handler = signal.getsignal(kind)
            if handler in (signal.SIG_DFL, signal.default_int_handler):
                before[kind] = handler
                signal.signal(kind, ending)
    try:
        yield ending
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def deaf() -> Iterator[None]:
    """Let SIGINT and SIGTERM end the process at once, where `ending_on_signal` would end the run.

    For work of a library that takes minutes without returning to Python, before anything has
    been computed.
    """
    before: dict[int, Ending] = {}
    if threading.current_thread() is threading.main_thread():
        for kind in (signal.SIGINT, signal.SIGTERM):
            handler = signal.getsignal(kind)
            if isinstance(handler, Ending):
                before[kind] = handler
                signal.signal(kind, signal.SIG_DFL)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
