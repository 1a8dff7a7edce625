"""Section of the case file about load steps and amplitudes."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from contact.case.messages import fault
from contact.case.section import Section, Text, as_tuple
from contact.settings import Accepted, Count, Number

Increasing: TypeAlias = Annotated[
    tuple[Number, ...],
    Field(min_length=2),
    as_tuple,
    Accepted("a list of 2 numbers or more that increase"),
]


def _check_increasing(key: str, times: tuple[float, ...]) -> None:
    if any(after <= before for before, after in pairwise(times)):
        raise fault(key, times, "numbers that increase")


class Amplitude(Section):
    """`[evolution.amplitudes.NAME]`: a factor as a function of time, linear between the values."""

    time: Increasing
    """Times; the first and the last step lie within them."""
    value: Annotated[tuple[Number, ...], as_tuple, Accepted("a list of numbers, one for each time")]
    """Values at these times."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_increasing("time", self.time)
        if len(self.value) != len(self.time):
            raise fault("value", self.value, f"{len(self.time)} values, as many as times")
        return self

    def __call__(self, time: float) -> float:
        """Return the factor at a time."""
        return float(np.interp(time, self.time, self.value))


class Evolution(Section):
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
    `[contact.rigid]`, `[[rigid]]`, `[[electrode]]`. Without one they act all
    the time."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_increasing("times", self.times)
        stages = len(self.times) - 1
        if len(self.steps) != stages:
            raise fault("steps", self.steps, f"{stages} numbers, one for each stage between times")
        for name, amplitude in self.amplitudes.items():
            first, last = amplitude.time[0], amplitude.time[-1]
            if first > self.times[0] or last < self.times[-1]:
                accepted = f"times that reach from {self.times[0]:g} to {self.times[-1]:g}"
                raise fault(f"amplitudes.{name}.time", amplitude.time, accepted)
        return self

    @property
    def ends(self) -> list[float]:
        """Ends of all steps."""
        return [
            end if k == count - 1 else begin + (end - begin) * (k + 1) / count
            for (begin, end), count in zip(pairwise(self.times), self.steps, strict=True)
            for k in range(count)
        ]
