"""Measures over the whole body, and forms compiled once for all parts and regions.

UFL's signature of a form, by which FFCx finds compiled code, contains the numbers of subdomains: an
integrand on another part would be compiled again.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import ufl
from dolfinx import fem
from ufl.core.expr import Expr

from contact.mesh.entities import Indices


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


#: Measure of a body or of a part of its boundary.
Measure: TypeAlias = ufl.Measure | ExtendedMeasure


def compiled(form: ufl.Form) -> fem.Form:
    """Compile a form whose subdomains are renumbered from 0. Collective.

    Subdomains with the same integrals become one.

    Parameters
    ----------
    form
        With the measures of one `contact.mesh.domain.Domain`.
    """
    everywhere, subdomains = [], defaultdict(list)
    for integral in form.integrals():
        numbers = integral.subdomain_id()
        if numbers == "everywhere":
            everywhere.append(integral)
            continue
        for number in numbers if isinstance(numbers, tuple) else (numbers,):
            subdomains[integral.integral_type(), number].append(integral)
    groups: dict[Any, tuple[list[ufl.Integral], list[Indices]]] = {}
    for (kind, number), own in sorted(subdomains.items(), key=lambda item: item[0]):
        same = kind, *((one.integrand(), repr(one.metadata())) for one in own)
        entities = dict(own[0].subdomain_data())[number]
        groups.setdefault(same, (own, []))[1].append(entities)
    # One object a kind of integrals, as dolfinx demands.
    data: dict[str, list[tuple[int, Indices]]] = defaultdict(list)
    made = [one.reconstruct(subdomain_data=data[one.integral_type()]) for one in everywhere]
    for (kind, *_), (own, entities) in groups.items():
        number = len(data[kind])
        made += [one.reconstruct(subdomain_id=number, subdomain_data=data[kind]) for one in own]
        data[kind].append((number, np.concatenate(entities)))
    return fem.form(ufl.Form(made))
