"""What a solution is worth: what there is to say about it, collected."""

from __future__ import annotations

import logging

from contact.output import assumptions, bodies, uniqueness
from contact.output.deformation import deformation
from contact.output.fields import DerivedFields
from contact.output.looseness import adrift, looseness
from contact.output.penalties import giving_way
from contact.output.solution import Solution

logger = logging.getLogger("contact.solve")


def announce(solution: Solution) -> None:
    """Review a solution, and log what there is to beware of; what is good in detail. Collective."""
    review(solution)
    if solution.problem.comm.rank == 0:
        for note in solution.notes:
            logger.debug(note)
        for warning in solution.warnings:
            logger.warning(warning)


def review(solution: Solution) -> None:
    """Add what there is to say to the notes and warnings of a solution. Collective."""
    body, x = solution.problem.equilibrium, solution.state.x
    extremes = DerivedFields(body, solution.state).extremes()
    solution.max_dev_strain = max(largest.strain for largest in extremes)
    solution.max_von_mises = max(largest.von_mises for largest in extremes)
    if any(largest.yields for largest in extremes):
        solution.share_beyond_yield = sum(largest.yielded for largest in extremes) / sum(
            largest.volume for largest in extremes
        )
    solution.deformation = deformation(body, x)
    for text, good in (
        *assumptions.monotonicity(solution, [largest.strain for largest in extremes]),
        assumptions.small_strain(solution),
        assumptions.chords(solution),
        assumptions.coarse_curves(solution),
        assumptions.fitting(solution.problem),
        assumptions.preload(solution),
        assumptions.falling(solution),
        assumptions.untouched(solution),
        assumptions.resolution(solution),
        assumptions.rounding(solution),
        assumptions.unknown_pressures(solution),
        assumptions.beside_loads(solution),
        uniqueness.theorem(solution),
        uniqueness.sliding(solution),
        *uniqueness.conductivity(solution),
        uniqueness.ramp(solution),
        *bodies.choices(solution),
        bodies.passing(solution.problem),
        bodies.regions(solution),
        looseness(solution),
        adrift(solution),
        giving_way(solution),
    ):
        if text:
            (solution.notes if good else solution.warnings).append(text)
