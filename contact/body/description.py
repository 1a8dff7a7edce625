"""Description of one body: material, supports and loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from contact.arguments import expect, fill, several
from contact.errors import InputError
from contact.model.body import Bolt, Elastic, Electrode, Fixed, Load
from contact.model.material import Material
from contact.model.rigid import Rigid
from forms.elasticity import Anisotropic
from forms.hencky import Law, is_linear
from forms.history import HistoryLaw
from forms.piezo import Piezo


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
            materials = several("law", law, Material, accepted)
            expect("law", law, accepted, materials and piezo is None and not regions)
            (law, piezo), regions = _leading(materials), materials
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
            fits = self.law is first and (self.piezo is None) == (tensors is None)
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

    def in_space(self, dim: int) -> Body:
        """Return the body with the laws of its materials in its axes, in 2-D or 3-D."""
        materials: Any = tuple(material.in_body(dim) for material in self.regions)
        if all(one is region for one, region in zip(materials, self.regions, strict=True)):
            return self
        return replace(self, law=materials, piezo=None, regions=())

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
