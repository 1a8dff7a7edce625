"""Patch tests in front of rigid foundations on cells of all shapes, none of them regular."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Load, Plane
from contact.mesh.domain import revolved
from contact.problem.problem import ContactProblem
from contact.results.fields import DerivedFields
from forms.hencky import Linear, Log
from forms.j2 import J2
from forms.laws import ConstantCoefficient
from scripts.force_balance import force_balance
from tests.problems.mechanics import Affine, constant, hooke, state_of
from tests.problems.quadrilaterals import SHAPES, unit_block

COMM = MPI.COMM_WORLD
CELLS = [cell for cells in SHAPES.values() for cell in cells]
KINDS = [
    *((cell, degree, "standard") for cell in CELLS for degree in (1, 2)),
    ("quadrilateral", 1, "mean_dilatation"),
    ("hexahedron", 1, "mean_dilatation"),
]
NAMES = [f"{cell}-{degree}-{element}" for cell, degree, element in KINDS]
CORE = [name for name in NAMES if name != "hexahedron-1-mean_dilatation"]


def ground(dim: int) -> Plane:
    return Plane((0.0,) * dim, (*(0.0,) * (dim - 1), 1.0))


@pytest.mark.core(*(f"{kind}-dense" for kind in CORE))
@pytest.mark.parallel
@pytest.mark.parametrize("condense", [True, False], ids=["dense", "sparse"])
@pytest.mark.parametrize(("cell", "degree", "element"), KINDS, ids=NAMES)
def test_uniform_pressure(cell: str, degree: int, element: str, condense: bool) -> None:
    domain = unit_block(COMM, cell)
    dim = domain.dim
    zero = constant(0.0, dim)
    sides = zip(("left", "front")[: dim - 1], range(dim - 1), strict=True)
    fixed = [Fixed(part, [zero if i == k else None for i in range(dim)]) for part, k in sides]
    body = Body(Linear(1.0, 0.3), fixed, [Load("top", pressure=constant(0.02, dim))])
    problem = ContactProblem(
        domain, body, Contact("bottom", ground(dim)), degree=degree, element=element
    )
    state = state_of(problem, condense=condense)
    np.testing.assert_allclose(state.multipliers.contact, 0.02, rtol=1e-12)
    stress = DerivedFields(problem.body, state).cells()["stress"].x.array.reshape(-1, 9)
    np.testing.assert_allclose(stress[:, 4 * (dim - 1)], -0.02, rtol=1e-10)
    assert problem.nodes.weight.min(initial=1.0) > 1e-3
    assert force_balance(problem, state).imbalance < 1e-12


@pytest.mark.core(*CORE)
@pytest.mark.parallel
@pytest.mark.parametrize(("cell", "degree", "element"), KINDS, ids=NAMES)
def test_constant_shear_under_stick(cell: str, degree: int, element: str) -> None:
    """The foundation holds a block that is pressed and pushed aside: u is linear in the height."""
    domain = unit_block(COMM, cell)
    dim, law = domain.dim, Linear(1.0, 0.3)
    gradient = np.zeros((dim, dim))
    gradient[:, -1] = [0.003, 0.002, -0.01][-dim:]
    strain = (gradient + gradient.T) / 2
    stress = hooke(law, strain)
    outward = {"left": -np.eye(dim)[0], "right": np.eye(dim)[0]}
    if dim == 3:
        outward |= {"front": -np.eye(3)[1], "back": np.eye(3)[1]}
    loads = [
        Load(part, [constant(float(value), dim) for value in stress @ normal])
        for part, normal in outward.items()
    ]
    fixed = [Fixed("top", [Affine(tuple(row)) for row in gradient])]
    friction = Friction(ConstantCoefficient(2.0))
    body, contact = Body(law, fixed, loads), Contact("bottom", ground(dim))
    problem = ContactProblem(domain, body, contact, friction, degree=degree, element=element)
    state = state_of(problem, 1e-13)
    x = problem.body.space.tabulate_dof_coordinates()[:, :dim]
    np.testing.assert_allclose(state.x.reshape(-1, dim), x @ gradient.T, rtol=0, atol=1e-12)
    vectors = state.multipliers.vectors(problem.nodes)
    np.testing.assert_allclose(vectors, -problem.nodes.normal @ stress, rtol=0, atol=1e-11)


@pytest.mark.core("1-standard-linear", "1-mean_dilatation-linear", "2-standard-j2")
@pytest.mark.parallel
@pytest.mark.parametrize("law", ["linear", "log", "j2"])
@pytest.mark.parametrize(
    ("degree", "element"), [(1, "standard"), (1, "mean_dilatation"), (2, "standard")]
)
def test_discs_about_an_axis(degree: int, element: str, law: str) -> None:
    """Between frictionless plates, with a free rim: uniaxial stress, past first yield too."""
    domain = revolved(unit_block(COMM, "quadrilateral"))
    laws = {
        "linear": Linear(1.0, 0.3),
        "log": Log(1.0, 0.3, yield_strain=0.005),
        "j2": J2(1.0, 0.3, yield_stress=0.01, hardening=0.1),
    }
    body = Body(laws[law], [Fixed("top", [None, constant(-0.02, 2)])])
    contact = Contact("bottom", ground(2))
    problem = ContactProblem(domain, body, contact, degree=degree, element=element)
    state = state_of(problem, 1e-12)
    assert problem.nodes.sum(np.ones(problem.nodes.nodes.size)) == pytest.approx(np.pi, rel=1e-12)
    stress = DerivedFields(problem.body, state).cells()["stress"].x.array.reshape(-1, 9)
    np.testing.assert_allclose(np.delete(stress, 4, axis=1), 0, atol=1e-10)
    pressure = problem.nodes.gather(state.multipliers.contact)
    np.testing.assert_allclose(pressure, -stress[0, 4] if len(stress) else pressure, atol=1e-10)
    if law == "linear":
        np.testing.assert_allclose(pressure, 0.02, rtol=1e-10)
    if law == "j2":
        # Y + H a, with the plastic strain a = 0.02 - sigma/E.
        np.testing.assert_allclose(pressure, (0.01 + 0.1 * 0.02) / 1.1, rtol=1e-8)
