"""The stick ratio c/a of a contact that grows, by boundary elements on a half plane or half space.

A contact of the half width a grows by da. As bodies are flat, the rates of its tractions are those
of a flat punch of the width a, whatever the profile is that presses: on the contact the normal
displacement is the same everywhere, where it sticks nothing moves along the surface, and where it
slips q = mu p. The ratio is the one for which the rate of q is bounded where slip begins, and thus
the same at all loads (Spence, J. Elasticity 5 (1975) 297). Shear's effect on the pressure is in it.

The foundation is rigid. With c = 2/(pi E*) and b = (1 - 2 nu)(1 + nu)/(2 E) surfaces move by

    w = -c int p ln|x - s| ds + b int sgn(x - s) q ds,
    t = -c int q ln|x - s| ds - b int sgn(x - s) p ds

in the plane (Johnson, Contact Mechanics, 1985, (2.25)), and, by Hankel transforms, about an axis by

    w = pi c int p J00(r, s) s ds - 2 b int_r^a q ds,
    t = pi c int q J11(r, s) s ds - (2 b/r) int_0^r p s ds,     Jii = int_0^inf J_i(kr) J_i(ks) dk.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np
from scipy.special import ellipe, ellipk

from contact.typing import Array

#: Points of Gauss's rule in each half of an element.
POINTS = 6


def _ends(count: int) -> Array:
    """Return the ends of elements in [0, 1], finer towards 1, where the pressure is singular."""
    return np.sin(np.linspace(0.0, np.pi / 2, count + 1))


@lru_cache
def plane(count: int, poisson: float) -> tuple[Array, ...]:
    """Return the middles of elements, and w and t of an even p and an odd q, times pi E*/2."""
    ends = _ends(count)
    x = (ends[1:] + ends[:-1]) / 2
    ratio = np.pi / 4 * (1 - 2 * poisson) / (1 - poisson)  # b/c

    def logs(sign: float) -> Array:
        offset = x[:, None] - sign * ends
        return sign * np.diff(offset * (np.log(np.abs(offset)) - 1), axis=1)

    def signs(sign: float) -> Array:
        return -sign * np.diff(np.abs(x[:, None] - sign * ends), axis=1)

    wp, wq = logs(1.0) + logs(-1.0), ratio * (signs(1.0) - signs(-1.0))
    tq, tp = logs(1.0) - logs(-1.0), -ratio * (signs(1.0) + signs(-1.0))
    return x, wp, wq, tp, tq


@lru_cache
def axisymmetric(count: int, poisson: float) -> tuple[Array, ...]:
    """Return the like about an axis."""
    ends = _ends(count)
    r = (ends[1:] + ends[:-1]) / 2
    ratio = np.pi / 4 * (1 - 2 * poisson) / (1 - poisson)
    points, weights = np.polynomial.legendre.leggauss(POINTS)
    # Towards the middle, where the kernels are singular, points gather like a cube.
    part = np.concatenate([-((1 + points) ** 3), (1 + points) ** 3]) / 8
    share = np.tile(3 * (1 + points) ** 2 / 8 * weights, 2)
    half = np.diff(ends) / 2
    s = r[:, None] + half[:, None] * part
    load = half[:, None] * share * s  # s ds
    low, high = (f(r[:, None, None], s) for f in (np.minimum, np.maximum))
    m = (low / high) ** 2
    wp = 2 * np.sum(ellipk(m) / high * load, axis=2)
    tq = 2 * np.sum((ellipk(m) - ellipe(m)) / low * load, axis=2)
    inner = np.clip(r[:, None], ends[:-1], ends[1:])
    wq = -2 * ratio * (ends[1:] - inner)
    tp = -ratio * (inner**2 - ends[:-1] ** 2) / r[:, None]
    return r, wp, wq, tp, tq


def stick_ratio(
    kind: Callable[[int, float], tuple[Array, ...]], mu: float, poisson: float, count: int = 400
) -> float:
    """Return c/a."""
    x, wp, wq, tp, tq = kind(count, poisson)
    excess = partial(_excess, wp, wq, tp, tq, mu)
    low, high = 1, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if excess(middle) > 0 else (middle, high)
    before, after = excess(low), excess(high)
    part = before / (before - after) if before * after < 0 else 0.5
    return float(x[low - 1] + (x[high - 1] - x[low - 1]) * np.clip(part, 0.0, 1.0))


def _excess(wp: Array, wq: Array, tp: Array, tq: Array, mu: float, sticks: int) -> float:
    """Return q - mu p in the last element that sticks, if `sticks` elements do, over p."""
    count = len(wp)
    slips = np.arange(sticks, count)
    matrix, rhs = np.zeros((2 * count, 2 * count)), np.zeros(2 * count)
    matrix[:count, :count], matrix[:count, count:] = wp, wq
    rhs[:count] = 1.0
    matrix[count : count + sticks, :count] = tp[:sticks]
    matrix[count : count + sticks, count:] = tq[:sticks]
    matrix[count + slips, slips], matrix[count + slips, count + slips] = -mu, 1.0
    p, q = np.split(np.linalg.solve(matrix, rhs), 2)
    return float(q[sticks - 1] / p[sticks - 1] - mu)
