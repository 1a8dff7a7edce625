"""A block whose top is pressed down, moved to and fro and unloaded, and its load steps."""

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Fixed, FixedPointOptions, Friction, GapFunction, NewtonOptions
from contact.mesh.grid import rectangle
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import constant

SELF = MPI.COMM_SELF
TIGHT = {"newton": NewtonOptions(tolerance=1e-12), "uzawa": FixedPointOptions(tolerance=1e-12)}


def tabulated(times, values):
    """Return an amplitude that is linear between values at some times."""
    return lambda time: float(np.interp(time, times, values))


def steps_of(problem, times, options=TIGHT["newton"], start=None) -> list[State]:
    """Return the states at the ends of all steps, which have to converge."""
    method = METHODS[options.method](problem, options, None)
    steps = list(LoadStepping(problem, method, start).steps(times))
    assert all(outcome.converged for _, outcome in steps)
    return [state for state, _ in steps]


#: Press, shear to and fro, unload.
STAGES = [0.0, 1.0, 2.0, 3.0, 4.0]
PRESS = tabulated(tuple(STAGES), (0.0, 1.0, 1.0, 1.0, 0.1))
SHEAR = tabulated(tuple(STAGES), (0.0, 0.0, 1.0, -1.0, 0.0))


def shaken(law=None, degree=1, mu=0.4, comm=SELF) -> ContactProblem:
    """Return a block whose top is pressed down, then moved to and fro."""
    down, along = constant(-0.01, 2), constant(0.006, 2)
    supports = [
        Fixed("top", [None, down], amplitude=PRESS),
        Fixed("top", [along, None], amplitude=SHEAR),
    ]
    return ContactProblem(
        rectangle(comm, [0.0, 0.0], [2.0, 1.0], [16, 6]),
        Body(law or Linear(1.0, 0.3), supports),
        Contact("bottom", GapFunction(lambda x: 0.001 * (x[:, 0] - 1) ** 2)),
        Friction(ConstantCoefficient(mu)),
        degree=degree,
    )


def times(count: int) -> list[float]:
    """Return the ends of `count` steps in each stage."""
    return [(k + 1) / count for k in range(count * (len(STAGES) - 1))]
