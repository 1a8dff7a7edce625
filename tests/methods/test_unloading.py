"""What is unloaded to next to nothing, or to nothing."""

import numpy as np
import pytest

from contact.body.description import Body
from contact.mesh.grid import rectangle
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.model.body import Fixed, Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.problems.mechanics import constant
from tests.problems.shaken import SELF, steps_of, tabulated

AT_EASE = {"newton": NewtonOptions(tolerance=1e-8), "uzawa": FixedPointOptions(tolerance=1e-8)}


@pytest.mark.parametrize("left", [1e-8, 1e-12, 1e-16, 0.0])
def test_what_is_unloaded_to_next_to_nothing_is_as_accurate(left):
    """Beside slips of the whole load the relaxation lost what it looked for."""
    amplitude = tabulated((0.0, 1.0, 2.0), (0.0, 1.0, left))
    loads = [
        Load("top", [constant(0.0, 2), constant(-0.01, 2)], amplitude=amplitude),
        Load("right", [constant(0.002, 2), constant(0.0, 2)], amplitude=amplitude),
    ]
    problem = ContactProblem(
        rectangle(SELF, [0.0, 0.0], [2.0, 1.0], [8, 4]),
        Body(Linear(1.0, 0.3), [Fixed("left", [constant(0.0, 2)] * 2)], loads),
        Contact("bottom"),
        Friction(mu=0.3),
    )
    loaded = steps_of(problem, [0.5, 1.0, 1.5])[-1]
    newton, uzawa = (steps_of(problem, [2.0], told, loaded) for told in AT_EASE.values())
    assert len(newton) == len(uzawa) == 1  # none was halved
    one, two = newton[0], uzawa[0]
    size = 0.02 * left + 1e-100
    assert np.abs(one.x - two.x).max() < 1e-6 * size
    assert np.abs(one.forces.friction - two.forces.friction).max() < 1e-6 * size
    assert 0.5 * left <= np.abs(one.forces.pressure).max() / 0.01 < 100 * size


def test_a_penalised_body_that_is_unloaded_to_nothing_rests():
    """The last step was halved again and again, and the evolution ended before."""
    amplitude = tabulated((0.0, 1.0, 2.0), (0.0, 1.0, 0.0))
    pressed = Fixed("top", [constant(0.001, 2), constant(-0.002, 2)], amplitude=amplitude)
    problem = ContactProblem(
        rectangle(SELF, [0.0, 0.0], [1.0, 1.0], [4, 4]),
        Body(Linear(10.0, 0.3), [pressed]),
        Contact("bottom"),
        Friction(mu=0.3),
    )
    steps = steps_of(problem, [1.0, 2.0], PenaltyOptions())
    assert [state.time for state in steps] == [1.0, 2.0]
    assert np.abs(steps[0].x).max() > 1e-3
    assert np.abs(steps[-1].x).max() == 0
