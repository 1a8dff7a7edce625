"""Derivatives by parameters beside closed forms, and their cost.

`python3 -m scripts.studies.derivatives [--out DIR] [--coarse]`; the page is docs/derivatives.md.
"""

from __future__ import annotations

import time
import tomllib
from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import field_gradient, gap_gradient, parse_case, sensitivity
from contact.case.file import number_at, to_toml
from contact.results.quantities import named_functionals
from contact.solution import Solution
from contact.typing import Array
from forms.elasticity import hexagonal
from forms.piezo import hexagonal_voigt
from scripts.reporting import Report, append, empty, solved
from scripts.studies.half_space import HalfSpace
from scripts.studies.indentation import Setting
from tests.problems.taylor import evolving

#: Constants of PZT-4 (GPa, C/m2, nF/m).
STIFFNESS = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
PIEZO = {"e31": -6.98, "e33": 13.84, "e15": 13.44, "beta11": 6.0, "beta33": 5.47}

#: Those by which the exponents of the force are tabulated.
BY = ("c11", "c33", "c44", "c13", "e31", "e33", "e15", "beta11", "beta33")

#: Extents of the boxes that stand for a half space, in contact radii.
BOXES = (15.0, 30.0)


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


def moved_block(mesh: dict[str, Any], move: list[float], gap: str) -> dict[str, Any]:
    """Return a block whose top is moved, with friction on its bottom."""
    return {
        "mesh": mesh,
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": move}],
        "contact": {"on": "bottom", "gap": gap},
        "friction": {"law": "coulomb", "mu": 0.3},
    }


def cost(report: Report) -> None:
    """Tabulate factorisations, back-substitutions and time beside those of the solution."""
    n = 8 if report.coarse else 125
    cells = [4, 2, 2] if report.coarse else [24, 12, 12]
    pressed = moved_block(
        {"generator": "rectangle", "size": [4.0, 1.0], "cells": [4 * n - 1, n // 4]},
        [0.002, -0.01],
        "0.001*(x - 2)**2",
    )
    space = moved_block(
        {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": cells},
        [0.002, 0.0, -0.01],
        "0.01*((x - 1)**2 + (y - 0.5)**2)",
    )
    loop = evolving(
        pressed | {"mesh": pressed["mesh"] | {"cells": [64, 16]}}, 1 if report.coarse else 4
    )
    plastic = loop | {"material": {"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 0.01}}
    columns = empty("problem", "unknowns", "parameters", "by", "factorisations", "solves", "s")
    many = ["friction.mu", "material.young", "material.poisson", "fixed.0.displacement.1"]
    problems = {"plane": pressed, "3-D": space, "loop": loop, "loop, J2": plastic}
    for title, data in problems.items():
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
