"""Sections of the case file about the body: elements, material, supports and loads."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from contact.case.types import (
    AmplitudeName,
    Formula,
    FormulaVector,
    Name,
    Names,
    NonNegative,
    Number,
    Section,
    Triple,
    Words,
    as_tuple,
    fault,
)
from contact.settings import Accepted, Positive, Switch
from forms.piezo import hexagonal_voigt


class Space(Section):
    """`[space]`: finite elements, and what the mesh stands for."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = Field(
        default=1,
        description="Degree of the Lagrange elements of the displacement and the potential.",
    )
    kinematics: Literal["plane_strain", "axisymmetric"] = Field(
        default="plane_strain",
        description="What a mesh in the plane stands for: a body in plane strain, or the half "
        "plane of a body of revolution, x the radius and y the axis. There displacements are "
        "0 across the axis without being asked for, and loads, forces and charges are those of the "
        "full turn.",
    )


def _matrix(rows: int, columns: int) -> Any:
    row = Annotated[tuple[Number, ...], Field(min_length=columns, max_length=columns), as_tuple]
    words = Accepted(f"a list of {rows} rows of {columns} numbers")
    return Annotated[tuple[row, ...], Field(min_length=rows, max_length=rows), as_tuple, words]


class Piezo(Section):
    """`[material.piezo]`: the law sigma = F eps + e^T grad(phi), D = e eps - beta grad(phi).

    A crystal of class 6mm poled along X3, by five constants, or full Voigt matrices. In the
    plane x and y stand for X2 and X3.
    """

    e31: Number | None = Field(
        default=None, description="Coupling e31 = e32 of class 6mm (charge/area)."
    )
    e33: Number | None = Field(default=None, description="Coupling e33 (charge/area).")
    e15: Number | None = Field(default=None, description="Coupling e15 = e24 (charge/area).")
    beta11: Positive | None = Field(
        default=None, description="Permittivity across the poling axis."
    )
    beta33: Positive | None = Field(default=None, description="Permittivity along the poling axis.")
    e: _matrix(3, 6) | None = Field(  # type: ignore[valid-type]
        None,
        description="Coupling matrix, columns 11, 22, 33, 23, 13, 12. With `beta`, instead "
        "of the five constants.",
    )
    beta: _matrix(3, 3) | None = Field(  # type: ignore[valid-type]
        None, description="Permittivity matrix, symmetric and positive definite."
    )
    poling: (
        Annotated[Number | Triple, Accepted("an angle in the plane, a list of 3 numbers in space")]
        | None
    ) = Field(
        default=None,
        description="Poling axis: angle (degrees) from x in the plane, a vector in space. "
        "Default: y in the plane, z in space.",
    )

    @property
    def voigt(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coupling, shape (3, 6), and permittivity, shape (3, 3), poled along X3."""
        if self.e is not None:
            return np.array(self.e), np.array(self.beta)
        constants = (self.e31, self.e33, self.e15, self.beta11, self.beta33)
        return hexagonal_voigt(*constants)  # type: ignore[arg-type]

    @model_validator(mode="after")
    def _check(self) -> Piezo:
        short = ("e31", "e33", "e15", "beta11", "beta33")
        full = ("e", "beta")
        given = [key for key in (*short, *full) if getattr(self, key) is not None]
        if set(given) not in ({*short}, {*full}):
            accepted = f"either all of {', '.join(short)}, or e and beta"
            missing = [k for k in (full if set(given) & {*full} else short) if k not in given]
            raise fault(
                missing[0] if missing else given[0],
                Words(f"only {', '.join(given) or 'nothing'}" if missing else "both ways"),
                accepted,
            )
        beta = self.voigt[1]
        if not np.allclose(beta, beta.T, rtol=1e-10, atol=0):
            raise fault("beta", self.beta, "a symmetric matrix")
        if not np.linalg.eigvalsh(beta)[0] > 0:
            raise fault("beta", self.beta, "a positive definite matrix")
        if isinstance(self.poling, tuple) and not any(self.poling):
            raise fault("poling", self.poling, "a vector that is not zero")
        return self


class Material(Section):
    """`[material]`: isotropic Hencky material, sigma = k0 tr(eps) I + 2 g dev(eps).

    Several materials are a list of tables `[[material]]`, each with its regions.
    """

    on: Names | None = Field(
        default=None,
        description="Regions of the mesh (its named groups of cells) that consist of it. Default: "
        "the whole mesh, where this is the only material.",
    )
    law: Literal["linear", "log"] = Field(
        default="linear",
        description="`linear`: g = mu1; `log`: (7.8), g = mu1 (s/t)(ln(t/s) + 1) "
        "beyond the yield strain s.",
    )
    young: Positive = Field(description="Young's modulus E (force/area).")
    poisson: Annotated[
        float, Field(gt=-1, lt=0.5), Accepted("a number between -1 and 0.5, both excluded")
    ] = Field(description="Poisson's ratio.")
    yield_strain: Positive | None = Field(
        default=None,
        description="Yield strain xi_0, a limit on |dev eps|. Required by `log`, of no "
        "effect on `linear`.",
    )
    argument: Literal["norm", "square"] = Field(
        default="norm",
        description="Argument of g: |dev eps|, or its square as printed in (7.8), which "
        "softens beyond e xi_0. `log` only.",
    )
    g_min: NonNegative = Field(
        default=0.0, description="Floor of g in `log` (force/area); 0: none."
    )
    piezo: Piezo | None = Field(
        default=None,
        description="Piezoelectric constants, `[material.piezo]`. Absent: mechanical only.",
    )

    @model_validator(mode="after")
    def _check(self) -> Material:
        if self.law == "log" and self.yield_strain is None:
            raise fault("yield_strain", Words("missing"), 'a number > 0 with law = "log"')
        for key in ("argument", "g_min") if self.law == "linear" else ():
            value = getattr(self, key)
            if value != type(self).model_fields[key].default:
                raise fault(key, value, f'{key} with law = "log"')
        mu1 = self.young / (2 + 2 * self.poisson)
        if self.g_min > mu1:
            raise fault("g_min", self.g_min, f"at most the shear modulus {mu1:g}")
        return self


def _component(given: Any) -> str:
    return "free" if given == "free" else "Formula"


Component: TypeAlias = Annotated[
    Annotated[Formula, Tag("Formula")] | Annotated[Literal["free"], Tag("free")],
    Discriminator(_component),
]


class Fixed(Section):
    """`[[fixed]]`: prescribed displacement or potential on a part."""

    on: Name = Field(description="Part of the boundary.")
    displacement: (
        Annotated[
            tuple[Component, ...],
            Field(min_length=2, max_length=3),
            as_tuple,
            Accepted(
                "a list of 2 components in the plane, 3 in space, each a number, a formula "
                'or "free"'
            ),
        ]
        | None
    ) = Field(
        default=None,
        description='Displacement of the part; "free" for a component that is not fixed.',
    )
    potential: Formula | None = Field(default=None, description="Electric potential of the part.")
    amplitude: AmplitudeName | None = Field(
        default=None,
        description="Factor of all that is prescribed as a function of time, see `[evolution]`.",
    )

    @property
    def is_clamped(self) -> bool:
        """True if every component of the displacement is prescribed."""
        return self.displacement is not None and "free" not in self.displacement

    @model_validator(mode="after")
    def _check(self) -> Fixed:
        if self.potential is None and (
            self.displacement is None or all(c == "free" for c in self.displacement)
        ):
            raise fault(
                "displacement",
                self.displacement or Words("missing"),
                "a component that is fixed, or a potential",
            )
        return self


class Load(Section):
    """`[[load]]`: forces and charges on a part, or in the whole body."""

    on: Name | None = Field(
        default=None,
        description="Part of the boundary, beside the contact part. This or `everywhere`.",
    )
    everywhere: Switch = Field(default=False, description="`true`: in the whole body.")
    traction: FormulaVector | None = Field(default=None, description="Force per area of the part.")
    pressure: Formula | None = Field(
        default=None,
        description="Normal pressure p on the part: traction -p along the outward normal.",
    )
    charge: Formula | None = Field(default=None, description="Charge per area of the part.")
    body_force: FormulaVector | None = Field(default=None, description="Force per volume.")
    body_charge: Formula | None = Field(default=None, description="Charge per volume.")
    amplitude: AmplitudeName | None = Field(
        default=None,
        description="Factor of all of these as a function of time, see `[evolution]`.",
    )

    @model_validator(mode="after")
    def _check(self) -> Load:
        if (self.on is None) == (not self.everywhere):
            given = "neither" if self.on is None else "both"
            raise fault("on", Words(given), "one of on and everywhere = true")
        surface, volume = ("traction", "pressure", "charge"), ("body_force", "body_charge")
        right, wrong = (volume, surface) if self.everywhere else (surface, volume)
        place = "everywhere = true" if self.everywhere else "on"
        for key in wrong:
            if getattr(self, key) is not None:
                raise fault(
                    key, Words(f"together with {place}"), f"with {place}: {', '.join(right)}"
                )
        if all(getattr(self, key) is None for key in right):
            raise fault(right[0], Words("missing"), f"at least one of {', '.join(right)}")
        return self
