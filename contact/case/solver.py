"""Sections of the case file about the computation: solver and output."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field, model_validator

from contact.case.types import (
    Accepted,
    Count,
    Positive,
    Section,
    Switch,
    Tolerance,
    either,
    fault,
)
from contact.methods.options import MAX_INNER

Method = Literal["uzawa", "penalty", "newton"]

#: The method where the case file names none.
DEFAULT_METHOD: Method = "newton"

#: Settings that not all methods read, and what reads them: values of other settings.
READ_WITH: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "stopping": {"method": ("uzawa", "penalty")},
    "eps": {"method": ("uzawa",), "stopping": ("thesis",)},
    "eps_fp": {"method": ("uzawa", "penalty"), "stopping": ("thesis",)},
    "inner_tolerance": {"method": ("uzawa",), "stopping": ("residual",)},
    "max_inner": {"method": ("uzawa", "penalty")},
    "r": {"method": ("uzawa",)},
    "acceleration": {"method": ("uzawa",)},
    "depth": {"method": ("uzawa",), "acceleration": ("anderson",)},
    "relaxation": {"method": ("uzawa",), "acceleration": ("none",)},
    "single_loop": {"method": ("uzawa",)},
    "material_step": {"method": ("uzawa", "penalty")},
    "eps_contact": {"method": ("penalty",)},
    "eps_slip": {"method": ("penalty",)},
}


class Solver(Section):
    """`[solver]`: method, tolerances and limits. What the method does not read is refused."""

    method: Method = Field(
        default=DEFAULT_METHOD,
        description="`uzawa`: Algorithms 1, 2 and their kin; `penalty`: Algorithm 3; `newton`: "
        "semismooth Newton.",
    )
    tolerance: Tolerance = Field(
        default=1e-8, description="Tolerance on each KKT residual (relative)."
    )
    stopping: Literal["residual", "thesis"] = Field(
        default="residual",
        description="`residual`: the KKT residuals end the loops; `thesis`: the rules (3.45) and "
        "(3.46) on the change between iterations do. The residuals decide `converged` in any case. "
        "`uzawa` and `penalty` only.",
    )
    eps: Tolerance = Field(
        default=1e-5, description="Tolerance of (3.45), inner loop; `uzawa` by `thesis` only."
    )
    eps_fp: Tolerance = Field(
        default=1e-5,
        description="Tolerance of (3.46), outer loop; `uzawa` and `penalty` by `thesis` only.",
    )
    inner_tolerance: Tolerance | None = Field(
        default=None,
        description="Tolerance of the inner loop, `uzawa` by `residual` only. Default: a tenth of "
        "`tolerance`.",
    )
    max_outer: Count = Field(default=200, description="Most outer iterations.")
    max_inner: Count = Field(
        default=MAX_INNER,
        description="Most inner iterations in an outer one, `uzawa` and `penalty` only.",
    )
    r: Annotated[Literal["auto"] | Positive, Accepted('"auto" or a number > 0')] = Field(
        default="auto",
        description="Augmentation parameter of the block relaxation (force/volume), `uzawa` only.",
    )
    acceleration: Literal["anderson", "none"] = Field(
        default="anderson", description="Acceleration of the block relaxation, `uzawa` only."
    )
    depth: Annotated[int, Field(ge=1, le=100), Accepted("a whole number from 1 to 100")] = Field(
        default=30, description="Number of earlier solves that `anderson` uses."
    )
    relaxation: Annotated[
        float, Field(gt=0, lt=2), Accepted("a number between 0 and 2, both excluded")
    ] = Field(
        default=1.0,
        description="Relaxation of the multiplier's step, with acceleration `none` only; above 1: "
        "over-relaxation.",
    )
    single_loop: Switch = Field(
        default=False,
        description="`true`: the friction bound is updated in the block relaxation itself, "
        "`uzawa` only.",
    )
    material_step: Literal["secant", "tangent", "auto"] = Field(
        default="auto",
        description="Linearisation of the material: `secant` (Kacanov), `tangent`, or secant "
        "first and tangent near the solution. `uzawa` and `penalty` only.",
    )
    eps_contact: Positive | None = Field(
        default=None,
        description="Penalty method: 1/eps_contact is the stiffness of the contact. Default: "
        "0.01 h/E, h the spacing of the contact nodes.",
    )
    eps_slip: Positive | None = Field(
        default=None,
        description="Penalty method: slip length. Default: the number `eps_contact` where that is "
        "given, else a hundredth of the displacement that the loads give.",
    )
    nested: Switch = Field(
        default=False,
        description="`true`: solve on coarser meshes first and start from there, `newton` only.",
    )
    nested_levels: Annotated[int, Field(ge=2, le=20), Accepted("a whole number from 2 to 20")] | (
        None
    ) = Field(default=None, description="Number of nested meshes. Default: all that save time.")
    linear: Literal["auto", "lu", "iterative"] = Field(
        default="auto", description="Linear solver: `auto` chooses by size."
    )

    @property
    def unread(self) -> Mapping[str, str]:
        """Settings that the method does not look at, and with what it would."""
        return {
            key: " and ".join(
                f"{other} = " + either([f'"{value}"' for value in values])
                for other, values in reads.items()
            )
            for key, reads in READ_WITH.items()
            if any(getattr(self, other) not in values for other, values in reads.items())
        }

    @model_validator(mode="after")
    def _check(self) -> Solver:
        for key, reads in self.unread.items():
            if key in self.model_fields_set:
                raise fault(key, getattr(self, key), f"{key} with {reads}")
        if self.inner_tolerance is not None and self.inner_tolerance > self.tolerance:
            raise fault(
                "inner_tolerance", self.inner_tolerance, f"at most tolerance = {self.tolerance:g}"
            )
        if self.nested and self.method != "newton":
            raise fault("nested", self.nested, 'nested = true with method = "newton"')
        if self.nested_levels is not None and not self.nested:
            raise fault("nested_levels", self.nested_levels, "nested_levels with nested = true")
        return self


class Output(Section):
    """`[output]`: what is written besides the summary and the tables."""

    fields: Literal["vtx", "xdmf", "none"] = Field(
        default="vtx", description="Format of the fields: `vtx` (fields.bp), `xdmf` or none."
    )
    checkpoint: Switch = Field(
        default=False, description="`true`: write a checkpoint from which a computation can go on."
    )
