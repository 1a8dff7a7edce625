"""Constants of materials: piezoelectric ones, hardening, matrices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

from contact.model.messages import Words, fault
from contact.model.section import Section
from contact.model.values import Axis, Either, as_tuple
from contact.settings import Accepted, NonNegative, Number, Positive
from forms.piezo import from_voigt, hexagonal_voigt

#: The constants of a crystal of class 6mm: elastic; coupling and permittivity.
SHORT = ("c11", "c12", "c13", "c33", "c44")
PIEZO = ("e31", "e33", "e15", "beta11", "beta33")
Poling: TypeAlias = Annotated[
    Either[Number, Axis], Accepted("an angle in 2-D, a list of 3 numbers in 3-D")
]
POSITIVE = "a symmetric, positive definite matrix"


def matrix(rows: int, columns: int) -> Any:
    """Return the kind of a matrix as a list of rows."""
    row = Annotated[tuple[Number, ...], Field(min_length=columns, max_length=columns), as_tuple]
    words = Accepted(f"a list of {rows} rows of {columns} numbers")
    return Annotated[tuple[row, ...], Field(min_length=rows, max_length=rows), as_tuple, words]


def either_way(section: Section, short: tuple[str, ...], full: tuple[str, ...]) -> None:
    """Raise a fault unless all of some keys, or all of others, are given."""
    given = [key for key in (*short, *full) if getattr(section, key) is not None]
    if set(given) in ({*short}, {*full}):
        return
    missing = [k for k in (full if {*given} & {*full} else short) if k not in given]
    raise fault(
        missing[0] if missing else given[-1],
        Words(f"only {', '.join(given) or 'nothing'}" if missing else "both ways"),
        f"either all of {', '.join(short)}, or {' and '.join(full)}",
        "exclusive-keys",
    )


class Piezo(Section):
    """`[material.piezo]`: the law sigma = F eps + e^T grad(phi), D = e eps - beta grad(phi).

    A crystal of class 6mm poled along X3, by five constants, or full Voigt matrices. In 2-D x and
    y stand for X2 and X3.
    """

    e31: Number | None = None
    """Coupling e31 = e32 of class 6mm (charge/area)."""
    e33: Number | None = None
    """Coupling e33 (charge/area)."""
    e15: Number | None = None
    """Coupling e15 = e24 (charge/area)."""
    beta11: Positive | None = None
    """Permittivity across the poling axis."""
    beta33: Positive | None = None
    """Permittivity along the poling axis."""
    e: matrix(3, 6) | None = None  # type: ignore[valid-type]
    """Coupling matrix, columns 11, 22, 33, 23, 13, 12. With `beta`, instead of the five
    constants."""
    beta: matrix(3, 3) | None = None  # type: ignore[valid-type]
    """Permittivity matrix, symmetric and positive definite."""
    poling: Poling | None = None
    """Poling axis: angle (degrees) from x in 2-D, a vector in 3-D. Default: y in 2-D, z in
    3-D."""

    @property
    def voigt(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coupling, shape (3, 6), and permittivity, shape (3, 3), poled along X3."""
        if self.e is not None:
            return np.array(self.e), np.array(self.beta)
        return hexagonal_voigt(*(getattr(self, key) for key in PIEZO))

    @model_validator(mode="after")
    def _check(self) -> Self:
        either_way(self, PIEZO, ("e", "beta"))
        try:
            from_voigt(*self.voigt)
        except ValueError as error:
            raise fault("beta", Words(error), POSITIVE, "material-constants") from None
        return self


class Saturation(Section):
    """`[material.hardening]`: yield stress R(a) = Y + H a + Q (1 - exp(-q a)) (Voce) of `j2`.

    a is the equivalent plastic strain.
    """

    saturation: Positive
    """Q (force/area)."""
    rate: Positive
    """q."""
    modulus: NonNegative = 0.0
    """H (force/area)."""


class BackStress(Section):
    """`[[material.kinematic]]`: back stress db = (2/3) C de_p - gamma b da of `j2`.

    Each term has one; the yield surface moves by their sum (Armstrong and Frederick, Chaboche).
    """

    modulus: Positive
    """C, uniaxial stress over plastic strain (force/area)."""
    recovery: NonNegative = 0.0
    """gamma; 0: Prager's."""


#: The hardening of `j2`.
Hardening: TypeAlias = Annotated[
    Annotated[NonNegative, Tag("number")]
    | Annotated[Saturation, Tag("table")]
    | Annotated[tuple[Annotated[tuple[Number, Number], as_tuple], ...], as_tuple, Tag("points")],
    Discriminator(
        lambda given: (
            "points"
            if isinstance(given, list | tuple | np.ndarray)
            else "table"
            if isinstance(given, Mapping | Section)
            else "number"
        )
    ),
    Accepted(
        "a modulus >= 0, a table { saturation, rate, modulus }, or a list of points "
        "[plastic strain, stress]"
    ),
]
Kinematic: TypeAlias = Annotated[
    Either[NonNegative, Annotated[tuple[BackStress, ...], as_tuple]],
    Accepted("a modulus >= 0, or a list of tables { modulus, recovery }"),
]
