"""Contact with given friction bounds solved for sure, against independent solutions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import block_diag

from contact.methods.convex.haslinger import coulomb
from contact.methods.convex.reduced import NotConvexError, Reduced, without_potential
from contact.methods.convex.tresca import Result, TrescaSolver, tresca


@dataclass(frozen=True)
class Setting:
    """A problem of contact with given friction bounds."""

    stiffness: np.ndarray
    load: np.ndarray
    normal: np.ndarray
    gap: np.ndarray
    weight: np.ndarray
    bound: np.ndarray
    free: np.ndarray

    @property
    def tangent(self) -> np.ndarray:
        d = self.normal.shape[1]
        projector = -self.normal[:, :, None] * self.normal[:, None, :]
        projector[:, np.arange(d), np.arange(d)] += self.free
        return projector

    @property
    def solver(self) -> TrescaSolver:
        return TrescaSolver(
            self.stiffness, self.normal, self.tangent, self.gap, self.weight, self.free
        )

    def solve(self, **options) -> Result:
        return tresca(
            self.stiffness,
            self.load,
            self.normal,
            self.tangent,
            self.gap,
            self.weight,
            self.bound,
            self.free,
            **options,
        )

    def energy(self, u: np.ndarray) -> float:
        slip = np.linalg.norm(np.einsum("nij,nj->ni", self.tangent, u), axis=1)
        linear = u.ravel() @ (0.5 * self.stiffness @ u.ravel() - self.load)
        return float(linear + np.sum(self.weight * self.bound * slip))

    def total(self, result: Result) -> float:
        return float(self.weight @ result.pressure)


def check(setting: Setting, result: Result, tolerance: float = 1e-9) -> None:
    """Check all conditions of the solution from scratch, each beside its own scale."""
    u, weight = result.displacement, setting.weight
    assert result.certified and result.certificate.largest <= 1e-10
    nodal = weight[:, None] * (result.pressure[:, None] * setting.normal + result.friction)
    balance = np.where(setting.free.ravel(), setting.stiffness @ u.ravel() - setting.load, 0.0)
    noise = 1e-14 * np.abs(setting.stiffness).sum(axis=1).max() * np.abs(u).max()
    largest = max(np.abs(setting.load).max(), np.abs(nodal).max())
    assert np.abs(balance + nodal.ravel()).max() <= tolerance * largest + noise
    slack = setting.gap - np.einsum("ni,ni->n", setting.normal, u)
    assert slack.min() >= -tolerance * max(np.abs(u).max(), 1e-300)
    assert result.pressure.min() >= 0
    touching = result.pressure > 0
    work = float(np.abs(setting.load) @ np.abs(u.ravel()))
    assert (
        np.sum((weight * result.pressure)[touching] * slack[touching]) <= tolerance * work + 1e-300
    )
    size = np.linalg.norm(result.friction, axis=1)
    assert np.all(size <= setting.bound * (1 + 1e-12))
    slip = np.einsum("nij,nj->ni", setting.tangent, u)
    lost = setting.bound * np.linalg.norm(slip, axis=1) - np.sum(slip * result.friction, axis=1)
    assert np.sum(weight * np.abs(lost)) <= tolerance * work + 1e-300
    assert not np.any(u[~setting.free])


def spd(m: int, condition: float, rng: np.random.Generator) -> np.ndarray:
    basis = np.linalg.qr(rng.standard_normal((m, m)))[0]
    return (basis * np.logspace(0, -np.log10(condition), m)) @ basis.T


def random_setting(
    n: int, d: int, condition: float, friction: float, seed: int, flat: bool = False
) -> Setting:
    rng = np.random.default_rng(seed)
    stiffness = spd(n * d, condition, rng)
    stiffness = (stiffness + stiffness.T) / 2
    load = rng.standard_normal(n * d)
    normal = np.tile(-np.eye(d)[-1], (n, 1)) if flat else rng.standard_normal((n, d))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    length = np.median(np.abs(np.linalg.solve(stiffness, load)))
    gap = length * np.abs(rng.standard_normal(n)) * rng.choice([0.0, 0.1, 1.0], n)
    bound = friction * np.abs(rng.standard_normal(n)) * rng.choice([0.0, 1.0, 1.0], n)
    weight = rng.uniform(0.5, 2, n)
    return Setting(stiffness, load, normal, gap, weight, bound, np.ones((n, d), dtype=bool))


def beam(
    n: int, length: float, *, tip: bool = False, bound: float = 0.0, gap: float = 0.5
) -> Setting:
    """Return a cantilever of height 1 over a stop, loaded to go down 50 gaps if it were free.

    Hermite's elements with their rotations eliminated; bars along it.
    """
    h = length / n
    bending = 1 / 12
    element = np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h * h, -6 * h, 2 * h * h],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h * h, -6 * h, 4 * h * h],
        ]
    )
    whole = np.zeros((2 * n + 2, 2 * n + 2))
    for i in range(n):
        whole[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += bending / h**3 * element
    whole = whole[2:, 2:]
    k, g, r = whole[::2, ::2], whole[::2, 1::2], whole[1::2, 1::2]
    along = (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)) / h
    along[-1, -1] /= 2
    stiffness = np.zeros((2 * n, 2 * n))
    stiffness[::2, ::2] = along
    stiffness[1::2, 1::2] = k - g @ np.linalg.solve(r, g.T)
    stiffness = (stiffness + stiffness.T) / 2
    load = np.zeros((n, 2))
    if tip:
        load[-1, 1] = -50 * 3 * bending * 0.5 / length**3
    else:
        load[:, 1] = -50 * 8 * bending * 0.5 / length**4 * h
        load[-1, 1] /= 2
    load[:, 0] = -0.01 * load[:, 1]
    weight = np.full(n, h)
    bounds = np.full(n, bound * np.abs(load[:, 1]).sum() / length)
    normal = np.tile([0.0, -1.0], (n, 1))
    free = np.ones((n, 2), dtype=bool)
    return Setting(stiffness, load.ravel(), normal, np.full(n, gap), weight, bounds, free)


def block(n: int, d: int, force: np.ndarray, bound: float, seed: int = 0) -> Setting:
    """Return a body that nothing holds but contact on its flat lower side."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, d))
    x[:, -1] = 0.0
    motions = [np.tile(e, n) for e in np.eye(d)]
    for i in range(d):
        for j in range(i):
            turn = np.zeros((n, d))
            turn[:, i], turn[:, j] = -x[:, j], x[:, i]
            motions.append(turn.ravel())
    rigid = np.linalg.qr(np.array(motions).T)[0]
    elastic = np.eye(n * d) - rigid @ rigid.T
    stiffness = elastic @ spd(n * d, 1e3, rng) @ elastic
    load = np.tile(force / n, n)
    normal = np.tile(-np.eye(d)[-1], (n, 1))
    free = np.ones((n, d), dtype=bool)
    gap, weight = np.full(n, 0.3), np.ones(n)
    return Setting(
        (stiffness + stiffness.T) / 2, load, normal, gap, weight, np.full(n, bound / n), free
    )


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


def enumerated(setting: Setting, mu: float | None = None) -> list[np.ndarray]:
    """Return all solutions in the plane, by trying each status; with mu Coulomb's law."""
    n = setting.gap.size
    normals = block_diag(*setting.normal).T  # columns
    sides = np.stack([-setting.normal[:, 1], setting.normal[:, 0]], axis=1)
    tangents = block_diag(*sides).T
    solutions = []
    statuses = ["open+", "open-", "open0", "stick", "slip+", "slip-"]
    for status in product(statuses, repeat=n):
        # unknowns u, normal force r, tangential force q
        size = 2 * n
        a = np.zeros((size + 2 * n, size + 2 * n))
        b = np.zeros(size + 2 * n)
        a[:size, :size], b[:size] = setting.stiffness, setting.load
        a[:size, size : size + n], a[:size, size + n :] = normals, tangents
        limit = setting.weight * setting.bound
        for i, s in enumerate(status):
            row, other = size + i, size + n + i
            if s.startswith("open"):
                a[row, size + i] = 1.0
            else:
                a[row, :size], b[row] = normals[:, i], setting.gap[i]
            if s in ("open0", "stick"):
                a[other, :size] = tangents[:, i]
            else:
                sign = 1.0 if s.endswith("+") else -1.0
                a[other, size + n + i] = 1.0
                if mu is None:
                    b[other] = sign * limit[i]
                else:
                    a[other, size + i] = -sign * mu
        try:
            x = np.linalg.solve(a, b)
        except np.linalg.LinAlgError:
            continue
        u, r, q = x[:size], x[size : size + n], x[size + n :]
        bounds = limit if mu is None else mu * r
        fits = np.all(normals.T @ u <= setting.gap + 1e-9) and np.all(r >= -1e-9)
        fits = fits and np.all(np.abs(q) <= bounds + 1e-9)
        for i, s in enumerate(status):
            if s[-1] in "+-":
                fits = fits and (tangents.T @ u)[i] * (1 if s[-1] == "+" else -1) >= -1e-9
        if fits and not any(np.allclose(u, v.ravel(), atol=1e-7) for v in solutions):
            solutions.append(u.reshape(n, 2))
    return solutions


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


@pytest.mark.parametrize(
    "setting", [random_setting(50, 3, 1e6, 0.5, 4), beam(80, 100.0, bound=0.1)]
)
@pytest.mark.parametrize(("stress", "length"), [(1e-12, 1.0), (1e12, 1.0), (3e5, 1e-12), (1, 1e12)])
def test_units_change_no_count(setting, stress, length):
    # forces are a stress times an area
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
def test_coulomb_friction_of_three_nodes_agrees_with_all_statuses_tried(seed):
    setting = random_setting(3, 2, 20.0, 0.0, seed)
    (expected,) = enumerated(setting, 0.3)
    found = coulomb(setting.solver, setting.load, lambda pressure, slip: 0.3 * pressure)
    assert found.converged and found.change <= 1e-8
    u = found.result.displacement
    assert np.allclose(u, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_coulomb_friction_that_depends_on_the_slip():
    setting = block(30, 2, np.array([0.1, -1.0]), 0.0)
    scale = 1.0

    def bound(pressure, slip):
        return (0.2 + 0.2 / (1 + slip / scale)) * pressure

    found = coulomb(setting.solver, setting.load, bound)
    assert found.converged  # though without friction nothing would hold it
    result = found.result
    slip = np.abs(result.displacement[:, 0])
    assert np.allclose(found.bound, bound(result.pressure, slip), rtol=0, atol=1e-7)
    check(replace(setting, bound=found.bound), result)


def test_a_bound_that_never_settles_is_said_not_to():
    setting = random_setting(10, 2, 1e2, 0.0, 1)
    rng = np.random.default_rng(0)
    found = coulomb(
        setting.solver, setting.load, lambda p, slip: rng.uniform(0.1, 2.0, 10) * p.max(), limit=12
    )
    assert not found.converged and found.change > 1e-8 and found.problems <= 12
    assert "not settle" in found.message


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
