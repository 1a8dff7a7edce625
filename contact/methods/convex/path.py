"""Steps along the central path: Mehrotra's predictor and corrector, whatever solves for them."""

from __future__ import annotations

from collections.abc import Callable

from contact.methods.convex.cones import Array, Cones, Step

#: Shares of the way to the rim of a cone that a step takes.
SHORTEST, LONGEST = 0.9, 0.999

#: From constants of the cones, see `Cones.affine_target`, to the step of the body and of the cones.
Solve = Callable[[tuple[Array, Array]], tuple[Array, Step]]


def central(cones: Cones, solve: Solve) -> tuple[Array, Step, float]:
    """Return the step of the body, that of the cones, and how much of both is to be taken.

    Parameters
    ----------
    cones
        Where the method is, scaled.
    solve
        Solves the linearised problem; both times with the same matrix.
    """
    now, degree = cones.work(), max(cones.degree, 1)
    _, affine = solve(cones.affine_target())
    length = min(1.0, cones.longest(affine))
    centre = (cones.work_after(affine, length) / now) ** 3 if now > 0 else 0.0
    centre = max(0.0, centre)
    dx, step = solve(cones.target(affine, centre * now / degree))
    share = min(LONGEST, max(SHORTEST, 1 - centre))
    return dx, step, min(1.0, share * cones.longest(step))
