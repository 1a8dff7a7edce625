"""Which of the loads is to blame for a right-hand side that is no number."""

from __future__ import annotations

from collections.abc import Iterator

import ufl
from dolfinx import fem
from mpi4py import MPI

from contact.body.amplitude import Moving, at_time
from contact.body.description import Field, Load
from contact.problem.problem import ContactProblem
from contact.tolerances import HUGE


def to_blame(problem: ContactProblem) -> str:
    """Return the key of the first load whose integral is not finite, or too large. Collective.

    Where none is, for the quadrature meets other points with the test functions, the answer is
    ``load``.
    """
    domain, time = problem.domain, problem.time
    x = ufl.SpatialCoordinate(domain.mesh)
    for i, load in enumerate(problem.body.loads):
        for name, field in _named(load):
            measure = domain.dx if load.on is None else domain.ds(load.on)
            form = fem.form(at_time(field, time).ufl(x) * measure)
            value = domain.comm.allreduce(float(fem.assemble_scalar(form)), op=MPI.SUM)
            if not abs(value) <= HUGE:
                return f"load.{i}.{name}"
    return "load"


def _named(load: Load) -> Iterator[tuple[str, Field | Moving]]:
    """Yield what is given with its key in a case file."""
    inside = load.on is None
    for k, component in enumerate(load.force or ()):
        yield f"{'body_force' if inside else 'traction'}.{k}", component
    if load.pressure is not None:
        yield "pressure", load.pressure
    if load.charge is not None:
        yield "body_charge" if inside else "charge", load.charge
