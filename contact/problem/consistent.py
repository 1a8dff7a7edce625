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

from contact.body.description import Fixed
from contact.body.fields import values_at
from contact.body.loads import to_blame
from contact.errors import InputError
from contact.kinds import check_range
from contact.problem.held import check_held
from contact.problem.problem import ContactProblem
from contact.tolerances import HUGE

#: Share of values up to which they are the same.
ROUNDING = 1e-9

#: Of numbers of the size of the body, or of the potential at strains of 1.
EPS = float(np.finfo(float).eps)


def check_problem(problem: ContactProblem) -> None:
    """Check loads, supports and what holds the body, at the time of a problem. Collective.

    Raises
    ------
    InputError
        If a load acts on a contact part or is no finite number, two supports contradict each
        other, or `check_held` finds that the body can move.
    """
    _check_loads(problem)
    check_supports(problem)
    check_held(problem)


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
    _check_sizes(problem)


def _check_sizes(problem: ContactProblem) -> None:
    """Refuse loads that are no numbers, or too large for them. Collective."""
    given, domain, time = problem.body.loads, problem.domain, problem.time
    loads = problem.equilibrium.external(time)
    if not domain.comm.allreduce(bool(np.isfinite(loads).all()), op=MPI.LAND):
        key = to_blame(given, domain, time)
        raise InputError(
            f"{key}: a formula is not finite everywhere on its part; accepted: a formula, or a "
            "function, that is"
        )
    largest = domain.comm.allreduce(float(np.abs(loads).max(initial=0.0)), op=MPI.MAX)
    if largest > HUGE:
        check_range(to_blame(given, domain, time), largest)


def check_supports(problem: ContactProblem) -> None:
    """Refuse different values for one component of what is part of two supports. Collective.

    Where parts meet at an edge values may differ: there the last one counts.

    Raises
    ------
    InputError
        If they differ at the time of the problem by more than rounding.
    """
    d, space, time = problem.dim, problem.equilibrium.space, problem.time
    for (i, first), (j, last) in combinations(enumerate(problem.body.fixed), 2):
        one, other = _prescribed(first), _prescribed(last)
        names = one.keys() & other.keys()
        facets, shared = _shared(problem, first.on, last.on)
        if not shared:
            continue
        nodes = fem.locate_dofs_topological(space, d - 1, facets)
        points = space.tabulate_dof_coordinates()[nodes, :d]
        for name in sorted(names):
            values = np.column_stack(
                [
                    fixed.factor(time)
                    * values_at(given[name], points, time, f"fixed.{n}.{name}", problem.comm)
                    for n, fixed, given in ((i, first, one), (j, last, other))
                ]
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
