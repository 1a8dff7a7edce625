"""A body: its materials, supports, loads, rigid parts, electrodes and bolts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from contact.arguments import OfTime, expect, fill, one_of, several
from contact.errors import InputError
from contact.model.fields import (
    Factor,
    Field,
    FreeVector,
    GivenAmplitude,
    GivenTimed,
    Moving,
    Scalar,
    Static,
    Vector,
    amplitude_of,
    knows_time,
)
from contact.model.formula import ZERO, Expression
from contact.model.material import Material
from contact.model.rigid import Rigid
from contact.model.section import (
    Described,
    FactorOfTime,
    Few,
    Free,
    NonNegativeValue,
    Part,
    Placeless,
    Timed,
    Value,
    Values,
)
from contact.settings import Accepted, Switch, Words, fault
from forms.elasticity import Anisotropic
from forms.hencky import Law, is_linear
from forms.history import HistoryLaw
from forms.piezo import Piezo


class Fixed(Described):
    """`[[fixed]]`: prescribed displacement or potential on a part.

    Examples
    --------
    >>> Fixed("left", [0.0, "free"]).on
    'left'
    """

    on: Part
    """Part of the boundary, or a list of parts."""
    displacement: (
        Annotated[
            Few[Free[Value]],
            Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula or "free"'),
        ]
        | None
    ) = None
    """Displacement of the part; "free" for a component that is not fixed."""
    symmetry: Literal["x", "y", "z"] | None = None
    """Instead of a displacement: the part lies in a plane of symmetry across this axis; its
    displacement along the axis is 0."""
    normal: Value | None = None
    """Instead of a displacement: that along the outward normal of the part; 0 for rollers. The part
    may be inclined or curved, and is free to move along itself."""
    potential: Value | None = None
    """Electric potential of the part."""
    amplitude: FactorOfTime | None = None
    """Factor of all that is prescribed as a function of time, see `[evolution]`."""

    def __init__(
        self,
        on: str | Sequence[str],
        displacement: FreeVector | None = None,
        potential: Scalar | None = None,
        amplitude: GivenAmplitude | None = None,
        *,
        normal: Scalar | None = None,
        symmetry: Literal["x", "y", "z"] | None = None,
    ) -> None:
        super().__init__(
            on=on,
            displacement=displacement,
            symmetry=symmetry,
            normal=normal,
            potential=potential,
            amplitude=amplitude,
        )

    @model_validator(mode="after")
    def _check(self) -> Self:
        keys = ("symmetry", "normal", "displacement")
        one = [key for key in keys if getattr(self, key) is not None]
        if len(one) > 1:
            accepted = f"one of {' and '.join(one)}, and for more another entry"
            self.require(False, one[0], accepted, "one-condition")
        accepted = "a component that is fixed, normal, symmetry or a potential"
        self.require(self.given, "displacement", accepted, "supports")
        return self

    @property
    def components(self) -> dict[int, Field | Moving]:
        """The components of the displacement that are prescribed."""
        if self.symmetry is not None:
            return {"xyz".index(self.symmetry): ZERO}
        given = enumerate(self.displacement or ())
        return {k: value for k, value in given if not isinstance(value, str)}

    @property
    def given(self) -> dict[str, Field | Moving]:
        """All that is prescribed, by key."""
        found: dict[str, Field | Moving | None] = {
            f"displacement.{k}": value for k, value in self.components.items()
        }
        found |= {"normal": self.normal, "potential": self.potential}
        return {key: value for key, value in found.items() if value is not None}

    @property
    def factor(self) -> Factor:
        """The amplitude, also where none is given."""
        return amplitude_of(self.amplitude, knows_time([*self.given.values()]))


class Elastic(Described):
    """`[[elastic]]`: an elastic support, a traction against the displacement of a part."""

    on: Part
    """Part of the boundary, or a list of parts, beside the contact part."""
    stiffness: (
        Annotated[
            Few[NonNegativeValue],
            Accepted("a list of 2 numbers >= 0 or formulas in 2-D, 3 in 3-D"),
        ]
        | None
    ) = None
    """Force per area and displacement along each axis: traction -k u."""
    normal: NonNegativeValue | None = None
    """The same along the normal of the part alone, which is free to move along itself."""

    def __init__(
        self,
        on: str | Sequence[str],
        stiffness: Vector | None = None,
        normal: Static | None = None,
    ) -> None:
        super().__init__(on=on, stiffness=stiffness, normal=normal)

    @model_validator(mode="after")
    def _check(self) -> Self:
        fits = self.stiffness is not None or self.normal is not None
        self.require(fits, "stiffness", "stiffness, normal, or both", "elastic")
        return self


#: Keys of a load on a part, and of one in the whole body.
SURFACE, VOLUME = ("traction", "force", "pressure", "charge"), ("body_force", "body_charge")


class Load(Described):
    """`[[load]]`: forces and charges on a part, or in the whole body."""

    hints = dict.fromkeys(
        ("resultant", "forces"),
        "force is the resultant on the part, traction is per area, body_force per volume",
    )

    on: Part | None = None
    """Part of the boundary, or a list of parts, beside the contact part. This or `everywhere`."""
    everywhere: Switch = False
    """`true`: in the whole body."""
    traction: Values | None = None
    """Force per area of the part."""
    force: (
        Annotated[
            Few[Placeless],
            Accepted("a list of 2 numbers or formulas in t in 2-D, 3 in 3-D"),
        ]
        | None
    ) = None
    """Resultant force on the part, spread evenly over it; in 2-D of a unit of depth, of a body of
    revolution that of the full turn. A part that is to move as a rigid body is `[[rigid]]`."""
    pressure: Value | None = None
    """Normal pressure p on the part: traction -p along the outward normal."""
    charge: Value | None = None
    """D·ν on the part, ν out of the body (charge per area): minus the free surface charge."""
    body_force: Values | None = None
    """Force per volume."""
    body_charge: Value | None = None
    """Free charge per volume, div D."""
    amplitude: FactorOfTime | None = None
    """Factor of all of these as a function of time, see `[evolution]`."""

    def __init__(
        self,
        on: str | Sequence[str] | None = None,
        density: Vector | None = None,
        pressure: Scalar | None = None,
        charge: Scalar | None = None,
        amplitude: GivenAmplitude | None = None,
        traction: Vector | None = None,
        body_force: Vector | None = None,
        body_charge: Scalar | None = None,
        *,
        force: Vector | None = None,
    ) -> None:
        if on is None:
            body_force = one_of("Load", density=density, body_force=body_force)
            charge, body_charge = None, one_of("Load", charge=charge, body_charge=body_charge)
        else:
            traction = one_of("Load", density=density, traction=traction)
        super().__init__(
            on=on,
            everywhere=on is None,
            traction=traction,
            force=force,
            pressure=pressure,
            charge=charge,
            body_force=body_force,
            body_charge=body_charge,
            amplitude=amplitude,
        )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.on is None) == (not self.everywhere):
            given = "neither" if self.on is None else "both"
            raise fault("on", Words(given), "one of on and everywhere = true", "exclusive-keys")
        right, wrong = (VOLUME, SURFACE) if self.everywhere else (SURFACE, VOLUME)
        place = "in the whole body" if self.everywhere else "on a part"
        for key in wrong:
            if getattr(self, key) is not None:
                accepted = f"{place}: {', '.join(right)}"
                raise fault(key, Words(f"given {place}"), accepted, "exclusive-keys")
        self.require(self.given, right[0], f"at least one of {', '.join(right)}", "load-values")
        return self

    @property
    def density(self) -> tuple[Field | Moving, ...] | None:
        """The force per area of a part, or per volume."""
        return self.traction if self.body_force is None else self.body_force

    @property
    def given(self) -> dict[str, Field | Moving]:
        """All that is given, by the keys that the case file has for it."""
        given: dict[str, Field | Moving | None] = {}
        for key in ("body_force", "traction", "force"):
            given |= {f"{key}.{i}": value for i, value in enumerate(getattr(self, key) or ())}
        for key in ("pressure", "charge", "body_charge"):
            given[key] = getattr(self, key)
        return {name: field for name, field in given.items() if field is not None}

    @property
    def factor(self) -> Factor:
        """The amplitude, also where none is given."""
        return amplitude_of(self.amplitude, knows_time([*self.given.values()]))


class Electrode(Described):
    """`[[electrode]]`: a part with one unknown potential, whose charge is given.

    Examples
    --------
    >>> Electrode(["left", "right"], charge=1e-6).on
    'left+right'
    """

    values: ClassVar[tuple[None]] = (None,)

    on: Part
    """Part of the boundary, or a list of parts."""
    charge: Timed = ZERO
    """Its charge; 0: open circuit. In 2-D of a unit of depth, of a body of revolution that of the
    full turn."""
    amplitude: FactorOfTime | None = None
    """Factor of the charge as a function of time, see `[evolution]`."""

    def __init__(
        self,
        on: str | Sequence[str],
        charge: GivenTimed = 0.0,
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        super().__init__(on=on, charge=charge, amplitude=amplitude)

    @property
    def forces(self) -> tuple[Expression | OfTime | None, ...]:
        """The charge."""
        return (self.charge,)


class Bolt(Described):
    """`[[bolt]]`: a cut through a body whose sides are drawn together: a bolt that is tightened."""

    on: Part
    """A part inside of the body, all facets of a plane section: a group of a mesh file, or one of
    `[mesh.inside]`."""
    force: Timed | None = None
    """Section force, tension > 0; in 2-D of a unit of depth, of a body of revolution that of the
    full turn. This or `shortening`."""
    shortening: Timed | None = None
    """Length by which the sides are drawn together; a tightened bolt keeps it under later loads."""
    amplitude: FactorOfTime | None = None
    """Factor of it as a function of time, see `[evolution]`."""

    def __init__(
        self,
        on: str | Sequence[str],
        force: GivenTimed | None = None,
        shortening: GivenTimed | None = None,
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        super().__init__(on=on, force=force, shortening=shortening, amplitude=amplitude)

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.require_either(("force",), ("shortening",), "bolt")
        return self

    @property
    def values(self) -> tuple[Expression | OfTime | None, ...]:
        """The shortening."""
        return (self.shortening,)

    @property
    def forces(self) -> tuple[Expression | OfTime | None, ...]:
        """The section force."""
        return (self.force,)


@dataclass(frozen=True)
class Body:
    """A body, or several: materials, supports and loads.

    Parameters
    ----------
    materials
        A law of the stress, a `Material`, or several of them with their regions; also by the name
        `law`.
    fixed, loads
        Supports and loads, one or several; the attributes are tuples, as those below.
    piezo
        Piezoelectric tensors in the body's axes, beside a law.
    rigid, electrodes
        Rigid parts, and parts of one unknown potential.
    elastic
        Elastic supports.
    bolts
        Cuts whose sides are drawn together.

    Raises
    ------
    InputError
        If something else is given, a law beside several materials, a bolt in a body with internal
        variables, or an electrode on one without coupling.
    """

    materials: tuple[Material, ...]
    fixed: tuple[Fixed, ...]
    loads: tuple[Load, ...]
    rigid: tuple[Rigid, ...]
    electrodes: tuple[Electrode, ...]
    elastic: tuple[Elastic, ...]
    bolts: tuple[Bolt, ...]

    def __init__(
        self,
        materials: Law | Material | Sequence[Material] | None = None,
        fixed: Fixed | Sequence[Fixed] = (),
        loads: Load | Sequence[Load] = (),
        piezo: Piezo | None = None,
        rigid: Rigid | Sequence[Rigid] = (),
        electrodes: Electrode | Sequence[Electrode] = (),
        elastic: Elastic | Sequence[Elastic] = (),
        bolts: Bolt | Sequence[Bolt] = (),
        *,
        law: Law | Material | Sequence[Material] | None = None,
    ) -> None:
        given: Any = one_of("Body", materials=materials, law=law)
        if not isinstance(given, Material | Sequence):
            given, piezo = Material(given, piezo), None
        accepted = "a law, Material(law), or a list of Material(law, on=region)"
        every = several("law", given, Material, accepted)
        expect("law", given, accepted, every and piezo is None)
        fill(self, materials=every)
        for name, parts, kind in (
            ("fixed", fixed, Fixed),
            ("loads", loads, Load),
            ("rigid", rigid, Rigid),
            ("electrodes", electrodes, Electrode),
            ("elastic", elastic, Elastic),
            ("bolts", bolts, Bolt),
        ):
            words = f"{kind.__name__}(...), or a list of them"
            fill(self, **{name: several(name, parts, kind, words)})
        if self.bolts and any(isinstance(one.law, HistoryLaw) for one in self.materials):
            raise InputError(
                f"bolt on {self.bolts[0].on!r}: a material of the body has internal variables, as "
                "flow theory has; accepted: materials without internal variables where a bolt is",
                "bolt",
            )
        fits = not self.electrodes or self.piezo is not None
        expect("electrodes", self.electrodes, "electrodes of a piezoelectric material", fits)

    @property
    def law(self) -> Law:
        """The law of the softest material, which determines the scales of the problem."""
        return min((material.law for material in self.materials), key=lambda law: law.young)

    @property
    def piezo(self) -> Piezo | None:
        """The first of the piezoelectric tensors, which determines the unit of the potential."""
        tensors = (material.piezo for material in self.materials)
        return next((given for given in tensors if given is not None), None)

    def in_space(self, dim: int) -> Body:
        """Return the body with its materials in its axes, in 2-D or 3-D."""
        return replace(self, materials=tuple(one.in_body(dim) for one in self.materials))

    @property
    def linear(self) -> bool:
        """Whether the stress is a linear function of the strain."""
        return all(is_linear(material.law) for material in self.materials)

    @property
    def symmetric(self) -> bool:
        """Whether its tangent is a symmetric matrix."""
        return all(getattr(material.law, "symmetric", True) for material in self.materials)

    @property
    def phi_scale(self) -> float:
        """Unit of the potential in the unknowns, sqrt(mu1/beta): both blocks are then alike."""
        if self.piezo is None:
            return 1.0
        permittivity = float(np.trace(np.asarray(self.piezo.beta))) / 3
        return float(np.sqrt(self.law.shear / permittivity))

    def check(self, dim: int) -> None:
        """Refuse constants that are none of a material, or none of a plane body."""
        for material in self.materials:
            young, poisson = float(material.law.young), float(material.law.poisson)
            if not ((young > 0 and -1 < poisson < 0.5) or isinstance(material.law, Anisotropic)):
                raise InputError(
                    f"material: given Young's modulus {young:g} and Poisson's ratio {poisson:g}; "
                    "accepted: a modulus > 0, a ratio between -1 and 0.5, both excluded",
                    "material-constants",
                )
            for name, tensors in (("", material.law), ("piezoelectric ", material.piezo)):
                if not isinstance(tensors, Anisotropic | Piezo):
                    continue
                try:
                    tensors.check()
                    if dim == 2:
                        tensors.check_plane()
                except ValueError as error:
                    raise InputError(f"{name}material: {error}", "material-constants") from error
