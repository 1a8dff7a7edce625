"""Intervals of the quoted quantities, from three nested uniform meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from contact.tolerances import ROUNDING

#: Quantity -> its interval; None where it does not converge like the error.
Intervals: TypeAlias = dict[str, list[float] | None]

#: Columns of ``adapt.csv`` that are no quantities of the body.
OF_MESHES = ("unknowns", "error", "kkt")

#: Factor of safety of the width, and the largest one by which C may grow from mesh to mesh.
SAFETY = 1.25

#: Ends of the names of a vector's components, whose rounding is that of the vector.
AXES = ("_x", "_y", "_z")


def intervals(rows: Sequence[Mapping[str, float]]) -> Intervals | None:
    """Return the interval of each quantity; None unless the error falls on the last three meshes.

    The grid convergence index (Roache, J. Fluids Eng. 116, 1994) with |Q - Q_h| <= C e, e being the
    estimated error in the energy norm: C is the larger |Q_j - Q_k|/(e_j - e_k) of the last two
    refinements. Where C grows it goes on to grow, and the changes to come are a geometric series.
    Most quantities converge faster, and lie well inside. Residuals of the solutions are added. One
    whose changes are of both signs has not begun to converge, and has none.

    Parameters
    ----------
    rows
        Those of ``adapt.csv``, the finest mesh last, all edges being cut alike from one to the
        next: where some cells are refined, most of the error of a quantity may be elsewhere.
    """
    if len(rows) < 3 or not rows[-3]["error"] > rows[-2]["error"] > rows[-1]["error"]:
        return None
    last, error = rows[-3:], [float(row["error"]) for row in rows[-3:]]
    quantities = [name for name in rows[-1] if name not in OF_MESHES]
    sizes: dict[str, float] = {}
    for name in quantities:
        size = max(abs(row[name]) for row in last)
        sizes[_whole(name)] = max(size, sizes.get(_whole(name), 0.0))
    found: Intervals = {}
    for name in quantities:
        unknown = max(ROUNDING, *(row["kkt"] for row in last)) * sizes[_whole(name)]
        values = [float(row[name]) for row in last]
        changes = [values[k + 1] - values[k] for k in (0, 1)]
        first, second = (
            max(abs(changes[k]) - 2 * unknown, 0.0) / (error[k] - error[k + 1]) for k in (0, 1)
        )
        turns = min(first, second) > 0 and changes[0] * changes[1] < 0
        growth = max(second / first, 1.0) if first > 0 else 1.0 if second == 0 else np.inf
        ratio = growth * error[2] / error[1]
        if turns or growth > SAFETY or ratio >= 1:
            found[name] = None
            continue
        change = max(first, second) * (error[1] - error[2])
        width = SAFETY * change * ratio / (1 - ratio) + unknown
        found[name] = [values[2] - width, values[2] + width]
    return found


def _whole(name: str) -> str:
    """Return the name of the vector of a component, or the name itself."""
    return name[:-2] if name.endswith(AXES) else name
