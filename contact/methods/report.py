"""Report of a solve: a `Record` of each step or outer iteration, and its `Outcome`.

And its end by the residuals, alike on all ranks: `Stagnation`, the stagnation limit, and `Best`,
the iterate of least residual.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from contact.errors import counted
from contact.linear.operator import Counters
from contact.problem.residuals import Residuals

logger = logging.getLogger("contact.solver")


def tell(logger: logging.Logger, share: float, text: str, *values: object) -> None:
    """Log the progress of many solves; `share` is the completed part, 0 to 1."""
    logger.info(text, *values, extra={"share": share})


@dataclass(frozen=True)
class Record:
    """One step of Newton's method, or one outer iteration (Kacanov) of the thesis' methods.

    Attributes
    ----------
    iteration
        Its number; 0 for the frictionless start of the fixed point.
    inner
        Number of linear solves.
    residuals
        Residuals after it.
    change
        Relative change of the friction bound, (3.46); NaN without friction or fixed point.
    seconds
        Time since the start of the solve.
    note
        Kind of the step, for instance "tangent", or name of the fallback.
    sizes
        Numbers of open, stick and slip nodes after it; None without an active set.
    steps
        Newton steps on the condensed problem, a record each.
    """

    iteration: int
    inner: int
    residuals: Residuals
    change: float
    seconds: float
    note: str = ""
    sizes: tuple[int, int, int] | None = None
    steps: tuple[Record, ...] = ()

    @property
    def contact_solves(self) -> int:
        """Number of linear solves with the condensed body."""
        return sum(step.inner for step in self.steps)


#: Called after each outer iteration, on all ranks.
Monitor: TypeAlias = Callable[[Record], None]


@dataclass
class Recorder:
    """Keeps the records of a solve, logs them at a level, and calls the monitor with each."""

    monitor: Monitor | None = None
    level: int = logging.INFO
    records: list[Record] = field(default_factory=list)
    begin: float = field(default_factory=time.perf_counter)

    def record(
        self,
        residuals: Residuals,
        note: str,
        inner: int = 1,
        sizes: tuple[int, int, int] | None = None,
        steps: tuple[Record, ...] = (),
    ) -> None:
        """Append the record of the next step."""
        seconds = time.perf_counter() - self.begin
        number = len(self.records) + 1
        self.add(Record(number, inner, residuals, np.nan, seconds, note, sizes, steps))

    def add(self, record: Record) -> None:
        """Append a record, log it and call the monitor."""
        self.records.append(record)
        logger.log(
            self.level,
            "iteration %d: %s; equilibrium %.1e, contact %.1e, friction %.1e%s",
            record.iteration,
            counted(record.inner, "linear solve"),
            record.residuals.equilibrium,
            record.residuals.contact,
            record.residuals.friction,
            f" ({record.note})" if record.note else "",
        )
        if self.monitor is not None:
            self.monitor(record)

    def poll(self) -> None:
        """Let a monitor with `poll` end the solve within an outer iteration. Collective."""
        poll = getattr(self.monitor, "poll", None)
        if poll is not None:
            poll()


@dataclass(frozen=True)
class Outcome:
    """End of a solve; the residuals alone decide whether it has converged.

    Attributes
    ----------
    residuals
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

    residuals: Residuals
    allowed: Residuals
    ended: str = ""
    signal: int = 0
    criterion: str = ""
    overloaded: bool = False
    records: tuple[Record, ...] = ()
    counters: Counters = field(default_factory=Counters)

    @property
    def converged(self) -> bool:
        """Whether all residuals are within tolerance or rounding, and no signal has interrupted."""
        return not self.signal and not self.residuals.unmet(self.allowed)

    @property
    def final(self) -> bool:
        """Whether no further stage is tried: converged, or friction cannot balance the loads."""
        return self.converged or self.overloaded

    @property
    def reason(self) -> str:
        """Reason of the end, and the residuals, in words."""
        if self.signal:
            return self.ended
        if unmet := self.residuals.unmet(self.allowed):
            met = f"{self.criterion}, but " if self.criterion else ""
            return (f"{self.ended}: " if self.ended else met) + unmet
        words = self.criterion or f"all residuals <= {self.allowed.largest:g}"
        granted = self.residuals.granted(self.allowed)
        return f"{words}, to rounding: {granted}" if granted else words


#: Ratio to the least residual so far that is progress.
PROGRESS = 0.5

T = TypeVar("T")


@dataclass
class Best(Generic[T]):
    """The iterate of least residual: the end of a method that fails."""

    iterate: T | None = None
    _least: float = np.inf

    def see(self, iterate: T, residual: float) -> None:
        """Keep an iterate if its residual is the least, and not NaN."""
        if residual < self._least:
            self.iterate, self._least = iterate, residual


@dataclass
class Stagnation:
    """Stagnation limit: number of steps without progress, a ratio to the reference residual.

    The reference is the least residual of all steps before; where it is cumulative that at the last
    progress, so that a slow decrease over several steps counts. `best` is the least residual.
    """

    limit: int
    progress: float
    cumulative: bool = False
    best: float = np.inf
    _since: int = 0
    _reference: float = np.inf

    def __call__(self, residual: float, limit: int | None = None) -> bool:
        """Count a step by its residual; True at the limit, that of this step if given."""
        gained = residual < self.progress * self._reference
        self._since = 0 if gained else self._since + 1
        self.best = min(self.best, residual)
        if gained or not self.cumulative:
            self._reference = self.best
        return self._since >= (self.limit if limit is None else limit)
