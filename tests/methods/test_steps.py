"""Load steps: friction remembers, methods agree, a state can be gone on from.

Load steps that fail: they are halved, and an evolution ends with what it has.
"""

from dataclasses import replace

import numpy as np
import pytest

from contact import evolve, load_case
from contact.errors import InputError
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.methods.options import NewtonOptions, PenaltyOptions
from contact.methods.report import Outcome
from contact.problem.problem import SLIP
from contact.problem.residuals import Balance, Residuals, balance, evaluate
from contact.solving import NotConvergedError, solve
from forms.hencky import Linear, Log
from forms.laws import ConstantCoefficient, SlipCoefficient
from scripts.cases import CASES
from tests.problems import mechanics
from tests.problems.mechanics import SlidingBlock, close
from tests.problems.shaken import SELF, TIGHT, shaken, steps_of, times
from tests.problems.stepped import SteppedBlock, back_and_forth

#: The stress p mu is that of the shear 0.0175: with pushes of 0.00875 no step both sticks and
#: slides.
COULOMB = SlidingBlock(Linear(1.0, 0.3), ConstantCoefficient(0.5), 0.01, 0.0, 0.0)
BLOCKS = {
    "coulomb": SteppedBlock(COULOMB, back_and_forth(0.035, 0.00875)),
    "slip-dependent": SteppedBlock(
        replace(COULOMB, mu=SlipCoefficient(0.5, 0.2, 100.0)), back_and_forth(0.06, 0.02)
    ),
    "hencky": SteppedBlock(
        SlidingBlock(Log(1.0, 0.3, yield_strain=0.05), ConstantCoefficient(0.3), 0.08, 0.0, 0.0),
        back_and_forth(0.2, 0.1),
    ),
}


@pytest.mark.core
def test_the_block_slides_by_the_closed_form():
    """s_n = clip(s_(n-1), U - H tau_c/G, U + H tau_c/G)."""
    stepped, slip = BLOCKS["coulomb"], 0.0
    for push, step in zip(stepped.pushes, stepped.steps, strict=True):
        slip = float(np.clip(slip, push - 0.0175, push + 0.0175))
        assert step.slip == pytest.approx(slip, abs=1e-14)


@pytest.mark.core
@pytest.mark.parametrize(
    ("dim", "degree", "method"),
    [(2, 1, "newton"), (2, 2, "newton"), (3, 1, "newton"), (2, 1, "uzawa")],
)
@pytest.mark.parametrize("name", BLOCKS)
def test_stepped_block(name, dim, degree, method):
    stepped = BLOCKS[name]
    problem = stepped.problem(SELF, dim, degree)
    steps = steps_of(problem, stepped.times, TIGHT[method])
    for found, exact, way in zip(steps, stepped.steps, stepped.ways, strict=True):
        nodal = problem.nodal(found)
        assert np.abs(nodal[:, 0] - exact.slip).max() < 1e-10
        assert np.abs(found.multipliers.friction[:, 0] - exact.stress).max() < 1e-10
        assert np.abs(found.multipliers.contact - exact.pressure).max() < 1e-10
        history = problem.commit(found)[SLIP]
        assert np.abs(history.accumulated - way).max() < 1e-10


@pytest.mark.core
def test_one_step_from_rest_is_the_static_problem():
    """Bit for bit: with a load that grows with time, and slip-dependent friction."""
    problem = mechanics.bar(SELF, 8)
    static = solve(problem, NewtonOptions()).state
    (state,) = evolve(problem, [1.0])
    assert np.array_equal(state.x, static.x)
    assert np.array_equal(state.multipliers.friction, static.multipliers.friction)


def balances(problem, steps):
    """Return the energies of all steps."""
    found = [Balance.rest(problem)]
    for state in steps:
        found.append(balance(problem.at(state.time, state.history), state, found[-1]))
    return found[1:]


@pytest.mark.core
def test_the_area_of_the_loop_is_what_friction_takes():
    """Around the loop +U -> -U -> +U the energy comes back, and work is dissipation."""
    stepped = BLOCKS["coulomb"]
    problem = stepped.problem(SELF)
    found = balances(problem, steps_of(problem, stepped.times))
    # The block's two corners are constrained, and half a cell of each side with them.
    width = problem.nodes.weight.sum()
    exact = width * stepped.dissipation
    np.testing.assert_allclose([b.dissipation for b in found], exact, rtol=1e-9, atol=1e-15)
    loop = found[len(found) // 5 :]
    assert loop[-1].energy == pytest.approx(found[len(found) // 5 - 1].energy, rel=1e-9)
    work = sum(b.work for b in loop)
    assert work == pytest.approx(sum(b.dissipation for b in loop), rel=1e-6)
    assert work > 0.1 * max(b.energy for b in loop)


@pytest.mark.slow
@pytest.mark.parametrize("law", [Linear(1.0, 0.3), Log(1.0, 0.3, yield_strain=0.003)])
def test_methods_agree_at_every_step(law):
    newton, uzawa = (steps_of(shaken(law), times(2), options) for options in TIGHT.values())
    kinds = set()
    for one, two in zip(newton, uzawa, strict=True):
        assert np.abs(one.x - two.x).max() < 1e-7 * np.abs(one.x).max()
        size = np.abs(one.multipliers.contact).max()
        difference = one.multipliers.friction - two.multipliers.friction
        assert np.abs(difference).max() < 1e-7 * size
        problem = shaken(law).at(one.time, one.history)
        interface, nodal = problem.interface, problem.nodal(one)
        bound = interface.bound(nodal, one.multipliers)
        active = interface.active_set(nodal, one.multipliers, bound, rounding_stress=1e-9)
        kinds |= set(zip(active.closed, active.sticks, active.slips, strict=True))
    assert len(kinds) == 3  # open, sticking and sliding nodes have been met


def test_penalty_comes_near():
    options = PenaltyOptions(eps_contact=1e-3, eps_slip=1e-6)
    exact, near = (steps_of(shaken(), times(4), told) for told in (TIGHT["newton"], options))
    for one, two in zip(exact, near, strict=True):
        assert np.abs(one.x - two.x).max() < 1e-4


@pytest.mark.core
def test_unloaded_in_one_step_or_two_is_not_the_same():
    """Friction remembers: where the load has been matters, not only where it is."""
    there = steps_of(shaken(), [1.0, 2.0, 2.5])[-1]
    at_once = steps_of(shaken(), [2.5])[-1]
    assert np.abs(there.x - at_once.x).max() > 1e-4


@pytest.mark.parametrize("law", [Linear(1.0, 0.3), Log(1.0, 0.3, yield_strain=0.003)])
def test_the_balance_closes_with_the_steps(law):
    """Work - change of energy - dissipation = O(step^2) a step; no dissipation is negative."""
    defects = []
    for count in (4, 8, 16):
        problem = shaken(law)
        found = balances(problem, steps_of(problem, times(count)))
        assert min(each.dissipation for each in found) >= -1e-18
        energy = np.array([0.0, *(each.energy for each in found)])
        defect = [b.work - b.dissipation for b in found] - np.diff(energy)
        assert np.abs(defect).sum() < 0.03 * energy.max() * 4 / count
        defects.append(np.abs(defect[count : 2 * count]).max())  # pushed from the middle
    ratios = np.divide(defects[:-1], defects[1:])
    np.testing.assert_allclose(ratios, 4.0, rtol=0.35)


@pytest.mark.core
def test_a_state_can_be_gone_on_from():
    problem = shaken(Log(1.0, 0.3, yield_strain=0.003))
    ends = times(2)
    whole = list(evolve(problem, ends, TIGHT["newton"]))
    rest = list(evolve(problem, ends[3:], TIGHT["newton"], start=whole[2]))
    for one, two in zip(whole[3:], rest, strict=True):
        assert close(one, two, atol=1e-10)
    assert not close(whole[3], rest[1], atol=1e-10)
    for state in whole:
        assert evaluate(problem.at(state.time, state.history), state).largest < 1e-12


@pytest.mark.parametrize("ends", [[1.0, 1.0], [0.0, 1.0], [1.0, np.nan], [2.0, 1.0]])
def test_times_have_to_increase(ends):
    with pytest.raises(InputError, match=r"\[value\]"):
        list(evolve(shaken(), ends))


@pytest.mark.parallel(2)
def test_a_cycle_of_fretting_comes_back():
    """Around the loop the force changes its sign and comes back to the same size."""
    case = load_case(CASES / "fretting.toml", ["mesh.cells=[24,12]", "evolution.steps=[4,4,8,8]"])
    force = {step.row["t"]: step.row["contact_force_x"] for step in solve(case).steps}
    assert force[4.0] == pytest.approx(-force[2.0], rel=0.02)
    assert force[6.0] == pytest.approx(force[2.0], rel=1e-6)
    assert abs(force[3.0]) > 0.1 * abs(force[2.0])  # friction remembers


def failing(problem, largest: float, options=TIGHT["newton"]):
    """Return Newton's method that fails for steps longer than `largest`."""

    class Careful(type(METHODS[options.method](problem, options, None))):
        def solve(self, *given):
            state, outcome = super().solve(*given)
            since = self.problem.since or 0.0
            if self.problem.time - since > largest * (1 + 1e-9):
                kkt = Residuals(1.0, 1.0, 1.0)
                outcome = Outcome(kkt, outcome.allowed, "too long")
                state = replace(state, x=state.x + 1.0)
            return state, outcome

    return Careful(problem, options, None)


@pytest.mark.parametrize("parts", [1, 2, 16])
def test_a_step_that_fails_is_halved(parts):
    problem = shaken()
    steps = list(LoadStepping(problem, failing(problem, 1 / parts)).steps([1.0, 2.0]))
    assert all(outcome.converged for _, outcome in steps)
    assert [state.time for state, _ in steps] == [(k + 1) / parts for k in range(2 * parts)]


def test_an_evolution_ends_with_what_it_has():
    problem = shaken()
    steps = list(LoadStepping(problem, failing(problem, 1 / 17)).steps([0.05, 1.05, 2.0]))
    assert [outcome.converged for _, outcome in steps] == [True, False]
    assert [state.time for state, _ in steps] == [0.05, 0.05 + 1 / 16]


def test_evolve_says_that_a_step_fails():
    options = NewtonOptions(tolerance=1e-12, max_outer=1, max_iterations=1, condense=False)
    states = evolve(shaken(), [1.0, 2.0], options)
    with pytest.raises(NotConvergedError, match=r"no step to 0\.0625: .*"):
        list(states)
