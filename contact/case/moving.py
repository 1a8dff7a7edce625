"""Checks of what moves as a rigid body, and of electrodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

from contact.case.rigid import NOTHING, Moving
from contact.case.types import Words, as_given, fault
from contact.mesh.together import meet

#: `contact.case.file.Case`.
Case: TypeAlias = Any


def moving(case: Case) -> Iterator[tuple[str, Moving]]:
    """Give the sections about rigid motions, with their keys."""
    for path, contact in case.contacts:
        if contact.rigid is not None:
            yield f"{path}.rigid", contact.rigid
    for i, part in enumerate(case.rigid):
        yield f"rigid.{i}", part


def check_moving(case: Case) -> None:
    """Raise a fault if a part is rigid or an electrode twice, or an electrode has no field."""
    touched = [contact.on for _, contact in case.contacts]
    for i, part in enumerate(case.rigid):
        if any(meet(part.on, other) for other in touched):
            raise fault(f"rigid.{i}.on", part.on, "a part beside the contact part")
    if case.space.kinematics == "axisymmetric":
        for path, motion in moving(case):
            _check_along_axis(path, motion)
    for key in ("rigid", "electrode"):
        parts = [section.on for section in getattr(case, key)]
        for i, on in enumerate(parts):
            if any(meet(on, other) for other in parts[:i]):
                raise fault(f"{key}.{i}.on", on, f"a part that no other [[{key}]] has")
    if case.electrode and not any(material.piezoelectric for _, material in case.materials):
        raise fault("electrode", Words("given"), "electric quantities with [material.piezo] only")
    held = [fixed.on for fixed in case.fixed if fixed.potential is not None]
    for i, section in enumerate(case.electrode):
        if any(meet(section.on, other) for other in held):
            raise fault(f"electrode.{i}.on", section.on, "a part whose potential is not fixed")


def _check_along_axis(path: str, section: Moving) -> None:
    """Raise a fault if something moves otherwise than along the axis of a body of revolution."""
    across = (section.displacement or (NOTHING,))[0]
    if across != NOTHING:
        accepted = "0 across the axis of a body of revolution"
        raise fault(f"{path}.displacement.0", as_given(across), accepted)
    if any(turn != NOTHING for turn in section.turns):
        raise fault(f"{path}.rotation", Words("given"), "no rotation of a body of revolution")
