"""Friction multipliers are tangential, whatever the method; the residual sees where they are not.

Two contacts on one small body let errors along the normal grow: each contact presses by another
amount then, with all three residuals below the tolerance.
Friction that is given in Python: what resists is a number that is not negative.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact import (
    Body,
    Contact,
    Electric,
    Fixed,
    Friction,
    InputError,
    Linear,
    Problem,
    SlipCoefficient,
)
from contact.interface.multipliers import Multipliers
from contact.mesh.grid import rectangle
from contact.problem.residuals import evaluate
from contact.solving import solve
from forms.laws import ConstantCoefficient, Coulomb
from tests.problems.mechanics import bar, leaning_block
from tests.problems.rings import between_plates, squeezed

COMM = MPI.COMM_WORLD

RING = Path(meshes.__file__).parent / "fixtures" / "ring.msh"


def along_normal(problem, multipliers) -> float:
    """Return the largest normal component of friction over the largest pressure. Collective."""
    largest = problem.nodes.maximum(np.abs(problem.nodes.normal_component(multipliers.friction)))
    return largest / problem.nodes.maximum(multipliers.contact)


def forces_of(solution) -> np.ndarray:
    """Return what each contact exerts, shape (contacts, d). Collective."""
    problem, nodes = solution.problem, solution.problem.nodes
    vectors = solution.multipliers.contact[:, None] * nodes.normal + solution.multipliers.friction
    sizes = [own.nodes.nodes.size for own in problem.geometries]
    groups = np.split(nodes.weight[:, None] * vectors, np.cumsum(sizes)[:-1])
    return problem.comm.allreduce(np.array([group.sum(axis=0) for group in groups]), op=MPI.SUM)


def check(solution) -> None:
    """Only the two contacts press on the ring: their forces are opposite. Collective."""
    assert solution.converged, solution.outcome.reason
    assert along_normal(solution.problem, solution.multipliers) < 1e-14
    plate, lid = forces_of(solution)
    assert abs(plate[1]) > 1e-6
    assert plate[1] == pytest.approx(-lid[1], rel=1e-7)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(
    ("method", "seed"), [("newton", 0), ("newton", 1), ("uzawa", 3), ("penalty", 2)]
)
def test_plate_and_lid_press_a_ring_alike(method, seed):
    # Penalty springs take thousands of steps to find where a free ring stays.
    case = squeezed(method, guided=method == "penalty")
    check(solve(case, domain=between_plates(COMM, seed)))


@pytest.mark.parametrize("method", ["newton", pytest.param("uzawa", marks=pytest.mark.slow)])
def test_pressures_balance_the_reaction(method):
    """Uzawa's pressures have differed by 1.8 % here, with all residuals below 1e-9."""
    moduli = {
        "ring": (0.43666293017617736, 0.45),
        "plate": (0.6751374270856283, 0.2),
        "lid": (9.825794969270524, 0.45),
    }
    case = squeezed(method, moduli, "ring_top", -0.004130309947621388, file=str(RING))
    solution = solve(case, comm=MPI.COMM_SELF)
    nodes = solution.problem.nodes
    assert along_normal(solution.problem, solution.multipliers) < 1e-14
    assert solution.converged or method == "uzawa"
    if solution.converged:
        check(solution)
        for side in (nodes.normal[:, 1] > 0, nodes.normal[:, 1] < 0):
            pressed = nodes.sum(solution.multipliers.contact * side)
            assert pressed == pytest.approx(2.3788e-5, rel=2e-4)


@pytest.mark.core
@pytest.mark.parametrize("share", [1e-3, -1e-3])
def test_residual_sees_friction_along_the_normal(share):
    """On sticking, slipping and open nodes, and where forces stay balanced."""
    solution = solve(squeezed("newton", tolerance=1e-11), domain=between_plates(MPI.COMM_SELF, 0))
    problem, state, nodes = solution.problem, solution.state, solution.problem.nodes
    assert evaluate(problem, state).largest < 1e-10
    closed = solution.status != "open"
    for there in (closed, ~closed):
        size = share * state.multipliers.contact.max() * there
        friction = state.multipliers.friction + size[:, None] * nodes.normal
        pressure = state.multipliers.contact - size * closed
        for taken in (state.multipliers.contact, pressure):
            wrong = replace(state, multipliers=Multipliers(taken, friction))
            assert evaluate(problem, wrong).friction > 1e-5


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_tangential_part_of_a_displacement_nearly_along_the_normal(dim):
    """Beside a large normal displacement the small tangential one has no part along the normal."""
    nodes = leaning_block(MPI.COMM_SELF, 2).nodes if dim == 3 else bar(MPI.COMM_SELF, 4).nodes
    rng = np.random.default_rng(dim)
    normal = rng.standard_normal(nodes.normal.shape)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    tangent = np.eye(dim) - normal[:, :, None] * normal[:, None, :]
    nodes = replace(nodes, normal=normal, tangential_projector=tangent)
    small = np.einsum("nij,nj->ni", tangent, rng.standard_normal(normal.shape))
    part = nodes.tangential_component(normal + 1e-9 * small)
    size = np.linalg.norm(part, axis=1)
    assert np.all(np.abs(nodes.normal_component(part)) < 1e-15 * size)
    np.testing.assert_allclose(part, 1e-9 * small, rtol=0, atol=1e-15)


def problem(contact, friction=None):
    """Return a block that is pressed down and pulled aside."""
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    body = Body(Linear(10.0, 0.3), Fixed("top", [0.01, -0.01]))
    return Problem(domain, body, contact, friction)


class Pulling(Coulomb):
    """A law whose friction pulls."""

    def __init__(self):
        super().__init__(ConstantCoefficient(0.3))

    def __call__(self, slip, pressure):
        """Return the bound."""
        return -0.3 * pressure + 0 * slip

    def by_pressure(self, slip, pressure):
        """Return the derivative by the pressure."""
        return -0.3 + 0 * slip


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
        (lambda: Friction(law=Pulling()), "law: s/p, the coefficient, is -0.3"),
    ],
)
def test_what_resists_is_not_negative(friction, said):
    with pytest.raises(InputError, match=rf"{said}.*\[(negative|not-finite)\]"):
        problem(Contact("bottom", friction=friction()))


def test_what_has_no_effect_is_refused():
    for law in ({}, {"tresca": 0.01}):
        with pytest.raises(InputError, match=r"radius"):
            Friction(radius=0.1, **law)
    with pytest.raises(InputError, match=r"contact.*\[piezo\]"):
        problem(Contact("bottom", conductor=Electric(k_e=1.0)))


def test_values_at_contact_nodes_cannot_be_changed():
    """Results after that were of two kinds."""
    contact = solve(problem(Contact("bottom"))).contact
    with pytest.raises(ValueError, match="read-only"):
        contact.pressure[:] = 0.0


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
