"""Parametric mesh generators: bodies by Gmsh, their boundary parts as named physical groups.

A generator is a function with keyword parameters (lengths, all positive) that fills the current
Gmsh model and meshes it, with straight-sided triangles or tetrahedra if nothing else is asked for.
``GENERATORS`` lists them by name. In a case file::

    [mesh]
    generator = "quarter_disc"
    contact_size = 0.1

On the command line: ``python3 -m meshes quarter_disc --contact-size 0.1 --out body.msh``.
"""

import difflib
import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from contact.errors import InputError
from meshes.bars import bar, bar_on_ends, block, column, piezo_bar
from meshes.bracket import bracket
from meshes.hertz import disc, half_disc, quarter_disc, sphere
from meshes.indentation import half_cylinder, half_space
from meshes.pairs import (
    ball_between_plates,
    bimorph_on_stop,
    cylinder_on_block,
    two_balls,
    two_blocks,
    two_boxes,
    two_half_cylinders,
    two_spheres,
)

__all__ = ["GENERATORS", "build", "parameters", "write"]

GENERATORS: Mapping[str, Callable[..., None]] = {
    generator.__name__: generator
    for generator in (
        quarter_disc,
        half_disc,
        disc,
        sphere,
        bar,
        piezo_bar,
        bar_on_ends,
        block,
        column,
        bracket,
        half_space,
        half_cylinder,
        two_blocks,
        two_boxes,
        cylinder_on_block,
        two_half_cylinders,
        two_balls,
        two_spheres,
        ball_between_plates,
        bimorph_on_stop,
    )
}


def parameters(name: str) -> dict[str, float]:
    """Return the parameters of a generator with their defaults.

    Raises
    ------
    InputError
        If there is no such generator.
    """
    if name not in GENERATORS:
        raise InputError(_unknown("mesh generator", name, GENERATORS), "generator")
    signature = inspect.signature(GENERATORS[name])
    return {key: parameter.default for key, parameter in signature.parameters.items()}


#: Generators whose mesh is swept: of tetrahedra of first order.
SWEPT = ("half_cylinder",)

#: Shape of the cells -> Gmsh's options. Triangles of twice the size are put together in pairs, and
#: all are cut into quadrilaterals; tetrahedra of twice the size are cut into four hexahedra each.
CELLS: Mapping[str, Mapping[str, float]] = {
    "triangle": {},
    "quadrilateral": {"RecombineAll": 1, "RecombinationAlgorithm": 2},
    "tetrahedron": {},
    "hexahedron": {"SubdivisionAlgorithm": 2, "MeshSizeFactor": 2},
}


@contextmanager
def _cells(gmsh: Any, cell: str | None, order: int) -> Iterator[None]:
    """Let Gmsh make cells of a shape and an order; its options are left as they were."""
    options = {"ElementOrder": order, "SecondOrderIncomplete": 0, **CELLS.get(cell or "", {})}
    before = {key: gmsh.option.getNumber(f"Mesh.{key}") for key in options}
    try:
        for key, value in options.items():
            gmsh.option.setNumber(f"Mesh.{key}", value)
        yield
    finally:
        for key, value in before.items():
            gmsh.option.setNumber(f"Mesh.{key}", value)


def build(name: str, cell: str | None = None, order: int = 1, **given: float) -> None:
    """Fill the current Gmsh model by a generator and mesh it; Gmsh must be initialised.

    Parameters
    ----------
    name
        Of the generator.
    cell
        Shape of the cells: in 2-D ``triangle``, the default, or ``quadrilateral``, in 3-D
        ``tetrahedron`` or ``hexahedron``.
    order
        Order of the cells, 1 or 2: those of 2 are curved.
    given
        Parameters of the generator.

    Raises
    ------
    InputError
        For an unknown generator or parameter, for a length that is not positive, for cells that
        the generator cannot make, and for sizes that would give too many cells.
    """
    import gmsh

    defaults = parameters(name)
    for key, value in given.items():
        if key not in defaults:
            raise InputError(
                _unknown(f"parameter of the mesh generator {name!r}", key, defaults), "generator"
            )
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0.0 < value < math.inf:
            raise InputError(
                f"{key} of the mesh generator must be a positive number; given: {value}",
                "generator",
            )
    if order not in (1, 2):
        raise InputError(f"order of the mesh generator must be 1 or 2; given: {order}", "generator")
    if name in SWEPT and (cell not in (None, "tetrahedron") or order > 1):
        raise InputError(
            f"cells of the mesh generator {name!r} must be tetrahedra of order 1; given: "
            f"{cell or 'tetrahedron'}, order {order}",
            "generator",
        )
    with _cells(gmsh, cell, order):
        GENERATORS[name](**given)
    known = {2: ("triangle", "quadrilateral"), 3: ("tetrahedron", "hexahedron")}
    accepted = known[gmsh.model.getDimension()]
    if cell not in (None, *accepted):
        raise InputError(
            f"cell of the mesh generator {name!r} must be {' or '.join(accepted)}; given: {cell}",
            "generator",
        )


def write(
    name: str,
    path: str | Path,
    cell: str | None = None,
    order: int = 1,
    *,
    version: float = 4.1,
    **given: float,
) -> None:
    """Write a generator's mesh to a ``.msh`` file of format 4.1 or 2.2; cells as in `build`.

    Raises
    ------
    InputError
        As `build`.
    """
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.model.add(name)
        build(name, cell, order, **given)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def _unknown(kind: str, given: str, accepted: Mapping[str, object]) -> str:
    near = difflib.get_close_matches(given, accepted, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"unknown {kind}: {given!r}{hint} (accepted: {', '.join(accepted)})"
