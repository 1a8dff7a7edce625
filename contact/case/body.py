"""Sections of the case file about the body: elements, supports, loads, rigid parts."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias, cast

import numpy as np
from dolfinx.mesh import entities_to_geometry
from mpi4py import MPI
from pydantic import Field, model_validator

from contact.body import description, rigid
from contact.case.formula import Expression, TimeField, as_field, as_number
from contact.case.messages import Words, fault
from contact.case.section import (
    AmplitudeName,
    Component,
    Either,
    Few,
    Formula,
    FormulaVector,
    NonNegativeFormula,
    Part,
    Section,
    TimeComponent,
    TimeFormula,
    Vector,
    as_given,
)
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.settings import SPATIAL, Accepted, Switch

#: `contact.case.file.Case`, of which these are sections.
Case: TypeAlias = Any


class Space(Section):
    """`[space]`: finite elements, and the kinematics of the body."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = 1
    """Degree of the Lagrange elements of the displacement and the potential."""
    element: Literal["standard", "mean_dilatation"] = "standard"
    """`"mean_dilatation"`: volumetric strains are averaged over each cell, so that nearly
    incompressible bodies, and yielding ones, do not lock. On triangles and tetrahedra with
    `degree = 2` (P2-P0), on quadrilaterals and hexahedra with `degree = 1` (Q1-P0)."""
    kinematics: Literal["plane_strain", "plane_stress", "axisymmetric"] = "plane_strain"
    """The body of a mesh in 2-D: in plane strain; in plane stress, a sheet of unit thickness that
    is free to grow thinner; or a body of revolution, of which the mesh is the half plane x = r, y
    along the axis. Displacements across the axis are then 0 without a support, and loads, forces
    and charges are those of the full turn."""


class Fixed(Section):
    """`[[fixed]]`: prescribed displacement or potential on a part."""

    on: Part
    """Part of the boundary, or a list of parts."""
    displacement: (
        Annotated[
            Few[Component],
            SPATIAL,
            Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula or "free"'),
        ]
        | None
    ) = None
    """Displacement of the part; "free" for a component that is not fixed."""
    symmetry: Literal["x", "y", "z"] | None = None
    """Instead of a displacement: the part lies in a plane of symmetry across this axis; its
    displacement along the axis is 0."""
    normal: Formula | None = None
    """Instead of a displacement: that along the outward normal of the part; 0 for rollers. The part
    may be inclined or curved, and is free to move along itself."""
    potential: Formula | None = None
    """Electric potential of the part."""
    amplitude: AmplitudeName | None = None
    """Factor of all that is prescribed as a function of time, see `[evolution]`."""

    @property
    def is_clamped(self) -> bool:
        """True if every component of the displacement is prescribed."""
        return self.displacement is not None and "free" not in self.displacement

    @model_validator(mode="after")
    def _check(self) -> Self:
        keys = ("symmetry", "normal", "displacement")
        one = [key for key in keys if getattr(self, key) is not None]
        if len(one) > 1:
            accepted = f"one of {' and '.join(one)}, and for more another entry"
            raise fault(one[0], as_given(getattr(self, one[0])), accepted, "one-condition")
        if self.symmetry is not None or self.normal is not None:
            return self
        if self.potential is None and all(c == "free" for c in self.displacement or ()):
            given = self.displacement or Words("missing")
            accepted = "a component that is fixed, normal, symmetry or a potential"
            raise fault("displacement", given, accepted, "supports")
        return self

    def build(self, key: str, case: Case, domain: Domain) -> description.Fixed:
        """Return the support itself; ``key`` is the section's own. Collective."""
        displacement: list[Any] | None = None
        comm = domain.comm
        if self.symmetry is not None:
            axis = "xyz".index(self.symmetry)
            _check_across(f"{key}.symmetry", domain, self.on, axis)
            displacement = [0.0 if k == axis else None for k in range(domain.dim)]
        if self.displacement is not None:
            displacement = [
                as_field(f"{key}.displacement.{k}", component, comm)
                for k, component in enumerate(self.displacement)
            ]
        potential = as_field(f"{key}.potential", self.potential, comm)
        amplitude = case.amplitude(self.amplitude)
        normal = as_field(f"{key}.normal", self.normal, comm)
        return description.Fixed(self.on, displacement, potential, amplitude, normal=normal)


class Elastic(Section):
    """`[[elastic]]`: an elastic support, a traction against the displacement of a part."""

    on: Part
    """Part of the boundary, or a list of parts, beside the contact part."""
    stiffness: (
        Annotated[
            Few[NonNegativeFormula],
            SPATIAL,
            Accepted("a list of 2 numbers >= 0 or formulas in 2-D, 3 in 3-D"),
        ]
        | None
    ) = None
    """Force per area and displacement along each axis: traction -k u."""
    normal: NonNegativeFormula | None = None
    """The same along the normal of the part alone, which is free to move along itself."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.stiffness is None and self.normal is None:
            raise fault("stiffness", Words("missing"), "stiffness, normal, or both")
        return self

    def build(self, key: str, comm: MPI.Intracomm) -> description.Elastic:
        """Return the support itself; ``key`` is the section's own."""
        return description.Elastic(
            self.on,
            self.stiffness
            and [
                as_field(f"{key}.stiffness.{k}", value, comm, 0.0)
                for k, value in enumerate(self.stiffness)
            ],
            as_field(f"{key}.normal", self.normal, comm, 0.0),
        )


ZERO = Expression(0.0)

Components: TypeAlias = Annotated[
    Few[TimeComponent],
    SPATIAL,
    Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula in t or "free"'),
]
Forces: TypeAlias = Annotated[
    Few[TimeFormula],
    SPATIAL,
    Accepted("a list of 2 numbers or formulas in t in 2-D, 3 in 3-D"),
]
Rotation: TypeAlias = Annotated[
    Either[TimeComponent, Components],
    Accepted('in 2-D an angle, a formula in t or "free", in 3-D a list of 3 of these'),
]
Moment: TypeAlias = Annotated[
    Either[TimeFormula, Forces],
    Accepted("in 2-D a number or a formula in t, in 3-D a list of 3 of these"),
]


def _check_across(key: str, domain: Domain, on: str, axis: int) -> None:
    """Refuse a part that lies in no plane across an axis. Collective."""
    name = "xyz"[axis]
    if axis >= domain.dim or (domain.revolved and axis == 0):
        known = "y" if domain.revolved else " or ".join("xyz"[: domain.dim])
        raise InputError(f'{key}: given "{name}"; accepted: {known}', "value")
    facets, there = domain.facets(on), np.zeros(0)
    if facets.size:  # which `entities_to_geometry` divides by
        nodes = entities_to_geometry(domain.mesh, domain.dim - 1, facets)
        there = domain.mesh.geometry.x[nodes.ravel(), axis]
    low = domain.comm.allreduce(float(there.min(initial=np.inf)), op=MPI.MIN)
    high = domain.comm.allreduce(float(there.max(initial=-np.inf)), op=MPI.MAX)
    if high - low > 1e-6 * domain.size:
        raise InputError(
            f"{key}: {on} reaches from {name} = {low:.6g} to {high:.6g}; accepted: a part in a "
            f"plane across {name}",
            "symmetry",
        )


#: Keys of a load on a part, and of one in the whole body.
SURFACE, VOLUME = ("traction", "force", "pressure", "charge"), ("body_force", "body_charge")


class Load(Section):
    """`[[load]]`: forces and charges on a part, or in the whole body."""

    hints = dict.fromkeys(
        ("resultant", "forces"),
        "force is the resultant on the part, traction is per area, body_force per volume",
    )

    on: Part | None = None
    """Part of the boundary, or a list of parts, beside the contact part. This or `everywhere`."""
    everywhere: Switch = False
    """`true`: in the whole body."""
    traction: FormulaVector | None = None
    """Force per area of the part."""
    force: Forces | None = None
    """Resultant force on the part, spread evenly over it; in 2-D of a unit of depth, of a body of
    revolution that of the full turn. A part that is to move as a rigid body is `[[rigid]]`."""
    pressure: Formula | None = None
    """Normal pressure p on the part: traction -p along the outward normal."""
    charge: Formula | None = None
    """Charge per area of the part."""
    body_force: FormulaVector | None = None
    """Force per volume."""
    body_charge: Formula | None = None
    """Charge per volume."""
    amplitude: AmplitudeName | None = None
    """Factor of all of these as a function of time, see `[evolution]`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.on is None) == (not self.everywhere):
            given = "neither" if self.on is None else "both"
            raise fault("on", Words(given), "one of on and everywhere = true", "exclusive-keys")
        right, wrong = (VOLUME, SURFACE) if self.everywhere else (SURFACE, VOLUME)
        place = "everywhere = true" if self.everywhere else "on"
        for key in wrong:
            if getattr(self, key) is not None:
                given = Words(f"together with {place}")
                raise fault(key, given, f"with {place}: {', '.join(right)}", "exclusive-keys")
        if all(getattr(self, key) is None for key in right):
            raise fault(right[0], Words("missing"), f"at least one of {', '.join(right)}")
        return self

    def build(self, key: str, case: Case, comm: MPI.Intracomm) -> description.Load:
        """Return the load itself; ``key`` is the section's own."""
        density, charge = VOLUME if self.everywhere else ("traction", "charge")
        components = getattr(self, density)
        force = [
            f.value if f.is_constant else cast(TimeField, as_field(f"{key}.force.{k}", f, comm))
            for k, f in enumerate(self.force or ())
        ]
        with warnings.catch_warnings():  # the word has always had this meaning in a case
            warnings.simplefilter("ignore", FutureWarning)
            return description.Load(
                self.on,
                components
                and [as_field(f"{key}.{density}.{k}", f, comm) for k, f in enumerate(components)],
                as_field(f"{key}.pressure", self.pressure, comm),
                as_field(f"{key}.{charge}", getattr(self, charge), comm),
                case.amplitude(self.amplitude),
                force=force or None,
            )


class Moving(Section):
    """A rigid-body motion: each component is given, or free under a given force."""

    displacement: Components | None = None
    """Displacement; `"free"` for a component that its force determines. Default: 0."""
    force: Forces | None = None
    """Force on the free components of the displacement. Default: 0."""
    rotation: Rotation = ZERO
    """Rotation about `centre` (degrees, small), or `"free"`."""
    moment: Moment = ZERO
    """Moment about `centre` on a free rotation."""
    centre: Vector | None = None
    """Centre of rotation. Required where something turns."""
    amplitude: AmplitudeName | None = None
    """Factor of all of these as a function of time, see `[evolution]`."""

    @property
    def turns(self) -> tuple[Expression | str, ...]:
        """The rotation, as a list."""
        return self.rotation if isinstance(self.rotation, tuple) else (self.rotation,)

    @property
    def moments(self) -> tuple[Expression, ...]:
        """The moment, as a list."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_free("force", self.force or (), self.displacement or (), "displacement")
        _check_free("moment", self.moments, self.turns, "rotation")
        if self.centre is None and any(turn != ZERO for turn in self.turns):
            raise fault("centre", Words("missing"), "a point about which it turns")
        return self

    def check_dimension(self, key: str, dimension: int) -> None:
        """Raise a fault if a rotation is none of the space."""
        for name in ("rotation", "moment"):
            value = getattr(self, name)
            if isinstance(value, tuple):
                fits = dimension == 3 and len(value) == 3
            else:
                fits = dimension == 2 or value == ZERO
            if not fits:
                accepted = "one angle or moment in 2-D, a list of 3 in 3-D"
                raise fault(f"{key}.{name}", as_given(value), accepted)

    def check_along_axis(self, key: str) -> None:
        """Raise a fault if a motion leaves the axis of a body of revolution."""
        across = (self.displacement or (ZERO,))[0]
        if across != ZERO:
            accepted = "0 across the axis of a body of revolution"
            raise fault(f"{key}.displacement.0", as_given(across), accepted)
        if any(turn != ZERO for turn in self.turns):
            raise fault(
                f"{key}.rotation",
                Words("given"),
                "no rotation of a body of revolution",
                "rigid-part",
            )

    def motion(self, case: Case, dim: int) -> rigid.Motion:
        """Return the motion itself, of a body in 2-D or 3-D."""
        turns = 2 * dim - 3
        return rigid.Motion(
            _components(self.displacement or (), dim),
            _components(self.turns, turns, np.pi / 180),
            _components(self.force or (), dim),
            _components(self.moments, turns),
            self.centre or (0.0,) * dim,
            case.amplitude(self.amplitude),
        )


class Rigid(Moving):
    """`[contact.rigid]`: the foundation moves as a rigid body. Absent: it is fixed."""


class RigidPart(Moving):
    """`[[rigid]]`: a part that moves as a rigid body, such as a plate that loads the body."""

    on: Part
    """Part of the boundary, or a list of parts."""


class Electrode(Section):
    """`[[electrode]]`: a part with one unknown potential, whose charge is given."""

    on: Part
    """Part of the boundary, or a list of parts."""
    charge: TimeFormula = ZERO
    """Its charge; 0: open circuit."""
    amplitude: AmplitudeName | None = None
    """Factor of the charge as a function of time, see `[evolution]`."""

    def build(self, case: Case) -> rigid.Electrode:
        """Return the electrode itself."""
        return rigid.Electrode(self.on, as_number(self.charge), case.amplitude(self.amplitude))


class Bolt(Section):
    """`[[bolt]]`: a cut through a body whose sides are drawn together: a bolt that is tightened."""

    on: Part
    """A part inside of the body, all facets of a plane section: a group of a mesh file, or one of
    `[mesh.inside]`."""
    force: TimeFormula | None = None
    """Section force, tension > 0; in 2-D of a unit of depth, of a body of revolution that of the
    full turn. This or `shortening`."""
    shortening: TimeFormula | None = None
    """Length by which the sides are drawn together; a tightened bolt keeps it under later loads."""
    amplitude: AmplitudeName | None = None
    """Factor of it as a function of time, see `[evolution]`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.force is None) == (self.shortening is None):
            given = "neither" if self.force is None else "both"
            raise fault("force", Words(given), "one of force and shortening", "bolt")
        return self

    def build(self, case: Case) -> rigid.Bolt:
        """Return the bolt itself."""
        force = None if self.force is None else as_number(self.force)
        shortening = None if self.shortening is None else as_number(self.shortening)
        return rigid.Bolt(self.on, force, shortening, case.amplitude(self.amplitude))


def _check_free(
    key: str, forces: Sequence[Expression], moves: Sequence[Expression | str], name: str
) -> None:
    """Raise a fault if a force acts on a component that is not free."""
    for k, force in enumerate(forces):
        if force != ZERO and moves[k : k + 1] != ("free",):
            path = f"{key}.{k}" if len(forces) > 1 else key
            raise fault(path, as_given(force), f'a {key} where the {name} is "free"')


def _components(values: Sequence[Expression | str], size: int, unit: float = 1.0) -> list[Any]:
    """Return components, None for those that are free, and 0 where none are given."""
    known = [None if isinstance(value, str) else as_number(value, unit) for value in values]
    return [*known, *[0.0] * (size - len(known))][:size]
