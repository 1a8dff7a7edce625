"""Derivatives by every parameter of random problems, against central differences of solutions.

`python3 -m scripts.studies.derivatives [--out DIR] [--coarse]`.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import solve
from contact.case.file import Case, number_at, parse_case, to_toml, with_number
from contact.derivatives.by_parameters import (
    ADJOINT,
    TANGENT,
    Parameter,
    Sensitivities,
    parameters_of,
    sensitivity,
)
from contact.errors import InputError
from contact.problem.linearised import active_set
from contact.results.quantities import named_functionals
from contact.results.solution import Solution
from contact.typing import Array
from scripts.reporting import Report, append, empty, options

#: Relative changes of a parameter in the central differences: the first without a kink between.
STEPS = (2e-5, 5e-6, 1e-6)

#: Sections with parameters.
SECTIONS = ("material", "fixed", "load", "contact", "friction", "electric", "electrode")

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


def evolving(data: dict[str, Any], steps: int = 2) -> dict[str, Any]:
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
    data, family = block(rng), family_of(seed)
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
        data["friction"]["mu"] = max(data["friction"]["mu"], 0.4)  # which holds the upper one
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
    elif family == "smoothed":
        data["friction"]["radius"] = rng.uniform(0.1, 0.3)
    elif family == "evolution, j2":
        hardening = {"yield_stress": 0.01 * data["material"]["young"], "hardening": 0.2}
        data["material"] |= {"law": "j2", **hardening}
        data = evolving(data)
    elif family == "evolution, electrode":
        data["material"] = {"young": 100.0, "poisson": 0.3, "piezo": PIEZO}
        data["electric"] = {"law": "perfect", "k_e": rng.uniform(0.5, 2), "phi_f": 0.05}
        data["electrode"] = [
            {"on": "top", "charge": rng.uniform(-0.1, 0.1), "amplitude": "constant"}
        ]
        data = evolving(data)
    elif family == "revolution":
        data["space"] = {"kinematics": "axisymmetric", "degree": 2}
        data["fixed"] = [{"on": "top", "displacement": [0.0, -0.01]}]
        data["contact"]["gap"] = "0.01*x**2"
    elif family == "turning plate":
        data["fixed"] = []
        force = [rng.uniform(-3e-3, 3e-3), -rng.uniform(0.01, 0.02)]
        plate = {"on": "top", "displacement": ["free", "free"], "force": force}
        plate |= {"rotation": "free", "moment": rng.uniform(-1e-3, 1e-3)}
        data["rigid"] = [{**plate, "centre": [rng.uniform(0.6, 1.4), 0.0]}]
        data["friction"]["mu"] = max(data["friction"]["mu"], 0.5)
    elif family == "slant, in SI":
        size, young = 10 ** rng.uniform(-3, 0), 210e9
        angle = rng.uniform(10, 80)
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        push = 1e-3 * size * np.array([[c, -s], [s, c]]) @ [rng.uniform(-1, 1), -4.0]
        data["mesh"] |= {"size": [2 * size, size], "rotation": angle}
        data["material"]["young"] = young
        data["fixed"] = [{"on": "top", "displacement": push.tolist()}]
        data["load"] = [{"on": "left", "traction": [0.0, 1e-5 * young]}]
        data["contact"]["gap"] = 1e-3 * size
    elif family == "numbers at 0":
        size, young = 10 ** rng.uniform(-6, 0), 10 ** rng.uniform(0, 11)
        data["mesh"] |= {"size": [2 * size, size], "origin": [0.0, 0.0], "rotation": 0.0}
        data["material"] = {"young": young, "poisson": 0.0}
        data["fixed"] = [{"on": "bottom", "displacement": [0.0, 0.0]}]
        data["load"] = [{"on": "right", "traction": [0.0, 0.0]}]
        ball = {"shape": "sphere", "centre": [0.0, 3.01 * size], "radius": 2 * size}
        motion = {"displacement": [0.0, -0.06 * size], "rotation": 0.0, "centre": [0.0, 0.0]}
        data["contact"] = {"on": "top", "foundation": ball, "rigid": motion}
        law = {"law": "slip", "a": rng.uniform(0.2, 0.6), "b": 0.0, "rho": 0.0}
        data["friction"] = {"law": "coulomb", "mu": law}
    return family, data | {"solver": {"tolerance": 1e-13}}


def family_of(seed: int) -> str:
    """Return the family of a problem: those of `FURTHER` come after the others."""
    if seed < COUNT:
        return FAMILIES[seed % len(FAMILIES)]
    return FURTHER[(seed - COUNT) % len(FURTHER)]


#: Families of which all numbers are parameters, those of the mesh and 0 among them.
FURTHER = ("turning plate", "slant, in SI", "numbers at 0")

#: Problems of the others, and of all.
COUNT, ALL = 60, 72

FAMILIES = (
    "number", "slip", "log", "layer", "evolution", "evolution, slip", "evolution, log", "piezo",
    "two bodies", "ball under a force", "3-D", "revolution", "smoothed", "evolution, j2",
    "evolution, electrode",
)  # fmt: skip


def keys(case: Case, every: bool = False) -> list[str]:
    """Return the keys of a case with numbers that its solution depends on.

    Every one, or those of the sections but the mesh and rigid parts that are not 0.
    """
    data = tomllib.loads(to_toml(case))
    sections = (*SECTIONS, "mesh", "rigid") if every else SECTIONS
    found = [key for name in sections if name in data for key in _numbers(data[name], name, every)]
    kept = [key for key in found if key.rpartition(".")[2] not in CHOICES or "foundation" in key]
    return [key for key in kept if _moves(case, key)]


def _moves(case: Case, key: str) -> bool:
    """Tell whether a larger number is accepted: no moment is where no rotation is free."""
    try:
        with_number(case, key, number_at(case, key) + 1e-9)
    except InputError:
        return False
    return True


def _numbers(value: Any, path: str, every: bool) -> Iterator[str]:
    if isinstance(value, Mapping | list):
        inner = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, item in inner:
            if every or key not in ("foundation", "centre"):
                yield from _numbers(item, f"{path}.{key}", every)
    elif isinstance(value, float) and abs(value) < np.inf and (every or value != 0):
        yield path


def size_of(case: Case, key: str) -> float:
    """Return the size of a parameter, by the units of the body where it is 0."""
    size = abs(number_at(case, key))
    if size > 0:
        return size
    assert case.mesh.size is not None  # numbers at 0 are those of rectangles
    length, young = case.mesh.size[-1], number_at(case, f"{case.materials[0][0]}.young")
    sizes = {
        "displacement": 0.01 * length,
        "traction": 0.01 * young,
        "rotation": 1.0,
        "poisson": 0.1,
        "origin": 0.1 * length,
        "centre": 0.1 * length,
        "b": 0.1,
        "rho": 1 / length,
    }
    named = [name for name in key.split(".") if not name.isdigit()]
    return sizes[named[-1]]


def values(solution: Solution, names: list[str]) -> Array:
    """Return results of the end of a solution. Collective."""
    known, state = named_functionals(solution.problem), solution.state
    problem = solution.problem.at(state.time, state.history)
    return np.array([known[name](problem, state) for name in names])


def moved(case: Case, way: Mapping[str, float], by: float) -> Case:
    """Return a case with each of some numbers changed by so many times its way and size."""
    made = case
    for key, change in way.items():
        if change:
            made = with_number(made, key, number_at(case, key) + by * change * size_of(case, key))
    return made


def active_sets(solution: Solution) -> Array:
    """Return states of the contact nodes of all steps, in an order of their places. Collective.

    Of all ranks: two runs need not divide a mesh alike, and their meshes may differ a little.
    """
    base, found = solution.problem, []
    along = np.sqrt([1.0, 2.0, 3.0])[: base.dim]
    for state in [step.state for step in solution.steps] or [solution.state]:
        active = active_set(base.at(state.time, state.history), state)
        own = np.column_stack([base.nodes.points @ along, active.closed, active.slips])
        rows = base.nodes.gather(own)
        found.append(rows[np.argsort(rows[:, 0]), 1:])
    return np.array(found)


def differences(
    solution: Solution, names: list[str], way: Mapping[str, float]
) -> tuple[Array, float]:
    """Return the derivatives along a way of parameters by differences of solutions.

    Where the active sets of the ends differ in a step, the difference goes across a kink of
    the results: it is taken over a smaller part of the way then. It is central, or
    of second order on one side where no number is accepted on the other.
    """
    comm, case = solution.problem.comm, solution.source
    for step in STEPS:
        try:
            ends, factors = [moved(case, way, by) for by in (step, -step)], (0.5, -0.5)
        except InputError:  # a border
            ends, factors = [moved(case, way, by) for by in (step, 2 * step, 0.0)], (2, -0.5, -1.5)
        runs = [solve(end, comm=comm) for end in ends]
        one, *others = (active_sets(run) for run in runs)
        same = all(np.array_equal(one, other) for other in others)
        if same:
            break
    found = sum(f * values(run, names) for f, run in zip(factors, runs, strict=True)) / step
    return found, step if same else 0.0


@dataclass(frozen=True)
class Compared:
    """Relative differences of the tangent, the largest over results and ways."""

    family: str
    #: To central differences of solutions, and to the adjoint.
    apart: float
    adjoint: float
    #: Number of weakly active nodes; names of the parameters whose differences were shortened, for
    #: at their ends another node touches, sticks or slips, each with the step.
    weak: int
    kinks: str
    #: How many there are; ways of parameters along which solutions were compared.
    parameters: int
    results: int
    ways: int


def by_both(
    solution: Solution, names: Sequence[str], parameters: Sequence[str] | Mapping[str, Parameter]
) -> tuple[Sensitivities, Sensitivities]:
    """Return the derivatives by the tangent and by the adjoint. Collective.

    The problems beside the parameters, which take most of the time to set up, are the same.
    """
    shared = {
        name: replace(one, problem=cache(one.problem))
        for name, one in parameters_of(solution, parameters)
    }
    tangent, adjoint = (sensitivity(solution, names, shared, way) for way in (TANGENT, ADJOINT))
    return tangent, adjoint


def compared(seed: int, comm: MPI.Intracomm, each: bool = True) -> Compared:
    """Compare the derivatives of a random problem by all of its parameters. Collective."""
    family, data = problem(seed)
    solution = solve(parse_case(data), comm=comm)
    given = keys(solution.source, every=family in FURTHER)
    names = ["contact_force_x", "contact_force_y", "max_pressure", "max_displacement"]
    names = names[1:] if family == "revolution" else names
    if family == "ball under a force":
        names += ["rigid_x", "rigid_y"]
    if family == "piezo":
        names += ["charge_foundation", "charge_top"]
    if family == "evolution, electrode":
        names += ["charge_foundation", "potential_top", "reaction_x_top"]
    if family == "turning plate":
        names += ["rigid_x", "rigid_y", "rigid_rotation"]
    size = np.array([size_of(solution.source, key) for key in given])
    found, other = by_both(solution, names, given)
    # By relative changes of the parameters: in the units of the results.
    tangent, adjoint = (
        np.array([[of[name][key] for key in given] for name in names]) * size
        for of in (found, other)
    )
    natural = np.maximum(np.abs(values(solution, names)), 1e-300)[:, None]
    both = float((np.abs(tangent - adjoint) / np.maximum(np.abs(tangent), natural)).max())
    ways = np.eye(len(given))
    if not each:
        ways = np.random.default_rng(seed).uniform(-1, 1, (len(given), 1))
        at = np.array([number_at(solution.source, key) for key in given])
        ways[at == 0] = np.abs(ways[at == 0])  # 0 may be the least that is accepted
    ends = [differences(solution, names, dict(zip(given, way, strict=True))) for way in ways.T]
    apart, along = np.column_stack([end for end, _ in ends]), tangent @ ways
    known = given if each else ["all of them"]
    kinks = [f"{k} ({step:g})" for k, (_, step) in zip(known, ends, strict=True) if step < STEPS[0]]
    return Compared(
        family,
        float((np.abs(along - apart) / np.maximum(np.abs(apart), LEAST * natural)).max()),
        both,
        len(found.weakly_active),
        "; ".join(kinks),
        len(given),
        len(names),
        ways.shape[1],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare the problems, and tabulate them by family."""
    given = options(__doc__, "derivatives", arguments)
    report = Report(given.out)
    rows = empty(*Compared.__annotations__)
    for seed in range(len(FAMILIES) if given.coarse else ALL):  # one of each
        append(rows, *vars(compared(seed, MPI.COMM_WORLD, each=not given.coarse)).values())
        print(seed, *(column[-1] for column in rows.values()), flush=True)
    report.numbers("problems-all", rows)
    tabulate(report, rows)


def tabulate(report: Report, rows: Mapping[str, Sequence[Any]]) -> None:
    """Tabulate the problems by family."""
    columns = empty("family", "problems", "derivatives", "adjoint", "differences", "apart", "kinks")
    every = [dict(zip(rows, row, strict=True)) for row in zip(*rows.values(), strict=True)]
    for family in dict.fromkeys(rows["family"]):
        own = [row for row in every if row["family"] == family]
        apart, adjoint = (max(row[name] for row in own) for name in ("apart", "adjoint"))
        by, along = (sum(r[name] * r["results"] for r in own) for name in ("parameters", "ways"))
        kinks = sum(len(row["kinks"].split(";")) for row in own if row["kinks"])
        append(columns, family, len(own), by, adjoint, along, apart, kinks)
    report.table(
        "problems",
        "Derivatives of random problems by all their parameters",
        columns,
        "Largest relative difference of the tangent to the adjoint, and to central differences of "
        "solutions by each parameter (apart). Derivatives are compared relative to themselves, but "
        "to not less than the result (adjoint), or a hundredth of the result (apart), over the "
        "parameter. Kinks: differences between whose ends a node begins to touch, stick or slip; "
        "they were taken over a smaller part of the way. problems-all.csv names their parameters.",
    )


if __name__ == "__main__":
    main()
