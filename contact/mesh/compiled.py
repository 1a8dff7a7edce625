"""Forms over parts and regions, compiled once for all of these.

UFL's signature of a form, by which FFCx finds compiled code, contains the numbers of subdomains: an
integrand on another part would be compiled again.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from contact.mesh.entities import Indices


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
