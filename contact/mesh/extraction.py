"""What a Gmsh model holds, taken out as plain arrays; judged elsewhere."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]

#: Gmsh's element types of first order, by dimension.
SIMPLEX = {0: 15, 1: 1, 2: 2, 3: 4}


@dataclass(frozen=True)
class Model:
    """What a Gmsh model holds.

    Attributes
    ----------
    kinds
        Name, dimension and order of each type of elements.
    tags, points
        Nodes: their tags, shape (n,), and coordinates, shape (n, 3).
    cells
        Simplices of the largest dimension d by their nodes' tags, shape (m, d + 1).
    regions, parts
        Physical groups of dimension d and d - 1: name -> their simplices likewise.
    """

    kinds: list[tuple[str, int, int]]
    tags: Ints
    points: npt.NDArray[np.float64]
    cells: Ints
    regions: dict[str, Ints]
    parts: dict[str, Ints]

    @property
    def dim(self) -> int:
        """Largest dimension of an element, -1 without any."""
        return max((dim for _, dim, _ in self.kinds), default=-1)


def extract(model: Any, entities_are_groups: bool) -> Model:
    """Take nodes, simplices and groups out of `gmsh.model`.

    Parameters
    ----------
    entities_are_groups
        Whether the model's entities are the groups themselves.
    """
    kinds = [model.mesh.getElementProperties(t)[:3] for t in model.mesh.getElementTypes()]
    tags, xyz, _ = model.mesh.getNodes()
    nodes = tags.astype(np.int64), xyz.reshape(-1, 3)
    dim = max((kind[1] for kind in kinds), default=-1)
    if dim < 1:
        return Model(kinds, *nodes, np.empty((0, 1), dtype=np.int64), {}, {})
    return Model(
        kinds,
        *nodes,
        _simplices(model, dim, [-1]),
        _groups(model, dim, entities_are_groups),
        _groups(model, dim - 1, entities_are_groups),
    )


def _groups(model: Any, dim: int, entities_are_groups: bool) -> dict[str, Ints]:
    """Simplices of each physical group of a dimension; one without a name goes by its number."""
    if entities_are_groups:
        found = [(tag, [tag]) for _, tag in model.getEntities(dim) if tag != 0]
    else:
        found = [
            (tag, model.getEntitiesForPhysicalGroup(dim, tag).tolist())
            for _, tag in model.getPhysicalGroups(dim)
        ]
    entities: dict[str, list[int]] = {}
    for tag, members in found:
        entities.setdefault(model.getPhysicalName(dim, tag) or str(tag), []).extend(members)
    return {name: _simplices(model, dim, members) for name, members in entities.items()}


def _simplices(model: Any, dim: int, entities: list[int]) -> Ints:
    """Node tags of the simplices of some entities (-1: of all), shape (m, dim + 1)."""
    nodes = [model.mesh.getElementsByType(SIMPLEX[dim], entity)[1] for entity in entities]
    return np.concatenate(nodes).astype(np.int64).reshape(-1, dim + 1)
