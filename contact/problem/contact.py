"""A contact: two parts, or a part and an obstacle, and the laws between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact.arguments import expect, fill
from contact.interface.law import Conductor
from contact.interface.layer import Layer
from contact.mesh.parts import part
from contact.model.fields import Static
from contact.model.friction import Friction
from contact.model.obstacle import GapFunction, Obstacle


@dataclass(frozen=True)
class Contact:
    """A part that may touch an obstacle, and the laws between them.

    Parameters
    ----------
    on
        The part, or a list of parts.
    foundation
        The obstacle; or a gap to a rigid foundation along the body's normal (length): a number, a
        function of x, UFL (`ufl.core.expr.Expr`) or a `dolfinx.fem.Function`. A gap below 0 is an
        interference. By default the body lies on it.
    layer
        The compliant layer in front of it.
    friction, conductor
        Friction and electric contact; None: those that the problem has for all contacts.
    press
        Whether the obstacle, or the other body, may overlap the undeformed body: the overlap is an
        interference, which contact removes.
    against
        The part of another body that `on` may touch instead of a rigid foundation; the gap of
        `foundation` is then added to that between the bodies. None for a foundation.
    gap
        The same as a gap for `foundation`, by its name in the case file.
    name
        Of its results; that of the part by default.

    Raises
    ------
    InputError
        If something else is given.

    Examples
    --------
    >>> Contact(["left", "right"], gap=0.01).on
    'left+right'
    """

    on: str
    foundation: Obstacle
    layer: Layer | None
    friction: Friction | None
    conductor: Conductor | None
    press: bool
    against: str | None
    name: str

    def __init__(
        self,
        on: str | Sequence[str],
        foundation: Obstacle | Static = 0.0,
        layer: Layer | None = None,
        friction: Friction | None = None,
        conductor: Conductor | None = None,
        press: bool = False,
        against: str | Sequence[str] | None = None,
        gap: Static | None = None,
        name: str | None = None,
    ) -> None:
        fill(self, on=part(on), against=None if against is None else part(against))
        accepted = "a text without blanks at its ends, or None"
        fits = name is None or (isinstance(name, str) and name.strip() == name != "")
        expect("Contact: name", name, accepted, fits)
        fill(self, name=self.on if name is None else name)
        if gap is not None:
            alone = isinstance(foundation, float) and foundation == 0.0
            expect("Contact: foundation", foundation, "this, or a gap", alone)
            foundation = gap
        if not hasattr(foundation, "measure"):
            foundation = GapFunction.of(foundation)
        fill(self, foundation=foundation)
        expect("Contact: layer", layer, "Layer(...), or None", isinstance(layer, Layer | None))
        expect("Contact: press", press, "True or False", isinstance(press, bool | np.bool_))
        check_laws("Contact", friction, conductor)
        fill(self, layer=layer, friction=friction, conductor=conductor, press=press)


def check_laws(name: str, friction: object, conductor: object) -> None:
    """Refuse objects that are no friction, or no electric contact."""
    fits = isinstance(friction, Friction | None)
    expect(f"{name}: friction", friction, "Friction(mu=...), or None", fits)
    fits = isinstance(conductor, Conductor | None)
    expect(f"{name}: conductor", conductor, "Conductor(...), or None", fits)
