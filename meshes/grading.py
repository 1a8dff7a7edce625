"""Element sizes that grow away from the contact zone, and named groups."""

import logging
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from contact.errors import InputError

#: Bytes and seconds that Gmsh takes for a cell (seen: 1100 to 1500, and 1.5e-5 to 2.4e-5).
CELL_MEMORY, CELL_SECONDS = 800, 2e-5

#: Cells in a square or a cube of their size, in a body that fills little of its box (a disc and a
#: ball: 1.8 and 4.4; a filled one: 2.3 and 8.5).
CELLS = {2: 1.5, 3: 3.0}

#: Seconds from which on there is a word on them: a solve on such a mesh takes far longer.
LONG = 5.0

logger = logging.getLogger("contact.mesh")


class Sizes(NamedTuple):
    """Sizes of elements near something and far away.

    Attributes
    ----------
    far, near
        Far away, and up to a distance.
    width
        This distance.
    growth
        From there on, a unit length.
    """

    far: float
    near: float
    width: float
    growth: float


def grade(
    gmsh: Any,
    sizes: Sizes,
    *,
    points: Sequence[int] = (),
    curves: Sequence[int] = (),
    surfaces: Sequence[int] = (),
    edges: Sequence[int] = (),
    edge_size: float = 0.0,
) -> None:
    """Set the element size by the distance to some entities.

    At ``edges``, points in the plane and curves in 3-D, it is ``edge_size``, and grows from
    there.

    Raises
    ------
    InputError
        If Gmsh, on one core, has not the memory for that.
    """
    size, near, width, growth = sizes
    near = min(near, size)
    chosen = [(d, tag) for d, tags in enumerate((points, curves, surfaces)) for tag in tags]
    # The first elements of the ramp count too.
    _check_count(gmsh, size, near, width + near / growth, chosen)
    zone = {"PointsList": points, "CurvesList": curves, "SurfacesList": surfaces}
    fields = [_ramp(gmsh, zone, near, size, width, growth)]
    if edges:
        flat = gmsh.model.getDimension() - 2
        ends = [(flat, tag) for tag in edges]
        _check_count(gmsh, size, min(edge_size, near), edge_size / growth, ends)
        kind = ("PointsList", "CurvesList")[flat]
        fields.append(_ramp(gmsh, {kind: edges}, min(edge_size, near), size, 0.0, growth))
    field = gmsh.model.mesh.field
    least = field.add("Min")
    field.setNumbers(least, "FieldsList", fields)
    field.setAsBackgroundMesh(least if edges else fields[0])
    for key in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{key}", 0)


def _ramp(
    gmsh: Any,
    entities: Mapping[str, Sequence[int]],
    near: float,
    size: float,
    width: float,
    growth: float,
) -> int:
    """Return a field of sizes that grow with the distance from entities beyond a width."""
    field = gmsh.model.mesh.field
    distance = field.add("Distance")
    for kind, chosen in entities.items():
        field.setNumbers(distance, kind, list(chosen))
    field.setNumber(distance, "Sampling", 200)
    ramp = field.add("Threshold")
    field.setNumber(ramp, "InField", distance)
    field.setNumber(ramp, "SizeMin", near)
    field.setNumber(ramp, "SizeMax", size)
    field.setNumber(ramp, "DistMin", width)
    # A ramp of no length would divide by zero.
    field.setNumber(ramp, "DistMax", width + max(size - near, 1e-6 * size) / growth)
    return int(ramp)


def _check_count(
    gmsh: Any, size: float, near: float, width: float, entities: Sequence[tuple[int, int]]
) -> None:
    """Refuse sizes that give too many cells, by a count that is rather too small.

    Up to ``width`` from the ``entities``, all of one dimension, elements have the size ``near``.
    """
    dim, flat = gmsh.model.getDimension(), entities[0][0]
    extents = _extents(gmsh, [(-1, -1)])[:dim]
    along = sorted(_extents(gmsh, entities))[3 - flat :]
    # Decimal logarithms: the numbers themselves may overflow.
    least = near if width > 2 * max(extents) else size
    check_cells(sum(math.log10(extent / least) for extent in extents), dim)
    zone = sum(math.log10(min(width, e) / near) for e in sorted(extents)[flat:])
    zone += sum(math.log10(max(extent / near, 1.0)) for extent in along)
    check_cells(zone)


def _extents(gmsh: Any, entities: Sequence[tuple[int, int]]) -> list[float]:
    """Return the extents of the box around entities."""
    boxes = [gmsh.model.getBoundingBox(*entity) for entity in entities]
    return [max(box[i + 3] for box in boxes) - min(box[i] for box in boxes) for i in range(3)]


def memory() -> int:
    """Return the memory of the machine (bytes)."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def check_cells(count: float, dim: int | None = None) -> None:
    """Refuse more cells than the memory holds, and say how long many take.

    Parameters
    ----------
    count
        Decimal logarithm of their number, rather too small.
    dim
        If it is that of squares (2) or cubes (3) of their size in the box around a body.

    Raises
    ------
    InputError
        If Gmsh has not the memory for them.
    """
    count += math.log10(1.0 if dim is None else CELLS[dim])
    machine = memory()
    if count > math.log10(machine / CELL_MEMORY):
        raise InputError(
            f"the sizes ask for at least 1e{math.floor(count)} cells, which take more memory than "
            f"the {machine / 1e9:.3g} GB that there are; accepted: sizes that give at most "
            f"{machine / CELL_MEMORY:.1e} cells",
            "mesh-memory",
        )
    seconds = 10**count * CELL_SECONDS
    if seconds > LONG:
        time = f"{seconds / 60:.2g} min" if seconds > 60 else f"{seconds:.2g} s"
        logger.warning(
            f"mesh: the sizes ask for some {10**count:.1e} cells or more, which take Gmsh {time} "
            f"or more, and {10**count * CELL_MEMORY / 1e9:.2g} GB; a solve takes far more"
        )


def finish(
    gmsh: Any,
    dim: int,
    body: Sequence[int] | Mapping[str, Sequence[int]],
    parts: Mapping[str, Sequence[int]],
    sizes: Sizes | None = None,
    **near: Any,
) -> None:
    """Name the body, or several, and the parts (entities of dimension dim - 1); make the mesh.

    With sizes the geometry is Gmsh's own, and the elements are graded towards ``near``, as `grade`
    takes it.
    """
    if sizes is not None:
        gmsh.model.geo.synchronize()
        grade(gmsh, sizes, **near)
    bodies = body if isinstance(body, Mapping) else {"body": body}
    for name, entities in bodies.items():
        gmsh.model.addPhysicalGroup(dim, list(entities), name=name)
    for name, entities in parts.items():
        gmsh.model.addPhysicalGroup(dim - 1, list(entities), name=name)
    gmsh.model.mesh.generate(dim)
