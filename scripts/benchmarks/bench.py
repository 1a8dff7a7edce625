"""The benchmark: `python3 -m scripts.benchmarks.bench [--out DIR] [--coarse] [--parts a b c d e]`.

(a) solves, factorisations and seconds of every row of the thesis's tables, by each method;
(b) the full nonlinear solve against one linear elasticity solve with the same linear solver on
    the same mesh, in the plane and in space, with peak memory; (c) one rank against two;
(d) against GetFEM on the same mesh; (e) seconds by phase.

Every run is a process of its own, warm (its forms are compiled) and with one BLAS thread a
rank; ratios are taken within one call of this script. Absolute times are those of the machine.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshes import write
from scripts.cases import TABLE_8_4
from scripts.reporting import Report, parser, subplots

#: Seconds after which a run of the peer is ended: it is then shown as one of infinite length.
PATIENCE = 300.0

Run = dict[str, Any]


def run(*arguments: str, ranks: int = 1, rounds: int = 1) -> Run:
    """Run `bench_one` in a process of its own; return the fastest of some rounds."""
    command = [sys.executable, "-m", "scripts.benchmarks.bench_one", *arguments]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    return fastest([measured(command) for _ in range(rounds)])


def measured(command: Sequence[str], limit: float | None = None) -> Run:
    """Return what a process prints as JSON in its last line, within a limit (seconds)."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=limit)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr[-2000:]}")
    result: Run = json.loads(done.stdout.strip().splitlines()[-1])
    return result


def fastest(runs: Sequence[Run]) -> Run:
    """Return the run with the shortest solve."""
    return min(runs, key=lambda r: r["solve"])


def columns(rows: Sequence[Run]) -> dict[str, list[Any]]:
    """Return rows as columns."""
    return {key: [row.get(key) for row in rows] for key in rows[0]}


def tables_by_method(report: Report, coarse: bool) -> None:
    """Part (a): every row of the tables by every method."""
    methods = {
        "uzawa, r of the thesis": ["solver.method=uzawa", "solver.stopping=thesis"],
        "uzawa": ["solver.method=uzawa"],
        "penalty": ["solver.method=penalty"],
        "newton": ["solver.method=newton"],
        "newton, nested": ["solver.method=newton", "solver.nested=true"],
    }
    rows = []
    for table, row, case, changes, thesis_r in thesis_rows(coarse):
        for method, settings in methods.items():
            extra = [f"solver.r={thesis_r}"] if "thesis" in method else []
            result = run(case, *changes, *settings, *extra)
            keys = (
                "converged",
                "outer",
                "solves",
                "factorizations",
                "contact_solves",
                "solve",
            )
            found = {key: result[key] for key in keys}
            rows.append({"table": table, "row": row, "method": method, **found})
    report.table(
        "bench-tables",
        "Every row of the thesis's tables by every method",
        columns(rows),
        "Contact solves: dense ones at the contact nodes, with the body condensed onto these. "
        "Nested: solves on the finest mesh; the seconds are those of that mesh too.",
    )


def thesis_rows(coarse: bool) -> list[tuple[str, str, str, list[str], float]]:
    """Return table, row, case file, changes to it, and the thesis's r (per mm where it helps)."""
    found = []
    cells = "mesh.cells=[64, 16]" if coarse else "mesh.cells=[128, 32]"
    for load in (-0.005, -0.05):
        for rho in (1e5, 1e6, 1e7, 6e7):
            changes = [cells, f"load.0.traction=[0.0, {load}]", f"friction.mu.rho={rho}"]
            found.append(("7.1", f"f2 = {load}, rho = {rho:.0e}", "bar.toml", changes, 25.0))
    piezo = "mesh.cells=[32, 16]" if coarse else "mesh.cells=[64, 32]"
    for table, case in (("8.2", "piezo-8-1-conductive.toml"), ("8.3", "piezo-8-2.toml")):
        for phi in (0, 1, 2, 4, 8, 16, 32):
            changes = [piezo, f"electric.phi_f={float(phi)}"]
            found.append((table, f"phi_F = {phi}", case, changes, 0.25 * 58.7102))
    layer = "mesh.cells=[48, 8]" if coarse else "mesh.cells=[96, 16]"
    for small in TABLE_8_4:
        changes = [layer, f"friction.mu={small}", f"electric.k_e={small}"]
        found.append(("8.4", f"mu = k_e = {small}", "compliance-8-4.toml", changes, 0.25 * 58.7102))
    return found


def against_one_solve(report: Report, coarse: bool) -> None:
    """Part (b): nonlinear solves in units of one linear elasticity solve."""
    plane = (32, 64) if coarse else (32, 64, 128, 256, 512)
    space = (10, 16) if coarse else (20, 28, 40, 56, 70)
    rows = []
    for dimension, sizes in ((2, plane), (3, space)):
        for n in sizes:
            # In space the largest meshes take long enough once.
            for name in ("nested",) if dimension == 3 and n > 40 else ("cold", "nested"):
                result = run("ratio", str(dimension), str(n), name)
                rows.append({"dimension": dimension, "cells a unit": n, "start": name, **result})
    table = columns(rows)
    report.table("bench-ratio", "Nonlinear solve against one linear elasticity solve", table)
    figure, axes = subplots(1, 2, (6.6, 2.8))
    for axis, dimension in zip(axes, (2, 3), strict=True):
        for name, marker in (("cold", "o"), ("nested", "s")):
            chosen = [r for r in rows if r["dimension"] == dimension and r["start"] == name]
            ratio = [r["ratio"] for r in chosen]
            axis.loglog([r["dofs"] for r in chosen], ratio, marker + "-", label=name)
        axis.set_xlabel("unknowns")
        axis.set_title(f"{dimension}-D")
    axes[0].set_ylabel("solve / one linear solve")
    axes[0].legend()
    report.figure("bench-ratio-plot", "Cost in units of one linear elasticity solve", figure, table)


def ranks(report: Report, coarse: bool) -> None:
    """Part (c): one rank against two."""
    rows = []
    for dimension, n in ((2, 32), (3, 12)) if coarse else ((2, 256), (3, 40)):
        one, two = (run("ratio", str(dimension), str(n), "cold", ranks=k) for k in (1, 2))
        rows.append(
            {
                "dimension": dimension,
                "dofs": one["dofs"],
                "1 rank (s)": one["solve"],
                "2 ranks (s)": two["solve"],
                "speed-up": one["solve"] / two["solve"],
            }
        )
    report.table("bench-ranks", "One rank against two", columns(rows))


def against_getfem(report: Report, coarse: bool) -> None:
    """Part (d): the same mesh, material and friction in GetFEM."""
    rows = []
    for n in (16, 32) if coarse else (32, 64, 128, 256):
        for mu in ("0.2", "0.6"):
            rows.append({"problem": "bar", "cells": n, "mu": mu, **pair("bar", str(n), mu)})
    with tempfile.TemporaryDirectory() as folder:
        for n in (10, 20) if coarse else (20, 40, 80, 160):
            mesh = str(Path(folder, f"disc-{n}.msh"))
            sizes = {"contact_size": 2.7231 / n, "contact_width": 3.4, "growth": 0.2}
            write("quarter_disc", mesh, version=2.2, size=max(0.8, 16 / n), **sizes)
            for mu in ("0.0", "0.2"):
                rows.append({"problem": "Hertz", "cells": n, "mu": mu, **pair("hertz", mesh, mu)})
    for n in (4, 8) if coarse else (8, 12, 16):
        rows.append({"problem": "block", "cells": n, "mu": "0.3", **pair("block", str(n), "0.3")})
    report.table(
        "bench-getfem",
        "Against GetFEM: Example 7.2 with a linear material, Example 7.1, and a block in space",
        columns(rows),
        "Cells a unit length of the bar and the block, and on Hertz's half-width. Seconds of the "
        "whole Newton solve, the faster of two, both warm; a run of GetFEM that took more than "
        f"{PATIENCE:.0f} s in its two rounds is shown as inf. GetFEM: integral contact brick, "
        "augmented Lagrangian, r = E, residual 1e-10; its contact integrals and our nodal "
        "multipliers are different discretisations of order h.",
    )


def pair(problem: str, mesh: str, mu: str) -> Run:
    """Return our run beside GetFEM's."""
    ours = run(problem, mesh, mu, rounds=2)
    command = [sys.executable, "-m", "scripts.benchmarks.peer_getfem", problem, mesh, mu]
    try:
        theirs = measured(command, PATIENCE)
    except subprocess.TimeoutExpired:
        theirs = dict.fromkeys(("steps", "converged", "assembly", "max_displacement"), np.nan)
        theirs["solve"] = np.inf
    difference = ours["max_displacement"] / theirs["max_displacement"] - 1
    return {
        "dofs": ours["dofs"],
        "steps": ours["solves"],
        "GetFEM's": theirs["steps"],
        "converged": ours["converged"],
        "GetFEM": theirs["converged"],
        "solve (s)": ours["solve"],
        "GetFEM's (s)": theirs["solve"],
        "its assembly (s)": theirs["assembly"],
        "ratio": theirs["solve"] / ours["solve"],
        "difference of max |u|": abs(difference),
    }


def phases(report: Report, coarse: bool) -> None:
    """Part (e): where the time goes."""
    rows = []
    for dimension, n in ((2, 32), (3, 12)) if coarse else ((2, 256), (3, 40)):
        rows.append({"dimension": dimension, **run("phases", str(dimension), str(n))})
    report.table("bench-phases", "Seconds by phase", columns(rows))


PARTS: dict[str, Callable[[Report, bool], None]] = {
    "a": tables_by_method,
    "b": against_one_solve,
    "c": ranks,
    "d": against_getfem,
    "e": phases,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts that are asked for."""
    command = parser(__doc__, "bench")
    command.add_argument("--parts", nargs="+", default=list(PARTS), choices=list(PARTS))
    given = command.parse_args(arguments)
    np.set_printoptions(precision=3)
    for part in given.parts:
        PARTS[part](Report(given.out), given.coarse)


if __name__ == "__main__":
    main()
