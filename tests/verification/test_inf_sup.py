"""The inf-sup constant of the nodal multipliers does not depend on the mesh size."""

import pytest

from scripts.studies.inf_sup import SERIES, constant


@pytest.mark.parametrize(
    ("name", "degree", "cells", "least"),
    [
        ("uniform", 1, (4, 8, 16), 0.62),
        ("uniform", 2, (4, 8), 0.58),
        ("alternating", 1, (4, 8, 16), 0.45),
        ("crosspoints", 1, (4, 8, 16), 0.62),
        ("crosspoints", 2, (4, 8), 0.58),
        ("uniform, 3-D", 1, (2, 4), 0.55),
        ("uniform, 3-D", 2, (2,), 0.55),
        ("crosspoints, 3-D", 2, (2,), 0.55),
    ],
)
def test_multipliers_are_stable(name, degree, cells, least):
    """Bounded from below, at crosspoints, between unlike edges, and on quadratic triangles."""
    kind, levels = SERIES[name][0], 1 if "3-D" in name else 3
    found = [constant(kind, kind.make(n), degree, levels)[0] for n in cells]
    assert least < min(found) <= max(found) < 1, found
    assert max(found) - min(found) < 0.15 * max(found)
