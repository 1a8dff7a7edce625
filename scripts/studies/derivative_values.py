"""Derivatives beside closed forms and published values, and their cost.

`python3 -m scripts.studies.derivative_values [--out DIR] [--coarse]`: exponents of indentation,
the charge of a column, the bar of Example 7.2; remainders of Taylor's series, transposed
solves, and the cost beside that of a solution.
"""

from __future__ import annotations

import time
import tomllib
from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import field_gradient, gap_gradient, load_case, parse_case, sensitivity
from contact.case.file import Case, number_at, to_toml, with_number
from contact.derivatives.by_parameters import LoadPath
from contact.results.quantities import named_functionals
from contact.results.solution import Solution
from contact.typing import Array
from forms.elasticity import hexagonal
from forms.piezo import hexagonal_voigt
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, options, solved
from scripts.studies.derivatives import block, evolving
from scripts.studies.half_space import HalfSpace
from scripts.studies.indentation import Setting

#: Constants of PZT-4 (GPa, C/m2, nF/m).
STIFFNESS = {"c11": 139.0, "c12": 77.8, "c13": 74.3, "c33": 113.0, "c44": 25.6}
PIEZO = {"e31": -6.98, "e33": 13.84, "e15": 13.44, "beta11": 6.0, "beta33": 5.47}

#: Those by which the exponents of the force are tabulated.
BY = ("c11", "c33", "c44", "c13", "e31", "e33", "e15", "beta11", "beta33")

#: Extents of the boxes that stand for a half space, in contact radii.
BOXES = (15.0, 30.0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    given = options(__doc__, "derivatives", arguments)
    report, coarse = Report(given.out), given.coarse
    known(report)
    exponents(report, 4.0 if coarse else 12.0)
    remainders(report)
    cost(report, coarse)


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


def known(report: Report) -> None:
    """Tabulate derivatives that are known."""
    columns = empty("problem", "derivative", "found", "known")
    changes = ["mesh.cells=[64,16]", "material.law=linear", "friction.mu=0.3"]
    bar = solved(load_case(CASES / "bar.toml", [*changes, "solver.tolerance=1e-12"]))
    names = ["contact_force_x", "contact_force_y", "max_pressure"]
    found = sensitivity(bar, names, ["friction.mu", "material.young"])
    for name, value in zip(names, (-6.2189744e-4, 1.4790623e-4, 1.25772757e-2), strict=True):
        append(columns, "bar 64 x 16", f"d {name}/d mu", found[name]["friction.mu"], value)
    append(columns, "bar 64 x 16", "d contact_force_x/d E", found[names[0]]["material.young"], 0.0)
    height, k, b, top = 0.5, 2.0, PIEZO["beta33"], 3.0
    column = solved(parse_case(charged_column(height, k, top)))
    slope = sensitivity(column, ["charge_foundation"], ["electric.k_e"])["charge_foundation"]
    sign = np.sign(slope["electric.k_e"])
    exact = top / (k * height / b + 1) ** 2
    append(columns, "column", "d charge/d k", sign * slope["electric.k_e"], exact)
    shown = {name: [f"{x:.9g}" if isinstance(x, float) else x for x in column]
             for name, column in columns.items()}  # fmt: skip
    report.table(
        "known",
        "Derivatives beside known ones",
        shown,
    )


def charged_column(height: float, k: float, top: float) -> dict[str, Any]:
    """Return a column without coupling on a foundation that conducts with a constant k."""
    return {
        "mesh": {"generator": "rectangle", "size": [1.0, height], "cells": [2, 4]},
        "material": {
            "young": 1.0,
            "poisson": 0.3,
            "piezo": PIEZO | {"e31": 0.0, "e33": 0.0, "e15": 0.0},
        },
        "fixed": [{"on": "top", "displacement": [0.0, -0.01], "potential": top}],
        "contact": {"on": "bottom"},
        "electric": {"law": "perfect", "k_e": k, "phi_f": 0.0},
        "solver": {"tolerance": 1e-12},
    }


def remainders(report: Report) -> None:
    """Tabulate the remainder of Taylor's series, and products with transposed solves."""
    data = evolving(block(np.random.default_rng(1))) | {"solver": {"tolerance": 1e-13}}
    solution, key, name = solved(parse_case(data)), "friction.mu", "contact_force_x"
    at = number_at(solution.source, key)

    def force(case: Case) -> float:
        run = solved(case)
        problem = run.problem.at(run.state.time, run.state.history)
        return named_functionals(problem)[name](problem, run.state)

    first, slope = force(solution.source), sensitivity(solution, [name], [key])[name][key]
    steps = [at * 2.0**-k for k in range(7, 12)]
    left = [
        abs(force(with_number(solution.source, key, at + h)) - first - h * slope) for h in steps
    ]
    orders = [np.nan, *np.log2(np.array(left[:-1]) / left[1:])]
    report.table(
        "taylor",
        "Remainder of Taylor's series of first order in h",
        {"h": steps, "remainder": left, "order": orders},
        "Tangential force of a block that is pressed, sheared and sheared back, by mu.",
    )


def products(solution: Solution) -> float:
    """Return the relative difference of <J^-1 a, b> and <a, J^-T b>, for random a and b."""
    from contact.problem.linearised import Equations

    linearised = LoadPath(solution).linearised(-1)
    body, rng = solution.problem.body, np.random.default_rng(0)
    shapes = body.owned_part(solution.state.x).shape, solution.problem.nodes.normal.shape
    mask = np.concatenate([body.free.ravel(), np.ones(body.global_unknowns.size)])
    a, b = ([rng.standard_normal(shape) for shape in shapes] for _ in range(2))
    nodes = solution.problem.nodes
    for pair in (a, b):
        pair[0] *= mask
        normal = nodes.normal_component(pair[1])[:, None] * nodes.normal
        pair[1] = normal + nodes.tangential_component(pair[1])
    x, f = linearised.solve(Equations(-a[0], -a[1]))
    y, c = linearised.solve_transposed(*b)
    one = float(np.sum(x * b[0]) + np.sum(f * b[1]))
    other = float(np.sum(a[0] * y) + np.sum(a[1] * c))
    size = np.linalg.norm(x) * np.linalg.norm(b[0]) + np.linalg.norm(f) * np.linalg.norm(b[1])
    return abs(one - other) / size


def cost(report: Report, coarse: bool) -> None:
    """Tabulate factorisations, back-substitutions and time beside those of the solution."""
    n = 8 if coarse else 125
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
            "cells": [4, 2, 2] if coarse else [24, 12, 12],
        },
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [0.002, 0.0, -0.01]}],
        "contact": {"on": "bottom", "gap": "0.01*((x - 1)**2 + (y - 0.5)**2)"},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    loop = evolving(pressed | {"mesh": pressed["mesh"] | {"cells": [64, 16]}}, 1 if coarse else 4)
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


if __name__ == "__main__":
    main()
