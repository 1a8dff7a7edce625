"""Description of one body: material, supports and loads."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, replace
from dataclasses import field as default
from typing import Any, Protocol

import numpy as np
from dolfinx.fem import Function
from ufl.core.expr import Expr

from contact.arguments import CONSTANTS, expect, is_law, several
from contact.body.fields import (
    Amplitude,
    Given,
    Moving,
    Number,
    amplitude_of,
    field,
    knows_time,
    own_amplitude,
    vector,
)
from contact.body.rigid import Bolt, Electrode, Rigid
from contact.errors import InputError
from contact.mesh.together import part
from contact.typing import Array
from forms.elasticity import Anisotropic
from forms.hencky import Law, is_linear
from forms.history import HistoryLaw
from forms.piezo import Piezo
from forms.plane_stress import PlaneStressElastic, PlaneStressHistory, in_plane_stress

#: For scripts that are older than the meaning of the word.
CHANGED = (
    "Load(force=...) is the resultant, spread evenly over the part; the force per area, which it "
    "was in scripts from before the first release, is traction=..."
)


class Field(Protocol):
    """A given function of position, for instance `contact.case.formula.Expression`."""

    def ufl(self, x: Expr) -> Expr:
        """Return the function as a UFL expression of the coordinates."""

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""


@dataclass(frozen=True)
class Fixed:
    """Prescribed values on a part of the boundary.

    Parameters
    ----------
    on
        Name of the part, or a list of names.
    displacement
        A list with one value per component, each as `fields.field` takes it: a number, a function
        of x, UFL, a dolfinx Function; None or "free" leaves a component free. Or one UFL
        expression or Function of vectors.
    potential
        Of a piezoelectric body, likewise; None leaves it free.
    normal
        Instead of a displacement: that along the outward normal of the part, as on rollers; a
        number or a function likewise. The part is free to move along itself.
    amplitude
        Function of time by which the values are multiplied; "constant": they always act. By
        default they grow linearly from time 0 to time 1, and then stay; values that are functions
        of time are not multiplied.

    Raises
    ------
    InputError
        If a value is nothing of these.
    """

    on: Given
    displacement: Given = None
    potential: Given = None
    amplitude: Amplitude | None = None
    normal: Given = default(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Make fields of the given values."""
        object.__setattr__(self, "on", part(self.on))
        object.__setattr__(self, "displacement", vector(self.displacement, free=True))
        object.__setattr__(self, "normal", field(self.normal))
        object.__setattr__(self, "potential", field(self.potential))
        amplitude = own_amplitude(f"Fixed on {self.on!r}", self.amplitude)
        object.__setattr__(self, "amplitude", amplitude)
        if all(value is None for value in self.given.values()):
            raise InputError(
                f"Fixed on {self.on!r}: nothing is prescribed; accepted: a displacement with a "
                "component that is not free, normal, or a potential"
            )
        if self.normal is not None and self.displacement is not None:
            raise InputError(
                f"Fixed on {self.on!r}: normal and displacement; accepted: one of them, and two "
                "supports for both"
            )

    @property
    def given(self) -> dict[str, Given]:
        """All that may be prescribed, by key; None where free."""
        found = {f"displacement.{k}": value for k, value in enumerate(self.displacement or ())}
        return found | {"normal": self.normal, "potential": self.potential}

    @property
    def factor(self) -> Amplitude:
        """The amplitude, also where none is given."""
        return amplitude_of(self.amplitude, knows_time([*self.given.values()]))


@dataclass(frozen=True)
class Load:
    """Given forces and charges: on a part, or in the whole body where `on` is None.

    Each value is a number, a function of x, UFL or a dolfinx Function, as `fields.field` takes
    it.

    Parameters
    ----------
    on
        Name of the part, or a list of names; None for the whole body.
    density
        Traction (force/area) on a part, body force (force/volume) in the body.
    pressure
        Pressure against the outward normal of the part (force/area).
    charge
        Surface charge q_2 = D.nu on a part, body charge q_0 in the body.
    amplitude
        Function of time that multiplies all of them, as of `Fixed`.
    traction, body_force, body_charge
        The same as density and charge, by their names in the case file.
    force
        Resultant on a part, spread evenly over it: numbers; that of the full turn for a body of
        revolution, of a unit of depth for a plane one.

    Raises
    ------
    InputError
        If nothing is given, or a load that does not act there.
    """

    on: Given = None
    density: Given = None
    pressure: Given = None
    charge: Given = None
    amplitude: Amplitude | None = None
    traction: InitVar[Given] = None
    body_force: InitVar[Given] = None
    body_charge: InitVar[Given] = None
    force: Given = default(default=None, kw_only=True)

    def __post_init__(self, traction: Given, body_force: Given, body_charge: Given) -> None:
        """Make fields of the given values."""
        object.__setattr__(self, "on", None if self.on is None else part(self.on))
        inside = self.on is None
        density = self._one(density=self.density, traction=traction, body_force=body_force)
        charge = self._one(charge=self.charge, body_charge=body_charge)
        for name, given, fits in (
            ("traction", traction, not inside),
            ("pressure", self.pressure, not inside),
            ("force", self.force, not inside),
            ("body_force", body_force, inside),
            ("body_charge", body_charge, inside),
        ):
            accepted = "it in the whole body, on=None" if not inside else "it on a part"
            expect(f"Load: {name}", given, accepted, given is None or fits)
        object.__setattr__(self, "density", vector(density))
        object.__setattr__(self, "force", self._resultant())
        object.__setattr__(self, "pressure", field(self.pressure))
        object.__setattr__(self, "charge", field(charge))
        object.__setattr__(
            self, "amplitude", own_amplitude(f"Load on {self.on or 'the body'!r}", self.amplitude)
        )
        if not self.named:
            raise InputError(
                "Load: nothing is given; accepted: force, traction, pressure or charge"
            )

    def _resultant(self) -> tuple[Any, ...] | None:
        """Return the components of the resultant, which have no place."""
        found = vector(self.force)
        for component in found or ():
            accepted = "numbers, the resultant of the part; traction=... is per area, and may vary"
            expect("Load: force", self.force, accepted, isinstance(component, Number | Moving))
        if found is not None:
            warnings.warn(CHANGED, FutureWarning, stacklevel=4)
        return found

    @staticmethod
    def _one(**given: Given) -> Given:
        """Return which of several names for the same is given."""
        names = [name for name, value in given.items() if value is not None]
        expect("Load", names, f"one of {', '.join(given)}", len(names) < 2)
        return given[names[0]] if names else None

    @property
    def named(self) -> dict[str, Field | Moving]:
        """All that is given, by the keys that the case file has for it."""
        inside = self.on is None
        density, charge = ("body_force", "body_charge") if inside else ("traction", "charge")
        given = {f"{density}.{i}": component for i, component in enumerate(self.density or ())}
        given |= {f"force.{i}": component for i, component in enumerate(self.force or ())}
        given |= {"pressure": self.pressure, charge: self.charge}
        return {name: field for name, field in given.items() if field is not None}

    @property
    def factor(self) -> Amplitude:
        """The amplitude, also where none is given."""
        return amplitude_of(self.amplitude, knows_time([*self.named.values()]))


@dataclass(frozen=True)
class Elastic:
    """An elastic support: a traction -k u on a part, k by component, along the normal, or both.

    Parameters
    ----------
    on
        Name of the part, or a list of names.
    stiffness
        One value per component (force/area/length), each as `fields.field` takes it; 0 for none.
    normal
        Stiffness along the normal of the part, likewise: u has no resistance in its plane.

    Raises
    ------
    InputError
        If nothing is given, or something else.
    """

    on: Given
    stiffness: Given = None
    normal: Given = None

    def __post_init__(self) -> None:
        """Make fields of the given values."""
        object.__setattr__(self, "on", part(self.on))
        object.__setattr__(self, "stiffness", vector(self.stiffness))
        object.__setattr__(self, "normal", field(self.normal))
        if self.stiffness is None and self.normal is None:
            raise InputError(
                f"Elastic on {self.on!r}: nothing is given; accepted: stiffness or normal"
            )


@dataclass(frozen=True)
class Material:
    """A material and where it is.

    Attributes
    ----------
    law
        Law of the stress.
    piezo
        Piezoelectric tensors in the body's axes, or None.
    on
        Name of the region that consists of it, or several; none for the whole mesh.
    factor
        A function of position > 0 that its stresses are multiplied by, as `fields.field` takes it
        (no unit): Young's modulus as a field, of which the law has a mean. A Function is copied.
        None for 1.
    """

    law: Law
    piezo: Piezo | None = None
    on: Given = ()
    factor: Given = None

    def __post_init__(self) -> None:
        """Refuse anything but materials."""
        factor = self.factor.copy() if isinstance(self.factor, Function) else self.factor
        object.__setattr__(self, "factor", field(factor))
        names = several("on", self.on, str, "the name of a region, or a list of names")
        object.__setattr__(self, "on", names)
        accepted = (
            "Linear(young, poisson), Log, UserLaw, forms.elasticity.Anisotropic(stiffness), of a "
            "crystal in 2-D with .in_plane(), or an object with the numbers "
            f"{', '.join(CONSTANTS)} and a stress as forms.hencky.Hencky or "
            "forms.history.HistoryLaw have it"
        )
        expect("law", self.law, accepted, is_law(self.law))
        fits = isinstance(self.piezo, Piezo | None)
        expect("piezo", self.piezo, "Piezo(...), or None", fits)
        fits = self.factor is None or not (self.piezo or isinstance(self.law, HistoryLaw))
        accepted = "a material without coupling and internal variables"
        expect("factor", self.factor, accepted, fits and not isinstance(self.factor, Moving))

    @property
    def in_plane_stress(self) -> bool:
        """Whether no stress acts across a plane body of it."""
        return isinstance(self.law, PlaneStressElastic | PlaneStressHistory)

    def plane_stress(self) -> Material:
        """Return the material of a plane body without stress across it, of unit thickness.

        Crystals are in the axes of the body.

        Raises
        ------
        InputError
            If a nonlinear law is piezoelectric: the strain across would have to follow the field.
        """
        fits = self.piezo is None or self.in_plane_stress or is_linear(self.law)
        expect("piezo", self.piezo, "None in plane stress, unless the law is linear", fits)
        law, piezo = in_plane_stress(self.law, self.piezo)
        return replace(self, law=law, piezo=piezo)


def _leading(materials: Sequence[Material]) -> tuple[Law, Piezo | None]:
    """Return the softest law, and the first of the piezoelectric tensors, of which scales are."""
    softest = min((material.law for material in materials), key=lambda law: law.young)
    return softest, next((m.piezo for m in materials if m.piezo is not None), None)


@dataclass(frozen=True)
class Body:
    """A body, or several: materials, supports and loads.

    Attributes
    ----------
    law
        Law of the stress, a `Material`, or several of them with their regions; the attribute is
        then the law of the softest one, which determines the scales of the problem.
    fixed, loads
        Supports and loads, one or several.
    piezo
        Piezoelectric tensors in the body's axes, or None; of several materials those of the first
        that has some, whose permittivity determines the unit of the potential.
    regions
        The materials that were given as `law`; else none.
    rigid, electrodes
        Rigid parts, foundations included, and parts of one unknown potential.
    elastic
        Elastic supports.
    bolts
        Cuts whose sides are drawn together.
    """

    law: Given
    fixed: Sequence[Fixed]
    loads: Sequence[Load] = default(default_factory=tuple)
    piezo: Piezo | None = None
    regions: tuple[Material, ...] = ()
    rigid: tuple[Rigid, ...] = ()
    electrodes: tuple[Electrode, ...] = ()
    elastic: Sequence[Elastic] = default(default_factory=tuple)
    bolts: tuple[Bolt, ...] = ()

    def __post_init__(self) -> None:
        """Refuse other arguments; accept one support or one load without a list."""
        if isinstance(self.law, Material | list | tuple):
            accepted = "a law, Material(...), or a list of materials"
            given = several("law", self.law, Material, accepted)
            expect("law", self.law, accepted, given and self.piezo is None and not self.regions)
            law, piezo = _leading(given)
            for name, value in (("law", law), ("piezo", piezo), ("regions", given)):
                object.__setattr__(self, name, value)
        Material(self.law, self.piezo)
        for name, kind in (
            ("fixed", Fixed),
            ("loads", Load),
            ("regions", Material),
            ("rigid", Rigid),
            ("electrodes", Electrode),
            ("elastic", Elastic),
            ("bolts", Bolt),
        ):
            words = f"{kind.__name__}(...), or a list of them"
            object.__setattr__(self, name, several(name, getattr(self, name), kind, words))
        if self.regions:  # as `dataclasses.replace` hands them on
            law, piezo = _leading(self.regions)
            accepted = "all materials as the law, Body([Material(...), Material(...)], ...)"
            fits = self.law is law and self.piezo is piezo
            expect("regions beside a law", self.regions, accepted, fits)
        history = any(isinstance(m.law, HistoryLaw) for m in self.materials)
        if self.bolts and history:
            raise InputError(
                f"bolt on {self.bolts[0].on!r}: a material of the body has internal variables, as "
                "flow theory has; accepted: materials without internal variables where a bolt is"
            )
        fits = not self.electrodes or self.piezo is not None
        expect("electrodes", self.electrodes, "electrodes of a piezoelectric material", fits)

    @property
    def materials(self) -> tuple[Material, ...]:
        """The materials, each with its regions."""
        return self.regions or (Material(self.law, self.piezo),)

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
        """Refuse constants that are none of a material, or none of a plane body.

        Raises
        ------
        InputError
            If they are not.
        """
        for material in self.materials:
            young, poisson = float(material.law.young), float(material.law.poisson)
            if not ((young > 0 and -1 < poisson < 0.5) or isinstance(material.law, Anisotropic)):
                raise InputError(
                    f"material: given Young's modulus {young:g} and Poisson's ratio {poisson:g}; "
                    "accepted: a modulus > 0, a ratio between -1 and 0.5, both excluded"
                )
            for name, tensors in (("", material.law), ("piezoelectric ", material.piezo)):
                if not isinstance(tensors, Anisotropic | Piezo):
                    continue
                try:
                    tensors.check()
                    if dim == 2:
                        tensors.check_plane()
                except ValueError as error:
                    raise InputError(f"{name}material: {error}") from error
