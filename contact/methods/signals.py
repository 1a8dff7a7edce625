"""Signals of the operating system: they end a solve between iterations, on all ranks together."""

from __future__ import annotations

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import TYPE_CHECKING, TypeAlias

from mpi4py import MPI

from contact.ranks import largest

if TYPE_CHECKING:  # it loads dolfinx, which PETSc's options have to precede
    from contact.methods.report import Monitor, Record

#: The signals that ask a run to end.
ENDING = signal.SIGINT, signal.SIGTERM

#: Seconds in which a second signal is taken for an echo of the first: a launcher and its process
#: group may both deliver the same one.
REPEAT = 2.0

#: Added to the number of the signal that ended a run: its exit status.
SIGNALLED = 128

#: A handler of signals, as `signal.signal` takes it.
Handler: TypeAlias = Callable[[int, FrameType | None], object] | int


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
        The signals on this rank.
    told
        Whether `Interrupted` has been raised for them.
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
        number = self.first()
        if number:
            self.told = True
            raise Interrupted(number)

    def first(self) -> int:
        """Return the number of a signal on any rank; 0 for none. Collective."""
        return int(largest(self.comm, self.caught[0] if self.caught else 0))


@dataclass
class Ending:
    """Handler of signals outside of a solve: ends the run by an exception.

    Attributes
    ----------
    caught
        The signals so far. Where a library swallows the exception, the next solve stops for them.
    deaf_until
        Until when a signal is an echo of the one that has stopped a solve (monotonic seconds).
    """

    caught: list[int] = field(default_factory=list)
    deaf_until: float = -math.inf

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note a signal, and raise KeyboardInterrupt or `Terminated`."""
        if time.monotonic() >= self.deaf_until:
            self.caught.append(number)
            raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def _handled(handler: Handler, replaces: Callable[[object], bool]) -> Iterator[None]:
    """Install a handler in place of some, which come back in the end.

    Signals can be caught in the main thread alone; in others nothing is changed.
    """
    before = {number: signal.getsignal(number) for number in ENDING}
    if threading.current_thread() is not threading.main_thread():
        before.clear()
    before = {k: old for k, old in before.items() if old is not None and replaces(old)}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


@contextmanager
def signals_held() -> Iterator[list[int]]:
    """Let signals wait until the end of the block, which must not be left half done.

    One that comes more than `REPEAT` seconds after the first ends the process.

    Yields
    ------
    The signals so far. They have their effect in the end, unless the list is cleared.
    """
    caught: list[int] = []
    last = math.inf

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal last
        if time.monotonic() > last:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)
        if not caught:
            last = time.monotonic() + REPEAT
        caught.append(number)

    try:
        with _handled(note, lambda old: True):
            yield caught
    finally:
        if caught:
            signal.raise_signal(caught[0])


@contextmanager
def stop_on_signal(comm: MPI.Intracomm, monitor: Monitor | None) -> Iterator[Stop]:
    """Yield a monitor that raises `Interrupted` on all ranks after a signal on any.

    A signal for which nothing was raised, after the last iteration, has its usual effect in the
    end, on all ranks.

    Parameters
    ----------
    comm
        Communicator of the problem.
    monitor
        Told of every iteration first.
    """
    stop = Stop(comm, monitor)
    outside = [old for old in map(signal.getsignal, ENDING) if isinstance(old, Ending)][:1]
    try:
        with signals_held() as stop.caught:
            stop.caught += [number for ending in outside for number in ending.caught[:1]]
            try:
                yield stop
                number = stop.first()
                if number and not stop.caught:
                    stop.caught.append(number)
            finally:
                if stop.told:
                    stop.caught.clear()
    finally:
        for ending in outside if stop.told else ():
            ending.deaf_until = time.monotonic() + REPEAT


@contextmanager
def ending_on_signal() -> Iterator[None]:
    """Let signals end a run in words, where Python's own handlers stand."""
    own = signal.SIG_DFL, signal.default_int_handler
    with _handled(Ending(), lambda old: old in own):
        yield


@contextmanager
def deaf() -> Iterator[None]:
    """Let signals end the process at once, where `ending_on_signal` would end the run.

    For work of a library that takes minutes without returning to Python, before anything has
    been computed.
    """
    with _handled(signal.SIG_DFL, lambda old: isinstance(old, Ending)):
        yield
