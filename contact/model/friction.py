"""Friction of a contact: made in Python, or read from a case file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Tag

from contact.arguments import expect
from contact.errors import InputError
from contact.model.fields import Scalar
from contact.model.section import Described, NonNegativeValue, described
from contact.settings import Accepted, NonNegative, OrOwn, ReadWith
from forms.laws import FrictionCoefficient, FrictionLaw, SlipCoefficient

#: Attributes of a coefficient, and of a law of friction.
COEFFICIENT = ("maximum", "lipschitz", "__call__", "derivative")
LAW = ("maximum", "lipschitz", "__call__", "by_slip", "by_pressure")


@described()
class SlipLaw(SlipCoefficient):
    """Coefficient a + b/(rho s + 2) at the slip s, (7.16)."""

    a: NonNegative = 0.5
    """Coefficient at large slip."""
    b: NonNegative = 0.2
    """Twice the excess without slip."""
    rho: NonNegative = field(kw_only=True)
    """Decay rate (1/length)."""
    law: Literal["slip"] = field(kw_only=True)
    """The slip-dependent law."""


def _is_own(given: object) -> bool:
    """Tell a coefficient, or law, of Python's; one that lacks something is no field."""
    if not any(hasattr(given, name) for name in {*COEFFICIENT, *LAW} - {"__call__"}):
        return False
    has_all = any(all(hasattr(given, name) for name in names) for names in (COEFFICIENT, LAW))
    accepted = f"an object with {', '.join(COEFFICIENT)}, or with {', '.join(LAW)}"
    if not has_all:
        raise InputError(f"given {given!r}; accepted: {accepted}", "value")
    return True


#: A coefficient of friction. A further law is a class like `SlipLaw`, and a line here.
Mu: TypeAlias = Annotated[
    Annotated[
        Annotated[NonNegativeValue, Tag(":formula")] | Annotated[SlipLaw, Tag(":slip")],
        Discriminator(lambda x: f":{x.get('law')}" if isinstance(x, Mapping) else ":formula"),
    ]
    | FrictionCoefficient
    | FrictionLaw,
    OrOwn(_is_own),
    Accepted('a number >= 0 or a formula, or a table with law = "slip"', "law"),
]


class Friction(Described):
    """`[friction]`: friction on the contact parts that have none of their own. Absent: none.

    Examples
    --------
    >>> Friction(mu=0.3).law
    'coulomb'
    """

    law: Literal["none", "tresca", "coulomb"] = "none"
    """`tresca`: fixed bound; `coulomb`: mu times the smoothed pressure."""
    bound: Annotated[NonNegativeValue | None, ReadWith("law", "tresca", required=True)] = None
    """Bound S of the tangential stress."""
    mu: Annotated[Mu | None, ReadWith("law", "coulomb", required=True)] = None
    """Coefficient of friction."""
    radius: Annotated[NonNegative, ReadWith("law", "coulomb")] = 0.0
    """Radius of the smoothing operator R; 0: the pressure itself."""

    def __init__(
        self,
        coefficient: FrictionCoefficient | None = None,
        tresca: Scalar | None = None,
        radius: float = 0.0,
        mu: Scalar | FrictionCoefficient | None = None,
        law: FrictionLaw | None = None,
    ) -> None:
        if isinstance(coefficient, int | float):
            raise InputError(
                f"Friction({coefficient}): accepted: Friction(mu={coefficient}), a "
                "coefficient, or Friction(tresca=...), a bound",
                "no-such-name",
            )
        for name, one, methods in (("coefficient", coefficient, COEFFICIENT), ("law", law, LAW)):
            fits = one is None or all(hasattr(one, method) for method in methods)
            expect(f"Friction: {name}", one, f"an object with {', '.join(methods)}", fits)
        given = [one for one in (coefficient, tresca, mu, law) if one is not None]
        if len(given) > 1:
            raise InputError("Friction: accepted: one of coefficient, tresca, mu and law", "value")
        more: dict[str, Any] = {"radius": radius} if radius else {}
        if tresca is not None:
            super().__init__(law="tresca", bound=tresca, **more)
        elif given:
            super().__init__(law="coulomb", mu=given[0], **more)
        else:
            super().__init__(law="none", **more)

    @property
    def acts(self) -> bool:
        """Whether there is any."""
        return self.law != "none"
