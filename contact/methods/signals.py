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

#: Signals that end a run.
ENDING = signal.SIGINT, signal.SIGTERM

#: Seconds in which a second signal is an echo of the first: a launcher and its process group may
#: both deliver one.
REPEAT = 2.0

#: Exit status of a run ended by a signal, less the number of the signal.
SIGNALLED = 128

#: A handler of signals, as `signal.signal` takes it.
Handler: TypeAlias = Callable[[int, FrameType | None], object] | int


class Interrupted(Exception):
    """End of a solve by the signal of a number."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted ({signal.Signals(number).name})")
        self.number = number


class Terminated(KeyboardInterrupt):
    """SIGTERM, where SIGINT would raise KeyboardInterrupt."""


@dataclass
class Stop:
    """A monitor that calls another, and raises `Interrupted` on all ranks after a signal on any.

    `caught` are the signals on this rank, `raised` tells whether it has been raised for them.
    """

    comm: MPI.Intracomm
    monitor: Monitor | None
    caught: list[int] = field(default_factory=list)
    raised: bool = False

    def __call__(self, record: Record) -> None:
        """Call the monitor, and look for signals. Collective."""
        if self.monitor is not None:
            self.monitor(record)
        self.poll()

    def poll(self) -> None:
        """Raise `Interrupted` after a signal on any rank. Collective."""
        number = self.first()
        if number:
            self.raised = True
            raise Interrupted(number)

    def first(self) -> int:
        """Return the number of a signal on any rank; 0 for none. Collective."""
        return int(largest(self.comm, self.caught[0] if self.caught else 0))


@dataclass
class RunEnding:
    """Handler of signals outside of a solve: ends the run by an exception.

    `caught` are the signals so far, for the next solve where a library swallows the exception;
    before `echo_until` (monotonic seconds) signals are echoes.
    """

    caught: list[int] = field(default_factory=list)
    echo_until: float = -math.inf

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Note a signal, and raise KeyboardInterrupt or `Terminated`."""
        if time.monotonic() >= self.echo_until:
            self.caught.append(number)
            raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


@contextmanager
def _handled(handler: Handler, replaces: Callable[[object], bool]) -> Iterator[None]:
    """Replace some handlers within a block, in the main thread alone."""
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
    """Delay signals to the end of the block; yield their list, which may be cleared.

    A signal more than `REPEAT` seconds after the first one ends the process.
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

    A signal after the last iteration has its usual effect after the block, on all ranks.
    """
    stop = Stop(comm, monitor)
    outside = [old for old in map(signal.getsignal, ENDING) if isinstance(old, RunEnding)][:1]
    try:
        with signals_held() as stop.caught:
            stop.caught += [number for ending in outside for number in ending.caught[:1]]
            try:
                yield stop
                number = stop.first()
                if number and not stop.caught:
                    stop.caught.append(number)
            finally:
                if stop.raised:
                    stop.caught.clear()
    finally:
        for ending in outside if stop.raised else ():
            ending.echo_until = time.monotonic() + REPEAT


@contextmanager
def ending_on_signal() -> Iterator[None]:
    """End a run by an exception at a signal, in place of Python's own handlers."""
    defaults = signal.SIG_DFL, signal.default_int_handler
    with _handled(RunEnding(), lambda old: old in defaults):
        yield


@contextmanager
def killed_on_signal() -> Iterator[None]:
    """End the process at a signal within `ending_on_signal`, in long calls of libraries."""
    with _handled(signal.SIG_DFL, lambda old: isinstance(old, RunEnding)):
        yield
