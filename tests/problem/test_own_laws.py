"""Laws of one's own are checked when they are given: against differences, and for methods."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Conductor,
    Contact,
    Fixed,
    Friction,
    InputError,
    Layer,
    Linear,
    Material,
    Problem,
)
from contact.arguments import check_slope
from contact.mesh.grid import rectangle
from forms.elasticity import Anisotropic, hexagonal, isotropic
from forms.laws import Compliance, PotentialFactor, ShiftedConductivity, SlipCoefficient, Truncation
from forms.piezo import hexagonal as piezo_of
from tests.problems.messages import message_of

pytestmark = pytest.mark.parallel(2)

STIFF = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
COUPLING = {"e31": -6.98, "e33": 13.84, "e15": 13.44, "beta11": 6.0, "beta33": 5.47}
PZT = piezo_of(**COUPLING).in_plane()


def problem(friction=None, piezo=None, law=None, **contact):
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    phi = None if piezo is None else 0.0
    fixed = Fixed("top", [0.0, -0.005], potential=phi)
    body = Body(Material(Linear(10.0, 0.3) if law is None else law, piezo), fixed)
    return Problem(domain, body, Contact("bottom", **contact), friction or Friction())


class Slipping:
    """mu = 0.2 + 0.1 exp(-s), with a derivative times a factor."""

    maximum, lipschitz = 0.3, 0.1

    def __init__(self, factor=1.0):
        self.factor = factor

    def __call__(self, slip):
        return 0.2 + 0.1 * np.exp(-slip)

    def derivative(self, slip):
        return -0.1 * self.factor * np.exp(-slip)


def with_constants(law, **constants):
    """Return a law with a maximum or a Lipschitz constant of its own."""
    for name, value in constants.items():
        setattr(law, name, value)
    return law


class Pressed:
    """s = 0.3 p / (1 + p) / (1 + slip), with derivatives times factors."""

    maximum, lipschitz = 0.3, 0.3

    def __init__(self, factor=1.0):
        self.factor = factor

    def __call__(self, slip, pressure):
        return 0.3 * pressure / (1 + pressure) / (1 + slip)

    def by_slip(self, slip, pressure):
        return -0.3 * pressure / (1 + pressure) / (1 + slip) ** 2

    def by_pressure(self, slip, pressure):
        return self.factor * 0.3 / (1 + pressure) ** 2 / (1 + slip)


class Squared:
    """p_nu = s^2, with a derivative times a factor."""

    def __init__(self, factor=1.0):
        self.factor = factor

    def __call__(self, s):
        return np.maximum(s, 0.0) ** 2

    def derivative(self, s):
        return 2 * self.factor * np.maximum(s, 0.0)


class Without:
    """A coefficient without a derivative, and a conductivity without anything."""

    maximum, lipschitz = 0.3, 0.0

    def __call__(self, slip):
        return 0.3 + 0 * slip


class Tanh:
    """phi_L = tanh, with a derivative times a factor."""

    def __init__(self, factor=1.0):
        self.factor = factor

    def __call__(self, s):
        return np.tanh(s)

    def derivative(self, s):
        return self.factor / np.cosh(s) ** 2


class Unbounded:
    """A coefficient that has a method of these alone."""

    def __call__(self, slip):
        return 0.3 + 0 * slip

    def derivative(self, slip):
        return 0 * slip


def layer(factor):
    return Layer(0.1, Squared(factor), PotentialFactor(10.0))


def conductor(factor):
    return Conductor(ShiftedConductivity(1.0, 10.0), 0.0, Tanh(factor))


class Steep(ShiftedConductivity):
    """Of the wrong sign."""

    def gap_slope(self, s, pressed):
        return -super().gap_slope(s, pressed)


WRONG = {
    "slip law of the wrong sign": lambda: problem(Friction(mu=Slipping(-1.0))),
    "slip law off by a factor": lambda: problem(Friction(mu=Slipping(2.0))),
    "law by pressure": lambda: problem(Friction(law=Pressed(-1.0))),
    "no number for a maximum": lambda: problem(
        Friction(mu=with_constants(Slipping(), maximum="large"))
    ),
    "layer": lambda: problem(layer=layer(-1.0)),
    "drive of the current": lambda: problem(piezo=PZT, conductor=conductor(-1.0)),
    "conductivity": lambda: problem(piezo=PZT, conductor=Conductor(Steep(1.0, 10.0), 0.0)),
    "no derivative": lambda: problem(Friction(mu=Without())),
    "no bound": lambda: problem(Friction(mu=Unbounded())),
    "no conductivity": lambda: problem(piezo=PZT, conductor=Conductor(Without(), 0.0)),
    "no derivative of the drive": lambda: problem(
        piezo=PZT, conductor=Conductor(ShiftedConductivity(1.0, 10.0), 0.0, Without())
    ),
    "a crystal out of the plane": lambda: problem(law=Anisotropic(hexagonal(**STIFF))),
    "a coupling out of the plane": lambda: problem(piezo=piezo_of(**(COUPLING | {"e15": 0.0}))),
    "a coupling that shears the body out of the plane": lambda: problem(piezo=piezo_of(**COUPLING)),
    "a matrix in place of a law": lambda: problem(law=hexagonal(**STIFF)),
}


@pytest.mark.wording
def test_messages_of_wrong_laws(snapshot):
    snapshot("wrong-laws", {name: message_of(make) for name, make in WRONG.items()})


def test_right_laws_are_accepted():
    problem(Friction(mu=Slipping()))
    problem(Friction(law=Pressed()))
    problem(Friction(mu=SlipCoefficient(0.5, 0.2, 1e4)))
    problem(layer=layer(1.0))
    problem(layer=Layer(np.inf, Compliance(0.1), PotentialFactor(10.0, 2.0, 128.0)))
    problem(piezo=PZT, conductor=conductor(1.0))
    problem(piezo=PZT, conductor=Conductor(ShiftedConductivity(1.0, 10.0), 1.0, Truncation(0.5)))
    for law in (
        Anisotropic(hexagonal(**STIFF)).in_plane(),
        Anisotropic(hexagonal(**STIFF)).rotated(np.eye(3)),
        Anisotropic(isotropic(7.0, 0.3)),
    ):
        problem(law=law)


def test_a_crystal_in_the_plane_is_stiffer_along_its_axis():
    law = Anisotropic(hexagonal(**STIFF)).in_plane()
    assert law.stiffness[1, 1] == pytest.approx(STIFF["c33"])
    assert law.stiffness[0, 0] == pytest.approx(STIFF["c11"])


@pytest.mark.parametrize("slope", [lambda s: 1 + 0 * s, lambda s: -3 * s**2, lambda s: 0 * s])
def test_a_wrong_derivative_is_one_anywhere(slope):
    with pytest.raises(InputError, match=r"\[law-derivative\]"):
        check_slope("f", lambda s: s**3, slope, np.logspace(-9, 3, 49))
