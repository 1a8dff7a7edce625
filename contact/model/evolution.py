"""Load steps: stages, and amplitudes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Self, TypeAlias

import numpy as np
from annotated_types import Predicate
from pydantic import Field, model_validator

from contact.arguments import expect
from contact.errors import InputError
from contact.model.data import read_data
from contact.model.section import Described, File, Text, as_tuple
from contact.settings import Accepted, Count, Fault, Number, fault
from contact.typing import Array

#: Share of an amplitude's range from which on an extreme value that no step meets is told.
LOST = 0.02


def increase(times: Sequence[float] | Array) -> bool:
    """Tell whether times increase."""
    return all(before < after for before, after in pairwise(times))


Increasing: TypeAlias = Annotated[
    tuple[Number, ...],
    Field(min_length=2),
    Predicate(increase),
    as_tuple,
    Accepted("a list of 2 numbers or more that increase"),
]


class Amplitude(Described):
    """`[evolution.amplitudes.NAME]`: a factor as a function of time, linear between the values."""

    time: Increasing | None = None
    """Times; the first and the last step lie within them. Required without `file`."""
    value: (
        Annotated[tuple[Number, ...], as_tuple, Accepted("a list of numbers, one for each time")]
        | None
    ) = None
    """Values at these times. Likewise."""
    file: Annotated[File, Accepted("a CSV file of times and values")] | None = None
    """CSV file instead, relative to the case file: times in the first column, values in the second
    one, a measured curve for instance. Its first row has names."""

    @cached_property
    def points(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The times, and the values there."""
        if self.file is not None:
            return read_curve(self.file)
        assert self.time is not None and self.value is not None  # checked
        return self.time, self.value

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.require_either(("time", "value"), ("file",))
        try:
            times, values = self.points  # read now, so that messages name the key
        except InputError as error:
            raise Fault(f"file: {error.words}", error.identifier) from None
        fits = len(values) == len(times)
        self.require(fits, "value", f"{len(times)} values, as many as times")
        return self

    def __call__(self, time: float) -> float:
        """Return the factor at a time."""
        return float(np.interp(time, *self.points))


def read_curve(path: str | Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the first two columns of a CSV file with a row of names, two numbers each at least."""
    columns = [*read_data(path).values()][:2]
    if len(columns) < 2 or len(columns[0]) < 2 or not np.isfinite(columns).all():
        accepted = "a row of names, then two rows or more of a finite time and value"
        raise InputError(f"{path}: no curve; accepted: {accepted}", "amplitude-file")
    times, values = columns
    expect(f"{path}: times", times.tolist(), "numbers that increase", increase(times))
    return tuple(float(time) for time in times), tuple(float(value) for value in values)


class Evolution(Described):
    """`[evolution]`: quasi-static load steps with incremental friction. Absent: one static step.

    Friction acts on the slip of each step. A step that fails is halved, up to four times.
    """

    times: Increasing
    """Ends of the stages; the body is in its reference configuration at the first."""
    steps: Annotated[
        tuple[Count, ...],
        as_tuple,
        Accepted("a list of whole numbers from 1 to 10000000, one for each stage"),
    ]
    """Number of equal steps in each stage."""
    amplitudes: dict[Text, Amplitude] = Field(default={})
    """Factors by name, for the key `amplitude` of `[[fixed]]`, `[[load]]`, `[electric]`,
    `[contact.rigid]`, `[[rigid]]`, `[[electrode]]`, `[[bolt]]`. Without one the values of an entry
    grow from 0 to their size over the first stage, and are constant afterwards, unless one of them
    is a formula in t. With `"constant"` they act from the beginning."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        stages = len(self.times) - 1
        accepted = f"{stages} numbers, one for each stage between times"
        self.require(len(self.steps) == stages, "steps", accepted)
        for name, amplitude in self.amplitudes.items():
            times = amplitude.points[0]
            if times[0] > self.times[0] or times[-1] < self.times[-1]:
                accepted = f"times that reach from {self.times[0]:g} to {self.times[-1]:g}"
                key = "time" if amplitude.file is None else "file"
                raise fault(f"amplitudes.{name}.{key}", times, accepted)
        return self

    @property
    def lost_peaks(self) -> list[str]:
        """The largest and the least values of amplitudes that no step meets, in words."""
        steps, found = self.step_times, []
        for name, amplitude in self.amplitudes.items():
            times, values = map(np.array, amplitude.points)
            inside = (times > self.times[0]) & (times < self.times[-1])
            met = np.interp(steps, times, values)
            for k, seen in ((values.argmax(), met.max()), (values.argmin(), met.min())):
                if inside[k] and abs(values[k] - seen) > LOST * np.ptp(values):
                    found.append(
                        f"evolution.amplitudes.{name}: {values[k]:.4g} at t = {times[k]:.4g} lies "
                        f"between steps, which go to {seen:.4g}; a stage that ends there, or more "
                        "steps, meet it"
                    )
        return found

    @property
    def ends(self) -> list[float]:
        """Ends of all steps."""
        return [
            end if k == count - 1 else begin + (end - begin) * (k + 1) / count
            for (begin, end), count in zip(pairwise(self.times), self.steps, strict=True)
            for k in range(count)
        ]

    @property
    def step_times(self) -> list[float]:
        """Begin of the first step, and ends of all."""
        return [self.times[0], *self.ends]
