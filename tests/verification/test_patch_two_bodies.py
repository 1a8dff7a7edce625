"""Patch tests of two bodies in contact: constant stresses pass through any pair of meshes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact import Body, Contact, Domain, Fixed, Friction, GapFunction, Load, Material, from_file
from contact.interface.nodes import ContactNodes
from contact.mesh.cells import Shape
from contact.mesh.domain import revolved
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.fields import DerivedFields
from contact.typing import Array
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from scripts.force_balance import force_balance
from tests.problems.blocks import Blocks, squares, write_unlike
from tests.problems.mechanics import Affine, constant, hooke, state_of

COMM = MPI.COMM_WORLD
KINDS = [
    (2, 1, "triangle"),
    (2, 2, "triangle"),
    (2, 1, "quadrilateral"),
    (2, 2, "quadrilateral"),
    (3, 1, "tetrahedron"),
    (3, 2, "tetrahedron"),
    (3, 1, "hexahedron"),
    (3, 2, "hexahedron"),
]
NAMES = [f"{cell}-{degree}" for _, degree, cell in KINDS]
CURVED = [cell for _, degree, cell in KINDS if degree == 2]
SIDES = {2: ("left", "right"), 3: ("left", "right", "front", "back")}
ROLLERS = {dim: (("bottom", dim - 1), ("left", 0), ("front", 1))[:dim] for dim in (2, 3)}
NOTHING = GapFunction(lambda points: np.zeros(len(points)))


def constants(values: Array) -> list:
    return [constant(float(value), len(values)) for value in values]


def blocks(dim: int, **more) -> Blocks:
    upper, lower = (5, 8) if dim == 2 else (2, 3)
    return Blocks(dim, upper, lower, **more)


def contact(on: str, against: str, mu: float = 0.0) -> Contact:
    friction = Friction(ConstantCoefficient(mu)) if mu > 0 else Friction()
    return Contact(on, NOTHING, friction=friction, against=against)


PAIRS = [("under", "over"), ("over", "under")]

#: Either side the slave, each solved one way and in one place: by both on all cells.
DENSE = [(PAIRS[0], True), (PAIRS[1], False)]
TURNED = [(PAIRS[0], 0.0), (PAIRS[1], 30.0)]


def check_constant_pressure(
    domain: Domain,
    rollers: Sequence[tuple[str, int]],
    degree: int,
    pair: Sequence[str],
    dense: bool,
    stiff: float = 100.0,
) -> tuple[ContactNodes, Array]:
    """Check that the pressure is that on top, for a lower block that is `stiff` times as stiff.

    Return the contact nodes, and the stresses in the cells, shape (n, 9).
    """
    dim = domain.dim
    zero = constant(0.0, dim)
    fixed = [
        Fixed(part, [zero if i == axis else None for i in range(dim)]) for part, axis in rollers
    ]
    laws = {"upper": Linear(1.0, 0.3), "lower": Linear(stiff, 0.2)}
    materials = [Material(law, on=(name,)) for name, law in laws.items()]
    load = Load("top", pressure=constant(0.01, dim))
    body = Body(materials, fixed, [load])
    problem = ContactProblem(domain, body, contact(*pair), degree=degree)
    state = state_of(problem, condense=dense)
    np.testing.assert_allclose(state.multipliers.contact, 0.01, rtol=1e-12)
    stress = DerivedFields(problem.body, state).cells()["stress"].x.array.reshape(-1, 9)
    k = 4 * (dim - 1)
    np.testing.assert_allclose(stress[:, k], -0.01, rtol=1e-10)
    assert force_balance(problem, state).imbalance < 1e-12
    return problem.nodes, stress


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("pair", "condense"), DENSE, ids=["upper-dense", "lower-sparse"])
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_constant_pressure(
    dim: int, degree: int, cell: str, pair: Sequence[str], condense: bool
) -> None:
    domain = blocks(dim, grading=1.4, cell=cell).domain(COMM)
    check_constant_pressure(domain, ROLLERS[dim], degree, pair, condense)


@pytest.mark.parallel
@pytest.mark.parametrize("pair", PAIRS, ids=["upper", "lower"])
@pytest.mark.parametrize("cell", CURVED)
def test_constant_pressure_between_facets_curved_in_their_plane(
    cell: str, pair: Sequence[str]
) -> None:
    """With facets cut along straight lines pressures are off by up to 9 %."""
    dim = Shape(cell).dim
    domain = blocks(dim, cell=cell, bow=0.06).domain(COMM)
    check_constant_pressure(domain, ROLLERS[dim], 2, pair, True, 1.0)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_constant_pressure_of_unlike_cells(dim: int, shared_tmp_path: Path) -> None:
    """Simplices above, quadrilaterals or hexahedra below, as one file of Abaqus has them."""
    upper, lower = (
        blocks(dim, cell=cell, grading=1.4)
        for cell in {2: ("triangle", "quadrilateral"), 3: ("tetrahedron", "hexahedron")}[dim]
    )
    path = shared_tmp_path / "pair.inp"
    if COMM.rank == 0:
        write_unlike(path, upper, lower)
    COMM.barrier()
    domain = from_file(COMM, path)
    assert "become" in domain.notes[0]
    sides = (("left", 0), ("front", 1))[: dim - 1]
    rollers = [(f"{body}_{side}", k) for body in ("upper", "lower") for side, k in sides]
    for degree in (1, 2):
        for pair in PAIRS:
            check_constant_pressure(domain, [("bottom", dim - 1), *rollers], degree, pair, False)


@pytest.mark.parallel
@pytest.mark.parametrize("pair", PAIRS, ids=["upper", "lower"])
@pytest.mark.parametrize("degree", [1, 2])
def test_constant_pressure_on_discs(degree: int, pair: Sequence[str]) -> None:
    """Two discs about an axis: the pressure and sigma_zz are constant, rings and axis alike."""
    domain = revolved(blocks(2, grading=1.4).domain(COMM))
    nodes, stress = check_constant_pressure(domain, [("bottom", 1)], degree, pair, True, 7.0)
    assert nodes.sum(np.ones(nodes.nodes.size)) == pytest.approx(np.pi, rel=1e-12)
    np.testing.assert_allclose(np.delete(stress, 4, axis=1), 0, atol=1e-11)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("pair", "turn"), TURNED, ids=["upper-straight", "lower-turned"])
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_constant_stress_with_shear(
    dim: int, degree: int, cell: str, pair: Sequence[str], turn: float
) -> None:
    """Under full stick two bodies carry any constant stress, as one body does."""
    check_constant_stress(blocks(dim, turn=turn, cell=cell), degree, pair)


@pytest.mark.parallel
@pytest.mark.parametrize(("pair", "turn"), TURNED, ids=["upper-straight", "lower-turned"])
@pytest.mark.parametrize("cell", CURVED)
def test_constant_stress_between_facets_curved_in_their_plane(
    cell: str, pair: Sequence[str], turn: float
) -> None:
    check_constant_stress(blocks(Shape(cell).dim, turn=turn, cell=cell, bow=0.06), 2, pair)


LAW = Linear(1.0, 0.3)


def strain_of(given: Blocks) -> Array:
    """Return a strain along the axes of two blocks."""
    dim, axes = given.dim, given.axes
    strain = np.diag([0.002, 0.001, -0.01][-dim:]) + 0.002 * (1 - np.eye(dim))
    return axes @ strain @ axes.T


def check_constant_stress(given: Blocks, degree: int, pair: Sequence[str], *further: Fixed) -> None:
    """Check that two blocks have a constant stress under its tractions."""
    dim, axes, strain = given.dim, given.axes, strain_of(given)
    stress = hooke(LAW, strain)
    outward = {"left": -axes[:, 0], "right": axes[:, 0], "top": axes[:, -1]}
    outward |= {"front": -axes[:, 1], "back": axes[:, 1]}
    loads = [Load(part, constants(stress @ outward[part])) for part in ("top", *SIDES[dim])]
    body = Body(LAW, [Fixed("bottom", [Affine(tuple(row)) for row in strain]), *further], loads)
    problem = ContactProblem(given.domain(COMM), body, contact(*pair, mu=2.0), degree=degree)
    state = check_linear(problem, strain)
    vectors = state.multipliers.vectors(problem.nodes)
    np.testing.assert_allclose(vectors, -problem.nodes.normal @ stress, rtol=0, atol=1e-11)


def check_linear(problem: ContactProblem, strain: Array) -> State:
    """Check that the displacement of the solution is that of a constant strain."""
    state, dim = state_of(problem, 1e-12), len(strain)
    x = problem.body.space.tabulate_dof_coordinates()[:, :dim]
    np.testing.assert_allclose(state.x.reshape(-1, dim), x @ strain.T, rtol=0, atol=1e-12)
    return state


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("pair", PAIRS, ids=["upper", "lower"])
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_a_rim_that_is_held_carries_no_multiplier(
    dim: int, degree: int, cell: str, pair: Sequence[str]
) -> None:
    """All of the outer boundary follows a linear field: the functions of the rim go inwards."""
    given = blocks(dim, cell=cell)
    strain = strain_of(given)
    linear = [Affine(tuple(row)) for row in strain]
    body = Body(LAW, [Fixed(part, linear) for part in ("top", "bottom", *SIDES[dim])])
    problem = ContactProblem(given.domain(COMM), body, contact(*pair, mu=2.0), degree=degree)
    # The rim has no jump of its own, and the gap of the others is that of the linear field.
    check_linear(problem, strain)


@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_a_rim_that_is_held_along_the_surface(dim: int, degree: int, cell: str) -> None:
    """Friction acts there on the other body, which is not constrained: a constant shear passes."""
    given = blocks(dim, cell=cell)
    along = [Affine(tuple(row)) for row in strain_of(given)[:-1]]
    check_constant_stress(given, degree, PAIRS[0], Fixed("upper_left", [*along, None]))


@pytest.mark.core
@pytest.mark.parametrize(("dim", "degree", "cell"), KINDS, ids=NAMES)
def test_matching_meshes_are_one_body(dim: int, degree: int, cell: str) -> None:
    """Tied by friction along matching meshes, two blocks bend as one does."""
    n = 5 if dim == 2 else 2
    given = Blocks(dim, n, n, jitter=0.0, cell=cell)
    zero = constant(0.0, dim)
    load = Load("top", constants(np.array([3e-4, *[0.0] * (dim - 2), -0.01])))
    body = Body(Linear(1.0, 0.3), [Fixed("bottom", [zero] * dim)], [load])
    two = ContactProblem(
        given.domain(MPI.COMM_SELF), body, contact("under", "over", 50.0), degree=degree
    )
    state = state_of(two, 1e-12)
    assert (state.multipliers.contact > 0).all()
    joined = given.joined(MPI.COMM_SELF)
    far = GapFunction(lambda points: np.full(len(points), 1e3))
    one = ContactProblem(joined, body, Contact("top", far), degree=degree)
    alone = state_of(one, 1e-12)
    spaces = [problem.body.space for problem in (two, one)]
    points, others = (space.tabulate_dof_coordinates()[:, :dim] for space in spaces)
    distance, nearest = cKDTree(others).query(points)
    assert distance.max() < 1e-12
    values, expected = state.x.reshape(-1, dim), alone.x.reshape(-1, dim)
    np.testing.assert_allclose(values, expected[nearest], rtol=0, atol=1e-10 * np.abs(values).max())


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("condense", [True, False], ids=["dense", "sparse"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_chain_of_bodies(degree: int, condense: bool) -> None:
    """Three blocks on each other: the middle one has a part `on`, and one `against` it."""
    domain = squares(COMM, [(0, 0), (0, 1), (0, 2)], (4, 5, 3))
    zero = constant(0.0, 2)
    laws = [Linear(young, 0.3) for young in (2.0, 1.0, 5.0)]
    materials = [Material(law, on=(f"body{k}",)) for k, law in enumerate(laws)]
    fixed = [Fixed("bottom0", [None, zero]), *(Fixed(f"left{k}", [zero, None]) for k in range(3))]
    body = Body(materials, fixed, [Load("top2", pressure=constant(0.01, 2))])
    pairs = [contact("bottom1", "top0"), contact("bottom2", "top1")]
    state = state_of(ContactProblem(domain, body, pairs, degree=degree), condense=condense)
    np.testing.assert_allclose(state.multipliers.contact, 0.01, rtol=1e-12)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("condense", [True, False], ids=["dense", "sparse"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_corner_that_is_on_one_body_and_against_another(degree: int, condense: bool) -> None:
    """The corner of a block presses on the one below, and the one beside presses on it."""
    domain = squares(COMM, [(0, 0), (0, 1), (1, 1)], (4, 5, 3))
    zero = constant(0.0, 2)
    rollers = [("bottom0", 1), ("left0", 0), ("left1", 0), ("bottom2", 1)]
    fixed = [Fixed(part, [None if i != axis else zero for i in range(2)]) for part, axis in rollers]
    loads = [Load("top1", pressure=constant(0.01, 2)), Load("right2", pressure=constant(0.02, 2))]
    body = Body(Linear(1.0, 0.3), fixed, loads)
    pairs = [contact("bottom1", "top0"), contact("left2", "right1")]
    problem = ContactProblem(domain, body, pairs, degree=degree)
    state = state_of(problem, condense=condense)
    expected = np.where(np.abs(problem.nodes.normal[:, 0]) > 0.5, 0.02, 0.01)
    np.testing.assert_allclose(state.multipliers.contact, expected, rtol=1e-12)
