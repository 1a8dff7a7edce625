"""Stop a solve after the running outer iteration, on all ranks together."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from mpi4py import MPI

from contact.report import Monitor, Record

#: Seconds in which a second signal is taken for an echo of the first.
REPEAT = 2.0


class Interrupted(Exception):
    """A signal asked for the end of the solve."""


@contextmanager
def stop_on_signal(comm: MPI.Intracomm, monitor: Monitor | None) -> Iterator[Monitor]:
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
    effect (a launcher and its process group may both deliver the same one). Signals can be
    caught in the main thread alone; in others nothing is changed.
    """
    caught: list[int] = []
    since: list[float] = []
    before: dict[int, Callable[[int, FrameType | None], object] | int] = {}

    def note(number: int, frame: FrameType | None) -> None:
        if caught and time.monotonic() - since[0] > REPEAT:
            for ending, handler in before.items():
                signal.signal(ending, handler)
            signal.raise_signal(number)
        if not caught:
            caught.append(number)
            since.append(time.monotonic())

    def check(record: Record) -> None:
        if monitor is not None:
            monitor(record)
        number = comm.allreduce(caught[0] if caught else 0, op=MPI.MAX)
        if number:
            raise Interrupted(f"interrupted ({signal.Signals(number).name})")

    try:
        if threading.current_thread() is threading.main_thread():
            for ending in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(ending)
                if handler is not None:  # None: not installed from Python, left alone
                    before[ending] = handler
                    signal.signal(ending, note)
        yield check
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
