"""Formulas of the case file as functions of position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI
from ufl.core.expr import Expr

from contact.body.amplitude import Amplitude, steady
from contact.case import file as sections
from contact.case.formula import Expression
from contact.errors import InputError
from contact.kinds import check_range
from contact.typing import Array


@dataclass(frozen=True)
class NodalField:
    """A formula of the case file, evaluated on all ranks together; messages name its key."""

    key: str
    expression: Expression
    comm: MPI.Intracomm
    minimum: float = -np.inf
    time: Any = None

    def ufl(self, x: Expr) -> Expr:
        """Return the formula as a UFL expression of the coordinates."""
        return self.expression.ufl(x, self.time)

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d). Collective."""
        try:
            values = self.expression.numpy(points, self.comm, self.time)
        except InputError as error:
            raise InputError(f"{self.key}: {error}") from None
        largest = float(np.abs(values).max(initial=0.0))
        check_range(self.key, self.comm.allreduce(largest, op=MPI.MAX), least=0.0)
        least = self.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
        if least < self.minimum:
            raise InputError(
                f"{self.key}: {self.expression} is {least:g} at a node; accepted: values >= 0"
            )
        return values


@dataclass(frozen=True)
class MovingField:
    """A formula of the case file that depends on the time."""

    key: str
    expression: Expression
    comm: MPI.Intracomm

    def at(self, time: Any) -> NodalField:
        """Return the field at a time: a number, or a constant of a form."""
        return NodalField(self.key, self.expression, self.comm, time=time)


def amplitude(case: sections.Case, name: str | None) -> Amplitude | None:
    """Return a factor of time by its name; in an evolution what has none always acts."""
    if case.evolution is None:
        return None
    return steady if name is None else case.evolution.amplitudes[name].function


def given_field(
    key: str, expression: Expression | None, comm: MPI.Intracomm, minimum: float = -np.inf
) -> NodalField | None:
    """Return a formula of the case file as a field; None where none is given."""
    return None if expression is None else NodalField(key, expression, comm, minimum)


def loading_field(
    key: str, expression: Any, comm: MPI.Intracomm
) -> NodalField | MovingField | None:
    """Return a load or a prescribed value as a field; None where it is no formula."""
    if not isinstance(expression, Expression):
        return None
    kind = MovingField if "t" in expression.names else NodalField
    return kind(key, expression, comm)
