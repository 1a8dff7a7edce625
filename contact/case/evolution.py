"""The section about load steps, and the checks of all that knows the time."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Any, TypeAlias

from pydantic import Field, model_validator

from contact.body.amplitude import Tabulated
from contact.case.formula import Expression
from contact.case.showing import listed
from contact.case.types import Number, Section, Text, as_tuple, fault
from contact.settings import Accepted, Count

#: `contact.case.file.Case`, whose check this is.
Case: TypeAlias = Any

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

    time: Increasing = Field(description="Times; the first and the last step lie within them.")
    value: Annotated[
        tuple[Number, ...], as_tuple, Accepted("a list of numbers, one for each time")
    ] = Field(description="Values at these times.")

    @model_validator(mode="after")
    def _check(self) -> Amplitude:
        _check_increasing("time", self.time)
        if len(self.value) != len(self.time):
            accepted = f"{len(self.time)} values, as many as times"
            raise fault("value", self.value, accepted)
        return self

    @property
    def function(self) -> Tabulated:
        """The factor itself."""
        return Tabulated(self.time, self.value)


class Evolution(Section):
    """`[evolution]`: load steps with friction that remembers. Absent: one static step.

    Friction acts on what slips in each step. A step that fails is halved, up to four times.
    """

    times: Increasing = Field(description="Ends of the stages; the body is at rest at the first.")
    steps: Annotated[
        tuple[Count, ...],
        as_tuple,
        Accepted("a list of whole numbers from 1 to 10000000, one for each stage"),
    ] = Field(description="Number of equal steps in each stage.")
    amplitudes: dict[Text, Amplitude] = Field(
        default={},
        description="Factors by name, for the key `amplitude` of `[[fixed]]`, `[[load]]`, "
        "`[electric]`, `[contact.rigid]`, `[[rigid]]`, `[[electrode]]`. What has none acts all "
        "the time.",
    )

    @model_validator(mode="after")
    def _check(self) -> Evolution:
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


def check_evolution(case: Case) -> None:
    """Raise a fault if amplitudes are named that are not there, or t is used where it is not."""
    evolution: Evolution | None = case.evolution
    for key, section in _loading(case):
        name = section.amplitude
        if name is None:
            continue
        if evolution is None:
            raise fault(f"{key}.amplitude", name, "an amplitude with [evolution] only")
        if name not in evolution.amplitudes:
            near = difflib.get_close_matches(name, evolution.amplitudes, n=1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            names = listed(sorted(evolution.amplitudes)) or "none is given"
            raise fault(
                f"{key}.amplitude", name, f"a name below evolution.amplitudes: {names}{hint}"
            )
    if evolution is not None and getattr(case.solver, "nested", False):
        raise fault("solver.nested", True, "nested = false with [evolution]")


def check_time(case: Case, path: str, formula: Expression) -> None:
    """Raise a fault if a formula uses t where it has no meaning."""
    if "t" not in formula.names:
        return
    timed = path.startswith(("fixed.", "load.", "rigid.", "electrode.")) or ".rigid." in path
    if not timed and not path.endswith(".phi_f"):
        raise fault(path, formula.source, "a formula without t")
    if case.evolution is None:
        raise fault(path, formula.source, "a formula in t with [evolution] only")


def _loading(case: Case) -> Iterator[tuple[str, Any]]:
    """Give the sections that may have an amplitude, with their paths."""
    for name in ("fixed", "load", "rigid", "electrode"):
        yield from ((f"{name}.{i}", section) for i, section in enumerate(getattr(case, name)))
    for key, contact in case.contacts:
        if contact.rigid is not None:
            yield f"{key}.rigid", contact.rigid
        path, electric = case.electric_of(key, contact)
        if electric is not None:
            yield path, electric
