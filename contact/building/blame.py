"""Which of the loads is to blame for a right-hand side that is no number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.body.amplitude import at_time
from contact.mesh.domain import Domain
from contact.tolerances import HUGE


def to_blame(loads: Sequence[Any], domain: Domain, time: float = 1.0) -> str:
    """Return the key of the first load whose integral is not finite, or too large. Collective.

    Where none is, for the quadrature meets other points with the test functions, the answer is
    ``load``.

    Parameters
    ----------
    loads
        Loads of the body, whose fields know their keys in the case file (`given.NodalField`).
    domain
        The domain.
    time
        When they act.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    for on, field in _fields(loads):
        form = fem.form(at_time(field, time).ufl(x) * (domain.dx if on is None else domain.ds(on)))
        value = domain.comm.allreduce(float(fem.assemble_scalar(form)), op=MPI.SUM)
        if not abs(value) <= HUGE:
            return str(field.key)
    return "load"


def _fields(loads: Sequence[Any]) -> Iterator[tuple[str | None, Any]]:
    for load in loads:
        for field in load.fields:
            yield load.on, field
