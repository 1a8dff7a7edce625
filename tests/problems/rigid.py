"""Blocks that rigid indenters, plates and electrodes act on."""

from typing import Any

from mpi4py import MPI

from contact.case.file import Case, parse_case
from contact.methods.options import NewtonOptions, Options
from contact.results.resultants import movements
from contact.solution import Solution
from contact.solving import solve

#: Class 6mm of the thesis, in GPa, C/m2, nF/m.
PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


def indented(dim: int = 2, n: int = 12, degree: int = 1, **rigid: Any) -> Case:
    """Return a block, 2 wide and 1 high, with a ball of radius 1 on it."""
    middle = [1.0] * (dim - 1)
    data: dict[str, Any] = {
        "mesh": {
            "generator": "rectangle" if dim == 2 else "box",
            "origin": [0.0] * dim,
            "size": [2.0] * (dim - 1) + [1.0],
            "cells": [2 * n] * (dim - 1) + [n],
        },
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "bottom", "displacement": [0.0] * dim}],
        "contact": {
            "on": "top",
            "foundation": {"shape": "sphere", "centre": [*middle, 2.0], "radius": 1.0},
            "rigid": {"centre": [*middle, 2.0], **rigid},
        },
        "friction": {"law": "coulomb", "mu": 0.4},
    }
    return parse_case(data)


def solved(
    case: Case, comm: MPI.Comm, settings: Options | None = None
) -> tuple[Solution, dict[str, Any]]:
    """Return the solution of a case, and how what is rigid has moved in it."""
    solution = solve(case, settings or NewtonOptions(tolerance=1e-10), comm=comm)
    assert solution.converged, solution.outcome.reason
    return solution, movements(solution.problem, solution.state)


def plate(**more):
    """Return a block under a plate that stays plane, on a plane without friction."""
    data = {
        "mesh": {
            "generator": "rectangle",
            "origin": [0.0, 0.0],
            "size": [2.0, 1.0],
            "cells": [12, 6],
        },
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, "free"]}],
        "rigid": [
            {
                "on": "top",
                "displacement": [0.0, "free"],
                "force": [0.0, -0.02],
                "rotation": "free",
                "moment": 0.002,
                "centre": [1.0, 1.0],
            }
        ],
        "contact": {"on": "bottom"},
    }
    return parse_case({**data, **more})


def column(**more):
    """Return a piezoelectric column of height 2 on an electrode, pressed by 1e-3."""
    data = {
        "mesh": {"generator": "rectangle", "size": [1.0, 2.0], "cells": [3, 6]},
        "material": {"young": 100.0, "poisson": 0.3, "piezo": PIEZO},
        "fixed": [
            {"on": "left", "displacement": [0.0, "free"]},
            {"on": "right", "displacement": [0.0, "free"]},
            {"on": "bottom", "potential": 0.0},
        ],
        "load": [{"on": "top", "traction": [0.0, -1e-3]}],
        "electrode": [{"on": "top"}],
        "contact": {"on": "bottom"},
    }
    return parse_case({**data, **more})
