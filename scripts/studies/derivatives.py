"""Derivatives by parameters: random problems, closed forms and published values, and their cost.

`python3 -m scripts.studies.derivatives [--out DIR] [--coarse]`; the page is docs/derivatives.md.
"""

from __future__ import annotations

import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import field_gradient, gap_gradient, parse_case, solve
from contact.case.file import Case, number_at, to_toml, with_number
from contact.derivatives.by_parameters import (
    ADJOINT,
    TANGENT,
    Parameter,
    Sensitivities,
    parameters_of,
    sensitivity,
)
from contact.errors import InputError
from contact.results.quantities import named_functionals
from contact.results.solution import Solution
from contact.typing import Array
from forms.elasticity import hexagonal
from forms.piezo import hexagonal_voigt
from scripts.reporting import Report, append, empty, solved
from scripts.studies.half_space import HalfSpace
from scripts.studies.indentation import Setting

#: Largest step in Taylor's series, in sizes of the parameters; the other one is half of it.
STEP = 2e-5

#: Constants of PZT-4 (GPa, C/m2, nF/m).
STIFFNESS = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
PIEZO = {"e31": -6.98, "e33": 13.84, "e15": 13.44, "beta11": 6.0, "beta33": 5.47}

#: Those by which the exponents of the force are tabulated.
BY = ("c11", "c33", "c44", "c13", "e31", "e33", "e15", "beta11", "beta33")

#: Extents of the boxes that stand for a half space, in contact radii.
BOXES = (15.0, 30.0)


#: Sections with parameters.
SECTIONS = ("material", "fixed", "load", "contact", "friction", "electric", "electrode")

#: Numbers that are no parameters: they choose, or leave the problem as it is.
CHOICES = ("radius", "layer", "yield_strain")

SHARP = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


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


def problem(family: str) -> dict[str, Any]:
    """Return the case of a random problem."""
    rng = np.random.default_rng(FAMILIES.index(family))
    data = block(rng)
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
        data["material"] = {"young": 100.0, "poisson": 0.3, "piezo": SHARP}
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
        data["material"] = {"young": 100.0, "poisson": 0.3, "piezo": SHARP}
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
    return data | {"solver": {"tolerance": 1e-13}}


#: Families of which all numbers are parameters, those of the mesh and 0 among them.
FURTHER = "turning plate", "slant, in SI", "numbers at 0"

FAMILIES = (
    "number", "slip", "log", "layer", "evolution", "evolution, slip", "evolution, log", "piezo",
    "two bodies", "ball under a force", "3-D", "revolution", "smoothed", "evolution, j2",
    "evolution, electrode", *FURTHER,
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


@dataclass(frozen=True)
class Taylor:
    """Taylor's series of results along a way of parameters, by the tangent; all is relative."""

    #: Largest difference of the adjoint, over derivative and result.
    adjoint: float
    #: Largest difference of one-sided differences of second order, over derivative and a hundredth
    #: of the result.
    apart: float
    #: Order of the largest remainder of first order.
    order: float
    #: Number of weakly active nodes.
    weak: int


def taylor(
    solution: Solution, names: Sequence[str], sizes: Mapping[str, float], way: Array
) -> Taylor:
    """Compare tangent, adjoint and two more solutions along a way. Collective."""
    case, comm = solution.source, solution.problem.comm
    both = by_both(solution, names, [*sizes])
    # By relative changes of the parameters: in the units of the results.
    scale = np.array([*sizes.values()])
    tangent, adjoint = (
        np.array([[of[name][key] for key in sizes] for name in names]) * scale for of in both
    )
    here = values(solution, names)
    natural = np.maximum(np.abs(here), 1e-300)
    least = np.maximum(np.abs(tangent), natural[:, None])

    def moved(by: float) -> Array:
        """Return the change of the results."""
        end = case
        for key, change in zip(sizes, by * way * scale, strict=True):
            end = with_number(end, key, number_at(case, key) + change)
        return values(solve(end, comm=comm), names) - here

    far, near = moved(STEP), moved(STEP / 2)
    along, apart = tangent @ way, (4 * near - far) / STEP
    first, second = (
        float((np.abs(end - by * along) / natural).max())
        for end, by in ((far, STEP), (near, STEP / 2))
    )
    return Taylor(
        float((np.abs(tangent - adjoint) / least).max()),
        float((np.abs(along - apart) / np.maximum(np.abs(apart), 1e-2 * natural)).max()),
        float(np.log2(first / second)) if second else np.nan,
        len(both[0].weakly_active),
    )


#: Results of a family beside forces, pressure and displacement.
MORE = {
    "ball under a force": ("rigid_x", "rigid_y"),
    "piezo": ("charge_foundation", "charge_top"),
    "evolution, electrode": ("charge_foundation", "potential_top", "reaction_x_top"),
    "turning plate": ("rigid_x", "rigid_y", "rigid_rotation"),
}


def series(family: str, comm: MPI.Intracomm) -> Taylor:
    """Compare along a random way of all parameters of a random problem. Collective."""
    solution = solve(parse_case(problem(family)), comm=comm)
    case, names = solution.source, ["contact_force_y", "max_pressure", "max_displacement"]
    names += ([] if family == "revolution" else ["contact_force_x"]) + [*MORE.get(family, ())]
    sizes = {key: size_of(case, key) for key in keys(case, every=family in FURTHER)}
    way = np.random.default_rng(FAMILIES.index(family)).uniform(-1, 1, len(sizes))
    at_zero = np.array([number_at(case, key) == 0 for key in sizes])
    way[at_zero] = np.abs(way[at_zero])  # 0 may be the least that is accepted
    return taylor(solution, names, sizes, way)


def relative(solution: Solution, name: str, keys: Sequence[str]) -> Array:
    """Return d ln Q/d ln m of a result by parameters."""
    found = sensitivity(solution, [name], keys)[name]
    value = named_functionals(solution.problem)[name](solution.problem, solution.state)
    return np.array([found[key] * number_at(solution.source, key) / value for key in keys])


def closed_exponents(potential: float | None) -> Array:
    """Return the exponents of the force of a ball on a half space of PZT-4 by its constants."""

    def stiffness(constants: dict[str, float]) -> float:
        coupling = hexagonal_voigt(**{key: constants[key] for key in PIEZO})
        elastic = hexagonal(*(constants[key] for key in ("c11", "c12", "c13", "c33", "c44")))
        body = HalfSpace(elastic, *coupling)
        return body.insulating if potential is None else body.conducting

    constants, step = STIFFNESS | PIEZO, 1e-5
    return np.array(
        [
            np.log(
                stiffness(constants | {key: constants[key] * (1 + step)})
                / stiffness(constants | {key: constants[key] * (1 - step)})
            )
            / (2 * step)
            for key in BY
        ]
    )


def ball(potential: float | None, fineness: float, material: dict[str, Any]) -> list[Solution]:
    """Return a ball on a half space of a material in two boxes."""
    found = []
    for extent in BOXES:
        data = tomllib.loads(to_toml(Setting("PZT-4", "ball", potential, fineness).case(extent)))
        data["material"], data["solver"] = material, {"tolerance": 1e-11}
        if "piezo" not in material:
            del data["fixed"][0]["potential"], data["fixed"][1]["potential"]
        found.append(solved(parse_case(data)))
    return found


def exponents(report: Report, fineness: float) -> None:
    """Tabulate the exponents of the force on a ball, of PZT-4 and of Hertz."""
    crystal = {"law": "anisotropic", "poling": -90.0, **STIFFNESS, "piezo": PIEZO}
    shape = ["contact.foundation.radius", "contact.rigid.displacement.1"]
    columns = empty("ball", "parameter", *(f"box {box:g} a" for box in BOXES))
    columns |= {"extrapolated": [], "closed form": []}
    for kind, potential, material, own in (
        ("insulating", None, crystal, BY),
        ("conducting", 0.0, crystal, BY),
        ("Hertz", None, {"young": 100.0, "poisson": 0.3}, ("young",)),
    ):
        keys = [f"material.{'' if key in STIFFNESS or kind == 'Hertz' else 'piezo.'}{key}"
                for key in own]  # fmt: skip
        first, second = (
            relative(solution, "contact_force_y", [*keys, *shape])
            for solution in ball(potential, fineness, material)
        )
        exact = [1.0] if kind == "Hertz" else closed_exponents(potential)
        rows = zip(
            [*own, "R", "delta"], first, second, 2 * second - first, [*exact, 0.5, 1.5], strict=True
        )
        for row in rows:
            append(columns, kind, *row)
    report.table(
        "exponents",
        "Exponents of the force on a ball: d ln P/d ln m at a given depth",
        columns,
        "Quadratic elements in a body of revolution, 12 of them on the contact radius a = 0.1 R. "
        "The error caused by the finite box is of first order in a over its size, and is "
        "extrapolated.",
    )


def cost(report: Report) -> None:
    """Tabulate factorisations, back-substitutions and time beside those of the solution."""
    n = 8 if report.coarse else 125
    pressed = {
        "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [4 * n - 1, n // 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [0.002, -0.01]}],
        "contact": {"on": "bottom", "gap": "0.001*(x - 2)**2"},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    space = {
        "mesh": {
            "generator": "box",
            "size": [2.0, 1.0, 1.0],
            "cells": [4, 2, 2] if report.coarse else [24, 12, 12],
        },
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [0.002, 0.0, -0.01]}],
        "contact": {"on": "bottom", "gap": "0.01*((x - 1)**2 + (y - 0.5)**2)"},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    loop = evolving(
        pressed | {"mesh": pressed["mesh"] | {"cells": [64, 16]}}, 1 if report.coarse else 4
    )
    plastic = loop | {"material": {"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 0.01}}
    columns = empty("problem", "unknowns", "parameters", "by", "factorisations", "solves", "s")
    many = ["friction.mu", "material.young", "material.poisson", "fixed.0.displacement.1"]
    for title, data in (
        ("plane", pressed),
        ("3-D", space),
        ("loop", loop),
        ("loop, J2", plastic),
    ):
        begin = time.process_time()
        solution = solved(parse_case(data))
        seconds, summary = time.process_time() - begin, solution.counters
        size = solution.problem.body.layout.unknowns
        append(columns, title, size, 0, "solution", summary.factorizations,
               summary.linear_solves, seconds)  # fmt: skip
        name, nodes = "contact_force_x", solution.problem.nodes.size
        for parameters, method in ((many[:1], "tangent"), (many, "tangent"), (many[:1], "adjoint"),
                                   (many, "adjoint")):  # fmt: skip
            begin = time.process_time()
            found = sensitivity(solution, [name], parameters, method)
            seconds, taken = time.process_time() - begin, found.counters
            append(columns, title, size, len(parameters), method, taken.factorizations,
                   taken.linear_solves, seconds)  # fmt: skip
        for count, label, made in (
            (nodes, "gap_gradient", gap_gradient),
            (solution.problem.domain.mesh.topology.index_map(solution.problem.dim).size_local,
             "field_gradient", field_gradient),
        ):  # fmt: skip
            begin = time.process_time()
            made(solution, name)
            append(columns, title, size, count, label, len(solution.steps) or 1, "—",
                   time.process_time() - begin)  # fmt: skip
    report.table(
        "cost",
        "Cost of derivatives of one result beside that of the solution",
        columns,
        "Factorisations, back-substitutions and seconds of the processor on one thread. The time "
        "includes two residuals per parameter and step, and the problems of the two changed "
        "values.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "derivatives", arguments)
    exponents(report, 4.0 if report.coarse else 12.0)
    cost(report)


if __name__ == "__main__":
    main()
