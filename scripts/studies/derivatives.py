"""Derivatives by every parameter of random problems, against central differences of solutions.

`python3 -m scripts.studies.derivatives [COUNT] [FIRST]` prints a row a problem: the largest
relative difference of tangent and central differences, and of tangent and adjoint.
"""

import logging
import sys
import time
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import solve
from contact.case.file import Case, parse_case
from contact.case.text import number_at, to_toml, with_number
from contact.derivatives import sensitivity
from contact.output.differentiable import named_quantities
from contact.output.solution import Solution
from contact.typing import Array

#: Relative change of a parameter in the central differences, and sections with parameters.
STEP = 1e-4
SECTIONS = ("material", "fixed", "load", "contact", "friction", "electric")

#: Numbers that are no parameters: they choose, or leave the problem as it is.
CHOICES = ("radius", "layer", "yield_strain")

#: Derivatives are compared relative to themselves, but not to less than this share of quantity
#: over parameter: a solve knows no more of them.
LEAST = 1e-2

PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


def block(rng: np.random.Generator, cells: int = 12) -> dict[str, Any]:
    """Return a block on a plane, pressed and pushed on its top."""
    push, press = rng.uniform(-0.02, 0.02), -rng.uniform(0.01, 0.03)
    return {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [cells, cells // 2]},
        "material": {"young": rng.uniform(0.5, 2), "poisson": rng.uniform(0.1, 0.4)},
        "fixed": [{"on": "top", "displacement": [push, press]}],
        "contact": {"on": "bottom", "gap": f"{rng.uniform(0.002, 0.02):.4f}*(x - 0.9)**2"},
        "friction": {"law": "coulomb", "mu": rng.uniform(0.05, 0.8)},
    }


def evolving(data: dict[str, Any], steps: int = 3) -> dict[str, Any]:
    """Return a block that is pressed, sheared and sheared back."""
    (top,) = data["fixed"]
    push, press = top["displacement"]
    return data | {
        "fixed": [
            {"on": "top", "displacement": ["free", press], "amplitude": "press"},
            {"on": "top", "displacement": [push, "free"], "amplitude": "shear"},
        ],
        "evolution": {
            "times": [0.0, 1.0, 2.0, 3.0],
            "steps": [steps] * 3,
            "amplitudes": {
                "press": {"time": [0.0, 1.0, 3.0], "value": [0.0, 1.0, 0.7]},
                "shear": {"time": [0.0, 1.0, 2.0, 3.0], "value": [0.0, 0.1, 1.0, -0.4]},
            },
        },
    }


def _slip(rng: np.random.Generator) -> dict[str, Any]:
    return {"law": "slip", "a": rng.uniform(0.2, 0.5), "b": rng.uniform(0, 0.2), "rho": 20.0}


def problem(seed: int) -> tuple[str, dict[str, Any]]:
    """Return a random problem: its family, and the data of its case."""
    rng = np.random.default_rng(seed)
    data, family = block(rng), FAMILIES[seed % len(FAMILIES)]
    if family == "slip":
        data["friction"]["mu"] = _slip(rng)
    elif family == "log":
        data["material"] |= {"law": "log", "yield_strain": 0.01}
    elif family == "layer":
        given = {"layer": 0.05, "stiffness": 5.0, "limit": 0.1}
        data["contact"] |= {"law": "compliance", **given}
        data["contact"]["gap"] = "0.01*(x - 0.9)**2 + 0.055"
    elif family == "evolution":
        data = evolving(data)
    elif family == "evolution, slip":
        data["friction"]["mu"] = _slip(rng)
        data = evolving(data)
    elif family == "evolution, log":
        data["material"] |= {"law": "log", "yield_strain": 0.01}
        data = evolving(data)
    elif family == "piezo":
        data["material"] = {"young": 100.0, "poisson": 0.3, "piezo": PIEZO}
        data["fixed"][0]["potential"] = 0.0
        data["electric"] = {"k_e": rng.uniform(0.5, 2), "phi_f": rng.uniform(0.02, 0.1)}
        data["electric"]["law"] = "perfect"
    elif family == "two bodies":
        data["mesh"] = {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.23}
        material = data["material"]
        data["material"] = [
            {"on": "upper", **material},
            {"on": "lower", "young": 2.3, "poisson": 0.25},
        ]
        data["fixed"] = [{"on": "lower_bottom", "displacement": [0.0, 0.0]}]
        traction = [rng.uniform(-0.003, 0.003), -rng.uniform(0.01, 0.02)]
        data["load"] = [{"on": "upper_top", "traction": traction}]
        data["contact"] = {"on": "upper_bottom", "against": "lower_top"}
    elif family == "ball under a force":
        data["fixed"] = [{"on": "bottom", "displacement": [0.0, 0.0]}]
        ball = {"shape": "sphere", "centre": [1.0, 2.0], "radius": 1.0}
        force = [rng.uniform(0, 2e-4), -rng.uniform(1e-3, 5e-3)]
        rigid = {"displacement": ["free", "free"], "force": force, "centre": [1.0, 2.0]}
        data["contact"] = {"on": "top", "foundation": ball, "rigid": rigid}
    elif family == "3-D":
        push, press = data["fixed"][0]["displacement"]
        data["mesh"] = {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 3, 3]}
        data["fixed"] = [{"on": "top", "displacement": [push, 0.3 * push, press]}]
        data["contact"]["gap"] = "0.01*((x - 0.9)**2 + (y - 0.4)**2)"
    elif family == "revolution":
        data["space"] = {"kinematics": "axisymmetric", "degree": 2}
        data["fixed"] = [{"on": "top", "displacement": [0.0, -0.01]}]
        data["contact"]["gap"] = "0.01*x**2"
    return family, data | {"solver": {"tolerance": 1e-13}}


FAMILIES = (
    "number",
    "slip",
    "log",
    "layer",
    "evolution",
    "evolution, slip",
    "evolution, log",
    "piezo",
    "two bodies",
    "ball under a force",
    "3-D",
    "revolution",
)


def keys(case: Case) -> list[str]:
    """Return the keys of a case with numbers that its solution depends on."""
    data = tomllib.loads(to_toml(case))
    found = [key for name in SECTIONS if name in data for key in _numbers(data[name], name)]
    return [key for key in found if key.rpartition(".")[2] not in CHOICES]


def _numbers(value: Any, path: str) -> Iterator[str]:
    if isinstance(value, Mapping | list):
        inner = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, item in inner:
            if key not in ("foundation", "centre"):
                yield from _numbers(item, f"{path}.{key}")
    elif isinstance(value, float) and 0 < abs(value) < np.inf:
        yield path


def differences(
    solution: Solution, names: list[str], given: list[str], comm: MPI.Intracomm
) -> Array:
    """Return the derivatives by central differences of solutions, (quantities, parameters)."""
    case, columns = solution.source, []
    assert case is not None
    for key in given:
        at = number_at(case, key)
        ends = []
        for sign in (1, -1):
            here = solve(with_number(case, key, at * (1 + sign * STEP)), comm=comm)
            known = named_quantities(here.problem)
            problem = here.problem.at(here.state.time, here.state.history)
            ends.append([known[name](problem, here.state) for name in names])
        columns.append((np.array(ends[0]) - np.array(ends[1])) / (2 * STEP * at))
    return np.array(columns).T


def compared(seed: int, comm: MPI.Intracomm) -> tuple[str, float, float, int]:
    """Return the family, the largest differences with central differences and with the adjoint.

    Both are relative. And the number of nodes that are weakly active.
    """
    family, data = problem(seed)
    solution = solve(parse_case(data), comm=comm)
    given = keys(solution.source)
    names = ["contact_force_x", "contact_force_y", "max_pressure", "max_displacement"]
    if family == "revolution":
        names = names[1:]
    if family == "ball under a force":
        names += ["rigid_x", "rigid_y"]
    if family == "piezo":
        names += ["charge_foundation", "charge_top"]
    found = sensitivity(solution, names, given, "tangent")
    adjoint = sensitivity(solution, names, given, "adjoint")
    tangent, other = (
        np.array([[of[name][key] for key in given] for name in names]) for of in (found, adjoint)
    )
    apart = differences(solution, names, given, comm)
    size = np.abs([number_at(solution.source, key) for key in given])
    known = named_quantities(solution.problem)
    values = np.abs([[known[name](solution.problem, solution.state)] for name in names])
    natural = np.maximum(values, 1e-300) / size
    return (
        family,
        float((np.abs(tangent - apart) / np.maximum(np.abs(apart), LEAST * natural)).max()),
        float((np.abs(tangent - other) / np.maximum(np.abs(tangent), natural)).max()),
        len(found.weakly_active),
    )


def main() -> None:
    """Print a row a problem."""
    logging.disable(logging.WARNING)
    count, first = (int(text) for text in [*sys.argv[1:], *("60", "0")[len(sys.argv) - 1 :]])
    comm = MPI.COMM_WORLD
    for seed in range(first, first + count):
        begin = time.perf_counter()
        family, apart, adjoint, weak = compared(seed, comm)
        if comm.rank == 0:
            seconds = time.perf_counter() - begin
            print(
                f"{seed:3} {family:20} {apart:8.1e} {adjoint:8.1e} {weak:3} {seconds:6.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
