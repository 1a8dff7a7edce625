"""The sliding block of closed form 1 pushed back and forth: its slip at the end of every step."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from contact.problem.problem import ContactProblem
from contact.typing import Array
from tests.problems.mechanics import Affine, SlidingBlock


@dataclass(frozen=True)
class Between:
    """Affine fields at some times: that of a time stands in their list."""

    fields: dict[float, Affine]

    def at(self, time: float) -> Affine:
        """Return the field at a time; the first one before all of them."""
        return self.fields.get(time, next(iter(self.fields.values())))


@dataclass(frozen=True)
class SteppedBlock:
    """A block, pressed at once, that sticks or slides through the steps."""

    block: SlidingBlock
    pushes: Sequence[float]

    @property
    def times(self) -> list[float]:
        """Ends of the steps."""
        return [float(k + 1) for k in range(len(self.pushes))]

    @cached_property
    def steps(self) -> list[SlidingBlock]:
        """The block at the end of each step."""
        found, slip, way = [], 0.0, 0.0
        for push in self.pushes:
            moved = replace(self.block, push=push, slip=slip)
            if self._beyond(slip, push, slip, way) > 0:
                # Towards the push until friction is enough: at the push there is no stress.
                end = brentq(self._beyond, slip, push, (push, slip, way), xtol=1e-15)
                moved = replace(moved, slip=float(end))
            way += abs(moved.slip - slip)
            slip = moved.slip
            found.append(moved)
        return found

    def _beyond(self, slip: float, push: float, before: float, way: float) -> float:
        """Return by how much the stress exceeds its bound at a slip."""
        block = replace(self.block, push=push, slip=slip)
        return abs(block.stress) - float(block.mu(way + abs(slip - before))) * block.pressure

    @property
    def ways(self) -> Array:
        """What has slipped until the end of each step."""
        slips = [0.0, *(step.slip for step in self.steps)]
        return np.cumsum(np.abs(np.diff(slips)))

    @property
    def dissipation(self) -> Array:
        """What friction takes in each step, with its stress at the end (per area)."""
        slips = [0.0, *(step.slip for step in self.steps)]
        return np.array([step.stress for step in self.steps]) * np.diff(slips)

    def problem(self, comm: MPI.Comm, dim: int = 2, degree: int = 1) -> ContactProblem:
        """Return the problem, whose supports know the time."""
        every = [step.problem(comm, dim, degree) for step in self.steps]
        fixed = []
        for k, given in enumerate(every[0].description.fixed):
            moving = [
                component
                if isinstance(component, str)
                else Between(
                    {
                        time: problem.description.fixed[k].displacement[i]
                        for time, problem in zip(self.times, every, strict=True)
                    }
                )
                for i, component in enumerate(given.displacement)
            ]
            fixed.append(given.model_copy(update={"displacement": tuple(moving)}))
        first = every[0]
        return ContactProblem(
            first.domain,
            replace(first.description, fixed=fixed),
            first.contacts,
            degree=degree,
        )


def back_and_forth(largest: float, step: float) -> list[float]:
    """Return pushes 0 -> largest -> -largest -> largest in steps of one size, without the 0."""
    count = round(largest / step)
    ways = [*range(1, count + 1), *range(count - 1, -count - 1, -1), *range(1 - count, count + 1)]
    return [step * k for k in ways]
