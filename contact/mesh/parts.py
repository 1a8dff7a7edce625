"""Names of parts: several parts under one name, and facets by the parts that they are in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from mpi4py import MPI

from contact.errors import InputError, nearest
from contact.mesh.entities import Indices, combinations

ACCEPTED = "the name of a part, or a list of names"


class Together(str):
    """The name of several parts together: their names with + between, one word in tables.

    Attributes
    ----------
    members
        The parts.
    """

    __slots__ = ("members",)

    members: tuple[str, ...]

    def __new__(cls, members: Iterable[str]) -> Together:
        """Join names."""
        names = tuple(members)
        made = super().__new__(cls, "+".join(names))
        made.members = names
        return made

    def __getnewargs__(self) -> tuple[tuple[str, ...]]:  # type: ignore[override]
        """Return the names, of which copies are made: a text alone does not say where one ends."""
        return (self.members,)


def part(given: str | Sequence[str]) -> str:
    """Return the name of a part, or of several together, of a name or a list of names."""
    names = [given] if isinstance(given, str) else given
    named = isinstance(names, list | tuple) and all(isinstance(n, str) and n for n in names)
    if not named or not names:
        raise InputError(f"given {given!r}; accepted: {ACCEPTED}", "value")
    different = list(dict.fromkeys(names))
    return different[0] if len(different) == 1 else Together(different)


def members(name: str) -> tuple[str, ...]:
    """Return the parts that a name stands for."""
    return name.members if isinstance(name, Together) else (name,)


def meet(one: str, other: str) -> bool:
    """Tell whether two names have a part in common."""
    return not set(members(one)).isdisjoint(members(other))


def disjoint_pieces(
    comm: MPI.Intracomm, count: int, parts: Iterable[Indices]
) -> list[tuple[tuple[int, ...], Indices]]:
    """Divide the facets 0, ..., count - 1 into pieces in the same of some parts. Collective.

    A piece is the parts by their positions, and the facets in exactly these; all ranks have the
    same ones in the same order, some without facets.
    """
    numbers, combined = combinations(count, parts)
    own = {combined[k]: np.flatnonzero(numbers == k).astype(np.int32) for k in np.unique(numbers)}
    there = sorted(set().union(*comm.allgather(tuple(own))) - {()})
    return [(found, own.get(found, np.empty(0, dtype=np.int32))) for found in there]


def known_name(kind: str, name: str, names: Mapping[str, Indices]) -> str:
    """Return a name, or raise an InputError with the nearest one and all names."""
    if name in names:
        return name
    hint = nearest(str(name), names, "; did you mean '{}'?")
    raise InputError(
        f"the mesh has no {kind} {name!r}{hint} (its {kind}s: {', '.join(sorted(names))})",
        "part-name",
    )
