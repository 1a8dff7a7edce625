"""Every row of the thesis's tables by every method: solves, factorisations, seconds.

python3 -m scripts.benchmarks.by_method [--out DIR] [--coarse]
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

from contact import Case, build_problem, load_case, solve
from contact.methods.options import NewtonOptions
from contact.refining import nested_start
from scripts.cases import CASES, TABLE_8_4
from scripts.reporting import Report, parser

METHODS = {
    "uzawa, r of the thesis": ["solver.method=uzawa", "solver.stopping=thesis"],
    "uzawa": ["solver.method=uzawa"],
    "penalty": ["solver.method=penalty"],
    "newton": ["solver.method=newton"],
    "newton, nested": ["solver.method=newton", "solver.nested=true"],
}


def rows_of_tables(coarse: bool) -> Iterator[tuple[str, str, str, list[str], float]]:
    """Return table, row, case file, changes to it, and the thesis's r (per mm where it helps)."""
    cells = "mesh.cells=[32, 8]" if coarse else "mesh.cells=[128, 32]"
    for load in (-0.005, -0.05):
        for rho in (1e5,) if coarse else (1e5, 1e6, 1e7, 6e7):
            changes = [cells, f"load.0.traction=[0.0, {load}]", f"friction.mu.rho={rho}"]
            yield "7.1", f"f2 = {load}, rho = {rho:.0e}", "bar.toml", changes, 25.0
    r = 0.25 * 58.7102
    piezo = "mesh.cells=[16, 8]" if coarse else "mesh.cells=[64, 32]"
    for table, case in (("8.2", "piezo-8-1-conductive.toml"), ("8.3", "piezo-8-2.toml")):
        for phi in (1,) if coarse else (0, 1, 2, 4, 8, 16, 32):
            yield table, f"phi_F = {phi}", case, [piezo, f"electric.phi_f={float(phi)}"], r
    layer = "mesh.cells=[48, 8]" if coarse else "mesh.cells=[96, 16]"
    for small in TABLE_8_4[:1] if coarse else TABLE_8_4:
        changes = [layer, f"friction.mu={small}", f"electric.k_e={small}"]
        yield "8.4", f"mu = k_e = {small}", "compliance-8-4.toml", changes, r


def measured(case: Case) -> dict[str, Any]:
    """Solve a case; return its costs."""
    problem = build_problem(case)
    begin = time.process_time()
    settings, start = case.solver, None
    if isinstance(settings, NewtonOptions) and settings.nested:
        settings, start = settings.model_copy(update={"nested": None}), nested_start(case, problem)
    solution = solve(problem, settings, start=start)
    counters = solution.counters
    return {
        "converged": solution.converged,
        "outer": len(solution.history),
        "solves": counters.linear_solves,
        "factorizations": counters.factorizations,
        "contact solves": counters.contact_solves,
        "seconds": time.process_time() - begin,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the table."""
    given = parser(__doc__, "by_method").parse_args(arguments)
    found, known = [], set()
    for table, row, file, changes, thesis_r in rows_of_tables(given.coarse):
        for method, settings in METHODS.items():
            extra = [f"solver.r={thesis_r}"] if "thesis" in method else []
            case = load_case(CASES / file, [*changes, *settings, *extra])
            if (file, method) not in known:  # its forms are compiled
                measured(case)
            known.add((file, method))
            found.append({"table": table, "row": row, "method": method, **measured(case)})
    Report(given.out).table(
        "bench-tables",
        "Every row of the thesis's tables by every method",
        {key: [row[key] for row in found] for key in found[0]},
        "Seconds of the processor. Contact solves: Newton iterations on the condensed problem. "
        "Nested: solves on the finest mesh; the seconds include those on the coarser ones.",
    )


if __name__ == "__main__":
    main()
