"""Static frictional contact of Hencky elasto-plastic and piezoelectric bodies.

>>> from contact import load_case, solve
>>> solution = solve(load_case("bar.toml"))  # doctest: +SKIP

The names below are imported on first use, so that a program can import the package and still
initialise PETSc with its own arguments.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from contact.build import build_problem
    from contact.case.file import Case, load_case, parse_case
    from contact.errors import InputError
    from contact.evolving import evolve
    from contact.output.files import write_outputs
    from contact.output.solution import Solution
    from contact.solving import solve, solve_problem

_HOMES = {
    "Case": "case.file",
    "InputError": "errors",
    "Solution": "output.solution",
    "build_problem": "build",
    "evolve": "evolving",
    "load_case": "case.file",
    "parse_case": "case.file",
    "solve": "solving",
    "solve_problem": "solving",
    "write_outputs": "output.files",
}

__all__ = [
    "Case",
    "InputError",
    "Solution",
    "build_problem",
    "evolve",
    "load_case",
    "parse_case",
    "solve",
    "solve_problem",
    "write_outputs",
]

# Open MPI reads this as it starts, where nothing has started it before. With its default choice
# MPI_Dist_graph_create, by which checkpoints are read, may hang (open-mpi/ompi issue 13918).
os.environ.setdefault("OMPI_MCA_topo", "basic")


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
