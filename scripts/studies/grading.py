"""Meshes that are finer towards singular points: a grid, pulled towards its corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contact.mesh.domain import Domain
from contact.typing import Array


def pulled(t: Array, power: float) -> Array:
    """Return places in [0, 1], pulled towards both ends as t^power is towards 0."""
    near = 0.5 * (2 * np.minimum(t, 1 - t)) ** power
    return np.asarray(np.where(t < 0.5, near, 1 - near))


def grade(domain: Domain, power: float, places: Sequence[Sequence[float]]) -> Domain:
    """Move the nodes of a grid towards lines across it; return the domain.

    Between two lines a node at the part t of the way goes to `pulled(t, power)`: near a line
    elements are of the size r^(1 - 1/power) h at the distance r. For u ~ r^lambda they do away
    with the singularity, for elements of degree k, where power > k/lambda (Babuska, Kellogg and
    Pitkaranta, Numer. Math. 33 (1979) 447).
    """
    points = domain.mesh.geometry.x
    for axis, lines in enumerate(places):
        ends = np.asarray(lines, dtype=float)
        x = points[:, axis].copy()
        piece = np.clip(np.searchsorted(ends, x, side="right") - 1, 0, ends.size - 2)
        begin, length = ends[piece], np.diff(ends)[piece]
        points[:, axis] = begin + length * pulled(np.clip((x - begin) / length, 0, 1), power)
    return domain
