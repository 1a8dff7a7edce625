"""Whether `converged` can be believed: random cases, methods and limits of iterations.

`python3 -m scripts.studies.random_ends [--out DIR] [--coarse] [--count N] [--first K]`. Cases of
both sweeps, and charged bodies with weak and strong couplings under potentials of all sizes, are
solved by a random method and linear solver with a random `max_outer`. Each `summary.json` is held
against the residuals of the state in a problem that was built anew, at the whole load, and against
the forces and charges that its numbers leave out of balance (`raw_balance`). A run that takes
longer than `LIMIT`, such as thousands of Uzawa block relaxations of a beam 600 x 1, is ended by a
signal, and its results are judged like the rest.
"""

from __future__ import annotations

import json
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from contact import Case, Solution, build_problem, solve
from contact.case.file import parse_case
from contact.io.files import write_outputs
from contact.methods.options import OPTIONS, Options, with_method
from contact.methods.signals import Terminated, ending_on_signal
from contact.problem.residuals import evaluate
from contact.results.options import OutputOptions
from contact.solving import SolveInterrupted
from scripts.reporting import Report, append, parser
from scripts.studies.raw_balance import imbalance
from scripts.studies.sweep import piezo, problems

COUNT, COARSE_COUNT, CHARGED, SEED = 500, 10, 300, 22
METHODS, SOLVERS = ("newton", "uzawa", "penalty"), ("auto", "auto", "iterative")
#: Seconds of processor after which a solve is ended.
LIMIT = 10.0
#: Rounding of a residual that is computed once more, and of rounding that is seen by other means:
#: that which was granted, or the change of the raw forces where unknowns move by their own.
ROUNDING, OTHER = 1.01, 2.0


def charged(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a piezoelectric bar with an electrode, its coupling down to 1e-12 of that of PZT-5A."""
    case = piezo(rng)
    coupling = float(rng.choice([1e-12, 1e-9, 1e-6, 1e-3, 1.0]))
    for name in ("e31", "e33", "e15"):
        case["material"]["piezo"][name] *= coupling
    strain = float(rng.choice([1e-6, 1e-2, 1.0]))
    # Up to values that strain the body as much as the loads do, and to any size.
    potential = float(rng.choice([0.0, 1e-3, 1.0, 1e3, 1e6, 1e9, strain * 4.0 / coupling]))
    where = str(rng.choice(["right", "top"]))
    case["fixed"].append({"on": where, "potential": potential})
    share = float(rng.choice([1.0, 1e-3, 0.0]))
    case["load"] = [{"on": "top", "traction": [0.0, f"{-15 * share}*x"]}] if share else []
    return case


def draws(count: int) -> list[tuple[Case, Options]]:
    """Draw cases, the same ones whatever their number, with a method and its limits."""
    rng = np.random.default_rng(SEED)
    drawn = [case for hard in (False, True) for _, case in problems(False, hard=hard)]
    drawn += [parse_case(charged(rng), source=f"charged-{k}") for k in range(CHARGED)]
    found = []
    for number in rng.integers(len(drawn), size=max(count, COUNT))[:count]:
        case, method = drawn[number], str(rng.choice(METHODS))
        limit = int(rng.choice([1, 2, 3, 5, 8, 20]))
        linear = str(rng.choice(SOLVERS))
        settings = with_method(case.solver, OPTIONS[method])
        found.append((case, replace(settings, max_outer=limit, linear=linear)))
    return found


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Send SIGTERM to this process after some seconds of processor."""

    def end(number: int, frame: object) -> None:
        signal.raise_signal(signal.SIGTERM)

    with ending_on_signal():
        before = signal.signal(signal.SIGPROF, end)
        signal.setitimer(signal.ITIMER_PROF, seconds)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            signal.signal(signal.SIGPROF, before)


def solved(case: Case, settings: Options) -> Solution | None:
    """Solve within the limit; nothing where that ends before or behind the solve itself."""
    try:
        with limited(LIMIT):
            return solve(build_problem(case), settings)
    except SolveInterrupted as ended:
        return ended.solution
    except Terminated:
        return None


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve random cases and list those that claim to have converged and have not."""
    command = parser(__doc__, "random_ends")
    command.add_argument("--count", type=int, help="number of cases")
    command.add_argument("--first", type=int, default=0, help="number of the first case")
    given = command.parse_args(arguments)
    count = given.count or (COARSE_COUNT if given.coarse else COUNT)
    ends = Counter[str]()
    columns = ("case", "method", "max_outer", "rounding", "residuals", "raw", "allowed")
    rows: dict[str, list[Any]] = {name: [] for name in columns}
    with tempfile.TemporaryDirectory() as folder:
        for case, settings in draws(count)[given.first :]:
            solution, method = solved(case, settings), settings.method
            if solution is None:
                ends[f"{method}: ended beside the solve"] += 1
                continue
            solution.output = OutputOptions(fields="none")
            write_outputs(solution, folder)
            summary = json.loads(Path(folder, "summary.json").read_text())
            residuals = evaluate(build_problem(case), solution.state)
            allowed = solution.outcome.allowed
            how = "interrupted" if solution.outcome.signal else "not converged"
            ends[f"{method}: {'converged' if summary['converged'] else how}"] += 1
            pairs = [(getattr(residuals, name), getattr(allowed, name)) for name in summary["kkt"]]
            holds = all(value <= ROUNDING * most for value, most in pairs)
            raw = imbalance(solution)
            for unbalanced, size, unsure in zip(*raw.all, strict=True):
                rounding = OTHER * max(summary["rounding"]["equilibrium"] * size, unsure)
                holds &= unbalanced <= ROUNDING * allowed.equilibrium * size + rounding
            if summary["converged"] and not holds:
                shown = [" ".join(f"{pair[i]:.2e}" for pair in pairs) for i in (0, 1)]
                left = f"{raw.force:.2e} of {raw.applied:.2e}, "
                left += f"{raw.charge:.2e} of {raw.electrified:.2e}"
                topic = (
                    case.source,
                    method,
                    settings.max_outer,
                    summary["rounding"]["equilibrium"],
                )
                row = (*topic, shown[0], left, shown[1])
                print(*row, flush=True)
                append(rows, *row)
    print("endings:", dict(sorted(ends.items())))
    Report(given.out).table("random_ends", f"False ends among {count - given.first} cases", rows)
    return 1 if rows["case"] else 0


if __name__ == "__main__":
    sys.exit(main())
