"""Contact with given friction bounds: bodies that nothing holds, what is refused, and limits."""

from dataclasses import replace

import numpy as np
import pytest

from contact.methods.convex.reduced import NotConvexError, Reduced, without_potential
from tests.problems.convex import block, check, random_setting, spd


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("aside", "up", "bound"), [(0.4, -1.0, 0.3), (0.2, -1.0, 0.0), (0.0, 1.0, 0.3), (0.0, 0.4, 0.3)]
)
def test_a_block_that_nothing_holds_is_said_to_run_away(d, aside, up, bound):
    force = np.zeros(d)
    force[0], force[-1] = aside, up
    result = block(30, d, force, bound).solve()
    assert result.status == "unbounded" and not result.certified
    assert "nothing holds" in result.message


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_that_tips_over_its_edge_runs_away_however_far_the_foundation_is(d):
    force = np.zeros(d)
    force[-1] = -1.0
    for gap in (0.0, 0.3, 100.0):
        setting = replace(block(12, d, force, 0.5), gap=np.full(12, gap))
        setting.load[:] = 0.0
        setting.load[d - 1] = -1.0  # the first node carries all
        check(setting, setting.solve())
        # a couple that lifts one node by more than the other presses down
        setting.load[d + d - 1] = 1.5
        assert setting.solve().status == "unbounded"


def test_a_node_fixed_beyond_its_gap_has_no_solution():
    setting = random_setting(5, 2, 10.0, 0.1, 0, flat=True)
    setting.free[2] = False
    setting.stiffness[4:6] = setting.stiffness[:, 4:6] = 0.0
    setting.stiffness[4, 4] = setting.stiffness[5, 5] = 1.0
    setting.load[4:6] = 0.0
    check(setting, setting.solve())
    setting.gap[2] = -0.1
    result = setting.solve()
    assert result.status == "infeasible" and "2" in result.message and not result.certified


def test_what_is_no_problem_is_refused():
    setting = random_setting(5, 2, 10.0, 0.1, 0)
    with pytest.raises(NotConvexError):
        replace(setting, stiffness=setting.stiffness - 0.5 * np.eye(10)).solve()
    with pytest.raises(ValueError, match="finite"):
        replace(setting, load=np.full(10, np.nan)).solve()
    with pytest.raises(ValueError, match="negative"):
        setting.solver.solve(setting.load, -setting.bound - 1)


def test_too_few_steps_are_not_called_a_solution():
    setting = random_setting(60, 2, 1e6, 0.3, 1)
    result = setting.solver.solve(setting.load, setting.bound, limit=1)
    assert result.status == "unsolved" and not result.certified
    assert result.certificate.largest > 1e-10 and result.iterations == 1


def test_without_load_nothing_moves():
    setting = random_setting(10, 2, 10.0, 0.3, 0)
    result = replace(setting, load=np.zeros(20)).solve()
    assert result.certified and result.iterations == 0
    assert not result.displacement.any() and not result.pressure.any()


def test_a_body_pushed_in_without_load_is_pushed_back():
    setting = random_setting(8, 2, 10.0, 0.3, 0)
    setting = replace(setting, load=np.zeros(16), gap=np.full(8, -0.1))
    result = setting.solve()
    assert result.certified and result.pressure.max() > 0
    assert np.einsum("ni,ni->n", setting.normal, result.displacement).max() == pytest.approx(-0.1)


@pytest.mark.parametrize("gap", [1e9, np.inf])
def test_nothing_touches(gap):
    setting = random_setting(15, 3, 1e3, 0.0, 2)
    result = replace(setting, gap=np.full(15, gap)).solve()
    expected = np.linalg.solve(setting.stiffness, setting.load)
    assert result.certified and not result.pressure.any()
    assert np.allclose(result.displacement.ravel(), expected, rtol=1e-9)


@pytest.mark.parametrize("bound", [0.0, 1e3])
def test_everything_touches(bound):
    setting = random_setting(12, 2, 10.0, 0.0, 3, flat=True)
    stiff = np.diag(np.diag(setting.stiffness))
    load = np.tile([0.2, -1.0], 12)
    setting = replace(
        setting, stiffness=stiff, load=load, gap=np.zeros(12), bound=np.full(12, bound)
    )
    result = setting.solve()
    check(setting, result)
    assert np.allclose(setting.weight * result.pressure, 1.0)
    expected = 0.0 if bound else 0.2 / np.diag(stiff)[::2]
    assert np.allclose(result.displacement[:, 0], expected, atol=1e-9)


def test_some_gaps_infinite_and_tangents_fixed():
    setting = random_setting(20, 3, 1e3, 0.3, 5, flat=True)
    setting.gap[::3] = np.inf
    setting.free[::2, 0] = False
    setting.free[4, :2] = False
    fixed = np.flatnonzero(~setting.free.ravel())
    setting.stiffness[fixed] = setting.stiffness[:, fixed] = 0.0
    setting.stiffness[fixed, fixed] = 1.0
    setting.load[fixed] = 0.0
    result = setting.solve()
    check(setting, result)
    assert not result.pressure[::3].any() and result.pressure.any()
    assert not result.friction[::2, 0].any() and result.friction[::2, 1].any()


@pytest.mark.parametrize("noise", [0.0, 3e-14, -3e-14])
def test_free_motions_are_told_from_rounding(noise):
    """Of a body with a fine mesh behind its contact rounding left one eigenvalue at 3e-14."""
    setting = block(40, 2, np.array([0.0, -1.0]), 0.1)
    turn = np.linalg.eigh(setting.stiffness)[1][:, 0]
    stiffness = setting.stiffness + noise * np.outer(turn, turn) * np.diag(setting.stiffness).max()
    everywhere = np.ones(40, dtype=bool)
    tangent = np.tile(np.diag([1.0, 0.0]), (40, 1, 1))
    body = Reduced(stiffness, setting.normal, tangent, everywhere, everywhere, setting.free)
    assert body.motions.shape[1] == 3


def test_the_potential_is_eliminated_and_recovered():
    rng, n = np.random.default_rng(3), 6
    free = np.ones((n, 3), dtype=bool)
    free[0, 2] = free[1, 0] = False
    elastic, electric = spd(2 * n, 10.0, rng), spd(n, 10.0, rng)
    coupling = rng.standard_normal((n, 2 * n))
    whole = np.zeros((3 * n, 3 * n))
    mechanical = np.arange(3 * n).reshape(n, 3)[:, :2].ravel()
    whole[np.ix_(mechanical, mechanical)] = elastic
    whole[2::3, 2::3] = -electric
    whole[np.ix_(np.arange(2, 3 * n, 3), mechanical)] = coupling
    whole[np.ix_(mechanical, np.arange(2, 3 * n, 3))] = coupling.T
    fixed = np.flatnonzero(~free.ravel())
    whole[fixed] = whole[:, fixed] = 0.0
    whole[fixed, fixed] = 1.0
    load = np.where(free.ravel(), rng.standard_normal(3 * n), 0.0)
    stiffness, reduced, complete = without_potential(whole, load, free)
    assert np.linalg.eigvalsh(stiffness).min() > 0
    found = complete(np.linalg.solve(stiffness, reduced).reshape(n, 2))
    assert np.allclose(found.ravel(), np.linalg.solve(whole, load))
    floating = whole.copy()
    floating[2::3] = floating[:, 2::3] = 0.0
    with pytest.raises(NotConvexError, match="potential"):
        without_potential(floating, load, free)
