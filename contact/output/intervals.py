"""Intervals of the quoted quantities, from three nested uniform meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

#: Quantity -> its interval; None where it does not converge like the error.
Intervals: TypeAlias = dict[str, list[float] | None]

#: Columns of ``adapt.csv`` that are no quantities of the body.
OF_MESHES = ("unknowns", "error", "kkt")

#: Factor of safety of the width, and the largest one by which C may grow from mesh to mesh.
SAFETY = 1.25


def intervals(rows: Sequence[Mapping[str, Any]]) -> Intervals | None:
    """Return the interval of each quantity; None unless the error falls on the last three meshes.

    The grid convergence index (Roache, J. Fluids Eng. 116, 1994) with |Q - Q_h| <= C e, e being the
    estimated error in the energy norm: C is the larger |Q_j - Q_k|/(e_j - e_k) of the last two
    refinements. Most quantities converge faster, and lie well inside.

    Parameters
    ----------
    rows
        Those of ``adapt.csv``, the finest mesh last, all edges being cut in two from one to the
        next: where some cells are refined, most of the error of a quantity may be elsewhere.
    """
    if len(rows) < 3 or not rows[-3]["error"] > rows[-2]["error"] > rows[-1]["error"]:
        return None
    found: Intervals = {}
    for name, value in rows[-1].items():
        if name not in OF_MESHES:
            first, second = (
                abs(one[name] - other[name]) / (one["error"] - other["error"])
                for one, other in ((rows[-3], rows[-2]), (rows[-2], rows[-1]))
            )
            width = SAFETY * max(first, second) * rows[-1]["error"]
            bounded = second <= SAFETY * first
            found[name] = [float(value - width), float(value + width)] if bounded else None
    return found
