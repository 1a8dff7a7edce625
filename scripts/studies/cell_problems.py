"""Problems on cells of every shape: the third part of the robustness sweep.

`python3 -m scripts.studies.sweep --cells --methods newton` solves them, some of all shapes and
degrees, round bodies on straight and on curved cells. Each shape is drawn with a seed of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

Case = dict[str, Any]
Rng = np.random.Generator
Draw = Callable[[Rng], Case]

#: Problems of each shape of cells.
COUNT = 50


def _one(rng: Rng, *values: Any) -> Any:
    """Draw one of some values, as Python's own."""
    return values[int(rng.integers(len(values)))]


def slip_friction(rng: Rng) -> Case:
    """Draw mu from 0 to 1, constant or falling with the slip."""
    mu = _one(rng, 0.0, 0.1, 0.3, 0.6, 1.0)
    if mu == 0.0:
        return {"law": "none"}
    rho = _one(rng, 0.0, 1e2, 1e4, 6e7)
    law = {"law": "slip", "a": mu * 5 / 6, "b": mu / 3, "rho": rho}
    return {"law": "coulomb", "mu": law if rho > 0 else mu}


def round_body(rng: Rng, dim: int) -> Case:
    """Draw half a disc or a quarter of half a ball, pressed on a plane or a rigid cylinder."""
    size = _one(rng, 0.8, 1.6) if dim == 2 else 3.0
    mesh = {"generator": "quarter_disc" if dim == 2 else "sphere", "radius": 8.0, "size": 3.0}
    mesh |= {"contact_size": size, "order": _one(rng, 1, 2)}
    low = [0.0] * dim
    ground = _one(
        rng,
        {"shape": "plane", "point": low, "normal": [0.0] * (dim - 1) + [1.0]},
        {"shape": "sphere", "centre": [0.0] * (dim - 1) + [-12.0], "radius": 12.0},
    )
    load, law = -_one(rng, 1.0, 10.0, 100.0), _one(rng, "linear", "log")
    sides = ["symmetry"] if dim == 2 else ["symmetry_x", "symmetry_y"]
    return {
        "mesh": mesh,
        "space": {"degree": _one(rng, 1, 2)},
        "material": {"law": law, "young": 2000.0, "poisson": _one(rng, 0.1, 0.3, 0.45)}
        | ({"yield_strain": 0.02} if law == "log" else {}),
        "fixed": [
            {"on": side, "displacement": [0.0 if i == k else "free" for i in range(dim)]}
            for k, side in enumerate(sides)
        ],
        "load": [{"on": "top", "traction": [0.0] * (dim - 1) + [load]}],
        "contact": {
            "on": "contact",
            "foundation": ground,
            "direction": _one(rng, "foundation", "body"),
        },
        "friction": slip_friction(rng),
    }


def pair(rng: Rng, dim: int) -> Case:
    """Draw two bodies whose meshes do not match: blocks, or in 2-D a cylinder on a block."""
    degree, push = _one(rng, 1, 2), _one(rng, 0.0, 0.3, -1.0)
    if dim == 2 and _one(rng, True, False):
        mesh = {"generator": "cylinder_on_block", "radius": 8.0, "width": 8.0, "height": 6.0}
        mesh |= {"size": 3.0, "contact_size": 0.8, "order": _one(rng, 1, 2)}
        way, on, against = -_one(rng, 0.01, 0.1), "arc", "block_top"
        fixed = [
            {"on": "symmetry", "displacement": [0.0, "free"]},
            {"on": "block_bottom", "displacement": ["free", 0.0]},
            {"on": "top", "displacement": ["free", way]},
        ]
        bodies = "cylinder", "block"
    else:
        mesh = {"generator": "two_blocks" if dim == 2 else "two_boxes"}
        if dim == 3:
            mesh |= {"lower_size": 0.8, "upper_size": 0.6}
        way, on, against = -_one(rng, 0.001, 0.01), "upper_bottom", "lower_top"
        aside = [-push * way] + [0.0] * (dim - 2)
        fixed = [
            {"on": "lower_bottom", "displacement": [0.0] * dim},
            {"on": "upper_top", "displacement": [*aside, way]},
        ]
        bodies = "lower", "upper"
    if _one(rng, True, False):
        on, against = against, on
    return {
        "mesh": mesh,
        "space": {"degree": degree},
        "material": [
            {"on": body, "young": _one(rng, 0.2, 1.0, 5.0), "poisson": _one(rng, 0.0, 0.3, 0.45)}
            for body in bodies
        ],
        "fixed": fixed,
        "contact": [{"on": on, "against": against, "friction": slip_friction(rng)}],
    }


def _drawn(rng: Rng, draws: tuple[Draw, ...], cell: str) -> Case:
    """Draw one of some problems, on cells of a shape and of degree 1 or 2."""
    case: Case = _one(rng, *draws)(rng)
    case["mesh"]["cell"] = cell
    case.setdefault("space", {"degree": _one(rng, 1, 2)})
    return case


def families(flat: tuple[Draw, ...], solid: tuple[Draw, ...]) -> dict[str, Draw]:
    """Return how problems of each shape of cells are drawn.

    Parameters
    ----------
    flat, solid
        Problems on rectangles and on boxes.
    """
    kinds = {
        2: (*flat, partial(round_body, dim=2), partial(pair, dim=2)),
        3: (*solid, partial(round_body, dim=3), partial(pair, dim=3)),
    }
    shapes = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}
    return {cell: partial(_drawn, draws=kinds[dim], cell=cell) for cell, dim in shapes.items()}
