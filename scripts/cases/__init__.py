"""The case files, and the one that most studies vary."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from contact import Case, load_case

#: Where the case files are.
CASES = Path(__file__).parent

#: mu = k_e of Table 8.4, for Example 8.4.
TABLE_8_4 = (6e-1, 2e-1, 6.8e-2, 5.1e-3, 6.2e-4, 1.4e-5, 3.5e-6, 8.5e-7)


def on_grid(name: str, cells: Sequence[int], *changes: str) -> Case:
    """Return a case file with other numbers of cells along the axes."""
    return load_case(CASES / f"{name}.toml", [f"mesh.cells={list(cells)}", *changes])


def bar(n: int, load: float = -0.005, rho: float = 1e5, *changes: str) -> Case:
    """Return Example 7.2 with n cells per unit length, solved by Newton's method."""
    given = f"load.0.traction=[0.0, {load}]", f"friction.mu.rho={rho}", "solver.method=newton"
    return on_grid("bar", (4 * n, n), *given, *changes)
