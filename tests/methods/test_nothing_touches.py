"""Problems whose solution touches nothing are found with the first solve."""

import numpy as np
from mpi4py import MPI

from contact import build_problem
from contact.case.file import parse_case
from contact.methods.load_stepping import Evolution
from contact.methods.method import METHODS
from contact.methods.options import NewtonOptions

SELF = MPI.COMM_SELF

CASE = {
    "mesh": {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.3},
    "material": [
        {"on": "upper", "young": 1.0, "poisson": 0.3},
        {"on": "lower", "young": 3.0, "poisson": 0.3},
    ],
    "fixed": [
        {"on": "lower_bottom", "displacement": [0.0, 0.0]},
        {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*t"]},
    ],
    "contact": {"on": "upper_bottom", "against": "lower_top", "gap": 0.02},
    "friction": {"law": "coulomb", "mu": 0.3},
    "evolution": {"times": [0.0, 1.0], "steps": [10]},
}


def test_an_approach_of_two_blocks_takes_a_solve_a_step():
    """It took 2884 solves and 990 factorisations: rounding of one block was compared with none."""
    problem = build_problem(parse_case(CASE), SELF)
    method = METHODS["newton"](problem, NewtonOptions(), None)
    steps = list(Evolution(problem, method).run([*(np.arange(1, 11) / 10)]))
    assert all(step.outcome.converged for step in steps)
    assert method.counters.factorizations == 1
    assert method.counters.linear_solves <= 10 and method.counters.contact_solves <= 10
    assert steps[-1].outcome.reason == "all residuals <= 1e-08"
    top = problem.equilibrium.nodal(steps[-1].state.x)[:, 1].min()
    assert np.isclose(top, -0.001)
