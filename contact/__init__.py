"""Frictional contact of Hencky elasto-plastic and piezoelectric bodies.

A case file is solved by

>>> from contact import load_case, solve
>>> solution = solve(load_case("bar.toml"))  # doctest: +SKIP

and a problem that is put together in Python by

>>> from contact import Body, Contact, Domain, Fixed, Friction, Linear, Problem, solve
>>> domain = Domain.from_mesh(mesh, facet_tags, {"top": 1, "bottom": 2})  # doctest: +SKIP
>>> body = Body(Linear(210e3, 0.3), [Fixed("top", [0.0, -0.01])])  # doctest: +SKIP
>>> problem = Problem(domain, body, Contact("bottom"), Friction(mu=0.3))  # doctest: +SKIP
>>> solution = solve(problem)  # doctest: +SKIP

- Geometry: `from_msh` reads a Gmsh file, `Domain.from_mesh` takes dolfinx's mesh and tags.
- Body: `Body`, `Fixed`, `Load`; `Linear`, `Log`, `UserLaw`, `Piezo`; several by `Material`, and
  crystals by `make_material`; `Rigid` with its `Motion`, and `Electrode`.
- Contact: `Contact` with a gap, or a `Plane`, `Sphere`, `Cylinder`, `Cone`, `Paraboloid`, `Punch`,
  `Level`, `Triangles`, a `Shape` of your own; `Layer`; `Friction`, `SlipCoefficient`, `Coulomb`;
  `Conductor` with `ShiftedConductivity`, `RampConductivity`, `PerfectConductivity`.
- Solving: `Problem`, `solve`, `evolve`; `NewtonOptions`, `FixedPointOptions`, `PenaltyOptions`.
- Case files: `Case`, `load_case`, `parse_case`, `build_problem`.
- Results: `Solution`, `write_outputs`. Errors of the input: `InputError`; Ctrl-C:
  `SolveInterrupted`.

Wherever a field is given - a displacement, a load, a gap, a coefficient of friction - a number, a
function of x, UFL or a dolfinx Function will do.

The names are imported on first use, so that a program can import the package and still initialise
PETSc with its own arguments.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from contact.body.description import Body, Fixed, Load, Material
    from contact.body.rigid import Electrode, Motion, Rigid
    from contact.build import build_problem
    from contact.building.materials import make_material
    from contact.case.file import Case, load_case, parse_case
    from contact.errors import InputError
    from contact.evolving import evolve
    from contact.interface.current import Conductor
    from contact.interface.friction import Friction
    from contact.interface.layer import Layer
    from contact.interface.obstacle import (
        Cone,
        Cylinder,
        GapFunction,
        Level,
        Paraboloid,
        Plane,
        Punch,
        Shape,
        Sphere,
        Triangles,
    )
    from contact.mesh.domain import Domain
    from contact.mesh.reader import from_msh
    from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
    from contact.output.files import write_outputs
    from contact.output.solution import Solution
    from contact.problem.contact import Contact
    from contact.problem.problem import ContactProblem as Problem
    from contact.solving import SolveInterrupted, solve, solve_problem
    from forms.hencky import Linear, Log, UserLaw
    from forms.laws import (
        Coulomb,
        PerfectConductivity,
        RampConductivity,
        ShiftedConductivity,
        SlipCoefficient,
    )
    from forms.piezo import Piezo

#: Module -> the names that stand there.
_HOMES = {
    "contact.body.description": "Body Fixed Load Material",
    "contact.body.rigid": "Electrode Motion Rigid",
    "contact.build": "build_problem",
    "contact.building.materials": "make_material",
    "contact.case.file": "Case load_case parse_case",
    "contact.errors": "InputError",
    "contact.evolving": "evolve",
    "contact.interface.current": "Conductor",
    "contact.interface.friction": "Friction",
    "contact.interface.layer": "Layer",
    "contact.interface.obstacle": "Cone Cylinder GapFunction Level Paraboloid Plane Punch "
    "Shape Sphere Triangles",
    "contact.mesh.domain": "Domain",
    "contact.mesh.reader": "from_msh",
    "contact.methods.options": "FixedPointOptions NewtonOptions PenaltyOptions",
    "contact.output.files": "write_outputs",
    "contact.output.solution": "Solution",
    "contact.problem.contact": "Contact",
    "contact.problem.problem": "ContactProblem",
    "contact.solving": "SolveInterrupted solve solve_problem",
    "forms.hencky": "Linear Log UserLaw",
    "forms.laws": "Coulomb PerfectConductivity RampConductivity ShiftedConductivity "
    "SlipCoefficient",
    "forms.piezo": "Piezo",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}
#: Shorter names.
_ALIASES = {"Problem": "ContactProblem"}

__all__ = [
    "Body",
    "Case",
    "Conductor",
    "Cone",
    "Contact",
    "Coulomb",
    "Cylinder",
    "Domain",
    "Electrode",
    "Fixed",
    "FixedPointOptions",
    "Friction",
    "GapFunction",
    "InputError",
    "Layer",
    "Level",
    "Linear",
    "Load",
    "Log",
    "Material",
    "Motion",
    "NewtonOptions",
    "Paraboloid",
    "PenaltyOptions",
    "PerfectConductivity",
    "Piezo",
    "Plane",
    "Problem",
    "Punch",
    "RampConductivity",
    "Rigid",
    "Shape",
    "ShiftedConductivity",
    "SlipCoefficient",
    "Solution",
    "SolveInterrupted",
    "Sphere",
    "Triangles",
    "UserLaw",
    "__version__",
    "build_problem",
    "evolve",
    "from_msh",
    "load_case",
    "make_material",
    "parse_case",
    "solve",
    "solve_problem",
    "write_outputs",
]

__version__ = "0.1.0"

# Open MPI reads this as it starts, where nothing has started it before. With its default choice
# MPI_Dist_graph_create, by which checkpoints are read, may hang (open-mpi/ompi issue 13918).
os.environ.setdefault("OMPI_MCA_topo", "basic")


def __getattr__(name: str) -> Any:
    known = _ALIASES.get(name, name)
    if known not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[known]), known)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
