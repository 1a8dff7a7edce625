"""Half of a body of revolution in 3-D, from the mesh of its half plane."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from meshes.grading import check_cells

Ints = npt.NDArray[np.int64]

#: Gmsh's simplices of first order, by dimension.
SIMPLEX = {1: 1, 2: 2, 3: 4}


def turn(gmsh: Any, sectors: int) -> None:
    """Put half of a body of revolution in the place of its meshed half plane x >= 0.

    The axis y of the plane becomes z; the half y > 0 of the body is made of ``sectors``. Named
    parts stay, but for those on the axis, and both ends together are ``symmetry``.

    A mesh that is fine towards an edge in its half plane takes no more elements along this edge.
    Circles become polygons of the same area: nodes are a little outside. The prism between two
    half planes is cut into tetrahedra along the diagonals from the lower number in the first plane
    to the higher in the second, on which neighbours agree (J. Dompierre et al., 8th International
    Meshing Roundtable, 1999); cells that collapse on the axis are dropped.

    Raises
    ------
    InputError
        If there is not the memory for the cells.
    """
    tags, places, _ = gmsh.model.mesh.getNodes()
    number = np.empty(int(tags.max()) + 1, dtype=np.int64)
    number[tags.astype(np.int64)] = np.arange(tags.size)
    bodies, curves = (
        {name: number[rows] for name, rows in _groups(gmsh, dim).items()} for dim in (2, 1)
    )
    check_cells(math.log10(3 * sectors * sum(map(len, bodies.values()))))
    radius, height, _ = places.reshape(-1, 3).T
    # Nodes on the axis are in all half planes.
    step = np.where(radius > 1e-12 * radius.max(), radius.size, 0)
    numbers = np.arange(radius.size) + step * np.arange(sectors + 1)[:, None]
    sector = math.pi / sectors
    outer = radius * math.sqrt(sector / math.sin(sector))
    angle = sector * np.arange(sectors + 1)[:, None]
    x, y, z = np.broadcast_arrays(outer * np.cos(angle), outer * np.sin(angle), height)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    used = np.unique(numbers)
    parts = {name: _swept(rows, numbers) for name, rows in curves.items()}
    ends = [numbers[k][rows] for rows in bodies.values() for k in (0, -1)]
    parts["symmetry"] = np.concatenate(ends)

    gmsh.model.mesh.clear()
    gmsh.model.removePhysicalGroups()
    solids = {name: _entity(gmsh, 3, name) for name in bodies}
    gmsh.model.mesh.addNodes(3, next(iter(solids.values())), used + 1, points[used].ravel())
    for name, rows in bodies.items():
        _fill(gmsh, 3, solids[name], _oriented(_swept(rows, numbers), points))
    for name, rows in parts.items():
        if len(rows):
            _fill(gmsh, 2, _entity(gmsh, 2, name), rows)


def _groups(gmsh: Any, dim: int) -> dict[str, Ints]:
    """Return the simplices of the named groups of a dimension, by the tags of their nodes."""
    found = {}
    for _, group in gmsh.model.getPhysicalGroups(dim):
        entities = gmsh.model.getEntitiesForPhysicalGroup(dim, group)
        nodes = [gmsh.model.mesh.getElementsByType(SIMPLEX[dim], entity)[1] for entity in entities]
        rows = np.concatenate(nodes).astype(np.int64).reshape(-1, dim + 1)
        found[gmsh.model.getPhysicalName(dim, group)] = rows
    return found


def _swept(simplices: Ints, numbers: Ints) -> Ints:
    """Return the simplices between half planes, of one dimension more.

    Parameters
    ----------
    simplices
        Those in one half plane, shape (m, k).
    numbers
        Of the nodes in each half plane, shape (sectors + 1, n).
    """
    rows = np.sort(simplices, axis=1)
    lower, upper = numbers[:-1][:, rows], numbers[1:][:, rows]
    size = rows.shape[1]
    cut = [
        np.concatenate([lower[..., : k + 1], upper[..., k:]], axis=-1).reshape(-1, size + 1)
        for k in range(size)
    ]
    made = np.concatenate(cut)
    ordered = np.sort(made, axis=1)
    return made[np.all(ordered[:, 1:] > ordered[:, :-1], axis=1)]


def _oriented(tetrahedra: Ints, points: npt.NDArray[np.float64]) -> Ints:
    """Return tetrahedra of positive volume, as Gmsh's own are."""
    corners = points[tetrahedra]
    inverted = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    tetrahedra[inverted, :2] = tetrahedra[inverted, 1::-1]
    return tetrahedra


def _entity(gmsh: Any, dim: int, name: str) -> int:
    """Return a new entity without a geometry, a group by itself."""
    tag = int(gmsh.model.addDiscreteEntity(dim))
    gmsh.model.addPhysicalGroup(dim, [tag], name=name)
    return tag


def _fill(gmsh: Any, dim: int, entity: int, simplices: Ints) -> None:
    """Give the simplices of an entity, by the numbers of their nodes."""
    gmsh.model.mesh.addElementsByType(entity, SIMPLEX[dim], [], (simplices + 1).ravel())
