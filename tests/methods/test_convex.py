"""Contact with given friction bounds solved for sure, against independent solutions."""

from dataclasses import replace

import numpy as np
import pytest

from tests.problems.convex import beam, block, check, enumerated, random_setting


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_three_nodes_agree_with_all_statuses_tried(seed, friction):
    setting = random_setting(3, 2, 20.0, friction, seed)
    (expected,) = enumerated(setting)
    result = setting.solve()
    check(setting, result)
    assert np.allclose(result.displacement, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(3))
def test_friction_in_space_agrees_with_a_long_projected_gradient_run(seed):
    setting = random_setting(6, 3, 30.0, 0.5, seed)
    flexibility = np.linalg.inv(setting.stiffness)
    free = (flexibility @ setting.load).reshape(6, 3)
    force, step = np.zeros((6, 3)), 1 / np.linalg.norm(flexibility, 2)
    ahead, momentum = force, 1.0
    for _ in range(20000):
        u = free - (flexibility @ ahead.ravel()).reshape(6, 3)
        trial = ahead + step * (u - setting.gap[:, None] * setting.normal)
        push = np.einsum("ni,ni->n", trial, setting.normal)
        aside = trial - push[:, None] * setting.normal
        size = np.linalg.norm(aside, axis=1)
        limit = setting.weight * setting.bound
        aside *= np.minimum(1.0, limit / np.maximum(size, 1e-300))[:, None]
        new = np.maximum(push, 0.0)[:, None] * setting.normal + aside
        if np.sum((ahead - new) * (new - force)) > 0:  # restarted where it turns back
            momentum = 1.0
        later = (1 + np.sqrt(1 + 4 * momentum**2)) / 2
        ahead = new + (momentum - 1) / later * (new - force)
        force, momentum = new, later
    expected = free - (flexibility @ force.ravel()).reshape(6, 3)
    result = setting.solve()
    check(setting, result)
    assert np.allclose(result.displacement, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    found = setting.weight[:, None] * (result.pressure[:, None] * setting.normal + result.friction)
    assert np.allclose(found, force, rtol=0, atol=1e-7 * np.abs(force).max())


@pytest.mark.parametrize("condition", [1e2, 1e6, 1e10, 1e12])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("friction", [0.0, 0.3, 3.0])
def test_iterations_stay_few_whatever_the_condition(condition, d, friction):
    for n in (10, 120):
        setting = random_setting(n, d, condition, friction, n)
        result = setting.solve()
        check(setting, result, 1e-8 if condition < 1e11 else 1e-5)
        assert result.iterations <= 25


def test_no_displacement_near_the_solution_has_less_energy():
    setting = random_setting(20, 3, 1e3, 0.4, 7)
    u = setting.solve().displacement
    rng, lowest = np.random.default_rng(0), setting.energy(u)
    for size in (1e-4, 1e-2, 1.0):
        for _ in range(50):
            v = u + size * np.abs(u).max() * rng.standard_normal(u.shape)
            beyond = np.maximum(np.einsum("ni,ni->n", v, setting.normal) - setting.gap, 0.0)
            assert setting.energy(v - beyond[:, None] * setting.normal) >= lowest


@pytest.mark.parametrize("length", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("bound", [0.0, 0.1])
def test_a_beam_pressed_on_a_stop_by_its_end_touches_there_alone(length, bound):
    setting = beam(60, length, tip=True, bound=bound)
    assert np.linalg.cond(setting.stiffness) > 1e6
    result = setting.solve()
    check(setting, result)
    assert result.iterations <= 20 and result.polished
    assert np.flatnonzero(result.pressure).tolist() == [59]
    # Hermite's elements are exact at the nodes: 50 gaps of load, 1 of which bends the beam
    assert setting.total(result) == pytest.approx(49 / 50 * -setting.load[-1], rel=1e-7)


@pytest.mark.parametrize("bound", [0.0, 0.1])
def test_a_beam_under_uniform_load_lies_flat_beyond_the_known_length(bound):
    length, n = 100.0, 300
    setting = beam(n, length, bound=bound)
    assert np.linalg.cond(setting.stiffness) > 1e9
    result = setting.solve()
    check(setting, result, 1e-7)
    assert result.iterations <= 20
    q = -setting.load[1] / setting.weight[0]
    lifted = (72 / 12 * setting.gap[0] / q) ** 0.25
    touching = np.flatnonzero(result.pressure > 1e-6 * result.pressure.max())
    assert touching.size > 100
    assert (touching[0] + 1) * length / n == pytest.approx(lifted, abs=2 * length / n)
    assert touching[-1] == n - 1


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(("aside", "bound"), [(0.0, 0.0), (0.0, 0.2), (0.2, 0.3), (0.2, 50.0)])
def test_a_block_held_by_contact_alone(d, aside, bound):
    force = np.zeros(d)
    force[0], force[-1] = aside, -1.0
    setting = block(30, d, force, bound)
    result = setting.solve()
    check(setting, result)
    assert setting.total(result) == pytest.approx(1.0)
    assert np.allclose((setting.weight[:, None] * result.friction).sum(axis=0)[0], aside)


@pytest.mark.parametrize(
    "setting", [random_setting(50, 3, 1e6, 0.5, 4), beam(80, 100.0, bound=0.1)]
)
@pytest.mark.parametrize(
    ("stress", "length"),
    [(2.0**-40, 1.0), (2.0**40, 1.0), (2.0**18, 2.0**-40), (1.0, 2.0**40)],
)
def test_units_change_no_count(setting, stress, length):
    """By powers of two, which no number is rounded by. Forces are a stress times an area."""
    scaled = replace(
        setting,
        stiffness=stress * length * setting.stiffness,
        load=stress * length**2 * setting.load,
        gap=length * setting.gap,
        weight=length**2 * setting.weight,
        bound=stress * setting.bound,
    )
    one, other = setting.solve(), scaled.solve()
    assert one.certified and other.certified and one.iterations == other.iterations
    scale = length * np.abs(one.displacement).max()
    assert np.allclose(other.displacement, length * one.displacement, rtol=0, atol=1e-7 * scale)


def test_what_slides_freely_may_be_kept_or_eliminated():
    setting = random_setting(40, 3, 1e4, 0.0, 6)
    kept = setting.solver.solve(setting.load, setting.bound)
    result = setting.solve()
    check(setting, kept)
    check(setting, result)
    assert np.allclose(kept.displacement, result.displacement, rtol=0, atol=1e-8)


def test_the_right_status_needs_no_step():
    setting = random_setting(60, 3, 1e4, 0.5, 8)
    solver = setting.solver
    first = solver.solve(setting.load, setting.bound)
    again = solver.solve(setting.load, 1.0001 * setting.bound, start=first.point)
    assert first.iterations > 5 and again.iterations == 0
    check(replace(setting, bound=1.0001 * setting.bound), again)


@pytest.mark.parametrize("seed", range(4))
def test_all_nodes_pressed_onto_no_gap_take_no_more_steps(seed):
    """Their displacements are rounding: a penetration relative to these alone never vanished."""
    setting = random_setting(20, 2, 1e3, 0.0, seed, flat=True)
    load = np.zeros((20, 2))
    load[:, 1] = -1.1
    pressed = replace(setting, gap=np.zeros(20), load=load.ravel())
    result = pressed.solve()
    assert result.certified and np.all(result.pressure > 0)
    assert result.iterations <= 12


@pytest.mark.parametrize("gap", [0.6, 1e6])
def test_little_friction_on_what_bends_away_takes_no_more_steps(gap):
    """The slips of a body that touches nothing were reached in steps cut to nothing."""
    setting = beam(50, 10.0, bound=1e-4, gap=gap)
    bent = replace(setting, load=0.8 / 50 * setting.load)
    result = bent.solve()
    check(bent, result)
    assert not np.any(result.pressure > 0)
    assert result.iterations <= 5
