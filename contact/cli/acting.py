"""Loads, prescribed values and gaps of a problem over time, as `contact check` prints them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from contact.body.global_unknowns import Member
from contact.cli.geometry import table, vector
from contact.model.body import Electrode
from contact.model.rigid import Rigid
from contact.problem.checks import expected_displacements
from contact.problem.problem import ContactProblem
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Displacements above this share of the body are not small.
LARGE = 0.05
#: Loads over the contact part and Young's modulus from which on units are asked for: sharp
#: indenters come to a tenth.
SOFT = 0.25


#: Words for components that have no displacement given, or no force.
WORDS = {True: "free", False: "held"}


class Row(NamedTuple):
    """One thing that acts, or would if its size were not 0.

    Attributes
    ----------
    where, text
        The thing, and its values in words.
    size
        Of its values, by which those of several times are compared.
    moves
        Whether it prescribes a displacement.
    """

    where: str
    text: str
    size: float
    moves: bool = False


def acting(problem: ContactProblem, times: Sequence[float]) -> list[str]:
    """Return lines on all that acts at some times, and warnings of these. Collective.

    Each thing is told at the time at which it is largest, and not at all if it is 0 at all times.
    """
    comm, size = problem.comm, problem.domain.size
    gap = problem.interface.gap
    gap = np.where(np.abs(gap) < NEGLIGIBLE * size, 0.0, gap)  # rounding is no gap
    least = comm.allreduce(float(gap.min(initial=np.inf)), op=MPI.MIN)
    largest = comm.allreduce(float(gap.max(initial=-np.inf)), op=MPI.MAX)
    problems = [problem.at(time) for time in times]
    lines, forces = [], False
    for seen in zip(*map(_rows, problems), strict=True):
        time, row = max(zip(times, seen, strict=True), key=lambda pair: pair[1].size)
        if row.size > 0:
            forces |= not row.moves
            lines.append([row.where, row.text, f"at t = {time:g}" if len(times) > 1 else ""])
    if not lines and least >= 0:
        return ["# warning: nothing is loaded or moved: all results will be 0"]
    loads = [now.equilibrium.external(now.time) for now in problems]
    given = [now.equilibrium.prescribe(now.equilibrium.rest(), now.time) for now in problems]
    pairs = [expected_displacements(problem, *both) for both in zip(loads, given, strict=True)]
    pressed, moved = (max(values) / size for values in zip(*pairs, strict=True))
    over = " (below 0: an overlap, which is pressed apart)" if least < 0 else ""
    return [
        "# acting:",
        *table([*lines, ["gap", f"{least:.4g} to {largest:.4g}{over}", ""]]),
        *_warnings(pressed, moved, beyond=least > 10 * moved * size and not forces),
    ]


def _warnings(pressed: float, moved: float, beyond: bool) -> Iterator[str]:
    """Give warnings of loads and displacements that are large, and of a gap that is."""
    if moved > LARGE:
        yield (
            f"# warning: displacements of {moved:.0%} of the body are prescribed, and "
            "strains are taken as small"
        )
    if pressed > SOFT:
        yield (
            f"# warning: the loads over the area of the contact part are {pressed:.0%} of Young's "
            "modulus, and strains are taken as small; are both in the same units?"
        )
    if beyond:
        yield "# warning: the gap is far larger: the body may not touch at all"


def _rows(problem: ContactProblem) -> list[Row]:
    """Return all that may act at the time of a problem, the same things at all. Collective."""
    body, comm, d = problem.equilibrium, problem.comm, problem.dim
    unknowns, time = body.global_unknowns, problem.time

    def largest(values: Array) -> float:
        return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX))

    loads = body.nodal(body.external(time))
    given = body.nodal(body.prescribe(body.rest(), time))[: len(unknowns.tied)]
    given = np.where(unknowns.tied, 0.0, given)
    charge = np.abs(loads[:, d:] / body.phi_scale).sum()
    charge = float(comm.allreduce(float(charge), op=MPI.SUM))
    moved, raised = largest(given[:, :d]), largest(given[:, d:] * body.phi_scale)
    return [
        _forces("loads", loads[:, :d], problem),
        Row("charges", f"{charge:.4g} in all", charge),
        Row("supports", f"displacements of up to {moved:.4g}", moved, moves=True),
        Row("supports", f"potentials of up to {raised:.4g}", raised),
        *(row for member in unknowns.members for row in _member(member, time)),
        *_foundations(problem),
    ]


def _forces(where: str, nodal: Array, problem: ContactProblem) -> Row:
    """Return the resultant of nodal forces, (nodes, d). Collective."""
    total = np.asarray(problem.comm.allreduce(nodal.sum(axis=0), op=MPI.SUM))
    size = float(problem.comm.allreduce(float(np.abs(nodal).sum()), op=MPI.SUM))
    total = problem.domain.resultant(total)
    balanced = np.abs(total).max() <= NEGLIGIBLE * size
    text = (
        f"forces of {size:.4g} in all, which balance" if balanced else f"resultant {vector(total)}"
    )
    return Row(where, text, size)


def _member(member: Member, time: float) -> list[Row]:
    """Return the given motions and forces of a rigid body, the charge of an electrode, a bolt's."""
    given, where = member.description, f"{member.description.name} {member.description.on!r}"
    names: tuple[tuple[str, ...], ...] = (("shortening",), ("force",))
    if isinstance(given, Electrode):
        names = (("potential",), ("charge",))
    if isinstance(given, Rigid):
        where = f"foundation of {given.on!r}" if given.foundation else f"rigid part {given.on!r}"
        names = (("displacement", "rotation"), ("force", "moment"))
    d = len(given.displacement or ()) if isinstance(given, Rigid) else 1
    values = [member.given(time) * member.units, member.forces(time) / member.units]
    values[0][d:] = np.rad2deg(values[0][d:])
    rows = []
    for moves, kinds, every in zip((True, False), names, values, strict=True):
        told = [f"{value:.4g}" for value in every]
        told = [t if f != moves else WORDS[moves] for t, f in zip(told, member.free, strict=True)]
        for name, own, texts in zip(
            kinds, np.split(every, [d]), (told[:d], told[d:]), strict=False
        ):
            one = texts[0] if len(texts) == 1 else f"({', '.join(texts)})"
            text = f"{name} {one}{' degrees' if name == 'rotation' else ''}"
            rows.append(Row(where, text, np.abs(own).max(), moves))
    return rows


def _foundations(problem: ContactProblem) -> list[Row]:
    """Return the potentials of foundations, and the forces of layers before any motion."""
    body, start = problem.equilibrium, problem.start()
    forces = np.zeros(body.owned + body.global_unknowns.size)
    problem.interface.add_forces(forces, body.rest(), start.forces)
    found = [
        (contact.on, float(np.abs(contact.conductor.at(problem.time).phi_f).max(initial=0.0)))
        for contact in problem.contacts
        if contact.conductor is not None
    ]
    return [
        _forces("layers", -body.nodal(forces)[:, : problem.dim], problem),
        *(Row(f"foundation of {on!r}", f"potential {phi:.4g}", phi) for on, phi in found),
    ]
