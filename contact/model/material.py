"""A material and its regions: by constants, by the name of one of a library, or by a law object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypeAlias, get_args

import numpy as np
from dolfinx.fem import Function
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, Tag, ValidationError, model_validator

from contact.arguments import CONSTANTS as NUMBERS
from contact.arguments import expect, is_law, several
from contact.errors import InputError, shown
from contact.library.materials import PACKAGED, Entry, find
from contact.model import fields
from contact.model.messages import describe
from contact.model.section import (
    Axis,
    Described,
    Either,
    File,
    Names,
    Section,
    StaticValue,
    Text,
    as_tuple,
    by_kind,
)
from contact.model.units import SystemOfUnits, UnitSystem, unit_system
from contact.settings import (
    Accepted,
    Fault,
    Internal,
    NonNegative,
    Number,
    OrOwn,
    Positive,
    ReadWith,
    Words,
    fault,
)
from contact.typing import Array, TableValue
from forms import j2
from forms.crystal import in_plane, isotropic_about_x3, stiffness_tensor, to_axis
from forms.elasticity import Anisotropic, hexagonal, moduli
from forms.hencky import Law, Linear, Log, is_linear
from forms.history import HistoryLaw
from forms.piezo import Piezo as PiezoTensors
from forms.piezo import from_voigt, hexagonal_voigt
from forms.plane_stress import PlaneStressElastic, PlaneStressHistory, in_plane_stress

#: The constants of a crystal of class 6mm: elastic; coupling and permittivity.
SHORT = ("c11", "c12", "c13", "c33", "c44")
PIEZO = ("e31", "e33", "e15", "beta11", "beta33")
Poling: TypeAlias = Annotated[
    Either[Number, Axis], Accepted("an angle in 2-D, a list of 3 numbers in 3-D")
]
POSITIVE = "a symmetric, positive definite matrix"


def matrix(rows: int, columns: int) -> Any:
    """Return the kind of a matrix as a list of rows."""

    def several(one: Any, count: int, words: str) -> Any:
        bounds = Field(min_length=count, max_length=count)
        return Annotated[tuple[one, ...], bounds, as_tuple, Accepted(words)]

    row = several(Number, columns, f"a list of {columns} numbers")
    return several(row, rows, f"a list of {rows} rows of {columns} numbers")


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
        self.require_either(PIEZO, ("e", "beta"))
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
    Annotated[NonNegative, Tag(":one")]
    | Annotated[Saturation, Tag(":table")]
    | Annotated[tuple[Annotated[tuple[Number, Number], as_tuple], ...], as_tuple, Tag(":many")],
    by_kind,
    Accepted(
        "a modulus >= 0, a table { saturation, rate, modulus }, or a list of points "
        "[plastic strain, stress]"
    ),
]
Kinematic: TypeAlias = Annotated[
    Either[NonNegative, Annotated[tuple[BackStress, ...], as_tuple]],
    Accepted("a modulus >= 0, or a list of tables { modulus, recovery }"),
]


#: Keys that a material of the library does not take.
PLASTIC = ("yield_stress", "hardening", "kinematic")
CONSTANTS = ("law", "young", "poisson", "stiffness", *SHORT, "yield_strain", *PLASTIC, "piezo")

#: The laws of the stress; all but the last are isotropic.
LawName: TypeAlias = Literal["linear", "log", "j2", "anisotropic"]

ISOTROPIC = ReadWith("law", get_args(LawName)[:-1], required=True)
CRYSTAL = ReadWith("law", get_args(LawName)[-1])
LOG = ReadWith("law", "log")
J2 = ReadWith("law", "j2")


#: A law of a user's, in words.
OWN_LAW = (
    "Linear(young, poisson) of numbers, Log, UserLaw, forms.elasticity.Anisotropic(stiffness), of "
    "a crystal in 2-D with .in_plane(), or an object with the numbers "
    f"{', '.join(NUMBERS)} and a stress as forms.hencky.Hencky or forms.history.HistoryLaw have it"
)


def _own(factor: Any) -> Any:
    """Return a factor that does not change with the user's Function."""
    return factor.copy() if isinstance(factor, Function) else factor


class Material(Described):
    """`[material]`: isotropic material of Hencky or of flow theory (`j2`), or a crystal.

    Hencky's has sigma = k0 tr(eps) I + 2 g dev(eps).

    Several materials are a list of tables `[[material]]`, each with its regions. With `name` the
    constants are those of a library (`contact materials` lists them); they are then not given.
    """

    on: Names | None = None
    """Its regions of the mesh (named groups of cells). Default: the whole mesh, where this is the
    only material."""
    name: Text | None = None
    """Name of a material of the library, with its coupling."""
    units: Annotated[SystemOfUnits | None, ReadWith("name")] = None
    """With `name`: the case's system of units, into which the constants are converted. The
    potential of those with a force and a length is in V; `GPa`: GPa, GV/m, C/m2, and any length.
    Default: `[case] units` where that is a system, else `SI`."""
    library: Annotated[
        Annotated[File, Accepted("a library of materials (TOML)")] | None, ReadWith("name")
    ] = None
    """With `name`: a library of one's own (TOML), relative to the case file. Default: that of the
    package."""
    kind: Annotated[LawName | Law, OrOwn(is_law)] | None = Field(None, alias="law")
    """`linear`: g = mu1; `log`: g = mu1 (s/t)(ln(t/s) + 1) for t = |dev eps| above the yield strain
    s; `j2`: flow theory (von Mises), with plastic strain that remains; `anisotropic`:
    sigma = C eps. Default: `linear`."""
    young: Annotated[Positive | None, ISOTROPIC] = None
    """Young's modulus E (force/area)."""
    poisson: Annotated[
        Annotated[
            float, Field(gt=-1, lt=0.5), Accepted("a number between -1 and 0.5, both excluded")
        ]
        | None,
        ISOTROPIC,
    ] = None
    """Poisson's ratio."""
    stiffness: Annotated[matrix(6, 6) | None, CRYSTAL] = None  # type: ignore[valid-type]
    """C of `anisotropic`, rows and columns 11, 22, 33, 23, 13, 12, symmetric and positive
    definite (force/area). Or the five constants c11 to c44 of class 6mm about X3."""
    c11: Annotated[Number | None, CRYSTAL] = None
    """Across the axis X3."""
    c12: Annotated[Number | None, CRYSTAL] = None
    """c12 = c11 - 2 c66."""
    c13: Annotated[Number | None, CRYSTAL] = None
    """c13 = c23."""
    c33: Annotated[Number | None, CRYSTAL] = None
    """Along the axis X3."""
    c44: Annotated[Number | None, CRYSTAL] = None
    """c44 = c55."""
    poling: Poling | None = None
    """Direction of X3 of a crystal, and of its coupling: angle (degrees) from x in 2-D, a vector
    in 3-D. Default: y in 2-D, z in 3-D."""
    yield_strain: Positive | None = None
    """Yield strain xi_0, a limit on |dev eps|. Required by `log`, of no effect on `linear`."""
    argument: Annotated[Literal["norm", "square"], LOG] = "norm"
    """Argument of g: |dev eps|, or its square as in the thesis; that softens beyond e xi_0."""
    g_min: Annotated[NonNegative, LOG] = 0.0
    """Lower bound of g (force/area); 0: none."""
    yield_stress: Annotated[Positive | None, J2] = None
    """Y in uniaxial tension (force/area). Required by `j2`, but where `hardening` is a list of
    points, which begins with it."""
    hardening: Annotated[Hardening, J2] = 0.0
    """Isotropic hardening: H of R(a) = Y + H a, a being the equivalent plastic strain; or R by
    points, linear between them and constant behind."""
    kinematic: Annotated[Kinematic, J2] = 0.0
    """Kinematic hardening: Prager's modulus, uniaxial stress over plastic strain."""
    coupling: Annotated[Piezo | PiezoTensors, OrOwn(PiezoTensors)] | None = Field(
        None, alias="piezo"
    )
    """Piezoelectric constants, `[material.piezo]`. Absent: mechanical only."""
    factor: Internal[Annotated[StaticValue, AfterValidator(_own)] | None] = None
    """A function of position > 0 that its stresses are multiplied by; None for 1."""

    def __init__(
        self,
        law: Law | LawName | None = None,
        piezo: PiezoTensors | Mapping[str, float | Array | Sequence[Sequence[float]]] | None = None,
        on: str | Sequence[str] = (),
        factor: fields.Static | None = None,
        *,
        name: str | None = None,
        units: str | Mapping[str, str] | None = None,
        library: str | None = None,
        young: float | None = None,
        poisson: float | None = None,
        stiffness: Array | Sequence[Sequence[float]] | None = None,
        c11: float | None = None,
        c12: float | None = None,
        c13: float | None = None,
        c33: float | None = None,
        c44: float | None = None,
        poling: float | Array | Sequence[float] | None = None,
        yield_strain: float | None = None,
        argument: Literal["norm", "square"] = "norm",
        g_min: float = 0.0,
        yield_stress: float | None = None,
        hardening: float | Mapping[str, float] | Sequence[Sequence[float]] | None = None,
        kinematic: float | Sequence[Mapping[str, float]] | None = None,
    ) -> None:
        every: dict[str, Any] = {"name": name, "units": units, "library": library, "young": young}
        every |= {"poisson": poisson, "stiffness": stiffness, "poling": poling}
        every |= {"c11": c11, "c12": c12, "c13": c13, "c33": c33, "c44": c44}
        every |= {"yield_strain": yield_strain, "argument": argument, "g_min": g_min}
        every |= {"yield_stress": yield_stress, "hardening": hardening, "kinematic": kinematic}
        keys = {key: value for key, value in every.items() if value is not None}
        fits = isinstance(law, str) or is_law(law)
        by_keys = law is None and {*keys} & {"name", "young", "poisson", "stiffness", "c11"}
        expect("law", law, OWN_LAW, fits or by_keys)
        fits = isinstance(piezo, PiezoTensors | Mapping | None)
        expect("piezo", piezo, "Piezo(...), a table of constants, or None", fits)
        names = several("on", on, str, "the name of a region, or a list of names")
        super().__init__(law=law, piezo=piezo, on=names or None, factor=factor, **keys)

    @model_validator(mode="after")
    def _check_factor(self) -> Self:
        fits = self.factor is None or not (self.piezo or isinstance(self.law, HistoryLaw))
        accepted = "a material without coupling and internal variables"
        expect("factor", self.factor, accepted, fits)
        return self

    @cached_property
    def law(self) -> Law:
        """The law of the stress; of a crystal by its constants about its own axes."""
        return self._law(np.eye(3)) if isinstance(self.kind, str | None) else self.kind

    @property
    def piezo(self) -> PiezoTensors | None:
        """The piezoelectric tensors; those by constants about the axes of the crystal."""
        if self.coupling is not None:
            given = self.coupling
            return given if isinstance(given, PiezoTensors) else from_voigt(*given.voigt)
        if self.entry is None or self.entry.piezo is None:
            return None
        tensors = self.entry.piezo
        coupling, beta = np.asarray(tensors.e), np.asarray(tensors.beta)
        unit = self.system.unit
        return PiezoTensors(coupling / unit("coupling"), beta / unit("permittivity"))

    @cached_property
    def entry(self) -> Entry | None:
        """The material of the library that is named."""
        if self.name is None:
            return None
        return find(self.name, PACKAGED if self.library is None else Path(self.library))

    @property
    def system(self) -> UnitSystem:
        """The system of units of a material by name."""
        return self.units if isinstance(self.units, UnitSystem) else unit_system(self.units or "SI")

    @property
    def piezoelectric(self) -> bool:
        """Whether it couples stresses with an electric field."""
        return self.piezo is not None

    @property
    def axis(self) -> tuple[str, float | tuple[float, ...] | None]:
        """The key that says where X3 points, and its value."""
        if isinstance(self.coupling, Piezo) and self.coupling.poling is not None:
            return "piezo.poling", self.coupling.poling
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
        """Fill in the law; a material of the library has none, nor constants."""
        if not isinstance(given, Mapping):
            return given
        if given.get("name") is None:
            return given if given.get("law") is not None else {**given, "law": "linear"}
        for key in CONSTANTS:
            if given.get(key) is not None:
                words = Words(f'given with name = "{given["name"]}"')
                raise fault(key, words, f"{key} without name", "exclusive-keys")
        return given if given.get("units") is not None else {**given, "units": "SI"}

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.name is not None:
            self._check_name()
            return self
        table = self.coupling if isinstance(self.coupling, Piezo) else None
        if self.kind == "anisotropic":
            self._check_stiffness()
        elif self.poling is not None and table is None:
            self.require(False, "poling", 'an axis with law = "anisotropic" or piezo')
        elif self.kind == "log":
            self._check_log()
        elif self.kind == "j2":
            self._check_j2()
        both = self.poling is not None and table is not None and table.poling is not None
        self.require(not both, "piezo.poling", "one of poling and piezo.poling")
        return self

    def _check_name(self) -> None:
        try:
            entry = self.entry
        except InputError as error:
            key = "library" if self.library is not None and error.words[0] == "/" else "name"
            raise Fault(f"{key}: {error.words}", error.identifier) from None
        fits = self.poling is None or entry is None or entry.isotropic is None
        self.require(fits, "poling", f"no axis: {self.name} is isotropic")

    def _check_log(self) -> None:
        self.require(self.yield_strain is not None, "yield_strain", 'a number > 0 with law = "log"')
        assert self.young is not None and self.poisson is not None  # required
        _, mu1 = moduli(self.young, self.poisson)
        self.require(self.g_min <= mu1, "g_min", f"at most the shear modulus {mu1:g}")

    def _check_j2(self) -> None:
        self.require(self.yield_strain is None, "yield_strain", "yield_stress")
        points, given = self.hardening, self.yield_stress
        first = points[0][1] if isinstance(points, tuple) and points else given
        self.require(first is not None, "yield_stress", 'a number > 0 with law = "j2"')
        accepted = f"that of the first point of hardening, {first:g}"
        self.require(given in (None, first), "yield_stress", accepted)
        try:
            self._law(np.eye(3))
        except ValueError as error:
            words = str(error).replace("hardening: accepted", f"{shown(points)}; accepted")
            raise Fault(f"hardening: {words}", "material-constants") from None

    def _check_stiffness(self) -> None:
        self.require(self.yield_strain is None, "yield_strain", "yield_strain with another law")
        self.require_either(SHORT, ("stiffness",))
        try:
            Anisotropic(self.voigt).check()
        except ValueError as error:
            key = "c11" if self.stiffness is None else "stiffness"
            raise fault(key, Words(error), POSITIVE, "material-constants") from None

    def in_body(self, dim: int) -> Material:
        """Return the material with its law and tensors in the axes of a body in 2-D or 3-D."""
        if not isinstance(self.kind, str | None) and not isinstance(self.coupling, Piezo):
            return self
        key, axis = self.axis
        accepted = "an angle in 2-D" if dim == 2 else "3 numbers in 3-D"
        expect(key, axis, accepted, axis is None or np.ndim(axis) == dim - 2)
        if dim == 2:
            turn = in_plane(90.0 if axis is None else float(axis))  # type: ignore[arg-type]
        else:
            turn = np.eye(3) if axis is None else to_axis(axis)
        law = self._law(turn) if isinstance(self.kind, str | None) else self.kind
        tensors = self.piezo
        if tensors is not None and not isinstance(self.coupling, PiezoTensors):
            tensors = tensors.rotated(turn)
        return Material(law, tensors, self.on or (), self.factor)

    @property
    def in_plane_stress(self) -> bool:
        """Whether no stress acts across a plane body of it."""
        return isinstance(self.kind, PlaneStressElastic | PlaneStressHistory)

    def plane_stress(self) -> Material:
        """Return the material of a plane body without stress across it, of unit thickness."""
        own = self.in_body(2)
        # With a nonlinear law the strain across would have to follow the electric field.
        if not (own.piezo is None or own.in_plane_stress or is_linear(own.law)):
            raise InputError(
                "piezo: given with a nonlinear law in plane stress; accepted: a linear or "
                "anisotropic law",
                "plane-stress",
            )
        law, piezo = in_plane_stress(own.law, own.piezo)
        return Material(law, piezo, own.on or (), own.factor)

    def _law(self, turn: Array) -> Law:
        """Return the law of the stress, the crystal turned into the body."""
        if self.entry is not None:
            unit = self.system.unit("stress")
            if self.entry.isotropic is not None:
                young, poisson = self.entry.isotropic
                return Linear(young / unit, poisson)
            return Anisotropic(self.entry.stiffness / unit).rotated(turn)
        if self.kind == "anisotropic":
            return Anisotropic(self.voigt).rotated(turn)
        assert self.young is not None and self.poisson is not None  # required
        if self.kind == "linear":
            return Linear(self.young, self.poisson)
        if self.kind == "j2":
            return self._plastic()
        assert self.yield_strain is not None
        return Log(
            self.young,
            self.poisson,
            yield_strain=self.yield_strain,
            argument=self.argument,
            g_min=self.g_min,
        )

    def _plastic(self) -> Law:
        """Return the law of flow theory."""
        assert self.young is not None and self.poisson is not None  # required
        given, kinematic, limit = self.hardening, self.kinematic, self.yield_stress
        hardening: j2.Hardening
        if isinstance(given, tuple):
            hardening = j2.Tabulated(*map(tuple, zip(*given, strict=True)))
            limit = hardening.stress[0]
        elif isinstance(given, Saturation):
            hardening = j2.Voce(given.modulus, given.saturation, given.rate)
        else:
            hardening = j2.Voce(given)
        assert limit is not None  # checked
        return j2.J2(
            self.young,
            self.poisson,
            yield_stress=limit,
            hardening=hardening,
            kinematic=[(term.modulus, term.recovery) for term in kinematic]
            if isinstance(kinematic, tuple)
            else kinematic,
        )

    def check_revolved(self, key: str) -> None:
        """Refuse a crystal that is not transversely isotropic, for a body of revolution."""
        law, tensors = self.law, self.piezo
        parts = [] if tensors is None else [tensors.e, tensors.beta]
        if isinstance(law, Anisotropic):
            parts.append(stiffness_tensor(law.stiffness))
        if not isotropic_about_x3(*parts):
            raise InputError(
                f"{key}: the crystal is not the same all around its axis X3, and no body of "
                "revolution consists of it; accepted: materials of class 6mm, poled ceramics "
                "among them, or a mesh in 3-D",
                "material-constants",
            )


def make_material(dim: int, **keys: TableValue | Array) -> Material:
    """Return the material that `[material]` of a case file with some keys describes.

    Parameters
    ----------
    dim
        Dimension of the body, whose axes crystals are turned into: 2 or 3.
    keys
        Keys of the section `[material]` of a case file, with its units: ``name="PZT-4"`` with
        ``poling``, or ``young``, ``poisson`` and ``piezo={"e31": ..., ...}``; ``on``, a region or a
        list of regions. Matrices are lists of rows, or arrays.

    Returns
    -------
    The material, for `Body`.

    Raises
    ------
    InputError
        As for a case file: if a key is missing, unknown or has another value than is accepted; or
        if the axis of a crystal is none of the body's dimension.

    Examples
    --------
    >>> make_material(2, young=210e3, poisson=0.3).law
    Linear(young=210000.0, poisson=0.3)
    """
    try:
        return Material.model_validate(keys).in_body(dim)
    except ValidationError as error:
        raise describe(error, "make_material") from None
