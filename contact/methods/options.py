"""Options of the methods: tolerances, limits and parameters; `[solver]` of the case file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeVar

from annotated_types import Ge, Gt, Le, Lt
from pydantic import AllowInfNan, Discriminator, Tag, model_validator

from contact.model.section import Described
from contact.problem.residuals import Residuals
from contact.settings import Accepted, Count, Internal, Positive, ReadWith, Switch, Tolerance, fault
from contact.tolerances import LARGEST_VIOLATION, PRECISION


class Options(Described):
    """Options of all methods."""

    method: str
    """Name of the method."""
    tolerance: Tolerance = 1e-8
    """Tolerance on each KKT residual (relative); of `penalty`, on the equilibrium of the
    penalised problem."""
    max_outer: Count = 200
    """Most outer iterations; of `newton`, most steps in all its stages together."""
    linear: Literal["auto", "lu", "iterative"] = "auto"
    """Linear solver: `auto` chooses by size, and for `uzawa`, which solves with one matrix
    hundreds of times, `lu` as long as there is memory for it."""

    @property
    def allowed(self) -> Residuals:
        """Tolerance of each residual."""
        return Residuals(self.tolerance, self.tolerance, self.tolerance)


class LoopOptions(Options):
    """Options of methods with an inner and an outer loop."""

    stopping: Literal["residual", "thesis"] = "residual"
    """`residual`: the KKT residuals end the loops. `thesis`: the rules on the change between
    iterations end them, (3.45) and (3.46), with a potential (5.38); without friction (6.40),
    (6.41), with `penalty` (4.38); phi is measured in the unit sqrt(mu_1/beta), where the thesis
    adds the numbers of u and phi. The residuals decide `converged` in any case."""
    eps_fp: Annotated[Tolerance, ReadWith("stopping", "thesis")] = 1e-5
    """Tolerance of (3.46), (6.40), with `penalty` of (4.38): outer loop."""
    max_inner: Count = 5000
    """Most inner iterations in an outer one."""
    material_step: Literal["secant", "tangent", "auto"] = "auto"
    """Linearisation of the material: `secant` (Kacanov; Algorithms as printed), `tangent`, or
    `auto`: secant first, tangent below a residual of 1e-2 until it is twice the least one. The
    tangent of `penalty` is implicit in friction too."""


class FixedPointOptions(LoopOptions):
    """Algorithms 1, 2 and 4 to 9: a fixed point over Uzawa block relaxation."""

    method: Literal["uzawa"] = "uzawa"
    """Name of the method."""
    eps: Annotated[Tolerance, ReadWith("stopping", "thesis")] = 1e-5
    """Tolerance of (3.45), without friction (6.41): inner loop."""
    inner_tolerance: Annotated[Tolerance | None, ReadWith("stopping", "residual")] = None
    """Tolerance of the inner loop. Default: a tenth of `tolerance`."""
    r: Annotated[
        Annotated[Literal["auto"], Tag(":text")] | Annotated[Positive, Tag(":number")],
        Discriminator(lambda r: ":text" if isinstance(r, str) else ":number"),
        Accepted('"auto" or a number > 0'),
    ] = "auto"
    """Augmentation parameter of the Uzawa block relaxation (stress/length). `auto` fits a block;
    where the relaxation stalls with that, a slender body or the soft layer of a stiff one."""
    acceleration: Literal["anderson", "none"] = "anderson"
    """Acceleration of the Uzawa block relaxation: nonlinear GMRES, akin to Anderson's method."""
    depth: Annotated[
        int,
        Ge(1),
        Le(100),
        Accepted("a whole number from 1 to 100"),
        ReadWith("acceleration", "anderson"),
    ] = 30
    """Number of earlier solves that `anderson` uses."""
    relaxation: Annotated[
        float,
        Gt(0),
        Lt(2),
        Accepted("a number between 0 and 2, both excluded"),
        ReadWith("acceleration", "none"),
    ] = 1.0
    """Factor w: Steps 2 and 3 take w u + (1 - w) phi in place of u; above 1: over-relaxation."""
    single_loop: Switch = False
    """`true`: the friction bound is updated in the Uzawa block relaxation itself."""

    @model_validator(mode="after")
    def _check_inner(self) -> Self:
        if self.inner_tolerance is not None and self.inner_tolerance > self.tolerance:
            accepted = f"at most tolerance = {self.tolerance:g}"
            raise fault("inner_tolerance", self.inner_tolerance, accepted)
        return self

    @property
    def inner(self) -> float:
        """Tolerance of the inner loop."""
        return self.inner_tolerance or max(self.tolerance / 10, PRECISION)


class PenaltyOptions(LoopOptions):
    """Algorithm 3, the penalty method."""

    method: Literal["penalty"] = "penalty"
    """Name of the method."""
    eps_contact: Positive | None = None
    """1/eps_contact is the stiffness of the contact (force/length^3). Default: 0.01 h/E, h the
    spacing of the contact nodes."""
    eps_slip: Positive | None = None
    """Slip length of the regularised friction. Default: the number `eps_contact` where that is
    given, as in the thesis, else a hundredth of the displacement that the loads give."""

    @property
    def allowed(self) -> Residuals:
        """Tolerance of each residual."""
        return Residuals(self.tolerance, LARGEST_VIOLATION, LARGEST_VIOLATION)


class NewtonOptions(Options):
    """Semismooth Newton."""

    method: Literal["newton"] = "newton"
    """Name of the method."""
    nested: Switch | None = None
    """`true`: solve on coarser meshes first and start from there; of a case alone, for a problem
    that is built already has one mesh. Default: of static cases, where that saves time and there
    are coarser meshes: from 40000 unknowns on in 3-D with multigrid, and in 2-D where a body is
    not condensed onto its contact nodes, as slender ones; from 100000 on in 2-D where a nonlinear
    one is."""
    nested_levels: Annotated[
        Annotated[int, Ge(2), Le(20), Accepted("a whole number from 2 to 20")] | None,
        ReadWith("nested", True),
    ] = None
    """Number of meshes, the finest one included. Default: all that save time."""
    max_iterations: Internal[int] = 60
    """Number of steps allowed in each stage."""
    gamma: Internal[float] = 1e4
    """gamma E/(E_3 max(c, kappa)), (20): the ratio of the augmentation parameter gamma, with which
    the multipliers are eliminated node by node, to the stiffness at the contact."""
    stagnation_limit: Internal[int] = 12
    """Steps without progress after which the stage is given up."""
    softening: Internal[Annotated[float, AllowInfNan()]] = 0.25
    """Part of a node's own stiffness that a falling friction coefficient may take away.
    Infinity for the exact derivative: from nearby, it also leads to solutions on the falling
    part of the law, which are unstable."""
    condense: Internal[bool] = True
    """Whether to condense the linearised body onto the contact nodes where that pays: one step
    then solves the whole contact problem for a linear body."""
    reuse: Internal[Literal["never", "within", "across"]] = "within"
    """Whether to reuse the factorisation of a condensed body while that costs less than new
    ones: within a solve, which then does not depend on those before, or across solves too."""


#: Name of a method -> its options.
OPTIONS: Mapping[str, type[Options]] = {
    kind().method: kind for kind in (FixedPointOptions, PenaltyOptions, NewtonOptions)
}


AnyOptions = TypeVar("AnyOptions", bound=Options)


def with_method(options: Options, method: type[AnyOptions], **changes: Any) -> AnyOptions:
    """Return the options of a method with the settings that it shares with given ones."""
    shared = method.model_fields.keys() & type(options).model_fields.keys() - {"method"}
    return method(**{key: getattr(options, key) for key in shared} | changes)
