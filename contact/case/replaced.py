"""What a case need not say because Python replaces it by an object."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from contact.case.mesh import Mesh
from contact.errors import InputError

#: Key of the case -> the arguments of `build_problem` of which one replaces it.
REPLACEABLE = {
    "mesh": ("domain",),
    "material": ("law",),
    "friction.mu": ("coefficient", "friction"),
}


def replaced_by(arguments: Collection[str]) -> tuple[str, ...]:
    """Return the keys that arguments of `build_problem` replace."""
    return tuple(key for key, names in REPLACEABLE.items() if set(names) & set(arguments))


def stand_ins(
    data: Mapping[str, Any], without: Collection[str]
) -> tuple[dict[str, Any], list[str]]:
    """Fill what is missing and will be replaced, so that the rest can be checked.

    Returns
    -------
    The tables, and the keys that were filled.

    Raises
    ------
    InputError
        If a key is none that can be replaced.
    """
    made, filled = dict(data), []
    for key in without:
        if key not in REPLACEABLE:
            raise InputError(f"without: given {key!r}; accepted: {', '.join(REPLACEABLE)}")
        table = made.get("friction")
        if key == "friction.mu":
            if isinstance(table, Mapping) and table.get("law") == "coulomb" and "mu" not in table:
                made["friction"] = {**table, "mu": 0.0}
                filled.append(key)
        elif key not in made:
            made[key] = Mesh.absent() if key == "mesh" else {"young": 1.0, "poisson": 0.0}
            filled.append(key)
    return made, filled


def check_replaced(filled: Collection[str], arguments: Mapping[str, Any]) -> None:
    """Refuse to go on with what stands in for an object that is not there.

    Raises
    ------
    InputError
        If a key that was filled is replaced by nothing.
    """
    for key in filled:
        names = REPLACEABLE[key]
        if all(arguments[name] is None for name in names):
            raise InputError(
                f"{key}: missing; accepted: it in the case, or {' or '.join(names)}=... in Python"
            )
