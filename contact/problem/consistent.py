"""Checks that what is given does not contradict itself, before anything is solved.

Cases and problems that are put together in Python are checked here alike.
"""

from __future__ import annotations

from itertools import combinations, product
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.amplitude import values_at
from contact.body.description import Fixed
from contact.errors import InputError
from contact.problem.blame import to_blame
from contact.problem.held import check_held
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Share of values up to which they are the same.
ROUNDING = 1e-9

#: Of numbers of the size of the body, or of the potential at strains of 1.
EPS = float(np.finfo(float).eps)


def check_problem(problem: ContactProblem) -> None:
    """Check loads, supports and what holds the body, at the time of a problem. Collective.

    Raises
    ------
    InputError
        If a load or a prescribed value is no number, a load acts on a contact part, two supports
        contradict each other, or `check_held` finds that the body can move.
    """
    check_finite(problem)
    _check_loads(problem)
    check_supports(problem)
    check_held(problem)


def check_finite(problem: ContactProblem) -> None:
    """Refuse loads and prescribed values that are no numbers at the time of a problem. Collective.

    Raises
    ------
    InputError
        If some are; it names the first one, and of prescribed values a point.
    """
    body, time = problem.body, problem.time
    factors = {f"load.{i}": load.factor(time) for i, load in enumerate(body.loads)}
    factors |= {f"fixed.{i}": fixed.factor(time) for i, fixed in enumerate(body.fixed)}
    for name, factor in factors.items():
        if not np.isfinite(factor):
            raise InputError(
                f"{name}.amplitude: {factor:g} at t = {time:g}; accepted: a function of time "
                "whose values are finite"
            )
    loads = problem.equilibrium.external(time)
    if not problem.comm.allreduce(bool(np.isfinite(loads).all()), op=MPI.LAND):
        raise InputError(
            f"{to_blame(problem)}: a formula is not finite everywhere on its part; accepted: a "
            "formula, or a function, that is"
        )
    for i, fixed in enumerate(body.fixed):
        points = _points(problem, problem.domain.facets(fixed.on))
        for name, given in _prescribed(fixed).items():
            wrong = ~np.isfinite(_values(problem, fixed, given, points))
            found = np.concatenate(problem.comm.allgather(points[wrong][:1]))
            if found.size > 0:
                place = ", ".join(f"{x:g}" for x in found[0] + 0.0)  # no -0
                raise InputError(
                    f"fixed.{i}.{name}: not finite at ({place}); accepted: a number, formula or "
                    "function that is"
                )


def _points(problem: ContactProblem, facets: NDArray[np.int32]) -> Array:
    """Return the nodes of facets, shape (n, d)."""
    space = problem.equilibrium.space
    nodes = fem.locate_dofs_topological(space, problem.dim - 1, facets)
    return space.tabulate_dof_coordinates()[nodes, : problem.dim]


def _values(problem: ContactProblem, fixed: Fixed, given: Any, points: Array) -> Array:
    """Return prescribed values at points and the time of the problem. Collective."""
    return fixed.factor(problem.time) * values_at(given, points, problem.time)


def _shared(problem: ContactProblem, one: str, other: str) -> tuple[NDArray[np.int32], bool]:
    """Return the facets of this rank that two parts share, and whether any rank has some."""
    domain = problem.domain
    shared = np.intersect1d(domain.facets(one), domain.facets(other))
    return shared, domain.comm.allreduce(shared.size > 0, op=MPI.LOR)


def _check_loads(problem: ContactProblem) -> None:
    """Refuse loads on Gamma_3, where the foundation alone acts: Gamma_2 and Gamma_b exclude it."""
    for contact, (i, load) in product(problem.contacts, enumerate(problem.body.loads)):
        if load.on is not None and _shared(problem, load.on, contact.on)[1]:
            raise InputError(
                f"load.{i}.on: {load.on} shares facets with the contact part {contact.on}; "
                "accepted: parts beside it, or body forces"
            )


def check_supports(problem: ContactProblem) -> None:
    """Refuse different values for one component of what is part of two supports. Collective.

    Where parts meet at an edge values may differ: there the last one counts.

    Raises
    ------
    InputError
        If they differ at the time of the problem by more than rounding.
    """
    time = problem.time
    for (i, first), (j, last) in combinations(enumerate(problem.body.fixed), 2):
        one, other = _prescribed(first), _prescribed(last)
        names = one.keys() & other.keys()
        facets, shared = _shared(problem, first.on, last.on)
        if not shared:
            continue
        points = _points(problem, facets)
        for name in sorted(names):
            pair = (first, one), (last, other)
            values = np.column_stack(
                [_values(problem, fixed, given[name], points) for fixed, given in pair]
            )
            size = float(np.abs(values).max(initial=0.0))
            size = problem.comm.allreduce(size, op=MPI.MAX)
            # Rounding of what could be, such as sin(pi), is no value.
            unit = problem.equilibrium.phi_scale if name == "potential" else 1.0
            allowed = ROUNDING * size + EPS * unit * problem.domain.size
            differ = np.ptp(values, axis=1) > allowed
            found = np.concatenate(problem.comm.allgather(values[differ][:1])) + 0.0  # no -0
            if found.size > 0:
                when = "" if time == 1.0 else f" at t = {time:g}"
                raise InputError(
                    f"fixed.{j}.{name}: {found[0, 1]:g} on {last.on}; accepted: {found[0, 0]:g}, "
                    f"as fixed.{i} has there{when}"
                )


def _prescribed(fixed: Fixed) -> dict[str, Any]:
    """Return the fields of a support by their keys."""
    given = {f"displacement.{k}": field for k, field in enumerate(fixed.displacement or ())}
    given["potential"] = fixed.potential
    return {name: field for name, field in given.items() if field is not None}
