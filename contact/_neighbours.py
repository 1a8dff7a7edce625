"""The packages beside this one: whether they are ours, or files of somebody's that hide them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from contact.errors import InputError

NAMES = ("forms", "meshes")


def check_neighbours() -> None:
    """Refuse to go on with another's ``forms`` or ``meshes``, as from the working folder.

    Raises
    ------
    InputError
        If one of them is not where this package is, or missing.
    """
    root = Path(__file__).resolve().parents[1]
    for name in NAMES:
        spec = find_spec(name)
        places = [] if spec is None else [spec.origin, *(spec.submodule_search_locations or [])]
        origin = next((place for place in places if place is not None), None)
        if origin is None or not Path(origin).resolve().is_relative_to(root / name):
            given = f"{Path(origin)} hides" if origin else "there is not"
            raise InputError(
                f"{given} the package {name!r} of contact-fenicsx, {root / name}; accepted: "
                "another name for that file or folder, or another folder to run in"
            )
