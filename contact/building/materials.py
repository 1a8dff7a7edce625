"""From the sections `[material]` of a case to the materials of a body."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from contact.body.description import Material
from contact.case import file as sections
from contact.case.messages import describe
from contact.errors import InputError
from contact.kinds import check_range, expect
from contact.mesh.domain import Domain
from contact.typing import Array
from forms.crystal import in_plane, isotropic_about_x3, stiffness_tensor, to_axis
from forms.elasticity import Anisotropic
from forms.hencky import Law, Linear, Log
from forms.piezo import Piezo, from_voigt

#: Units of a case -> that of stress in Pa. Lengths and charges are SI; so is the potential times
#: the coupling, which has the unit of stress times length.
UNITS = {"SI": 1.0, "GPa": 1e9}


def make_materials(case: sections.Case, domain: Domain, law: Law | None) -> list[Material]:
    """Return the materials of a case in the axes of the body.

    Parameters
    ----------
    case, domain
        The case and its mesh.
    law
        Replaces the law of the only material; None for that of the case.

    Raises
    ------
    InputError
        If a law is given for several materials, a size overflows, or a crystal is none of a body
        of revolution.
    """
    if law is not None and len(case.materials) > 1:
        raise InputError("law: a law given beside the case replaces one material, not several")
    made = []
    for key, section in case.materials:
        if domain.revolved:
            _check_round(key, section)
        given = _made(section, domain.dim)
        this = given if law is None else replace(given, law=law)
        check_range(f"{key}.young", float(this.law.young))
        made.append(this)
    return made


def make_material(dim: int, **keys: Any) -> Material:
    """Return what `[material]` of a case file with some keys stands for.

    Parameters
    ----------
    dim
        Dimension of the body, whose axes crystals are turned into: 2 or 3.
    keys
        Keys of the section: ``name="PZT-4"`` with ``poling``, or ``young``, ``poisson`` and
        ``piezo={"e31": ..., ...}``; ``on``, a region or a list of regions.

    Raises
    ------
    InputError
        As for a case file.
    """
    expect("make_material: dim", dim, "2 or 3", dim in (2, 3))
    plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in keys.items()}
    try:
        section = sections.Material.model_validate(plain)
    except ValidationError as error:
        raise InputError(describe(error, sections.Material, "make_material")) from None
    key, axis = section.axis
    accepted = "an angle from x in degrees" if dim == 2 else f"a vector of {dim} numbers"
    expect(f"make_material: {key}", axis, accepted, axis is None or np.ndim(axis) == dim - 2)
    return _made(section, dim)


def _made(section: sections.Material, dim: int) -> Material:
    turn = rotation(section.axis[1], dim)
    return Material(material_law(section, turn), piezo(section, turn), section.on or ())


def rotation(axis: float | tuple[float, ...] | None, dim: int) -> Array:
    """Return the rotation of a crystal into a body of dimension d; X3 points along an axis."""
    if dim == 2:
        return in_plane(90.0 if axis is None else float(axis))  # type: ignore[arg-type]
    return np.eye(3) if axis is None else to_axis(axis)


def material_law(section: sections.Material, turn: Array) -> Law:
    """Return the law of a section, its crystal turned into the body."""
    if section.entry is not None:
        unit = UNITS[section.units or "SI"]
        if section.entry.isotropic is not None:
            young, poisson = section.entry.isotropic
            return Linear(young / unit, poisson)
        return Anisotropic(section.entry.stiffness / unit).rotated(turn)
    if section.law == "anisotropic":
        return Anisotropic(section.voigt).rotated(turn)
    # Demanded by the section.
    assert section.young is not None
    assert section.poisson is not None
    if section.law == "linear":
        return Linear(section.young, section.poisson)
    assert section.yield_strain is not None
    return Log(
        section.young,
        section.poisson,
        yield_strain=section.yield_strain,
        argument=section.argument,
        g_min=section.g_min,
    )


def piezo(section: sections.Material, turn: Array) -> Piezo | None:
    """Return the piezoelectric tensors of a section, turned into the body, if there are any."""
    tensors = _crystal(section)
    return None if tensors is None else tensors.rotated(turn)


def _crystal(section: sections.Material) -> Piezo | None:
    """Return the piezoelectric tensors of a section in the axes of the crystal."""
    if section.piezo is not None:
        return from_voigt(*section.piezo.voigt)
    if section.entry is None or section.entry.piezo is None:
        return None
    tensors = section.entry.piezo
    return Piezo(tensors.e, np.asarray(tensors.beta) * UNITS[section.units or "SI"])


def _check_round(key: str, section: sections.Material) -> None:
    """Refuse a crystal that a turn about its axis changes."""
    law, tensors = material_law(section, np.eye(3)), _crystal(section)
    parts = [] if tensors is None else [tensors.e, tensors.beta]
    if isinstance(law, Anisotropic):
        parts.append(stiffness_tensor(law.stiffness))
    if not isotropic_about_x3(*parts):
        raise InputError(
            f"{key}: the crystal is not the same all around its axis X3, and no body of revolution "
            "consists of it; accepted: materials of class 6mm, poled ceramics among them, or a "
            "mesh in space"
        )
