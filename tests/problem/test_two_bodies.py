"""Two bodies: how they are constrained, and methods and ranks that agree."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Problem, parse_case, solve
from contact.errors import InputError, SingularError
from contact.linear.operator import SparseOperator
from contact.mesh.domain import from_mesh
from contact.methods.options import FixedPointOptions, PenaltyOptions
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.material import Material
from contact.model.obstacle import GapFunction
from contact.problem.checks import check_rigid_modes
from contact.problem.problem import ContactProblem
from contact.results.contact_nodes import contact_table
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty
from contact.thesis.softest_mode import softest_mode
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.blocks import Blocks
from tests.problems.everywhere import agree, at_all, pressures
from tests.problems.mechanics import constant, solved_by, state_of
from tests.problems.mechanics import solve as relax
from tests.problems.meshes import midpoints
from tests.problems.overlapping import boxes
from tests.problems.pairs import case

COMM = MPI.COMM_WORLD
NOTHING = GapFunction(lambda points: np.zeros(len(points)))
ZERO = constant(0.0, 2)


def pushed(comm, degree=1, dim=2, mu=0.3, supports=(), gap=0.0, **given):
    """Return a block that is pressed on another one and pushed along; friction may hold it."""
    zero = constant(0.0, dim)
    force = [constant(c, dim) for c in (0.001, *[0.0] * (dim - 2), -0.01)]
    moduli = {"upper": 1.0, "lower": 3.0}
    body = Body(
        [Material(Linear(young, 0.3), on=(name,)) for name, young in moduli.items()],
        [Fixed("bottom", [zero] * dim), *supports],
        [Load("top", force)],
    )
    distance = GapFunction(lambda points: np.full(len(points), gap))
    pair = Contact("under", distance, friction=Friction(ConstantCoefficient(mu)), against="over")
    cells = (6, 9) if dim == 2 else (2, 3)
    return ContactProblem(Blocks(dim, *cells, **given).domain(comm), body, pair, degree=degree)


@pytest.mark.core
def test_another_geometry_or_interface_has_its_own_constraint():
    """A copy of the problem kept the constraint of the first one, once that had been asked for."""
    problem = pushed(MPI.COMM_SELF)
    swapped = ContactProblem(
        problem.domain, problem.description, Contact("over", NOTHING, against="under")
    )
    jumps = np.random.default_rng(1).standard_normal(problem.body.owned)
    first = problem.transformation.expand(jumps)
    for another in (
        problem.with_geometry(swapped.geometries),
        problem.with_interface(swapped.interface),
    ):
        other = another.transformation.expand(jumps)
        np.testing.assert_array_equal(other, swapped.transformation.expand(jumps))
        assert np.abs(other - first).max() > 0.1
    laws = problem.with_interface(replace(problem.interface, gap=problem.interface.gap + 1.0))
    assert laws.transformation is problem.transformation


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_methods_agree(degree):
    problem = pushed(MPI.COMM_SELF, degree)
    dense, sparse = (state_of(problem, 1e-11, condense).x for condense in (True, False))
    relaxed, size = relax(problem, 1e-11).state.x, np.abs(dense).max()
    np.testing.assert_allclose(relaxed, dense, rtol=0, atol=1e-8 * size)
    np.testing.assert_allclose(sparse, dense, rtol=0, atol=1e-9 * size)


@pytest.mark.core
def test_penalty_comes_near():
    problem = pushed(MPI.COMM_SELF, supports=[Fixed("upper_left", [ZERO, None])])
    exact, errors = state_of(problem, 1e-11).x, []
    for eps in (2e-2, 1e-2):
        options = PenaltyOptions(tolerance=1e-9, eps_contact=eps, eps_slip=eps * 1e-2)
        x = solved_by(problem, options).state.x
        errors.append(np.abs(x - exact).max() / np.abs(exact).max())
    assert errors[0] < 0.1 and errors[1] == pytest.approx(errors[0] / 2, rel=0.2)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_penalties_find_what_friction_alone_holds(degree, gap):
    """At rest nothing presses: without friction the upper block would fly away."""
    problem = pushed(MPI.COMM_SELF, degree, gap=gap)
    exact, near = state_of(problem, 1e-11).x, solved_by(problem, PenaltyOptions()).state.x
    assert np.abs(near - exact).max() < 0.02 * np.abs(exact).max()


def half_facing(**layer):
    """Return a constrained block that faces another one with half of its side, at a distance."""
    gap = GapFunction(lambda points: np.where(points[:, 0] < 0.6, 0.01, np.inf))
    moduli = {"upper": 1.0, "lower": 3.0}
    body = Body(
        [Material(Linear(young, 0.3), on=(name,)) for name, young in moduli.items()],
        [Fixed("bottom", [ZERO] * 2), Fixed("upper_left", [ZERO, None])],
        [Load("top", [ZERO, constant(-0.01, 2)])],
    )
    contact = Contact("under", gap, against="over", **layer)
    return ContactProblem(Blocks(2, 6, 9).domain(MPI.COMM_SELF), body, contact)


@pytest.mark.parametrize("layer", [{}, {"law": "compliance", "layer": 0.005, "stiffness": 1.0}])
def test_penalties_where_nodes_face_nothing(layer):
    """Their gap is infinite: the first increment was no number."""
    problem = half_facing(**layer)
    assert 0 < np.isinf(problem.nodes.gap).sum() < problem.nodes.size
    exact, near = state_of(problem, 1e-11).x, solved_by(problem, PenaltyOptions()).state.x
    assert np.abs(near - exact).max() < 0.02 * np.abs(exact).max()


def test_nodes_that_face_nothing_touch_no_layer():
    """At its first touch a layer has the same stiffness, whether it saturates or not."""
    found = []
    for limit in (0.1, np.inf):
        problem = half_facing(law="compliance", layer=0.005, stiffness=1.0, limit=limit)
        operator = FixedPoint(problem, FixedPointOptions()).operator
        shift = 1e-12 * problem.scales.c
        found.append(softest_mode(problem, operator, problem.start(), shift))
    assert found[1] == pytest.approx(found[0], rel=1e-9)
    assert found[0] < 0.5, "it holds half of the side"


def test_penalties_that_lose_a_body_have_not_converged(monkeypatch):
    """It was constrained at first: that it is lost on the way is no fault of the input."""
    method = Penalty(pushed(MPI.COMM_SELF), PenaltyOptions())
    solve, calls = SparseOperator.solve, []

    def singular(operator, *given):
        calls.append(given)
        if len(calls) > 2:
            raise SingularError("singular", "not-held")
        return solve(operator, *given)

    monkeypatch.setattr(SparseOperator, "solve", singular)
    _, outcome = method.solve()
    assert not outcome.converged and "a rigid-body mode is unconstrained" in outcome.ended


@pytest.mark.core
@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_ranks_agree(dim, condense):
    def quantities(problem):
        nodes, state = problem.nodes, state_of(problem, 1e-12, condense)
        values = {"points": nodes.points, "forces": state.multipliers.vectors(nodes)}
        return {name: at_all(nodes.comm, nodes.points, x) for name, x in values.items()}

    agree(lambda ranks: pushed(ranks, 1, dim), quantities, rtol=0, atol=1e-11)


def supported(fixed, load, mu=0.0, pair=("under", "over")):
    body = Body(Linear(1.0, 0.3), fixed, [load])
    friction = Friction(ConstantCoefficient(mu)) if mu > 0 else Friction()
    domain = Blocks(2, 3, 4).domain(MPI.COMM_SELF)
    contact = Contact(pair[0], NOTHING, friction=friction, against=pair[1])
    return ContactProblem(domain, body, contact)


PRESS, PULL = (Load("top", [ZERO, constant(force, 2)]) for force in (-0.01, 0.01))


@pytest.mark.core
@pytest.mark.parametrize("pair", [("under", "over"), ("over", "under")])
def test_a_body_may_be_held_by_contact_alone(pair):
    """It is where loads press it on; supports, or friction, have to do the rest."""
    clamped, guided = Fixed("bottom", [ZERO, ZERO]), Fixed("upper_left", [ZERO, None])
    check_rigid_modes(supported([clamped, guided], PRESS, pair=pair))
    check_rigid_modes(supported([clamped], PRESS, mu=0.2, pair=pair))
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        check_rigid_modes(supported([clamped], PRESS, pair=pair))
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        check_rigid_modes(supported([clamped, guided], PULL, pair=pair))
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        check_rigid_modes(supported([guided], PRESS, mu=0.0, pair=pair))
    # Both of them together, along the rollers of the lower one.
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        check_rigid_modes(supported([Fixed("bottom", [None, ZERO])], PRESS, mu=0.5, pair=pair))


@pytest.mark.core
def test_two_pairs_have_two_laws():
    """A ball between plates: friction below, none above, and the column `on` says which."""
    given = {
        "mesh": {"generator": "ball_between_plates", "contact_size": 0.05, "size": 0.3},
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [
            {"on": "symmetry", "displacement": [0.0, "free"]},
            {"on": "lower_bottom", "displacement": ["free", 0.0]},
            {"on": "upper_top", "displacement": ["free", -0.02]},
        ],
        "contact": [
            {
                "on": "ball_bottom",
                "against": "lower_top",
                "friction": {"law": "coulomb", "mu": 0.2},
            },
            {"on": "ball_top", "against": "upper_bottom"},
        ],
    }
    solution = solve(parse_case(given))
    assert solution.converged
    table = contact_table(solution.contact)
    below, above = table["on"] == "ball_bottom", table["on"] == "ball_top"
    upwards = table["weight"] * table["pressure"] * solution.contact.normal[:, 1]
    force = [upwards[below].sum(), upwards[above].sum()]
    assert force[1] > 0 and force[0] == pytest.approx(-force[1], rel=0.02)
    assert np.abs(table["tau"][above]).max() < 1e-10 < 0.1 < np.abs(table["tau"][below]).max()
    # On the axis, too, where nothing can slip.
    assert set(table["status"][above]) == {"open", "slip"}


def test_a_foundation_of_its_own_potential_is_no_body():
    electric = {"law": "perfect", "k_e": 0.7, "phi_f": 2.0}
    piezo = {"e31": 0.0, "e33": 0.0, "e15": 0.0, "beta11": 2.0, "beta33": 2.0}
    pair = {"on": "upper_bottom", "against": "lower_top", "electric": electric}
    with pytest.raises(InputError, match=r"contact\.electric\.phi_f.*\[value\]"):
        parse_case(case(contact=pair, material={"young": 1.0, "poisson": 0.3, "piezo": piezo}))


@pytest.mark.parallel
def test_a_rigid_plate_presses_a_block_on_another(comm):
    """A plate under a force sinks in as far as it takes that force to push it, on any ranks."""
    roller = {"on": "lower_bottom", "displacement": [0.0, 0.0]}
    contact = {"on": "upper_bottom", "against": "lower_top"}
    common = {"contact": contact, "solver": {"tolerance": 1e-12}}
    plate = {"on": "upper_top", "displacement": [0.0, "free"], "force": [0.0, -1.5]}
    free = case(fixed=[roller], rigid=[plate], **common)
    del free["load"]
    pressed = solve(parse_case(free), comm=comm)
    assert pressed.converged
    depth = float(pressed.problem.body.motion(pressed.state.x)[1])
    assert depth < 0
    top = {"on": "upper_top", "displacement": [0.0, depth]}
    given = case(fixed=[roller, top], **common)
    del given["load"]
    pushed_in = solve(parse_case(given), comm=comm)
    assert pushed_in.converged
    assert -pushed_in.contact_force[1] == pytest.approx(1.5, rel=1e-9)
    np.testing.assert_allclose(pressures(pushed_in), pressures(pressed), rtol=0, atol=1e-8)
    assert pressed.contact_force == pytest.approx(pushed_in.contact_force, rel=1e-9)


@pytest.mark.parallel
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_tiny_body_does_not_judge_the_gaps_of_others(mu):
    """A block that travels half its height onto a plate, and one of a thousandth beside it."""
    mesh = boxes(COMM, "quadrilateral", 1, [(40, 3), (7, 4), (4, 4)])
    facets, middle, *_ = midpoints(mesh)
    body_of = (middle[:, 0] // 2).astype(int)
    sides = {
        f"{name}{k}": facets[(body_of == k) & (np.abs(middle[:, 1] - end) < 1e-9)]
        for k in range(3)
        for name, end in (("bottom", 0), ("top", 1))
    }
    x, tiny, press = mesh.geometry.x, 1e-3, 1e-6
    k = ((x[:, 0] + 0.5) // 2).astype(int)
    size, left, low = np.array([[10, 1, tiny], [-5, -2.5, 1], [0, 1.5, 1]])[:, k]
    x[:, 0] = left + size * (x[:, 0] - 2 * k)
    x[:, 1] = low + np.where(k == 0, 1, size) * x[:, 1]
    down = [Fixed("top1", [0.0, -0.5 - press]), Fixed("top2", [0.0, -press * tiny])]
    body = Body(Linear(1000.0, 0.3), [Fixed("bottom0", [0.0, 0.0]), *down])
    contacts = [Contact(f"bottom{k}", against="top0", friction=Friction(mu=mu)) for k in (1, 2)]
    solution = solve(Problem(from_mesh(mesh, sides), body, contacts))
    assert solution.converged and len(solution.history) < 10
    young = 1000.0 / (1 - 0.3**2)
    for entry, width in enumerate((1.0, tiny)):
        force = solution.problem.nodes.sum(
            np.where(solution.problem.entry_numbers == entry, solution.pressure, 0.0)
        )
        assert 0.5 < force / (young * press * width) < 1.2
