"""Smoothed aggregation whose coarse operator ranks make of their own rows.

Solutions are corrected where they leave too much, and only where a correction helps.
Options of the user for multigrid: those of GAMG hold on the levels that ranks make, too.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact import Body, Contact, Fixed, Load, Plane
from contact.linear.layout import options
from contact.linear.multigrid import AGGREGATES, DEFAULTS, Aggregation, masked_motions, tentative
from contact.linear.operator import SparseOperator
from contact.linear.petsc import refine
from contact.mesh.grid import box
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.problems import mechanics

WORLD = MPI.COMM_WORLD


def level_of(problem: ContactProblem, steps: int = 1) -> tuple[PETSc.Mat, Aggregation]:
    """Return the stiffness of a body, and its first coarse level. Collective."""
    body = problem.body
    matrix = body.create_matrix()
    body.assemble(matrix, "secant", problem.start())
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setNearNullSpace(masked_motions(body.layout))
    return matrix, Aggregation(matrix, aggregates(matrix), steps)


def aggregates(matrix: PETSc.Mat, threshold: str = "0.01") -> PETSc.Mat:
    """Return the tentative interpolation of a matrix. Collective."""
    names = {k: v for k, v in DEFAULTS.items() if k.startswith("pc_gamg_")}
    names["pc_gamg_threshold"] = threshold
    with options("coarsened_", names | AGGREGATES):
        found = tentative(matrix, "coarsened_")
    assert found is not None
    return found


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("n", "steps"), [(1, 1), (8, 1), (8, 2)])
def test_the_coarse_operator_is_that_of_petsc(n: int, steps: int) -> None:
    """Also of another matrix and with other rows of P; and where ranks have no nodes.

    Rows of wider interpolation reach columns of ranks whose rows of K do not.
    """
    matrix, level = level_of(mechanics.leaning_block(WORLD, n), steps)
    for factor in (1.0, 3.0):
        matrix.scale(factor)
        starts, columns, values = level.rows.getValuesCSR()
        level.rows.setValuesIJV(starts, columns, factor * values)
        level.rows.assemble()
        check_coarse_operator(matrix, level)


@pytest.mark.parallel
def test_the_interpolation_is_smoothed_by_one_step_of_jacobi() -> None:
    """Coarse rigid motions become (1 - w D^-1 K) B of those of the body, with one w for all."""
    problem = mechanics.leaning_block(WORLD, 8)
    matrix, level = level_of(problem)
    coarse, diagonal = level.update(), matrix.getDiagonal()
    modes = (each.getNearNullSpace().getVecs() for each in (matrix, coarse))
    damping = []
    for fine, rough in zip(*modes, strict=True):
        assert abs(rough.norm() - 1) <= 1e-12
        strained, moved = matrix * fine, fine - level.interpolation * rough / level.unit
        moved.pointwiseMult(moved, diagonal)
        damping.append(moved.dot(strained) / strained.dot(strained))
        moved.axpy(-damping[-1], strained)
        assert moved.norm() <= 1e-12 * matrix.norm()
    assert np.ptp(damping) <= 1e-10 * damping[0]
    assert 0.2 < damping[0] < 1.4


@pytest.mark.parallel
@pytest.mark.parametrize("steps", [0, 2])
def test_the_interpolation_is_smoothed_as_often_as_asked_for(steps: int) -> None:
    """Coarse rigid motions become (1 - w D^-1 K)^steps B, with w of the same K for one step."""
    problem = mechanics.leaning_block(WORLD, 8)
    matrix, level = level_of(problem, steps)
    _, once = level_of(problem)
    diagonal = matrix.getDiagonal()
    levels = (level.update(), once.update())
    modes = (each.getNearNullSpace().getVecs() for each in (matrix, *levels))
    for fine, rough, other in zip(*modes, strict=True):
        step = fine - once.interpolation * other / once.unit
        strained = matrix * fine
        strained.pointwiseDivide(strained, diagonal)
        damping = step.dot(strained) / strained.dot(strained)
        expected = fine.copy()
        for _ in range(steps):
            strained = matrix * expected
            strained.pointwiseDivide(strained, diagonal)
            expected.axpy(-damping, strained)
        assert (level.interpolation * rough / level.unit - expected).norm() <= 1e-12 * fine.norm()
        assert step.norm() > 1e-3 * fine.norm()


@pytest.mark.parallel
@pytest.mark.parametrize("stress", [1.0, 2.0**-60, 2.0**80])
def test_the_coarse_operator_has_numbers_near_one(stress: float) -> None:
    """Those below 2e-14 are zero to PETSc."""
    problem = mechanics.leaning_block(WORLD, 8)
    matrix, _ = level_of(problem)
    modes = matrix.getNearNullSpace()
    matrix.scale(stress)
    matrix.setNearNullSpace(modes)
    diagonal = Aggregation(matrix, aggregates(matrix)).update().getDiagonal()
    assert 0.1 < diagonal.norm(PETSc.NormType.NORM_1) / diagonal.getSize() < 100


def check_coarse_operator(matrix: PETSc.Mat, level: Aggregation) -> None:
    """Check that the coarse operator is P^T K P by PETSc."""
    found = level.update()
    expected = matrix.ptap(level.interpolation.convert("aij", PETSc.Mat()))
    assert found.getBlockSize() == 6
    assert found.getSizes() == expected.getSizes()
    vector = expected.createVecRight()
    vector.setRandom()
    assert (found * vector - expected * vector).norm() <= 1e-13 * (expected * vector).norm()


@pytest.mark.parallel
def test_entries_may_be_zero_where_others_are_later() -> None:
    """The pattern of the coarse operator lacked those that the first values made zero."""
    body = (problem := mechanics.leaning_block(WORLD, 4)).body
    coupled = body.create_matrix()
    body.assemble(coupled, "secant", problem.start())
    matrix = coupled.copy()
    starts, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(*matrix.getOwnershipRange()), np.diff(starts))
    matrix.setValuesCSR(starts, columns, np.where(rows % 3 == columns % 3, values, 0.0))
    matrix.assemble()
    matrix.setNearNullSpace(masked_motions(body.layout))
    level = Aggregation(matrix, aggregates(matrix, "0"))
    level.update()
    coupled.copy(matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    check_coarse_operator(matrix, level)


@pytest.mark.parallel
def test_rounding_on_one_side_of_a_symmetric_matrix() -> None:
    """With a threshold of zero one rank broke off, and the others waited for it."""
    body = (problem := mechanics.leaning_block(WORLD, 8)).body
    matrix = body.create_matrix()
    body.assemble(matrix, "secant", problem.start())
    starts, columns, values = matrix.getValuesCSR()
    rows = np.repeat(np.arange(*matrix.getOwnershipRange()), np.diff(starts))
    small = 1e-17 * np.random.default_rng(WORLD.rank).integers(0, 2, values.size)
    tiny = (rows // 3 != columns // 3) & (rows % 3 == 0) & (columns % 3 == 0)
    weak = np.abs(values) < 0.2 * np.abs(values).max()
    values = np.where(
        rows % 3 == columns % 3, np.where(weak, np.where(tiny, small, 0.0), values), 0.0
    )
    matrix.setValuesCSR(starts, columns, values)
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    matrix.setNearNullSpace(masked_motions(body.layout))
    found = aggregates(matrix, "0")
    assert matrix.isSymmetricKnown() == (True, True)
    ones = found.createVecRight()
    ones.set(1.0)
    assert (found * ones).norm() > 0


@pytest.mark.core
@pytest.mark.parallel
def test_multigrid_knows_rigid_motions_with_inclined_supports() -> None:
    """Their matrix is copied, and lost them on the way: the program broke off."""
    tilt = np.sqrt(0.5)
    domain = box(WORLD, [0.0] * 3, [2.0, 1.0, 1.0], [16, 8, 8], rotation=45.0)
    rollers = [Fixed(side, normal=mechanics.constant(0.0, 3)) for side in ("left", "front", "top")]
    body = Body(Linear(1.0, 0.3), rollers, [Load("right", pressure=mechanics.constant(0.1, 3))])
    plane = Plane((0.0, 0.0, 0.0), (tilt, 0.0, tilt))
    problem = ContactProblem(domain, body, Contact("bottom", plane))
    found, blocks = {}, np.tile(np.eye(3), (problem.nodes.nodes.size, 1, 1))
    for kind in ("iterative", "lu"):
        operator = SparseOperator(problem.body, problem.nodes.nodes, solver=kind)
        operator.update("secant", problem.start(), blocks)
        found[kind] = operator.solve(problem.body.external())
    norm = problem.body.norm
    assert norm(found["iterative"] - found["lu"]) <= 1e-8 * norm(found["lu"])


@pytest.mark.parallel
def test_how_petsc_multiplies_on_several_ranks_is_no_matter_of_one() -> None:
    """The option of the user stays, and was unknown to the product of one rank."""
    known = PETSc.Options()
    problem = mechanics.leaning_block(WORLD, 4)
    _, level = level_of(problem)
    expected = level.update().norm()
    _, level = level_of(problem)
    known["matptap_via"] = "nonscalable"
    try:
        assert abs(level.update().norm() - expected) <= 1e-12 * expected
        assert known.getString("matptap_via") == "nonscalable"
    finally:
        known.delValue("matptap_via")


SIZE = np.array([2.0, 3.0, 4.0, 5.0])


def vector(values):
    return PETSc.Vec().createWithArray(np.array(values, dtype=float), comm=MPI.COMM_SELF)


@pytest.mark.parametrize("wrong", [-1.0, 0.0, 5.0])
def test_each_connected_component_takes_the_corrections_that_help_it(wrong):
    """A correction that helped one was taken as a whole, whatever it did to another."""
    matrix = PETSc.Mat().createAIJ((4, 4), nnz=1, comm=MPI.COMM_SELF)
    matrix.setDiagonal(vector(SIZE))
    matrix.assemble()
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=1e-8)

    def solve(asked, found):
        found.array[:] = asked.array_r / SIZE * np.array([1.0, 1.0, wrong, wrong])

    solution = vector([0.1, 0.2, 0.3, 0.4])
    refine(ksp, vector(SIZE), solution, solve, (np.array([0, 0, 1, 1]), 2))
    assert np.allclose(solution.array_r, [1.0, 1.0, 0.3, 0.4], rtol=0, atol=1e-12)


RTOL = 1e-8


def refined(sizes, off, components=None):
    """Return what is left over each right-hand side, and the tolerance of each correction.

    Solutions of unit systems are a part `off` wrong, and the solver is as bad as norms may differ:
    what it leaves is the root of its tolerance of all that it was asked for.
    """
    sizes, asked_for = np.array(sizes), []
    matrix = PETSc.Mat().createAIJ((sizes.size, sizes.size), nnz=1, comm=MPI.COMM_SELF)
    matrix.setDiagonal(vector(np.ones(sizes.size)))
    matrix.assemble()
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=RTOL)

    def solve(asked, found):
        asked_for.append(ksp.getTolerances()[0])
        unseen = 0.99 * asked_for[-1] ** 0.5 * asked.norm()
        values = asked.array_r
        found.array[:] = np.sign(values) * np.maximum(np.abs(values) - unseen, 0.0)

    solution = vector(sizes * (1 - np.array(off)))
    refine(ksp, vector(sizes), solution, solve, components)
    assert ksp.getTolerances()[0] == RTOL
    return np.abs(1 - solution.array_r / sizes), asked_for


@pytest.mark.parametrize(("off", "digits"), [(1.0, 8), (1e-2, 4), (2e-4, 0.61)])
def test_a_correction_is_asked_for_the_digits_that_are_missing(off, digits):
    """Once, by as much as norms may differ: all digits are no better, fewer need another one."""
    left, asked_for = refined([3.0], [off])
    assert -np.log10(asked_for) == pytest.approx([digits], abs=0.02)
    assert left[0] <= RTOL**0.5


def test_no_piece_waits_for_its_correction_because_another_is_larger():
    """Each of four took a correction of its own, and the last one got none."""
    sizes, count = [1.0, 1e-2, 1e-4, 1e-6], 4
    left, _ = refined(sizes, 4 * [1e-2], (np.arange(count), count))
    assert left.max() <= RTOL**0.5


def solved(given: dict[str, str]) -> tuple[SparseOperator, PETSc.PC, int]:
    """Return an operator that has solved with options, its preconditioner and iterations.

    Without the operator the preconditioner is empty. Collective.
    """
    problem = mechanics.leaning_block(WORLD, 8)
    blocks = np.tile(np.eye(3), (problem.nodes.nodes.size, 1, 1))
    rhs = problem.body.layout.mask(problem.body.external())
    known = PETSc.Options("contact_")
    for name, value in given.items():
        known[name] = value
    try:
        operator = SparseOperator(problem.body, problem.nodes.nodes, solver="iterative")
        operator.update("secant", problem.start(), blocks)
        found = operator.solve(rhs)
    finally:
        for name in given:
            known.delValue(name)
    residual = problem.body.norm(operator.multiply(found) - rhs)
    assert residual <= 1e-7 * problem.body.norm(rhs)
    return operator, operator.ksp.getPC(), operator.counters.linear_iterations


@pytest.mark.parallel
def test_cycles() -> None:
    """They were those of the levels of GAMG alone."""
    _usual, pc, usual = solved({})
    assert pc.getType() == "mg"
    assert pc.getMGCoarseSolve().getType() == "preonly"
    *_, twice = solved({"pc_mg_multiplicative_cycles": "2"})
    assert twice < 0.8 * usual
    _w, pc, taken = solved({"pc_mg_cycle_type": "w", "pc_gamg_coarse_eq_limit": "20"})
    coarse = pc.getMGCoarseSolve()
    assert coarse.getType() == "richardson"
    assert coarse.getIterationNumber() == 2
    assert coarse.getPC().getMGLevels() > 1
    # equal solves on ranks may differ by one: sums of random vectors bound Chebyshev's smoother
    assert taken <= solved({"pc_gamg_coarse_eq_limit": "20"})[2] + 1
    _additive, pc, additive = solved({"pc_mg_type": "additive"})
    assert pc.getMGType() == PETSc.PC.MGType.ADDITIVE
    assert additive > usual
