"""Loads: the work of given forces and charges, as functions of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as default
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from mpi4py import MPI
from ufl.constantvalue import ScalarValue
from ufl.core.expr import Expr
from ufl.corealg.traversal import traverse_unique_terminals

from contact.arguments import check_finite, naming, real
from contact.body.description import Body
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.geometry import area, volume
from contact.mesh.integrals import compiled
from contact.model.body import Load
from contact.model.fields import Amplitude, Field, Moving, at_time, constant
from contact.ranks import on_all_ranks
from contact.tolerances import HUGE
from contact.typing import Array
from forms.piezo import electric_load


@dataclass
class _Share:
    """Loads with one amplitude: assembled once, or where they know the time, for each time."""

    amplitude: Amplitude
    moving: bool
    works: list[ufl.Form]
    vector: Array = default(default_factory=lambda: np.zeros(0))
    time: float = np.nan

    @cached_property
    def forms(self) -> list[fem.Form]:
        """The compiled works: one form for each, that other bodies have too."""
        return [compiled(work) for work in self.works]


class Loads:
    """The nodal forces and charges that are given, at any time. Equation (5.29).

    Parameters
    ----------
    domain, body
        Mesh, and the loads on the body.
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
        for number, load in enumerate(body.loads):
            for work, moving in _works(domain, load, f"load.{number}", v, xi, self._time):
                kind = load.factor, moving
                share = next((s for s in self._shares if (s.amplitude, s.moving) == kind), None)
                if share is None:
                    self._shares.append(_Share(*kind, [work]))
                else:
                    share.works.append(work)

    def at(self, time: float) -> Array:
        """Return the owned nodal loads at a time. Collective where loads know the time."""
        if self._last is not None and self._last[0] == time:
            return self._last[1]
        total = np.zeros(self._owned)
        for share in self._shares:
            if np.isnan(share.time) or (share.moving and share.time != time):
                self._time.value = time
                share.vector = np.sum([assembled(f, self._owned) for f in share.forms], axis=0)
                share.time = time
            total += share.amplitude(time) * share.vector
        self._last = time, total
        return total


def assembled(form: fem.Form, owned: int) -> Array:
    """Return the owned part of an assembled vector, or this rank's part of a number. Collective."""
    if form.rank == 0:
        return np.array([fem.assemble_scalar(form)])
    vector = fem.assemble_vector(form)
    vector.scatter_reverse(InsertMode.add)
    return np.asarray(vector.array[:owned].copy())


def _works(
    domain: Domain, load: Load, key: str, v: Expr, xi: Expr | None, time: fem.Constant
) -> list[tuple[ufl.Form, bool]]:
    """Return the work of each part of a load, and whether it knows the time."""
    x = ufl.SpatialCoordinate(domain.mesh)
    measure = domain.dx if load.on is None else domain.ds(load.on)
    place = repr(load.on) if load.on is not None else "'the body'"
    for force in (load.density, load.force):
        if force is not None and len(force) != domain.dim:
            raise InputError(
                f"load on {place}: the force has {len(force)} components, the body has "
                f"{domain.dim}",
                "components",
            )
    if xi is None and any(name.endswith("charge") for name in load.named):
        raise InputError(f"load on {place}: a charge needs a piezoelectric material", "piezo")
    if domain.revolved and load.force is not None and not getattr(load.force[0], "is_zero", False):
        raise InputError(
            f"{key}.force.0: given one across the axis, where it cancels over the full turn; "
            "accepted: 0, or a traction or pressure",
            "value",
        )
    works = []
    vectors: dict[tuple[str, bool], list[Expr]] = {}
    for name, field in load.named.items():
        given = expression(domain, field, x, time, f"{key}.{name}")
        moving = isinstance(field, Moving)
        if name == "pressure":
            works.append((-given * ufl.dot(ufl.FacetNormal(domain.mesh), v), moving))
        elif name.endswith("charge"):
            place = "body" if load.on is None else "surface"
            works.append((electric_load(xi, **{place: given}), moving))
        else:
            kind, component = name.split(".")
            none = [constant(domain.mesh, 0.0) for _ in range(domain.dim)]
            vectors.setdefault((kind, moving), none)[int(component)] = given
    for (kind, moving), given in vectors.items():
        work = ufl.dot(ufl.as_vector(given), v)
        if kind == "force":
            size = volume(domain) if load.on is None else area(domain, load.on)
            work /= constant(domain.mesh, size)
        works.append((work, moving))
    return [(work * measure, moving) for work, moving in works]


def expression(
    domain: Domain, value: Field | Moving, x: Expr, time: float | fem.Constant, key: str
) -> Expr:
    """Return a given function at a time as UFL; a number becomes a form constant. Collective.

    Raises
    ------
    InputError
        On all ranks, with the key, if it is none on one.
    """
    with on_all_ranks(domain.comm), naming(key):
        found = at_time(value, time).ufl(x)
        if not isinstance(found, Expr):
            number = real(found, (), "a number, or UFL of one")
            check_finite(number.reshape(1), lambda _: "everywhere")
            return constant(domain.mesh, float(number))
        real(np.zeros(found.ufl_shape), (), "UFL of a number")
        for part in traverse_unique_terminals(found):
            if isinstance(part, ScalarValue):
                number = real(part.value(), (), "real UFL")
                check_finite(number.reshape(1), lambda _: "everywhere")
        if isinstance(found, ScalarValue | ufl.classes.Zero):
            return constant(domain.mesh, float(found))
        return found


def to_blame(loads: Sequence[Load], domain: Domain, time: float = 1.0) -> str:
    """Return the key of the first load whose integral is not finite, or too large. Collective.

    Where none is, for the quadrature meets other points with the test functions, the answer is
    ``load``.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    for i, load in enumerate(loads):
        measure = domain.dx if load.on is None else domain.ds(load.on)
        for name, field in load.named.items():
            form = compiled(expression(domain, field, x, time, f"load.{i}.{name}") * measure)
            value = domain.comm.allreduce(float(fem.assemble_scalar(form)), op=MPI.SUM)
            if not abs(value) <= HUGE:
                return f"load.{i}.{name}"
    return "load"
