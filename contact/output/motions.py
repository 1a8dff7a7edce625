"""How rigid bodies have moved, the potentials of electrodes, and what acts on them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from contact.body.global_unknowns import Member
from contact.body.rigid import Electrode
from contact.problem.kkt import residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


def movements(problem: ContactProblem, state: State) -> dict[str, Any]:
    """Return what a summary says of them, nothing where nothing moves. Collective.

    ``rigid`` is the foundation that moves; of several it has one entry each, by part.
    ``rigid_parts`` are the parts that move as rigid bodies, ``electrodes`` those of unknown
    potential. Rotations are in degrees. Forces, moments and charges are what acts on them from
    outside: those given, or what holds a component that is given.
    """
    foundations: dict[str, Any] = {}
    parts: dict[str, Any] = {}
    electrodes: dict[str, Any] = {}
    for member, values, forces in _members(problem, state):
        if isinstance(member.what, Electrode):
            electrodes[member.what.on] = {"potential": values[0], "charge": forces[0]}
            continue
        d = len(member.what.motion.displacement)
        said = {
            "displacement": values[:d].tolist(),
            "rotation": _one_or_more(np.rad2deg(values[d:])),
            "force": forces[:d].tolist(),
            "moment": _one_or_more(forces[d:]),
        }
        (foundations if member.foundation else parts)[member.what.on] = said
    rigid = next(iter(foundations.values())) if len(foundations) == 1 else foundations
    found = {"rigid": rigid, "rigid_parts": parts, "electrodes": electrodes}
    return {key: value for key, value in found.items() if value}


def rigid_columns(problem: ContactProblem, state: State) -> dict[str, dict[str, float]]:
    """Return the columns of the foundations that move, and of electrodes. Collective.

    They are `moved` (displacements and rotations), `acting` (forces and moments) and
    `potentials`. Of several foundations the names have that of the part behind them.
    """
    found: dict[str, dict[str, float]] = {"moved": {}, "acting": {}, "potentials": {}}
    several = sum(member.foundation for member in problem.equilibrium.global_unknowns.members) > 1
    for member, values, forces in _members(problem, state):
        part, d = member.what.on, problem.dim
        if isinstance(member.what, Electrode):
            found["potentials"][f"potential_{part}"] = float(values[0])
        elif member.foundation:
            turns = ["rotation"] if d == 2 else [f"rotation_{axis}" for axis in "xyz"]
            moments = ["moment"] if d == 2 else [f"moment_{axis}" for axis in "xyz"]
            axes, forced = (
                [*"xyz"[:d], *turns],
                [*(f"force_{axis}" for axis in "xyz"[:d]), *moments],
            )
            moved = np.concatenate([values[:d], np.rad2deg(values[d:])])
            for kind, names, numbers in (("moved", axes, moved), ("acting", forced, forces)):
                for name, number in zip(names, numbers, strict=True):
                    column = f"rigid_{name}" + (f"_{part}" if several else "")
                    found[kind][column] = float(number)
    return found


def _members(problem: ContactProblem, state: State) -> Iterator[tuple[Member, Array, Array]]:
    """Give rigid bodies and electrodes with their values, and what acts on them."""
    body = problem.equilibrium
    global_unknowns, q = body.global_unknowns, body.motion(state.x)
    if global_unknowns.size == 0:
        return
    residual = residual_forces(problem, state)
    forces = body.motion(residual) + global_unknowns.gathered(residual[: body.owned])
    forces += global_unknowns.forces(state.time)
    for member in global_unknowns.members:
        units, own = member.units, forces[member.columns]
        if problem.domain.revolved and not isinstance(member.what, Electrode):
            # Over the full turn what acts across the axis, and about it, cancels.
            own = np.where(np.arange(own.size) == 1, own, 0.0)
        yield member, q[member.columns] * units, own / units


def _one_or_more(values: Array) -> Any:
    return float(values[0]) if values.size == 1 else values.tolist()
