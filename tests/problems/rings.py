"""A ring between a plate and a lid: two contacts on one small body, a few nodes touch each."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.case.file import Case, parse_case
from contact.mesh.domain import Domain, from_mesh
from tests.problems.meshes import assembled, midpoints

#: Radii of the ring, and half the width and the height of plate and lid.
INNER, OUTER, HALF, HEIGHT = 0.5, 1.0, 0.75, 0.5

#: Young's modulus and Poisson's ratio of each body.
MODULI = {"ring": (0.44, 0.45), "plate": (0.68, 0.2), "lid": (9.8, 0.45)}


def between_plates(comm: MPI.Intracomm, seed: int, around: int = 28) -> Domain:
    """Return the mesh; the ring's facets are irregular. Parts are named as in `_named`."""
    rng = np.random.default_rng(seed)
    angle = -np.pi / 2 + 2 * np.pi * (np.arange(around) + rng.uniform(-0.2, 0.2, around)) / around
    angle[0] = -np.pi / 2  # touches the plate; opposite to it is a facet or a node beside the top
    radii = np.linspace(INNER, OUTER, 4)
    ring = np.stack([np.outer(radii, np.cos(angle)), np.outer(radii, np.sin(angle))], axis=2)
    ring[..., 1] -= ring[-1, :, 1].min()
    points, cells = [ring.reshape(-1, 2)], [_quads(np.arange(4 * around).reshape(4, -1), True)]
    for low, n in ((-HEIGHT, 11), (ring[-1, :, 1].max(), 12)):
        x, y = np.meshgrid(np.linspace(-HALF, HALF, n + 1), low + HEIGHT * np.linspace(0, 1, 4))
        number = sum(map(len, points)) + np.arange(x.size).reshape(x.shape)
        points.append(np.stack([x.ravel(), y.ravel()], axis=1))
        cells.append(_quads(number, False))
    mesh = assembled(comm, np.concatenate(points), np.concatenate(cells))
    return from_mesh(mesh, *_named(mesh, points[2][0, 1]))


def _quads(number: np.ndarray, closed: bool) -> np.ndarray:
    """Return two triangles for each cell of a grid of nodes; closed along its second index."""
    beside = np.roll(number, -1, axis=1)
    last = None if closed else -1
    a, b = number[:-1, :last].ravel(), beside[:-1, :last].ravel()
    c, d = number[1:, :last].ravel(), beside[1:, :last].ravel()
    return np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])


def _named(mesh: dmesh.Mesh, top: float) -> tuple[dict, float, dict]:
    """Return parts, what they are found by, and regions; the lid begins at a height."""
    facets, middle, inside, centre = midpoints(mesh)
    inside, centre = inside[:, 1], centre[:, 1]

    def at(height):
        return np.abs(middle[:, 1] - height) < 1e-9

    outside = np.linalg.norm(middle - [0.0, top / 2], axis=1) > (INNER + OUTER) / 2
    parts = {
        "plate_bottom": at(-HEIGHT),
        "plate_top": at(0.0) & (inside < 0),
        "ring_outside": outside & (inside > 0) & (inside < top),
        "ring_inside": ~outside,
        "lid_bottom": at(top) & (inside > top),
        "lid_top": at(top + HEIGHT),
    }
    regions = {
        "plate": np.flatnonzero(centre < 0),
        "ring": np.flatnonzero((centre > 0) & (centre < top)),
        "lid": np.flatnonzero(centre > top),
    }
    return {name: facets[there] for name, there in parts.items()}, 2.0, regions


def squeezed(
    method: str,
    moduli: Mapping[str, tuple[float, float]] = MODULI,
    side: str = "ring_outside",
    way: float = -0.01,
    file: str | None = None,
    guided: bool = False,
    traction: tuple[float, float] | None = None,
    **solver: object,
) -> Case:
    """Return the case: the lid goes down by -`way`, both flat sides `against` the ring."""
    tables: dict[str, Any] = {
        "material": [
            {"on": on, "young": young, "poisson": nu} for on, (young, nu) in moduli.items()
        ],
        "fixed": [
            {"on": "plate_bottom", "displacement": [0.0, 0.0]},
            {"on": "lid_top", "displacement": [0.0, way]},
            *([{"on": "ring_inside", "displacement": [0.0, "free"]}] if guided else []),
        ],
        "contact": [
            {"on": on, "against": side, "friction": {"law": "coulomb", "mu": 0.2}}
            for on in ("plate_top", "lid_bottom")
        ],
        "solver": {"method": method, **solver},
        "load": [] if traction is None else [{"on": "ring_inside", "traction": list(traction)}],
    }
    if file is None:
        return parse_case(tables)
    return parse_case({"mesh": {"file": file}, **tables})
