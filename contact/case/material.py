"""Sections of the case file about the material."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from contact.case.accepted import accepted_by
from contact.case.types import (
    File,
    Names,
    NonNegative,
    Number,
    Section,
    Text,
    Triple,
    Words,
    as_tuple,
    fault,
)
from contact.errors import InputError
from contact.library.entry import Entry
from contact.library.reading import PACKAGED, find
from contact.settings import Accepted, Positive
from forms.elasticity import Anisotropic, hexagonal
from forms.piezo import hexagonal_voigt

Poling: TypeAlias = Annotated[
    Number | Triple, Accepted("an angle in the plane, a list of 3 numbers in space")
]

#: Constants of an isotropic material, and the two ways to give those of another.
ISOTROPIC = ("young", "poisson")
SHORT = ("c11", "c12", "c13", "c33", "c44")


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
    poling: Poling | None = Field(
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
    """`[material]`: isotropic Hencky material, sigma = k0 tr(eps) I + 2 g dev(eps), or a crystal.

    Several materials are a list of tables `[[material]]`, each with its regions. With `name` the
    constants are those of a library (`contact materials` lists them); they are then not given.
    """

    on: Names | None = Field(
        default=None,
        description="Regions of the mesh (its named groups of cells) that consist of it. Default: "
        "the whole mesh, where this is the only material.",
    )
    name: Text | None = Field(
        default=None, description="Name of a material of the library, with its coupling."
    )
    units: Literal["SI", "GPa"] | None = Field(
        default=None,
        description="With `name`: units of the case. `SI`: Pa, V, C/m2; `GPa`: lengths in m, GPa, "
        "GV, C/m2. Default: `SI`.",
    )
    library: Annotated[File, Accepted("a library of materials (TOML)")] | None = Field(
        default=None,
        description="With `name`: a library of one's own (TOML), relative to the case file. "
        "Default: that of the package.",
    )
    law: Literal["linear", "log", "anisotropic"] | None = Field(
        default=None,
        description="`linear`: g = mu1; `log`: (7.8), g = mu1 (s/t)(ln(t/s) + 1) "
        "beyond the yield strain s; `anisotropic`: sigma = C eps. Default: `linear`.",
    )
    young: Positive | None = Field(
        default=None,
        description="Young's modulus E (force/area). Required by `linear` and `log`.",
    )
    poisson: (
        Annotated[
            float, Field(gt=-1, lt=0.5), Accepted("a number between -1 and 0.5, both excluded")
        ]
        | None
    ) = Field(default=None, description="Poisson's ratio. Required by `linear` and `log`.")
    stiffness: _matrix(6, 6) | None = Field(  # type: ignore[valid-type]
        None,
        description="C of `anisotropic`, rows and columns 11, 22, 33, 23, 13, 12, symmetric and "
        "positive definite (force/area); or the five constants of class 6mm about X3:",
    )
    c11: Number | None = Field(default=None, description="Across the axis X3.")
    c12: Number | None = Field(default=None, description="c12 = c11 - 2 c66.")
    c13: Number | None = Field(default=None, description="c13 = c23.")
    c33: Number | None = Field(default=None, description="Along the axis X3.")
    c44: Number | None = Field(default=None, description="c44 = c55.")
    poling: Poling | None = Field(
        default=None,
        description="Where X3 of a crystal points, its coupling's as well: angle (degrees) from "
        "x in the plane, a vector in space. Default: y in the plane, z in space.",
    )
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

    @cached_property
    def entry(self) -> Entry | None:
        """The material of the library that is named."""
        if self.name is None:
            return None
        return find(self.name, PACKAGED if self.library is None else Path(self.library))

    @property
    def piezoelectric(self) -> bool:
        """Whether it couples stresses with an electric field."""
        return self.piezo is not None or (self.entry is not None and self.entry.piezo is not None)

    @property
    def axis(self) -> tuple[str, float | tuple[float, ...] | None]:
        """The key that says where X3 points, and what it says."""
        if self.piezo is not None and self.piezo.poling is not None:
            return "piezo.poling", self.piezo.poling
        return "poling", self.poling

    @property
    def voigt(self) -> NDArray[np.float64]:
        """The stiffness matrix of `anisotropic`, X3 along its third axis, shape (6, 6)."""
        if self.stiffness is not None:
            return np.array(self.stiffness)
        return hexagonal(*(getattr(self, key) for key in SHORT))

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        """Fill in the defaults that depend on other keys."""
        if not isinstance(given, Mapping):
            return given
        default = {"law": "linear"} if given.get("name") is None else {"units": "SI"}
        return {**default, **given}

    @model_validator(mode="after")
    def _check(self) -> Material:
        if self.name is not None:
            self._check_name()
            return self
        for key in ("units", "library"):
            if getattr(self, key) is not None:
                raise fault(key, getattr(self, key), f"{key} with name only")
        if self.law == "anisotropic":
            self._check_stiffness()
        else:
            self._check_isotropic()
        if self.poling is not None and self.piezo is not None and self.piezo.poling is not None:
            raise fault("piezo.poling", self.piezo.poling, "one of poling and piezo.poling")
        if isinstance(self.poling, tuple) and not any(self.poling):
            raise fault("poling", self.poling, "a vector that is not zero")
        return self

    def _check_name(self) -> None:
        try:
            entry = self.entry
        except InputError as error:
            key = "library" if self.library is not None and str(error)[0] == "/" else "name"
            words, _, accepted = str(error).partition("; accepted: ")
            raise fault(key, Words(words), accepted) from None
        own = ("law", *ISOTROPIC, "stiffness", *SHORT, "yield_strain", "piezo")
        for key in own:
            if getattr(self, key) is not None:
                raise fault(key, Words(f'given with name = "{self.name}"'), f"{key} without name")
        self._refuse_log_keys()
        if self.poling is not None and entry is not None and entry.isotropic is not None:
            raise fault("poling", self.poling, f"no axis: {self.name} is isotropic")

    def _check_isotropic(self) -> None:
        for key in ISOTROPIC:
            if getattr(self, key) is None:
                accepted = accepted_by(type(self).model_fields[key].annotation)
                raise fault(key, Words("missing"), accepted)
        for key in ("stiffness", *SHORT):
            if getattr(self, key) is not None:
                raise fault(key, getattr(self, key), f'{key} with law = "anisotropic"')
        if self.poling is not None and self.piezo is None:
            raise fault("poling", self.poling, 'an axis with law = "anisotropic" or piezo')
        if self.law == "linear":
            self._refuse_log_keys()
            return
        if self.yield_strain is None:
            raise fault("yield_strain", Words("missing"), 'a number > 0 with law = "log"')
        assert self.young is not None
        assert self.poisson is not None
        mu1 = self.young / (2 + 2 * self.poisson)
        if self.g_min > mu1:
            raise fault("g_min", self.g_min, f"at most the shear modulus {mu1:g}")

    def _refuse_log_keys(self) -> None:
        for key in ("argument", "g_min"):
            value = getattr(self, key)
            if value != type(self).model_fields[key].default:
                raise fault(key, value, f'{key} with law = "log"')

    def _check_stiffness(self) -> None:
        self._refuse_log_keys()
        for key in (*ISOTROPIC, "yield_strain"):
            if getattr(self, key) is not None:
                raise fault(key, getattr(self, key), f"{key} with another law")
        given = [key for key in ("stiffness", *SHORT) if getattr(self, key) is not None]
        if set(given) not in ({"stiffness"}, {*SHORT}):
            accepted = f"either stiffness, or all of {', '.join(SHORT)}"
            missing = [key for key in SHORT if key not in given]
            both = "stiffness" in given
            raise fault(
                given[-1] if both else missing[0],
                Words("both ways" if both else f"only {', '.join(given) or 'nothing'}"),
                accepted,
            )
        try:
            Anisotropic(self.voigt).check()
        except ValueError as error:
            matrix = Words(str(error).replace("the stiffness must", "must"))
            accepted = "a symmetric, positive definite matrix"
            raise fault(given[0], Words(f"the stiffness {matrix}"), accepted) from None
