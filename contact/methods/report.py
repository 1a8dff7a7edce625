"""Reports of a solver: a record of each iteration, and the outcome."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias, runtime_checkable

import numpy as np

from contact.errors import counted
from contact.linear.operator import Counters
from contact.problem.residuals import Residuals

logger = logging.getLogger("contact.solver")


def tell(logger: logging.Logger, share: float, text: str, *values: object) -> None:
    """Log the progress of a run of many solves: the part of it that is done, 0 to 1."""
    logger.info(text, *values, extra={"share": share})


@dataclass(frozen=True)
class Record:
    """One outer iteration.

    Attributes
    ----------
    iteration
        Number of the iteration; 0 is the frictionless start of the fixed point.
    inner
        Linear solves that it took.
    kkt
        Residuals after it.
    change
        Relative change of the friction bound, (3.46); NaN where there is none.
    seconds
        Since the start of the solve.
    note
        Its kind where it is no plain one, for instance "tangent".
    sizes
        Numbers of nodes that are open, stick and slip after it; None where nothing is known.
    steps
        Newton iterations on the condensed problem that it took, a record each.
    """

    iteration: int
    inner: int
    kkt: Residuals
    change: float
    seconds: float
    note: str = ""
    sizes: tuple[int, int, int] | None = None
    steps: tuple[Record, ...] = ()

    @property
    def contact_solves(self) -> int:
        """Number of linear solves of the condensed problem."""
        return sum(step.inner for step in self.steps)


#: Told of every outer iteration, on all ranks.
Monitor: TypeAlias = Callable[[Record], None]


@runtime_checkable
class Poll(Protocol):
    """A monitor that can stop the solve within an outer iteration too."""

    def poll(self) -> None:
        """Raise on all ranks if the solve is to end. Collective."""


@dataclass
class Recorder:
    """Keeps the records of a solve, logs them at a level, and calls the monitor with each."""

    monitor: Monitor | None = None
    level: int = logging.INFO
    records: list[Record] = field(default_factory=list)
    begin: float = field(default_factory=time.perf_counter)

    def record(
        self,
        kkt: Residuals,
        note: str,
        inner: int = 1,
        sizes: tuple[int, int, int] | None = None,
        steps: tuple[Record, ...] = (),
    ) -> None:
        """Append the record of the next step."""
        seconds = time.perf_counter() - self.begin
        number = len(self.records) + 1
        self.add(Record(number, inner, kkt, np.nan, seconds, note, sizes, steps))

    def add(self, record: Record) -> None:
        """Append a record, log it and call the monitor."""
        self.records.append(record)
        logger.log(
            self.level,
            "iteration %d: %s; equilibrium %.1e, contact %.1e, friction %.1e%s",
            record.iteration,
            counted(record.inner, "linear solve"),
            record.kkt.equilibrium,
            record.kkt.contact,
            record.kkt.friction,
            f" ({record.note})" if record.note else "",
        )
        if self.monitor is not None:
            self.monitor(record)

    def poll(self) -> None:
        """Let the monitor end the solve within an outer iteration. Collective."""
        if isinstance(self.monitor, Poll):
            self.monitor.poll()


@dataclass(frozen=True)
class Outcome:
    """End of a solve; the residuals alone decide whether it has converged.

    Attributes
    ----------
    kkt
        Final residuals, of the problem at its whole load.
    allowed
        Tolerance of each residual.
    ended
        Reason other than convergence, in words.
    signal
        Number of the signal that ended it; 0 for none.
    criterion
        Criterion of the method itself, in words, where it does not end by the residuals.
    overloaded
        Whether friction does not balance the loads (limit analysis): no fallback is tried.
    records
        The outer iterations.
    counters
        Factorisations and linear solves.
    """

    kkt: Residuals
    allowed: Residuals
    ended: str = ""
    signal: int = 0
    criterion: str = ""
    overloaded: bool = False
    records: tuple[Record, ...] = ()
    counters: Counters = field(default_factory=Counters)

    @property
    def converged(self) -> bool:
        """Whether every residual is within its tolerance, and no signal has interrupted."""
        return not self.signal and not self.kkt.excess(self.allowed)

    @property
    def reason(self) -> str:
        """Why the method ended, and its residuals, in words."""
        if self.signal:
            return self.ended
        if excess := self.kkt.excess(self.allowed):
            # A criterion that is met is contradicted by the residual, any other end explained.
            met = f"{self.criterion}, but " if self.criterion else ""
            return (f"{self.ended}: " if self.ended else met) + excess
        # A converged end is no failure, even where the method had given up.
        words = self.criterion or f"all residuals <= {self.allowed.largest:g}"
        granted = self.kkt.granted(self.allowed)
        return f"{words}, to rounding: {granted}" if granted else words
