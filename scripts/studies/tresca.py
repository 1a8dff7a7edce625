"""Fifty problems with given friction bounds: solved to a duality gap, and by Newton's method.

`python3 -m scripts.studies.tresca [--out DIR] [--coarse]`. Blocks and beams of up to 4000 unknowns
in the plane and in space, held by supports or by contact alone (semidefinite), are condensed onto
their contact nodes and solved there by the interior point and by Newton's loop, which knows
nothing of the other. The loop may fail where bodies bend; it is then told where to start, and has
to stay there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from contact import build_problem
from contact.case.file import Case, parse_case
from contact.interface.multipliers import Multipliers
from contact.linear.operator import Counters
from contact.methods.convex.tresca import Result, TrescaSolver
from contact.methods.loop import NewtonLoop
from contact.methods.moduli import moduli_of
from contact.methods.options import NewtonOptions
from contact.methods.report import History
from contact.methods.search import Search
from contact.methods.step import Iterate, WholeStep
from contact.methods.sure import Gathered
from contact.problem.condensed import Condensation, CondensedProblem
from contact.problem.state import State
from scripts.reporting import Report, parser

SEED = 20240301
#: How many problems of each family; --coarse takes a fifth, on coarse meshes.
COUNTS = {"bar": 12, "beam": 10, "loose": 8, "block": 12, "loose_block": 8}

Draw = Callable[[np.random.Generator, int], dict[str, Any]]


def _plane(size: list[float], cells: list[int], load: list[Any], bound: float) -> dict[str, Any]:
    return {
        "mesh": {"generator": "rectangle", "size": size, "cells": cells},
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "top", "traction": load}],
        "contact": {"on": "bottom"},
        "friction": {"law": "tresca", "bound": bound},
    }


def bar(rng: np.random.Generator, size: int) -> dict[str, Any]:
    """Draw a block clamped at its left, pressed and pushed, over no gap or a small one."""
    n = int(rng.choice([size // 16, size // 16, size // 8, size // 2]))
    push, bound = 1e-3 * rng.uniform(-4, 4), 1e-3 * rng.choice([0.0, 0.3, 3.0])
    case = _plane(
        [4.0, 1.0], [n, max(n // 16, 2)], [push, f"-0.01*(1+x*{rng.uniform(0, 1)})"], bound
    )
    case["fixed"] = [{"on": "left", "displacement": [0.0, 0.0]}]
    case["contact"]["gap"] = float(rng.choice([0.0, 0.01]))
    return case


def beam(rng: np.random.Generator, size: int) -> dict[str, Any]:
    """Draw a cantilever that its load presses onto a stop."""
    slender, n = (
        float(rng.choice([10.0, 30.0, 100.0])),
        int(rng.choice([size // 16, size // 16, size // 4])),
    )
    bend = 0.5 * rng.choice([1.5, 5.0, 30.0])
    load = [0.0, -8 * bend / 12 / slender**4]
    case = _plane([slender, 1.0], [n, 2], load, abs(load[1]) * rng.choice([0.0, 0.1, 1.0]))
    case["fixed"] = [{"on": "left", "displacement": [0.0, 0.0]}]
    case["contact"]["gap"] = 0.5
    return case


def loose(rng: np.random.Generator, size: int) -> dict[str, Any]:
    """Draw a block that contact alone holds up, though it cannot move aside at its top."""
    n = int(rng.choice([size // 16, size // 16, size // 4]))
    load = [1e-3 * rng.uniform(-1, 1), f"-0.01*(1+0.2*x*{rng.uniform(0, 1)})"]
    case = _plane([4.0, 1.0], [n, max(n // 8, 2)], load, 3e-3)
    case["fixed"] = [{"on": "top", "displacement": [0.0, "free"]}]
    case["load"].append({"on": "right", "traction": [0.0, 1e-3]})
    return case


def _space(rng: np.random.Generator, size: int) -> dict[str, Any]:
    n = int(rng.choice([np.sqrt(size / part) for part in (20, 20, 8, 3.3)]))
    push = [float(1e-3 * rng.uniform(-1, 1)) for _ in range(2)]
    return {
        "mesh": {"generator": "box", "size": [1.0, 1.0, 0.5], "cells": [n, n, 3]},
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "top", "traction": [*push, f"-0.01*(1+x*{rng.uniform(0, 1)})"]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "tresca", "bound": 3e-3},
    }


def block(rng: np.random.Generator, size: int) -> dict[str, Any]:
    """Draw a block in space clamped at a side."""
    case = _space(rng, size)
    case["fixed"] = [{"on": "left", "displacement": [0.0, 0.0, 0.0]}]
    case["friction"]["bound"] = 1e-3 * rng.choice([0.0, 0.3, 3.0])
    return case


def loose_block(rng: np.random.Generator, size: int) -> dict[str, Any]:
    """Draw a block in space that contact alone holds."""
    case = _space(rng, size)
    case["fixed"] = [{"on": "top", "displacement": [0.0, 0.0, "free"]}]
    case["load"].append({"on": "right", "traction": [1e-3, 0.0, 1e-3]})
    return case


FAMILIES: dict[str, Draw] = {draw.__name__: draw for draw in (bar, beam, loose, block, loose_block)}


def problems(coarse: bool) -> Iterator[Case]:
    """Draw the problems, the same ones everywhere."""
    for number, (name, draw) in enumerate(FAMILIES.items()):
        rng = np.random.default_rng([SEED, number])
        for k in range(COUNTS[name] // 5 if coarse else COUNTS[name]):
            yield parse_case(draw(rng, 200 if coarse else 4000), source=f"{name}-{k}")


def interior_point(problem: CondensedProblem) -> tuple[Result, Gathered]:
    """Solve by the interior point alone."""
    of = Gathered.of(problem, problem.start())
    assert of is not None  # on one rank
    slip = np.zeros(of.gap.size)
    bound = problem.interface.friction.bound(slip, slip)
    rubbing = (bound > 0) & (of.weight > 0)
    solver = TrescaSolver(of.stiffness, of.normal, of.tangent, of.gap, of.weight, of.free, rubbing)
    return solver.solve(of.load, bound), of


def newton(problem: CondensedProblem, start: State | None) -> tuple[State, bool, int]:
    """Solve by Newton's loop alone; return the state, whether it converged, and its steps."""
    options, interface = NewtonOptions(tolerance=1e-11, condense=False), problem.interface
    moduli = moduli_of(problem.scales, options.gamma)
    step = WholeStep(problem, options, moduli, Counters())
    history = History()
    iterate = Iterate(problem.start())
    if start is not None:
        # Without the status it would begin with all nodes sticking that touch.
        nodal = interface.jump.apply(start.x)
        bound = interface.bound(nodal, start.forces)
        iterate = Iterate(start, interface.status(nodal, start.forces, bound, moduli.status))
    search = Search(problem, options, history, iterate)
    iterate, outcome = NewtonLoop(search, step, 0.0).run(iterate)
    return iterate.state, outcome.kkt.largest <= 1e-9, len(history.records)


def compare(case: Case) -> dict[str, Any]:
    """Solve a problem both ways."""
    full = build_problem(case)
    problem = Condensation(full, Counters()).linearise("secant", full.start())
    assert problem is not None
    result, of = interior_point(problem)
    start = problem.start()
    found = replace(
        start,
        x=of.origin + result.displacement.ravel(),
        forces=Multipliers(result.pressure, result.friction),
    )
    state, converged, steps = newton(problem, None)
    told = not converged
    if told:
        state, converged, steps = newton(problem, found)
    size = np.abs(state.x).max()
    return {
        "problem": case.source,
        "unknowns": of.load.size,
        "solved": result.certified,
        "gap": result.certificate.gap,
        "steps": result.iterations,
        "closed": int(np.count_nonzero(result.pressure > 0)),
        "newton steps": steps,
        "told": told,
        "newton": converged,
        "difference": float(np.abs(state.x - found.x).max() / size),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve all and say how they compare."""
    given = parser(__doc__, "tresca").parse_args(arguments)
    rows: dict[str, list[Any]] = {}
    for case in problems(given.coarse):
        for key, value in compare(case).items():
            rows.setdefault(key, []).append(value)
    caption = (
        f"{sum(rows['solved'])} of {len(rows['solved'])} problems with given friction bounds "
        f"solved: gaps up to {max(rows['gap']):.1e}, {max(rows['steps'])} steps at most; "
        f"Newton's method differs by {max(rows['difference']):.1e} at most"
    )
    Report(given.out).table("tresca", caption, rows)


if __name__ == "__main__":
    main()
