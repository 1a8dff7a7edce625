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

#: Seconds in which a second signal is taken for an echo of the first.
REPEAT = 2.0

#: Added to the number of the signal that ended a run: its exit status.
SIGNALLED = 128


#: A handler of signals, as `signal.signal` takes it.
Handler: TypeAlias = Callable[[int, FrameType | None], object] | int


@contextmanager
def _handled(
    handler: Handler,
    signals: tuple[int, ...] = (signal.SIGINT, signal.SIGTERM),
    replaces: Callable[[object], bool] = lambda old: True,
) -> Iterator[dict[int, Handler]]:
    """Install a handler of signals in place of some; yield those, which come back in the end.

    Signals can be caught in the main thread alone; in others nothing is changed.
    """
    before: dict[int, Handler] = {}
    if threading.current_thread() is threading.main_thread():
        for number in signals:
            old = signal.getsignal(number)
            if old is not None and replaces(old):  # None: not installed from Python
                before[number] = old
                signal.signal(number, handler)
    try:
        yield before
    finally:
        _restore(before)


def _restore(before: dict[int, Handler]) -> None:
    for number, handler in before.items():
        signal.signal(number, handler)
    before.clear()


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
        return int(largest(self.comm, self.caught[0] if self.caught else 0))


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
    nothing was raised, after the last iteration, in the end and on all ranks.
    """
    stop = Stop(comm, monitor)
    since: list[float] = []

    def note(number: int, frame: FrameType | None) -> None:
        if stop.caught and time.monotonic() - since[0] > REPEAT:
            _restore(before)
            signal.raise_signal(number)
        if not stop.caught:
            stop.caught.append(number)
            since.append(time.monotonic())

    try:
        with _handled(note) as before:
            outside = [handler for handler in before.values() if isinstance(handler, Ending)]
            for number in [handler.caught[0] for handler in outside if handler.caught][:1]:
                note(number, None)
            try:
                yield stop
                stop.agree()
            finally:
                for handler in outside if stop.told and since else []:
                    handler.deaf_until = since[0] + REPEAT
    finally:
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
    The signals so far. They have their effect in the end, unless the list is cleared.
    """
    caught: list[int] = []
    since: list[float] = []

    def note(number: int, frame: FrameType | None) -> None:
        caught.append(number)
        since.append(time.monotonic())
        if since[-1] - since[0] > timeout:
            caught.clear()
            _restore(before)
            signal.raise_signal(number)

    try:
        with _handled(note, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)) as before:
            yield caught
    finally:
        if caught:
            signal.raise_signal(caught[0])


@contextmanager
def ending_on_signal() -> Iterator[Ending]:
    """Let SIGINT and SIGTERM end a run in words, where Python's own handlers stand."""
    ending, own = Ending(), (signal.SIG_DFL, signal.default_int_handler)
    with _handled(ending, replaces=lambda old: old in own):
        yield ending


@contextmanager
def deaf() -> Iterator[None]:
    """Let SIGINT and SIGTERM end the process at once, where `ending_on_signal` would end the run.

    For work of a library that takes minutes without returning to Python, before anything has
    been computed.
    """
    with _handled(signal.SIG_DFL, replaces=lambda old: isinstance(old, Ending)):
        yield
