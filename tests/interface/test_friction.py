"""Friction that is given in Python: what resists is a number that is not negative."""

from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    InputError,
    Linear,
    Problem,
    SlipCoefficient,
)
from contact.mesh.grid import rectangle
from forms.laws import ConstantCoefficient


def problem(contact, friction=None):
    """Return a block that is pressed down and pulled aside."""
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    body = Body(Linear(10.0, 0.3), Fixed("top", [0.01, -0.01]))
    return Problem(domain, body, contact, friction)


class Negative(ConstantCoefficient):
    """A coefficient that pulls."""

    def __init__(self):
        super().__init__(-0.2)


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("friction", "said"),
    [
        (lambda: Friction(mu=-1e-3), "mu: -0.001 is negative"),
        (lambda: Friction(mu=np.nan), "mu"),
        (lambda: Friction(mu=lambda x: np.where(x[0] > 1.5, np.nan, 0.3)), "mu"),
        (lambda: Friction(tresca=lambda x: 1.0 - x[0]), "bound"),
        (lambda: Friction(tresca=np.inf), "bound"),
        (lambda: Friction(Negative()), "coefficient"),
    ],
)
def test_what_resists_is_not_negative(friction, said):
    with pytest.raises(InputError, match=rf"{said}.*\[(negative|not-finite)\]"):
        problem(Contact("bottom", friction=friction()))


@pytest.mark.parametrize(
    "given",
    [(-0.3, 0.8, 1.0), (0.1, -0.3, 1.0), (0.3, 0.2, -1.0), ("a", 0.2, 1.0), (0.3, 0.2, None)],
)
def test_a_coefficient_of_the_slip_is_a_number_and_not_negative(given):
    with pytest.raises(ValueError, match=r"a, a \+ b/2 and rho must be >= 0; given: Slip"):
        SlipCoefficient(*given)


@pytest.mark.parametrize("radius", [-1.0, np.nan, np.inf])
def test_a_radius_is_a_length(radius):
    with pytest.raises(InputError, match=r"\[value\]"):
        Friction(mu=0.3, radius=radius)


@pytest.mark.parallel
def test_a_gap_is_a_number():
    with pytest.raises(InputError, match=r"\[negative\]"):
        problem(Contact("bottom", lambda x: np.where(x[0] > 1.5, np.nan, 0.0)))


@dataclass
class Pressure:
    """s = 0.3 p max(p, least)^a."""

    maximum: float
    a: float = 0.0
    least: float = 1.0
    lipschitz: float = 0.0

    def __call__(self, slip, pressure):
        return 0.3 * pressure * np.maximum(pressure, self.least) ** self.a + 0.0 * slip

    def by_slip(self, slip, pressure):
        return 0.0 * slip * pressure

    def by_pressure(self, slip, pressure):
        above = np.maximum(pressure, self.least)
        return 0.3 * above**self.a * (1 + self.a * (pressure > self.least)) + 0.0 * slip


def test_a_law_exceeds_its_maximum_nowhere():
    """A body that it holds was said to be pulled off."""
    assert problem(Contact("bottom", friction=Friction(law=Pressure(0.3)))) is not None
    with pytest.raises(InputError, match=r"maximum: given 0\.1.*which is 0\.3 at a sample"):
        problem(Contact("bottom", friction=Friction(law=Pressure(0.1))))


def test_a_law_is_finite_without_pressure():
    law = Pressure(np.inf, -1 / 3, 0.0)
    with pytest.raises(InputError, match=r"Friction: law: .*not finite without pressure"):
        problem(Contact("bottom", friction=Friction(law=law)))
