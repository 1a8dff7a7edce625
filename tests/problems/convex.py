"""Contact with given friction bounds as matrices: random bodies, beams and blocks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.linalg import block_diag

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
