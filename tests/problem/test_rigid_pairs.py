"""Rigid plates on bodies that touch each other."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.body.description import Body
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.model.body import Fixed
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.rigid import Motion, Rigid
from contact.problem.checks import check_rigid_modes
from contact.problem.problem import ContactProblem
from contact.results.resultants import movements
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant, flat

SELF = MPI.COMM_SELF


def stacked() -> ContactProblem:
    """Return a block on another, pressed and tilted by a plate that is free to move."""
    plate = Motion([None, None], [None], [0.001, -0.01], [0.001], [0.5, 2.0])
    still = [constant(0.0, 2), constant(0.0, 2)]
    body = Body(Linear(1.0, 0.3), [Fixed("bottom", still)], (), rigid=(Rigid("top", plate),))
    friction = Friction(ConstantCoefficient(0.5))
    contact = Contact("under", flat(), friction=friction, against="over")
    return ContactProblem(Blocks().domain(SELF), body, contact)


@pytest.mark.core
@pytest.mark.parametrize("how", ["condensed", "whole", "uzawa"])
def test_a_free_plate_loads_two_bodies(how):
    problem = stacked()
    check_rigid_modes(problem)
    if how == "uzawa":
        method = FixedPoint(problem, FixedPointOptions(tolerance=1e-10))
    else:
        method = Newton(problem, NewtonOptions(tolerance=1e-10, condense=how == "condensed"))
    state, outcome = method.solve()
    assert outcome.converged
    nodes = problem.nodes
    stress = problem.interface.stress(problem.nodal(state), state.forces)
    force = nodes.weight[:, None] * stress
    # What the upper body exerts on the lower one is what acts on the plate.
    assert force.sum(axis=0) == pytest.approx([0.001, -0.01], abs=1e-12)
    arm = nodes.points - np.array([0.5, 2.0])
    moment = np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])
    assert moment == pytest.approx(0.001, rel=1e-9)
    # The same motion by all methods: that of the condensed one.
    plate = movements(problem, state)["rigid_parts"]["top"]
    exact, _ = Newton(problem, NewtonOptions(tolerance=1e-11)).solve()
    expected = movements(problem, exact)["rigid_parts"]["top"]
    for key in ("displacement", "rotation"):
        assert plate[key] == pytest.approx(expected[key], rel=1e-6), key
