"""Sections of the case file about the body: elements, supports and loads."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self, TypeAlias

from mpi4py import MPI
from pydantic import Field, model_validator

from contact.body import description
from contact.body.elements import MEAN_DILATATION, NEEDS
from contact.case.formula import as_field
from contact.case.messages import Words, fault
from contact.case.section import (
    AmplitudeName,
    Component,
    Formula,
    FormulaVector,
    Part,
    Section,
    as_tuple,
    few,
)
from contact.settings import SPATIAL, Accepted, Switch

#: `contact.case.file.Case`, of which these are sections.
Case: TypeAlias = Any


class Space(Section):
    """`[space]`: finite elements, and the kinematics of the body."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = 1
    """Degree of the Lagrange elements of the displacement and the potential."""
    element: Literal["standard", "mean_dilatation"] = "standard"
    """`"mean_dilatation"`: volumetric strains are averaged over each cell, so that nearly
    incompressible bodies, and yielding ones, do not lock. With `degree = 2`: P2-P0."""
    kinematics: Literal["plane_strain", "axisymmetric"] = "plane_strain"
    """The body of a mesh in 2-D: in plane strain, or a body of revolution whose half plane the
    mesh is, x the radius and y the axis. There displacements are 0 across the axis without being
    asked for, and loads, forces and charges are those of the full turn."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.element == MEAN_DILATATION and self.degree != 2:
            raise fault("element", self.element, NEEDS)
        return self


class Fixed(Section):
    """`[[fixed]]`: prescribed displacement or potential on a part."""

    on: Part
    """Part of the boundary, or a list of parts."""
    displacement: (
        Annotated[
            tuple[Component, ...],
            few,
            as_tuple,
            SPATIAL,
            Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula or "free"'),
        ]
        | None
    ) = None
    """Displacement of the part; "free" for a component that is not fixed."""
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
        if self.potential is None and all(c == "free" for c in self.displacement or ()):
            given = self.displacement or Words("missing")
            raise fault("displacement", given, "a component that is fixed, or a potential")
        return self

    def build(self, key: str, case: Case, comm: MPI.Intracomm) -> description.Fixed:
        """Return the support itself; ``key`` is the section's own."""
        displacement = None
        if self.displacement is not None:
            displacement = [
                as_field(f"{key}.displacement.{k}", component, comm)
                for k, component in enumerate(self.displacement)
            ]
        potential = as_field(f"{key}.potential", self.potential, comm)
        amplitude = case.amplitude(self.amplitude)
        return description.Fixed(self.on, displacement, potential, amplitude)


#: Keys of a load on a part, and of one in the whole body.
SURFACE, VOLUME = ("traction", "pressure", "charge"), ("body_force", "body_charge")


class Load(Section):
    """`[[load]]`: forces and charges on a part, or in the whole body."""

    hints = dict.fromkeys(
        ("force", "resultant", "forces"),
        "a load is given per area, traction = resultant / area of the part, or per volume, "
        "body_force; a resultant goes to a part that is rigid, force of [[rigid]]",
    )

    on: Part | None = None
    """Part of the boundary, or a list of parts, beside the contact part. This or `everywhere`."""
    everywhere: Switch = False
    """`true`: in the whole body."""
    traction: FormulaVector | None = None
    """Force per area of the part."""
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
            raise fault("on", Words(given), "one of on and everywhere = true")
        right, wrong = (VOLUME, SURFACE) if self.everywhere else (SURFACE, VOLUME)
        place = "everywhere = true" if self.everywhere else "on"
        for key in wrong:
            if getattr(self, key) is not None:
                given = Words(f"together with {place}")
                raise fault(key, given, f"with {place}: {', '.join(right)}")
        if all(getattr(self, key) is None for key in right):
            raise fault(right[0], Words("missing"), f"at least one of {', '.join(right)}")
        return self

    def build(self, key: str, case: Case, comm: MPI.Intracomm) -> description.Load:
        """Return the load itself; ``key`` is the section's own."""
        force, charge = VOLUME if self.everywhere else (SURFACE[0], SURFACE[2])
        components = getattr(self, force)
        return description.Load(
            self.on,
            components
            and [as_field(f"{key}.{force}.{k}", f, comm) for k, f in enumerate(components)],
            as_field(f"{key}.pressure", self.pressure, comm),
            as_field(f"{key}.{charge}", getattr(self, charge), comm),
            case.amplitude(self.amplitude),
        )
