"""What the methods are told: tolerances, limits and parameters."""

from __future__ import annotations

from dataclasses import dataclass

from contact.problem.kkt import KKT
from contact.tolerances import LAWS_HOLD

#: Most inner iterations in an outer one.
MAX_INNER = 5000


def all_within(tolerance: float) -> KKT:
    """Return one bound for every residual."""
    return KKT(tolerance, tolerance, tolerance)


@dataclass(frozen=True)
class FixedPointOptions:
    """Options of the fixed point.

    Attributes
    ----------
    tolerance
        On every KKT residual.
    r
        Augmentation parameter, or None for `automatic_r`.
    stopping
        "residual", or "thesis": (3.45) with `eps` inside and (3.46) or (6.40) with `eps_fp`.
    depth, over_relaxation, single_loop
        See `uzawa.Relaxation`.
    inner_tolerance
        Of the block relaxation; None for a tenth of the tolerance, as far as rounding allows.
    material_step
        "secant" (Kacanov), "tangent" (Newton), or "auto": secant steps until the residual is
        below 1e-2, then tangent ones as long as they reduce it.
    linear
        Kind of linear solver, see `linear.LinearOperator`.
    """

    tolerance: float = 1e-8
    r: float | None = None
    stopping: str = "residual"
    eps: float = 1e-5
    eps_fp: float = 1e-5
    depth: int = 30
    over_relaxation: float = 1.0
    single_loop: bool = False
    inner_tolerance: float | None = None
    material_step: str = "auto"
    linear: str = "auto"
    max_outer: int = 200
    max_inner: int = MAX_INNER

    @property
    def allowed(self) -> KKT:
        """How large each residual may be at the end."""
        return all_within(self.tolerance)


@dataclass(frozen=True)
class PenaltyOptions:
    """Options of the penalty method.

    Attributes
    ----------
    eps_contact
        1/stiffness of the foundation (length^3/force); None for `automatic_eps`.
    eps_slip
        Slip length of the regularised friction; None for the number `eps_contact`, as in the
        thesis, or where that is None too for `automatic_eps`.
    tolerance
        On the equilibrium residual of the penalised problem.
    stopping
        "residual", or "thesis": (4.38) with `eps_fp`.
    material_step
        "secant": Algorithm 3 as printed. "tangent": material and friction are implicit in
        SNES from the first frictional iteration on. "auto": Algorithm 3 until the residual is
        below 1e-2, implicit from there as long as SNES converges.
    max_outer, max_inner
        Largest number of outer iterations, and of SNES iterations in one of them.
    linear
        Kind of linear solver, see `linear.LinearOperator`.
    """

    eps_contact: float | None = None
    eps_slip: float | None = None
    tolerance: float = 1e-8
    stopping: str = "residual"
    eps_fp: float = 1e-5
    material_step: str = "auto"
    max_outer: int = 1000
    max_inner: int = 50
    linear: str = "auto"

    @property
    def allowed(self) -> KKT:
        """How large each residual may be at the end."""
        return KKT(self.tolerance, LAWS_HOLD, LAWS_HOLD)


@dataclass(frozen=True)
class NewtonOptions:
    """Options of Newton's method.

    Attributes
    ----------
    tolerance
        On every KKT residual.
    max_iterations
        Number of steps allowed in each stage.
    limit
        Number of steps allowed in all stages together.
    gamma
        Stiffness of the condensed constraints over that of the body.
    secant_until
        Equilibrium residual below which the material's tangent replaces its secant, where the
        body is not condensed.
    patience
        Steps without progress after which the stage is given up.
    softening
        Part of a node's own stiffness that a falling friction coefficient may take away in the
        first step. Infinity for the exact derivative: from nearby, it also leads to solutions
        on the falling part of the law, which are unstable.
    linear
        Kind of linear solver, see `linear.LinearOperator`.
    condense
        Whether to condense the linearised body onto the contact nodes where that pays: one
        step then solves the whole contact problem for a linear body.
    load_steps
        Whether to apply the load in steps where all else has failed.
    """

    tolerance: float = 1e-8
    max_iterations: int = 60
    limit: int = 1000
    gamma: float = 1e4
    secant_until: float = 1e-2
    patience: int = 12
    softening: float = 0.25
    linear: str = "auto"
    condense: bool = True
    load_steps: bool = True

    @property
    def allowed(self) -> KKT:
        """How large each residual may be at the end."""
        return all_within(self.tolerance)
