"""Energy line search: the length of a Newton step at which the energy along it is least.

The merit function is the potential energy at the contact forces of the step, which is convex along
it. A body in the plastic range answers a load by more than its tangent foresees: where strains grow
as the exponential of the stress, each Newton step multiplies them by a number that the last
residual bounds, and a solution far in the plastic range takes as many steps as its logarithm is
large. The slope of the energy costs an assembly of forces and no solve; where it is still steep at
the step's end, its zero is looked for beyond.

References
----------
Crisfield, Non-linear Finite Element Analysis of Solids and Structures 1 (1991), section 9.2.
Matthies and Strang, The solution of nonlinear finite element equations, IJNME 14 (1979).
"""

from __future__ import annotations

from collections.abc import Callable

#: Slope at the end of a step, over that at its beginning, from which on a longer one is looked
#: for, and the part of it that may remain in the end.
STEEP, FLAT = 0.1, 0.05

#: Residual below which no longer step is looked for, as the tangent is good there, and above which
#: no factorisation is frozen.
FAR = 0.05

#: Largest length, beyond which the material holds nothing, and refinements of one at most.
LONGEST, MOST = 64.0, 16


def step_length(slope: Callable[[float], float]) -> float:
    """Return the length of a step, 1 or more; 1 where the energy falls on and on.

    Parameters
    ----------
    slope
        Of the energy at a length: forces out of balance times the step. The same on all ranks.
    """
    first = slope(0.0)
    steep = slope(1.0) / first if first < 0 else 0.0
    if not steep > STEEP:
        return 1.0
    low, high, below = 1.0, 2.0, steep
    while (above := slope(high) / first) > 0:
        if abs(above) <= FLAT:
            return high
        low, high, below = high, 2 * high, above
        if high > LONGEST:
            return 1.0
    for _ in range(MOST):
        # Regula falsi, in which the end that stays counts half (Illinois).
        middle = low + (high - low) * below / (below - above)
        here = slope(middle) / first
        if abs(here) <= FLAT:
            return middle
        if here > 0:
            low, below, above = middle, here, above / 2
        else:
            high, above, below = middle, here, below / 2
    return low
