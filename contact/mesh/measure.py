"""Measures over a mesh that stands for more than itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import ufl
from ufl.core.expr import Expr


@dataclass(frozen=True)
class ExtendedMeasure:
    """A measure of UFL over a half plane, times the extent of the body there.

    It is used like a measure of UFL: it multiplies an integrand from the right.

    Attributes
    ----------
    measure
        dx or ds of the mesh.
    extent
        2 pi r, the length of the ring through a point.
    """

    measure: ufl.Measure
    extent: Expr

    def __call__(self, *arguments: Any, **settings: Any) -> ExtendedMeasure:
        """Return the measure with a subdomain or metadata of its own."""
        return ExtendedMeasure(self.measure(*arguments, **settings), self.extent)

    def __rmul__(self, integrand: Any) -> ufl.Form:
        """Return the integral over the whole body."""
        return (self.extent * integrand) * self.measure


#: What integrates over a body or a part of its boundary.
Measure: TypeAlias = ufl.Measure | ExtendedMeasure
