"""Given loads: their values in UFL, and their nodal forces and charges as functions of time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as default
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from ufl.constantvalue import ScalarValue
from ufl.core.expr import Expr
from ufl.corealg.traversal import traverse_unique_terminals

from contact.arguments import check_finite, naming, real
from contact.body.weak_form import LoadDensity, Term
from contact.errors import InputError
from contact.mesh.domain import Domain, compiled
from contact.mesh.geometry import area
from contact.model.body import Body, Load
from contact.model.fields import Factor, Field, Moving, at_time, constant
from contact.model.formula import is_zero
from contact.ranks import on_all_ranks, summed
from contact.tolerances import HUGE
from contact.typing import Array


def given_loads(
    domain: Domain, body: Body, time: fem.Constant
) -> Mapping[str, Sequence[LoadDensity]]:
    """Return the loads of a body for its weak form, by their keys; in UFL at a time. Collective.

    Refuses missing parts, forces of the wrong length, and charges on a body without a potential.
    """
    loads: dict[str, list[LoadDensity]] = defaultdict(list)
    x = ufl.SpatialCoordinate(domain.mesh)
    for number, load in enumerate(body.loads):
        _check(domain, body, load, f"load.{number}")
        over = domain.dx if load.on is None else domain.ds(load.on)
        vectors: dict[tuple[str, bool], list[Expr]] = {}
        for name, field in load.given.items():
            value = expression(domain, field, x, time, f"load.{number}.{name}")
            varies, (key, *component) = isinstance(field, Moving), name.split(".")
            if not component:
                loads[key].append(LoadDensity(value, over, load.on, load.factor, varies))
                continue
            none = [constant(domain.mesh, 0.0) for _ in range(domain.dim)]
            vectors.setdefault((key, varies), none)[int(component[0])] = value
        for (key, varies), values in vectors.items():
            vector = ufl.as_vector(values)
            if key == "force":
                assert load.on is not None
                key, vector = "traction", vector / constant(domain.mesh, area(domain, load.on))
            loads[key].append(LoadDensity(vector, over, load.on, load.factor, varies))
    return loads


def _check(domain: Domain, body: Body, load: Load, key: str) -> None:
    """Refuse a load of the wrong length, without effect, or that needs a potential."""
    place = repr(load.on) if load.on is not None else "'the body'"
    for force in (load.density, load.force):
        if force is not None and len(force) != domain.dim:
            raise InputError(
                f"load on {place}: the force has {len(force)} components, the body has "
                f"{domain.dim}",
                "components",
            )
    if body.piezo is None and any(name.endswith("charge") for name in load.given):
        raise InputError(f"load on {place}: a charge needs a piezoelectric material", "piezo")
    if domain.revolved and load.force is not None and not is_zero(load.force[0]):
        raise InputError(
            f"{key}.force.0: given one across the axis, where it cancels over the full turn; "
            "accepted: 0, or a traction or pressure",
            "value",
        )


@dataclass
class _Share:
    """Loads with one amplitude: assembled once, or at each time where their values depend on it."""

    amplitude: Factor
    time_dependent: bool
    terms: list[ufl.Form]
    vector: Array = default(default_factory=lambda: np.zeros(0))
    time: float = np.nan

    @cached_property
    def forms(self) -> list[fem.Form]:
        """The compiled terms: one form for each, that other bodies have too."""
        return [compiled(term) for term in self.terms]


class Loads:
    """The nodal forces and charges of the loads of a residual, at any time.

    Of the terms of the residual those of loads count; `owned` is the number of owned unknowns of
    their test functions, `time` the time of the values in UFL.
    """

    def __init__(self, residual: Sequence[Term], owned: int, time: fem.Constant) -> None:
        self._owned, self._time = owned, time
        self._shares: list[_Share] = []
        self._last: tuple[float, Array] | None = None
        for form, load in residual:
            if load is None:
                continue
            kind = load.amplitude, load.time_dependent
            share = next((s for s in self._shares if (s.amplitude, s.time_dependent) == kind), None)
            if share is None:
                self._shares.append(_Share(*kind, [form]))
            else:
                share.terms.append(form)

    def at(self, time: float) -> Array:
        """Return the owned nodal loads at a time. Collective where loads depend on it."""
        if self._last is not None and self._last[0] == time:
            return self._last[1]
        total = np.zeros(self._owned)
        for share in self._shares:
            if np.isnan(share.time) or (share.time_dependent and share.time != time):
                self._time.value = time
                share.vector = np.sum([assembled(f, self._owned) for f in share.forms], axis=0)
                share.time = time
            total -= share.amplitude(time) * share.vector  # in a residual loads are negative
        self._last = time, total
        return total


def assembled(form: fem.Form, owned: int) -> Array:
    """Return the owned part of an assembled vector, or this rank's part of a number. Collective."""
    if form.rank == 0:
        return np.array([fem.assemble_scalar(form)])
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(InsertMode.add)
    return np.asarray(vector.array[:owned].copy())


def expression(
    domain: Domain, value: Field | Moving, x: Expr, time: float | fem.Constant, key: str
) -> Expr:
    """Return a given function at a time as UFL; a number becomes a form constant. Collective.

    A value that is no function on one rank is refused on all, with its key.
    """
    with on_all_ranks(domain.comm), naming(key):
        expr = at_time(value, time).ufl(x)
        if not isinstance(expr, Expr):
            number = real(expr, (), "a number, or UFL of one")
            check_finite(number.reshape(1), lambda _: "everywhere")
            return constant(domain.mesh, float(number))
        real(np.zeros(expr.ufl_shape), (), "UFL of a number")
        for part in traverse_unique_terminals(expr):
            if isinstance(part, ScalarValue):
                number = real(part.value(), (), "real UFL")
                check_finite(number.reshape(1), lambda _: "everywhere")
        if isinstance(expr, ScalarValue | ufl.classes.Zero):
            return constant(domain.mesh, float(expr))
        return expr


def wrong_load(loads: Sequence[Load], domain: Domain, time: float) -> str:
    """Return the key of the first load whose integral is not finite, or too large. Collective."""
    x = ufl.SpatialCoordinate(domain.mesh)
    for i, load in enumerate(loads):
        dx = domain.dx if load.on is None else domain.ds(load.on)
        for name, field in load.given.items():
            form = compiled(expression(domain, field, x, time, f"load.{i}.{name}") * dx)
            if not abs(summed(domain.comm, fem.assemble_scalar(form))) <= HUGE:
                return f"load.{i}.{name}"
    return "load"
