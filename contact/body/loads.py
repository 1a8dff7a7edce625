"""Loads: the work of given forces and charges, as functions of time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from ufl.core.expr import Expr

from contact.body.amplitude import Amplitude, Moving, at_time
from contact.body.constants import constant
from contact.body.description import Body, Field, Load
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.typing import Array
from forms.piezo import electric_load


@dataclass
class _Share:
    """Loads with one amplitude: assembled once, or where they know the time, for each time."""

    amplitude: Amplitude
    moving: bool
    work: ufl.Form
    form: fem.Form | None = None
    vector: Array = field(default_factory=lambda: np.zeros(0))
    time: float = np.nan


class Loads:
    """The nodal forces and charges that are given, at any time. Equation (5.29).

    Parameters
    ----------
    domain, body
        Mesh, and what acts on the body.
    v, xi
        Test functions of the displacement and the potential; None for a body without.
    owned
        Number of owned unknowns.

    Raises
    ------
    InputError
        If a part is missing, a force has the wrong length, or a charge acts on a body without
        a potential.
    """

    def __init__(
        self,
        domain: Domain,
        body: Body,
        v: Expr,
        xi: Expr | None,
        owned: int,
    ) -> None:
        self._owned = owned
        self._time = constant(domain.mesh, 0.0)
        self._shares: list[_Share] = []
        self._last: tuple[float, Array] | None = None
        for load in body.loads:
            for work, moving in _works(domain, load, v, xi, self._time):
                self._add(load.factor, moving, work)

    def _add(self, amplitude: Amplitude, moving: bool, work: ufl.Form) -> None:
        for share in self._shares:
            if share.amplitude == amplitude and share.moving == moving:
                share.work = share.work + work
                return
        self._shares.append(_Share(amplitude, moving, work))

    def at(self, time: float) -> Array:
        """Return the owned nodal loads at a time. Collective where loads know the time."""
        if self._last is not None and self._last[0] == time:
            return self._last[1]
        total = np.zeros(self._owned)
        for share in self._shares:
            if share.form is None or (share.moving and share.time != time):
                self._time.value = time
                share.form = share.form or fem.form(share.work)
                share.vector, share.time = assembled(share.form, self._owned), time
            total += share.amplitude(time) * share.vector
        self._last = time, total
        return total


def assembled(form: fem.Form, owned: int) -> Array:
    """Return the owned part of an assembled vector. Collective."""
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(InsertMode.add)
    return np.asarray(vector.array[:owned].copy())


def _works(
    domain: Domain, load: Load, v: Expr, xi: Expr | None, time: fem.Constant
) -> list[tuple[ufl.Form, bool]]:
    """Return the work of each part of a load, and whether it knows the time."""
    x = ufl.SpatialCoordinate(domain.mesh)
    measure = domain.dx if load.on is None else domain.ds(load.on)
    place = repr(load.on) if load.on is not None else "'the body'"
    terms: list[tuple[Expr, Field | Moving]] = []
    if load.force is not None:
        if len(load.force) != domain.dim:
            raise InputError(
                f"load on {place}: the force has {len(load.force)} components, the body has "
                f"{domain.dim}"
            )
        for i, force in enumerate(load.force):
            terms.append((expression(domain, force, x, time) * v[i], force))
    if load.pressure is not None:
        nu = ufl.FacetNormal(domain.mesh)
        pressure = expression(domain, load.pressure, x, time)
        terms.append((-pressure * ufl.dot(nu, v), load.pressure))
    if load.charge is not None:
        if xi is None:
            raise InputError(f"load on {place}: a charge needs a piezoelectric material")
        charge = expression(domain, load.charge, x, time)
        given = {"body": charge} if load.on is None else {"surface": charge}
        terms.append((electric_load(xi, **given), load.charge))
    return [(term * measure, isinstance(field, Moving)) for term, field in terms]


def expression(domain: Domain, value: Field | Moving, x: Expr, time: Any) -> Expr:
    """Return a given function at a time as UFL; a number becomes a form constant."""
    found = at_time(value, time).ufl(x)
    if isinstance(found, int | float | ufl.constantvalue.ScalarValue | ufl.classes.Zero):
        return constant(domain.mesh, float(found))
    return found
