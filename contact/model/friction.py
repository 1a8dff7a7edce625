"""Friction of a contact: made in Python, or read from a case file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Discriminator, Tag

from contact.arguments import expect
from contact.errors import InputError
from contact.model.fields import Scalar
from contact.model.section import Described, NonNegativeValue, Own, Section
from contact.settings import Accepted, NonNegative, ReadWith
from forms.laws import FrictionCoefficient, FrictionLaw, SlipCoefficient

#: Attributes of a coefficient, and of a law of friction.
COEFFICIENT = ("maximum", "lipschitz", "__call__", "derivative")
LAW = ("maximum", "lipschitz", "__call__", "by_slip", "by_pressure")


class MuLaw(Section, ABC):
    """A table `mu = { law = ..., ... }`; its `law` names it."""

    law: str

    @property
    @abstractmethod
    def coefficient(self) -> FrictionCoefficient | FrictionLaw:
        """The coefficient, or the law of friction, itself."""


class SlipLaw(MuLaw):
    """`mu = { law = "slip", ... }`: coefficient a + b/(rho s + 2) at the slip s, (7.16)."""

    law: Literal["slip"]
    """The slip-dependent law."""
    a: NonNegative = 0.5
    """Coefficient at large slip."""
    b: NonNegative = 0.2
    """Twice the excess without slip."""
    rho: NonNegative
    """Decay rate (1/length)."""

    @property
    def coefficient(self) -> SlipCoefficient:
        """The coefficient itself."""
        return SlipCoefficient(self.a, self.b, self.rho)


def _own(given: Any) -> Any:
    """Return a coefficient, or law, of Python's with all of its attributes."""
    if all(any(not hasattr(given, name) for name in names) for names in (COEFFICIENT, LAW)):
        either = f"an object with {', '.join(COEFFICIENT)}, or with {', '.join(LAW)}"
        raise InputError(f"given {given!r}; accepted: {either}", "value")
    return given


def _kind(given: Any) -> str:
    if isinstance(given, Mapping | MuLaw):
        return f":{given.get('law') if isinstance(given, Mapping) else given.law}"
    # One that lacks something is no function of position.
    named = ("maximum", "lipschitz", "derivative", "by_slip", "by_pressure")
    return ":own" if any(hasattr(given, name) for name in named) else ":formula"


#: A coefficient of friction. A further law is a subclass of `MuLaw`, and a line here.
Mu: TypeAlias = Annotated[
    Annotated[NonNegativeValue, Tag(":formula")]
    | Annotated[SlipLaw, Tag(":slip")]
    | Annotated[FrictionCoefficient | FrictionLaw, Own(), AfterValidator(_own), Tag(":own")],
    Discriminator(_kind),
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
        if tresca is not None:
            super().__init__(law="tresca", bound=tresca)
        elif given:
            super().__init__(law="coulomb", mu=given[0], radius=radius)
        else:
            super().__init__(law="none")

    @property
    def acts(self) -> bool:
        """Whether there is any."""
        return self.law != "none"
