"""A contact: two parts, or a part and an obstacle, and the laws between them."""

from __future__ import annotations

from dataclasses import InitVar, dataclass
from typing import Any

import numpy as np

from contact.arguments import expect
from contact.body.fields import Given
from contact.interface.friction import Friction
from contact.interface.law import Conductor
from contact.interface.layer import Layer
from contact.interface.obstacle import GapFunction
from contact.mesh.together import part


@dataclass(frozen=True)
class Contact:
    """A part that may touch an obstacle, and the laws between them.

    Parameters
    ----------
    on
        The part, or a list of parts.
    foundation
        The obstacle; or a gap to a rigid foundation along the body's normal: a number, a function
        of x, UFL or a dolfinx Function. By default the body lies on it.
    layer
        The compliant layer in front of it.
    friction, conductor
        Friction and electric contact; None: those that the problem has for all contacts.
    press
        Whether the obstacle may overlap the undeformed body; contact then removes the overlap.
    against
        The part of another body that `on` may touch instead of a rigid foundation; the gap of
        `foundation` is then added to that between the bodies. None for a foundation.
    gap
        The same as a gap for `foundation`, by its name in the case file.

    Raises
    ------
    InputError
        If something else is given.
    """

    on: Given
    foundation: Given = 0.0
    layer: Layer | None = None
    friction: Friction | None = None
    conductor: Conductor | None = None
    press: bool = False
    against: Given = None
    gap: InitVar[Given] = None

    def __post_init__(self, gap: Given) -> None:
        """Make an obstacle of a gap."""
        object.__setattr__(self, "on", part(self.on))
        if self.against is not None:
            object.__setattr__(self, "against", part(self.against))
        if gap is not None:
            alone = isinstance(self.foundation, float) and self.foundation == 0.0
            expect("Contact: foundation", self.foundation, "this, or a gap", alone)
            object.__setattr__(self, "foundation", gap)
        if not hasattr(self.foundation, "measure"):
            object.__setattr__(self, "foundation", GapFunction.of(self.foundation))
        layer, press = self.layer, self.press
        expect("Contact: layer", layer, "Layer(...), or None", isinstance(layer, Layer | None))
        expect("Contact: press", press, "True or False", isinstance(press, bool | np.bool_))
        check_laws("Contact", self.friction, self.conductor)


def check_laws(name: str, friction: Any, conductor: Any) -> None:
    """Refuse objects that are no friction, or no electric contact."""
    fits = isinstance(friction, Friction | None)
    expect(f"{name}: friction", friction, "Friction(mu=...), or None", fits)
    fits = isinstance(conductor, Conductor | None)
    expect(f"{name}: conductor", conductor, "Conductor(...), or None", fits)
