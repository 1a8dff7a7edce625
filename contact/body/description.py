"""Description of one body: material, supports and loads."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from dolfinx.fem import Function

from contact.arguments import CONSTANTS, expect, fill, is_law, one_of, several
from contact.body.fields import (
    Amplitude,
    Field,
    FreeVector,
    GivenAmplitude,
    Moving,
    Number,
    Scalar,
    Static,
    Vector,
    amplitude_of,
    field,
    knows_time,
    own_amplitude,
    static,
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


@dataclass(frozen=True)
class Fixed:
    """Prescribed values on a part of the boundary.

    Parameters
    ----------
    on
        Name of the part, or a list of names.
    displacement
        A list with one value per component (length), each as `fields.field` takes it: a number, a
        function of x, UFL (`ufl.core.expr.Expr`), a `dolfinx.fem.Function`; None or "free" leaves a
        component free. Or one UFL expression or Function of vectors.
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
        If a value is nothing of these, nothing is prescribed, or both a displacement and a normal
        one are.

    Examples
    --------
    >>> Fixed("left", [0.0, "free"]).on
    'left'
    """

    on: str
    displacement: tuple[Field | Moving | None, ...] | None
    potential: Field | Moving | None
    amplitude: Amplitude | None
    normal: Field | Moving | None

    def __init__(
        self,
        on: str | Sequence[str],
        displacement: FreeVector | None = None,
        potential: Scalar | None = None,
        amplitude: GivenAmplitude | None = None,
        *,
        normal: Scalar | None = None,
    ) -> None:
        fill(
            self,
            on=part(on),
            displacement=vector(displacement, free=True),
            normal=field(normal),
            potential=field(potential),
        )
        fill(self, amplitude=own_amplitude(f"Fixed on {self.on!r}", amplitude))
        if all(value is None for value in self.given.values()):
            raise InputError(
                f"Fixed on {self.on!r}: nothing is prescribed; accepted: a displacement with a "
                "component that is not free, normal, or a potential",
                "supports",
            )
        if self.normal is not None and self.displacement is not None:
            raise InputError(
                f"Fixed on {self.on!r}: normal and displacement; accepted: one of them, and two "
                "supports for both",
                "one-condition",
            )

    @property
    def given(self) -> dict[str, Field | Moving | None]:
        """All that may be prescribed, by key; None where free."""
        found = {f"displacement.{k}": value for k, value in enumerate(self.displacement or ())}
        return found | {"normal": self.normal, "potential": self.potential}

    @property
    def factor(self) -> Amplitude:
        """The amplitude, also where none is given."""
        return amplitude_of(self.amplitude, knows_time([*self.given.values()]))


def _resultant(
    force: Sequence[float | Moving] | Array | None,
) -> tuple[Number | Moving, ...] | None:
    """Return the components of the resultant of a load, which have no place."""
    found = vector(force)
    for component in found or ():
        accepted = "numbers, the resultant of the part; traction=... is per area, and may vary"
        expect("Load: force", force, accepted, isinstance(component, Number | Moving))
    if found is not None:
        warnings.warn(CHANGED, FutureWarning, stacklevel=3)
    return cast(tuple[Number | Moving, ...] | None, found)


@dataclass(frozen=True)
class Load:
    """Given forces and charges: on a part, or in the whole body where `on` is None.

    Each value is a number, a function of x, UFL (`ufl.core.expr.Expr`) or a `dolfinx.fem.Function`,
    as `fields.field` takes it.

    Parameters
    ----------
    on
        Name of the part, or a list of names; None for the whole body.
    density
        Traction (force/area) on a part, body force (force/volume) in the body.
    pressure
        Pressure against the outward normal of the part (force/area).
    charge
        Surface charge q_2 = D.nu on a part (charge/area), body charge q_0 in the body
        (charge/volume).
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

    on: str | None
    density: tuple[Field | Moving, ...] | None
    pressure: Field | Moving | None
    charge: Field | Moving | None
    amplitude: Amplitude | None
    force: tuple[Number | Moving, ...] | None

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
        force: Sequence[float | Moving] | Array | None = None,
    ) -> None:
        fill(self, on=None if on is None else part(on))
        inside = self.on is None
        density = one_of("Load", density=density, traction=traction, body_force=body_force)
        charge = one_of("Load", charge=charge, body_charge=body_charge)
        for name, given, fits in (
            ("traction", traction, not inside),
            ("pressure", pressure, not inside),
            ("force", force, not inside),
            ("body_force", body_force, inside),
            ("body_charge", body_charge, inside),
        ):
            accepted = "it in the whole body, on=None" if not inside else "it on a part"
            expect(f"Load: {name}", given, accepted, given is None or fits)
        fill(
            self,
            density=vector(density),
            force=_resultant(force),
            pressure=field(pressure),
            charge=field(charge),
            amplitude=own_amplitude(f"Load on {self.on or 'the body'!r}", amplitude),
        )
        if not self.named:
            words = "Load: nothing is given; accepted: force, traction, pressure or charge"
            raise InputError(words, "load-values")

    @property
    def named(self) -> dict[str, Field | Moving]:
        """All that is given, by the keys that the case file has for it."""
        inside = self.on is None
        density, charge = ("body_force", "body_charge") if inside else ("traction", "charge")
        given: dict[str, Field | Moving | None] = {}
        given |= {f"{density}.{i}": component for i, component in enumerate(self.density or ())}
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

    on: str
    stiffness: tuple[Field, ...] | None
    normal: Field | None

    def __init__(
        self,
        on: str | Sequence[str],
        stiffness: Vector | None = None,
        normal: Static | None = None,
    ) -> None:
        name, given = f"Elastic on {part(on)!r}", vector(stiffness)
        components = tuple(
            static(cast(Static, one), f"{name}: stiffness.{i}") for i, one in enumerate(given or ())
        )
        along = None if normal is None else static(normal, f"{name}: normal")
        fill(self, on=part(on), stiffness=given and components, normal=along)
        if self.stiffness is None and self.normal is None:
            words = f"Elastic on {self.on!r}: nothing is given; accepted: stiffness or normal"
            raise InputError(words, "elastic")


@dataclass(frozen=True)
class Material:
    """A material and where it is.

    Parameters
    ----------
    law
        Law of the stress: `Linear`, `Log`, `UserLaw`, `J2`, or an object like these.
    piezo
        Piezoelectric tensors in the body's axes, or None.
    on
        Name of the region that consists of it, or several; none for the whole mesh.
    factor
        A function of position > 0 that its stresses are multiplied by, as `fields.field` takes it
        (no unit): Young's modulus as a field, of which the law has a mean. A Function is copied.
        None for 1.

    Raises
    ------
    InputError
        If an argument is nothing of these, or a factor is given with coupling, internal variables
        or a time.
    """

    law: Law
    piezo: Piezo | None
    on: tuple[str, ...]
    factor: Field | None

    def __init__(
        self,
        law: Law,
        piezo: Piezo | None = None,
        on: str | Sequence[str] = (),
        factor: Static | None = None,
    ) -> None:
        fill(self, law=law, piezo=piezo)
        factor = factor.copy() if isinstance(factor, Function) else factor
        names = several("on", on, str, "the name of a region, or a list of names")
        fill(self, factor=None if factor is None else static(factor, "factor"), on=names)
        accepted = (
            "Linear(young, poisson) of numbers, Log, UserLaw, "
            "forms.elasticity.Anisotropic(stiffness), of a crystal in 2-D with .in_plane(), or an "
            "object with the numbers "
            f"{', '.join(CONSTANTS)} and a stress as forms.hencky.Hencky or "
            "forms.history.HistoryLaw have it"
        )
        expect("law", self.law, accepted, is_law(self.law))
        fits = isinstance(self.piezo, Piezo | None)
        expect("piezo", self.piezo, "Piezo(...), or None", fits)
        fits = self.factor is None or not (self.piezo or isinstance(self.law, HistoryLaw))
        accepted = "a material without coupling and internal variables"
        expect("factor", self.factor, accepted, fits)

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
        accepted = "None in plane stress, unless the law is linear"
        expect("piezo", self.piezo, accepted, fits, "plane-stress")
        law, piezo = in_plane_stress(self.law, self.piezo)
        return replace(self, law=law, piezo=piezo)


def _leading(materials: Sequence[Material]) -> tuple[Law, Piezo | None]:
    """Return the softest law, and the first of the piezoelectric tensors, of which scales are."""
    softest = min((material.law for material in materials), key=lambda law: law.young)
    return softest, next((m.piezo for m in materials if m.piezo is not None), None)


@dataclass(frozen=True)
class Body:
    """A body, or several: materials, supports and loads.

    Parameters
    ----------
    law
        Law of the stress, a `Material`, or several of them with their regions; the attribute is
        then the law of the softest one, which determines the scales of the problem.
    fixed, loads
        Supports and loads, one or several; the attributes are tuples, as those below.
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

    Raises
    ------
    InputError
        If something else is given, a law beside several materials, a bolt in a body with internal
        variables, or an electrode on one without coupling.
    """

    law: Law
    fixed: tuple[Fixed, ...]
    loads: tuple[Load, ...]
    piezo: Piezo | None
    regions: tuple[Material, ...]
    rigid: tuple[Rigid, ...]
    electrodes: tuple[Electrode, ...]
    elastic: tuple[Elastic, ...]
    bolts: tuple[Bolt, ...]

    def __init__(
        self,
        law: Law | Material | Sequence[Material],
        fixed: Fixed | Sequence[Fixed],
        loads: Load | Sequence[Load] = (),
        piezo: Piezo | None = None,
        regions: Material | Sequence[Material] = (),
        rigid: Rigid | Sequence[Rigid] = (),
        electrodes: Electrode | Sequence[Electrode] = (),
        elastic: Elastic | Sequence[Elastic] = (),
        bolts: Bolt | Sequence[Bolt] = (),
    ) -> None:
        if isinstance(law, Material | list | tuple):
            accepted = "a law, Material(law), or a list of Material(law, on=region)"
            given = several("law", law, Material, accepted)
            expect("law", law, accepted, given and piezo is None and not regions)
            (law, piezo), regions = _leading(given), given
        fill(self, law=law, piezo=piezo)
        Material(self.law, self.piezo)
        for name, every, kind in (
            ("fixed", fixed, Fixed),
            ("loads", loads, Load),
            ("regions", regions, Material),
            ("rigid", rigid, Rigid),
            ("electrodes", electrodes, Electrode),
            ("elastic", elastic, Elastic),
            ("bolts", bolts, Bolt),
        ):
            words = f"{kind.__name__}(...), or a list of them"
            fill(self, **{name: several(name, every, kind, words)})
        if self.regions:  # as `dataclasses.replace` hands them on
            first, tensors = _leading(self.regions)
            accepted = "all materials as the law, Body([Material(...), Material(...)], ...)"
            fits = self.law is first and self.piezo is tensors
            expect("regions beside a law", self.regions, accepted, fits)
        history = any(isinstance(m.law, HistoryLaw) for m in self.materials)
        if self.bolts and history:
            raise InputError(
                f"bolt on {self.bolts[0].on!r}: a material of the body has internal variables, as "
                "flow theory has; accepted: materials without internal variables where a bolt is",
                "bolt",
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

        Parameters
        ----------
        dim
            Dimension of space, 2 or 3.

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
