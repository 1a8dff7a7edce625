"""Loads: the work of given forces and charges."""

from __future__ import annotations

import ufl
from ufl.core.expr import Expr

from contact.body.constants import constant
from contact.body.description import Body, Field
from contact.errors import InputError
from contact.mesh.domain import Domain
from forms.piezo import electric_load


def external_work(domain: Domain, body: Body, v: Expr, xi: Expr | None) -> ufl.Form | None:
    """Return the work of loads and charges, equation (5.29), or None without any.

    Parameters
    ----------
    domain, body
        Mesh, and what acts on the body.
    v, xi
        Test functions of the displacement and the potential; None for a body without.

    Raises
    ------
    InputError
        If a part is missing, a force has the wrong length, or a charge acts on a body without
        a potential.
    """
    x = ufl.SpatialCoordinate(domain.mesh)
    total: ufl.Form | None = None
    for load in body.loads:
        measure = domain.dx if load.on is None else domain.ds(load.on)
        place = repr(load.on) if load.on is not None else "'the body'"
        terms = []
        if load.force is not None:
            if len(load.force) != domain.dim:
                raise InputError(
                    f"load on {place}: the force has {len(load.force)} components, the body has "
                    f"{domain.dim}"
                )
            terms += [expression(domain, f, x) * v[i] for i, f in enumerate(load.force)]
        if load.pressure is not None:
            nu = ufl.FacetNormal(domain.mesh)
            terms.append(-expression(domain, load.pressure, x) * ufl.dot(nu, v))
        if load.charge is not None:
            if xi is None:
                raise InputError(f"load on {place}: a charge needs a piezoelectric material")
            charge = expression(domain, load.charge, x)
            given = {"body": charge} if load.on is None else {"surface": charge}
            terms.append(electric_load(xi, **given))
        for term in terms:
            total = term * measure if total is None else total + term * measure
    return total


def expression(domain: Domain, value: Field, x: Expr) -> Expr:
    """Return a given function as UFL; a number becomes a form constant."""
    found = value.ufl(x)
    if isinstance(found, int | float | ufl.constantvalue.ScalarValue | ufl.classes.Zero):
        return constant(domain.mesh, float(found))
    return found
