"""Element sizes that grow away from the contact zone, and named groups."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from contact.errors import InputError

#: Gmsh makes a mesh on one core: more cells than this are a misprint, and would run for hours.
MOST_CELLS = 1e8


def grade(
    gmsh: Any,
    *,
    size: float,
    contact_size: float,
    width: float,
    growth: float,
    points: Sequence[int] = (),
    curves: Sequence[int] = (),
    surfaces: Sequence[int] = (),
) -> None:
    """Set the element size by the distance to some entities.

    It is ``contact_size`` up to the distance ``width`` and then grows by ``growth`` a unit
    length, up to ``size``.

    Raises
    ------
    InputError
        If that would give more than `MOST_CELLS` cells.
    """
    near = min(contact_size, size)
    # The first elements of the ramp count too.
    _check_count(gmsh, size, near, width + near / growth, 2 if surfaces else 1 if curves else 0)
    field = gmsh.model.mesh.field
    distance = field.add("Distance")
    field.setNumbers(distance, "PointsList", list(points))
    field.setNumbers(distance, "CurvesList", list(curves))
    field.setNumbers(distance, "SurfacesList", list(surfaces))
    field.setNumber(distance, "Sampling", 200)
    ramp = field.add("Threshold")
    field.setNumber(ramp, "InField", distance)
    field.setNumber(ramp, "SizeMin", near)
    field.setNumber(ramp, "SizeMax", size)
    field.setNumber(ramp, "DistMin", width)
    # A ramp of no length would divide by zero.
    field.setNumber(ramp, "DistMax", width + max(size - near, 1e-6 * size) / growth)
    field.setAsBackgroundMesh(ramp)
    for key in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{key}", 0)


def _check_count(gmsh: Any, size: float, near: float, width: float, flat: int) -> None:
    """Refuse sizes that give too many cells, by a count that is rather too small.

    ``flat`` is the dimension of the entities, at the bottom of the body, up to ``width`` from
    which the elements have the size ``near``.
    """
    box, dim = gmsh.model.getBoundingBox(-1, -1), gmsh.model.getDimension()
    extents = [high - low for low, high in zip(box[:dim], box[3 : 3 + dim], strict=True)]
    # Decimal logarithms: the numbers themselves may overflow.
    far = sum(math.log10(extent / size) for extent in extents) - 0.5
    zone = (dim - flat) * math.log10(min(width, *extents) / near)
    zone += sum(math.log10(extent / near) for extent in extents[:flat]) - 0.5
    if max(far, zone) > math.log10(MOST_CELLS):
        raise InputError(
            f"the sizes ask for at least 1e{math.floor(max(far, zone))} cells; accepted: sizes "
            f"that give at most {MOST_CELLS:g}"
        )


def finish(gmsh: Any, dim: int, body: Sequence[int], parts: Mapping[str, Sequence[int]]) -> None:
    """Name the body and its parts (entities of dimension dim - 1), and make the mesh."""
    gmsh.model.addPhysicalGroup(dim, list(body), name="body")
    for name, entities in parts.items():
        gmsh.model.addPhysicalGroup(dim - 1, list(entities), name=name)
    gmsh.option.setNumber("Mesh.ElementOrder", 1)
    gmsh.model.mesh.generate(dim)
