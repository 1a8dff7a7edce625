"""Element sizes that grow away from the contact zone, and named groups."""

from collections.abc import Mapping, Sequence
from typing import Any


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
    """
    near = min(contact_size, size)
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


def finish(gmsh: Any, dim: int, body: Sequence[int], parts: Mapping[str, Sequence[int]]) -> None:
    """Name the body and its parts (entities of dimension dim - 1), and make the mesh."""
    gmsh.model.addPhysicalGroup(dim, list(body), name="body")
    for name, entities in parts.items():
        gmsh.model.addPhysicalGroup(dim - 1, list(entities), name=name)
    gmsh.option.setNumber("Mesh.ElementOrder", 1)
    gmsh.model.mesh.generate(dim)
