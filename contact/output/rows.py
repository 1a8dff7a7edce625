"""What a row says of a solution: of a step of an evolution, of a case of a sweep."""

from __future__ import annotations

from contact.output.balances import charge_balance
from contact.output.motions import rigid_columns
from contact.output.solution import Solution
from contact.output.summary import count, largest_displacement
from contact.output.table import Table


def contact_columns(solution: Solution, table: Table | None) -> dict[str, float]:
    """Return forces, pressures and what the contact nodes do. Collective.

    Parameters
    ----------
    solution, table
        The solution, and its contact table; None on ranks other than 0.
    """
    problem, counts = solution.problem, count(solution.problem.comm, table)
    force = zip("xyz", solution.contact_force, strict=False)
    return {
        **{f"contact_force_{axis}": float(component) for axis, component in force},
        "max_pressure": problem.nodes.maximum(solution.pressure),
        "contact_nodes": counts["stick"] + counts["slip"],
        "stick_nodes": counts["stick"],
        "slip_nodes": counts["slip"],
        "max_displacement": largest_displacement(solution),
    }


def moving_columns(solution: Solution) -> dict[str, float]:
    """Return what moves as a rigid body, and potentials and charges of electrodes. Collective."""
    problem, state = solution.problem, solution.state
    columns = rigid_columns(problem, state)
    if problem.piezoelectric:
        charges = charge_balance(problem, state)
        columns |= {f"charge_{part}": charge for part, charge in charges.electrodes.items()}
        columns["charge_foundation"] = charges.foundation
    return columns
