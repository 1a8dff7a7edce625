"""Discretisation error: locking, intervals of quantities, adaptive meshes.

`python3 -m scripts.studies.discretisation [--out DIR] [--coarse]`; the page is docs/error.md.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from contact import Case, build_problem, load_case, parse_case, solve
from contact.problem.problem import ContactProblem
from contact.results.error_estimate import estimated
from contact.results.remarks import LOCKED
from scripts.cases import CASES
from scripts.reporting import Report, append, empty
from tests.problems.bar import changed
from tests.problems.mechanics import state_of
from tests.problems.membrane import cook

LINEAR = {"material__law": "linear", "material__yield_strain": None}
#: The bar of Example 7.2 where it locks.
LOCKING = {
    "yield strain 0.005, f2 = -0.05": {
        "material__yield_strain": 0.005,
        "load__0__traction": [0.0, -0.05],
    },
    "nu = 0.4999, mu = 0": {**LINEAR, "material__poisson": 0.4999, "friction__mu": 0.0},
}
#: Bars whose errors are looked at.
BARS: dict[str, dict[str, Any]] = {
    "bar with friction": {**LINEAR, "friction__mu": 0.6},
    "bar without friction": {**LINEAR, "friction__mu": 0.0},
    "yielding bar": {"friction__mu": 0.6, "material__yield_strain": 0.005},
    "bar, nu = 0.4999": LOCKING["nu = 0.4999, mu = 0"],
}
#: The rise of Cook's membrane, P2 on 64 cells (19.43) beside the mean dilatation on as many.
COOK = 19.43
ELEMENTS = {"P1": (1, "standard"), "P2": (2, "standard"), "P2, mean": (2, "mean_dilatation")}


def bar(n: int, degree: int, element: str = "standard", **changes: Any) -> ContactProblem:
    """Return the bar of Example 7.2 with n cells a unit. Collective."""
    more = {"space__degree": degree, "space__element": element, **changes}
    return build_problem(parse_case(changed(mesh__cells=[4 * n, n], **more)))


def locking(report: Report) -> None:
    """Make the table of elements that lock, and of those that do not. Collective."""
    columns = empty(
        "bar", "element", "cells a unit", "largest displacement", "seconds", "k/g", "estimate",
        "warns",
    )  # fmt: skip
    for name, changes in LOCKING.items():
        for label, (degree, element) in ELEMENTS.items():
            for n in (8,) if report.coarse else (8, 16, 32):
                problem = bar(n, degree, element, **changes)
                begin = time.perf_counter()
                solution = solve(problem)
                seconds = time.perf_counter() - begin
                error = solution.error
                warns = any("[locking]" in text or "coarse" in text for text in solution.warnings)
                size = solution.max_displacement
                append(columns, name, label, n, size, seconds, error.stiffness_ratio,
                       error.relative, warns)  # fmt: skip
    report.table(
        "locking",
        "The bar of Example 7.2 where it is nearly incompressible",
        columns,
        f"k/g: bulk over secant shear modulus, weighted by the energy; P1 warns from {LOCKED:g} "
        'on. *P2, mean*: `element = "mean_dilatation"`.',
    )


#: Those of Cook's membrane, with the shape of their cells.
SHAPED = {label: (*given, "triangle") for label, given in ELEMENTS.items()} | {
    "Q1": (1, "standard", "quadrilateral"),
    "Q1, mean": (1, "mean_dilatation", "quadrilateral"),
}


def membrane(report: Report) -> None:
    """Make the table of Cook's membrane. Collective."""
    columns = empty("element", "cells", "rise", "limit", "ratio")
    for label, given in SHAPED.items():
        for n in (8,) if report.coarse else (8, 16, 32):
            rise = cook(n, *given)
            append(columns, label, n, rise, COOK, rise / COOK)
    report.table(
        "membrane",
        "Cook's membrane, whose limit elements of degree 1 do not reach",
        columns,
        "Plane strain, ν = 0.4999, cells along an edge: the rise of its corner, compared with that "
        "of P2 on 64 cells.",
    )


def quantities(report: Report) -> None:
    """Make the table of intervals beside values on a finer mesh. Collective."""
    columns = empty("problem", "element", "unknowns", "quantity", "low", "high", "value", "inside")
    most = {1: 1000 if report.coarse else 10_000, 2: 3000 if report.coarse else 10_000}
    for name, changes in BARS.items():
        known = solve(_uniform(2, 10 * most[2], **changes)).adaptation[-1]
        for degree, unknowns in most.items():
            solution = solve(_uniform(degree, unknowns, **changes))
            size = solution.adaptation[-1]["unknowns"]
            for quantity, interval in (solution.intervals or {}).items():
                value = known[quantity]
                if interval is not None and abs(value) > 1e-12:
                    low, high = interval
                    append(columns, name, f"P{degree}", size, quantity, low, high, value,
                           low <= value <= high)  # fmt: skip
    report.table(
        "quantities",
        "Intervals of quantities from three uniform meshes, and the values of a finer one",
        columns,
        "Value: P2 on 128 cells a unit. Pressures without an interval are infinite at a corner.",
    )


def _uniform(degree: int, unknowns: int, **changes: Any) -> Case:
    tables = changed(mesh__cells=[16, 4], space__degree=degree, **changes)
    tables["mesh"]["adapt"] = {"fraction": 1.0, "max_unknowns": unknowns}
    return parse_case(tables)


def per_second(report: Report) -> None:
    """Make the table of errors and times by element. Collective."""
    columns = empty("problem", "element", "unknowns", "seconds", "estimate", "largest displacement")
    tip = {"on": "right", "traction": [0.0, -1e-6]}
    beam = {**LINEAR, "mesh__size": [80.0, 1.0], "mesh__parts__loaded": None, "load__0": tip,
            "contact__gap": 10.0}  # fmt: skip
    for label, (degree, element) in ELEMENTS.items():
        space = {"space__degree": degree, "space__element": element}
        keys = [f"space.degree={degree}", f'space.element="{element}"']
        cases: list[tuple[str, Case]] = []
        for n in (8, 16) if report.coarse else (8, 16, 32):
            cells = {"mesh__cells": [4 * n, n]}
            cases.append(
                ("bar", parse_case(changed(**BARS["bar with friction"], **space, **cells)))
            )
        for n in (3,) if report.coarse or degree == 2 else (3, 6):
            cells = {"mesh__cells": [80 * n, n]}
            cases.append(("beam", parse_case(changed(**beam, **space, **cells))))
        cases.append(("Hertz, 2-D", load_case(CASES / "hertz.toml", keys)))
        for name, case in cases:
            begin = time.perf_counter()
            solution = solve(case)
            seconds = time.perf_counter() - begin
            append(columns, name, label, solution.problem.body.layout.unknowns, seconds,
                   solution.error.relative, solution.max_displacement)  # fmt: skip
    report.table(
        "per-second",
        "Error and time by element",
        columns,
        "One thread; seconds of the whole `solve`, with mesh and review, without the compilation "
        "of forms.",
    )


def adaptive(report: Report) -> None:
    """Make the table of adapted meshes beside uniform ones. Collective."""
    columns = empty(
        "problem", "element", "error", "unknowns, adapted", "unknowns, uniform", "rate, adapted",
        "rate, uniform", "meshes", "unknowns, last", "seconds", "seconds, last alone", "ratio",
    )  # fmt: skip
    for name, degree, error, case, uniform in _adapted(report.coarse):
        rows, seconds, last = _timed(case)
        found = {"adapted": [(row["unknowns"], row["error"]) for row in rows], "uniform": []}
        for problem in uniform:
            estimate = estimated(problem, state_of(problem, 1e-9)).relative
            found["uniform"].append((problem.body.layout.unknowns, estimate))
        needed, rates = zip(*(_fall(found[kind], error) for kind in found), strict=True)
        append(columns, name, f"P{degree}", error, *needed, *rates, len(rows),
               found["adapted"][-1][0], seconds, last, seconds / last)  # fmt: skip
    report.table(
        "adapted",
        "Adapted beside uniform meshes",
        columns,
        "Unknowns for an estimated error follow from the line through the meshes next to it, "
        "extended where no mesh has this error. Rates are those of the error by the unknowns, "
        "over the last three meshes or a factor of ten. Seconds are those of the processor: of "
        "the whole `solve` with all meshes, and of the last mesh alone from zero; forms compiled "
        "before, one thread.",
    )


def _adapted(
    coarse: bool,
) -> Iterator[tuple[str, int, float, Case, Iterator[ContactProblem]]]:
    """Give name, degree, error, case with `[mesh.adapt]`, and uniform meshes. Collective."""
    changes = BARS["bar with friction"]
    for degree, asked in ((1, 0.05 if coarse else 0.004), (2, 0.02 if coarse else 5e-4)):
        tables = changed(mesh__cells=[16, 4], space__degree=degree, **changes)
        tables["mesh"]["adapt"] = {"error": asked, "max_unknowns": 400_000}
        cells = (4, 8) if coarse else (4, 8, 16, 32, 64)
        uniform = (bar(n, degree, **changes) for n in cells)
        yield "bar with friction", degree, 0.01, parse_case(tables), uniform
    for degree, asked, error in ((1, 0.08, 0.1), (2, 0.02, 0.03)):
        adapt = {"error": 3 * asked if coarse else asked, "max_unknowns": 150_000}
        sizes = (4,) if coarse else (4, 8, 16) if degree == 2 else (4, 8, 16, 32)
        uniform = (build_problem(parse_case(ball_on_block(n, degree))) for n in sizes)
        case = parse_case(ball_on_block(4, degree, adapt=adapt))
        yield "rigid ball, 3-D", degree, error, case, uniform


def ball_on_block(n: int, degree: int, **mesh: Any) -> dict[str, Any]:
    """Return the case of a rigid ball of radius 2 on a quarter of a block, n cells a unit."""
    return {
        "mesh": {"generator": "box", "size": [1.0] * 3, "cells": [n] * 3, **mesh},
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [
            {"on": "left", "displacement": [0.0, "free", "free"]},
            {"on": "front", "displacement": ["free", 0.0, "free"]},
            {"on": "top", "displacement": ["free", "free", -0.02]},
        ],
        "contact": {
            "on": "bottom",
            "foundation": {"shape": "sphere", "centre": [0.0, 0.0, -2.0], "radius": 2.0},
        },
    }


def _timed(case: Case) -> tuple[Sequence[Mapping[str, Any]], float, float]:
    """Return the rows of adapted meshes, the seconds, and those of the last mesh. Collective."""
    solve(case)
    begin = time.process_time()
    solution = solve(case)
    seconds, begin = time.process_time() - begin, time.process_time()
    solve(build_problem(case, domain=solution.problem.domain))
    return solution.adaptation, seconds, time.process_time() - begin


def _fall(found: Sequence[tuple[int, float]], asked: float) -> tuple[float, float]:
    """Return the unknowns for an error, and the rate at which errors fall with unknowns."""
    unknowns, error = np.log(np.array(found).T)
    if unknowns.size == 1:
        return np.nan, np.nan
    last = np.arange(unknowns.size) >= unknowns.size - 3
    among = last | (unknowns >= unknowns[-1] - np.log(10))
    rate = -float(np.polyfit(unknowns[among], error[among], 1)[0])
    first = min(int(np.searchsorted(-error, -np.log(asked))), unknowns.size - 1)
    beside = [max(first - 1, 0), max(first, 1)]
    slope, start = np.polyfit(error[beside], unknowns[beside], 1)
    return float(np.exp(start + slope * np.log(asked))), rate


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all of them. Collective."""
    report = Report.of(__doc__, "discretisation", arguments)
    for make in (locking, membrane, quantities, per_second, adaptive):
        make(report)


if __name__ == "__main__":
    main()
