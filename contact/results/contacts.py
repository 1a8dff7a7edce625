"""Results of each contact: force, area, pressures, stick and slip, dissipation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.problem.energy import dissipated
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.resultants import resultant
from contact.typing import Array


@dataclass(frozen=True)
class ContactShare:
    """The results of one contact, as they stand in the summary.

    Attributes
    ----------
    force, moment
        Of the body on its foundation, or on the other body, see `Resultant`.
    area
        Tributary areas of the nodes that touch (length^(d - 1)).
    max_pressure, mean_pressure
        The largest contact pressure, and the mean over that area (stress).
    stick, slip
        Shares of that area.
    dissipation
        Of friction in the step (work).
    """

    force: Array
    moment: Array
    area: float
    max_pressure: float
    mean_pressure: float
    stick: float
    slip: float
    dissipation: float


def contact_shares(
    problem: ContactProblem, state: State, status: NDArray[np.str_]
) -> dict[str, ContactShare]:
    """Return the results of each contact, by its name. Collective.

    Parameters
    ----------
    problem, state
        The problem, and its solution.
    status
        "open", "stick" or "slip" of each owned contact node, shape (n,).
    """
    nodes, nodal = problem.nodes, problem.nodal(state)
    pressure = problem.interface.pressure(nodal, state.forces)
    forces = nodes.weight[:, None] * problem.interface.stress(nodal, state.forces)
    found = {}
    for number, contact in enumerate(problem.contacts):
        own = problem.entry_numbers == number
        total = resultant(problem, nodes.points[own], forces[own])
        stick, slides = (nodes.sum(own & (status == name)) for name in ("stick", "slip"))
        area = stick + slides
        found[contact.name] = ContactShare(
            total.force,
            total.moment,
            area,
            nodes.maximum(np.where(own, pressure, 0.0)),
            nodes.sum(np.where(own, pressure, 0.0)) / area if area > 0 else 0.0,
            stick / area if area > 0 else 0.0,
            slides / area if area > 0 else 0.0,
            dissipated(problem, state, own),
        )
    return found


def contact_columns(shares: Mapping[str, ContactShare]) -> dict[str, float]:
    """Return the results of each of several contacts as columns: ``contact_force_x_NAME``."""
    found: dict[str, float] = {}
    for name, share in shares.items():
        found |= {f"contact_force_{x}_{name}": float(f) for x, f in zip("xyz", share.force)}
        if share.moment.size == 1:
            found[f"contact_moment_{name}"] = float(share.moment[0])
        else:
            moments = zip("xyz", share.moment, strict=True)
            found |= {f"contact_moment_{x}_{name}": float(m) for x, m in moments}
        found[f"contact_area_{name}"] = share.area
        for key in ("max_pressure", "mean_pressure", "stick", "slip", "dissipation"):
            found[f"{key}_{name}"] = getattr(share, key)
    return found
