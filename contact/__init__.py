"""Frictional contact of elasto-plastic and piezoelectric bodies.

A case file is solved by

>>> from contact import load_case, solve
>>> solution = solve(load_case("bar.toml"))  # doctest: +SKIP

and a problem that is put together in Python by

>>> from contact import Body, Contact, Domain, Fixed, Friction, Linear, Problem, solve
>>> domain = Domain.from_mesh(mesh, facet_tags, {"top": 1, "bottom": 2})  # doctest: +SKIP
>>> body = Body(Linear(210e3, 0.3), [Fixed("top", [0.0, -0.01])])  # doctest: +SKIP
>>> problem = Problem(domain, body, Contact("bottom"), Friction(mu=0.3))  # doctest: +SKIP
>>> solution = solve(problem)  # doctest: +SKIP

- Geometry: `from_file` reads a mesh file, `from_msh` one of Gmsh, `Domain.from_mesh` takes
  dolfinx's mesh and tags.
- Body: `Body`, `Fixed`, `Elastic`, `Load`; `Linear`, `Log`, `UserLaw`, `Piezo`; `J2` with `Voce` or
  `Tabulated` hardening, and a stress update of your own, which returns a `Response`; several by
  `Material`, and crystals by `make_material`; `Rigid` with its `Motion`, `Electrode`, `Bolt`.
- Contact: `Contact` with a gap, or a `Plane`, `Sphere`, `Cylinder`, `Cone`, `Paraboloid`, `Punch`,
  `Level`, `Heights`, `Triangles`, a `Shape` of your own; `Layer`; `Friction`, `SlipCoefficient`,
  `Coulomb`; `Electric`, or a `Conductor` with `ShiftedConductivity`, `RampConductivity`,
  `PerfectConductivity`.
- Solving: `Problem`, `solve`, `solve_steps`, `evolve`; `NewtonOptions`, `FixedPointOptions`,
  `PenaltyOptions`.
- Derivatives: `sensitivity` by `Parameter` gives `Sensitivities`; `gap_gradient` and
  `field_gradient`; `identify` with `read_data` finds parameters from measurements, `Identified`.
- Case files: `Case`, `load_case`, `parse_case`, `build_problem`.
- Results: `Solution`, `write_outputs`. Errors: `InputError`; `NotConvergedError` of a load step;
  `SolveInterrupted` by Ctrl-C.

Wherever a field is given - a displacement, a load, a gap, a coefficient of friction - a number, a
formula such as "0.1*x", a function of x, UFL or a dolfinx Function will do.

The names stand in the stub `contact/__init__.pyi` and are imported on first use, so that a program
can import the package and still initialise PETSc with its own arguments.
"""

from __future__ import annotations

import ast
import os
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "0.1.0"

#: Public name -> its module and its name there.
_PUBLIC = {
    str(alias.asname): (str(node.module), alias.name)
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}

__all__ = ["__version__", *_PUBLIC]

# Open MPI reads this as it starts, where nothing has started it before. With its default choice
# MPI_Dist_graph_create, by which checkpoints are read, may hang (open-mpi/ompi issue 13918).
os.environ.setdefault("OMPI_MCA_topo", "basic")

# The wheels of dolfinx and PETSc do not find the library of MPI by themselves, but take the one
# that mpi4py has loaded. One of pip without a library of MPI raises a RuntimeError.
with suppress(ImportError, RuntimeError):
    import_module("mpi4py.MPI")


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from contact.errors import installed

    module, there = _PUBLIC[name]
    with installed():
        return getattr(import_module(module), there)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
