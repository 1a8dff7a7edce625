"""The block relaxation of bodies that friction alone keeps from sliding."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, parse_case
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.thesis.fixed_point import FixedPoint
from tests.problems import pairs


def pushed(push):
    """Return a block that friction alone holds."""
    return {
        "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [16, 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "top", "traction": [0.4 * push * 0.01, -0.01]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.4},
    }


def stack():
    """Return two blocks on a plane, which friction alone holds."""
    case = pairs.case(
        load=[{"on": "upper_top", "traction": [0.45, -1.0]}],
        friction={"law": "coulomb", "mu": 0.6},
        contact=[{"on": "upper_bottom", "against": "lower_top"}, {"on": "lower_bottom"}],
    )
    del case["fixed"]
    return case


def on_a_bent_one():
    """Return a block that lies lightly on one that is bent."""
    return pairs.case(
        load=[{"on": "upper_top", "traction": [0, -1e-6]}],
        fixed=[{"on": "lower_bottom", "displacement": ["1e-3*x", "1e-3*x*x"]}],
    )


def relaxed(case):
    """Return the loop that has solved a case by block relaxation, and its state."""
    loop = FixedPoint(
        build_problem(parse_case(case), MPI.COMM_SELF), FixedPointOptions(tolerance=1e-9)
    )
    state, outcome = loop.solve()
    assert outcome.converged, outcome.reason
    return loop, state


@pytest.mark.core
@pytest.mark.parametrize("case", [pushed(0.3), pushed(0.97), stack()], ids=["0.3", "0.97", "stack"])
def test_what_friction_alone_holds_is_stuck_at_first(case):
    """Without friction, as the thesis begins, it would slide away: it stalled at 1e-2."""
    loop, state = relaxed(case)
    exact, outcome = Newton(loop.problem, NewtonOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    np.testing.assert_allclose(state.x, exact.x, rtol=0, atol=1e-7 * np.abs(exact.x).max())


def test_a_body_that_lies_lightly_on_one_that_is_bent():
    """What bends the lower one is far more than friction has to bear: it stalled at 4e-1."""
    loop, state = relaxed(on_a_bent_one())
    problem = loop.problem
    pressed = problem.interface.nodes.sum(state.forces.pressure * problem.nodes.normal[:, 1])
    assert abs(pressed) == pytest.approx(2e-6, rel=1e-6)  # 2 wide
