"""The benchmark: `python3 -m scripts.benchmarks.bench [--coarse] [--parts NAME ...]`.

`PARTS` has the parts, in the order of the page.

All of it takes half an hour on two cores and 4 GB, and writes docs/benchmarks.md, its summary
and the table of docs/scaling.md after each part: after an interruption --parts goes on with
the others. --coarse is a trial that writes no page.
Every measurement is a process of its own, warm (its forms are compiled) and with one BLAS thread a
rank; ratios are taken within one process. Absolute times are those of the machine.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from meshes import write
from scripts.benchmarks.pages import PAGE, SCALING, write_memory, write_page
from scripts.benchmarks.processes import Run, command, measured, run, started
from scripts.reporting import Report, parser

#: Seconds after which a run of the peer is ended: it is then shown as one of infinite length.
TIMEOUT = 150.0


def script(report: Report, name: str) -> None:
    """Run a script that writes into the same folder."""
    extra = ["--coarse"] if report.coarse else []
    started([*command(name), "--out", str(report.out), *extra])


def against_one_solve(report: Report) -> None:
    """Nonlinear solves in units of one linear elasticity solve."""
    rows = []
    coarse = {2: (16, 32), 3: (8, 12)}
    sizes = coarse if report.coarse else {2: (64, 128, 256), 3: (20, 28, 40, 56)}
    for dimension, cells in sizes.items():
        run("ratio", str(dimension), "8")  # compiles the forms, whose memory would count
        for n in cells:
            for start in ("", "cold"):
                result = run("ratio", str(dimension), str(n), *([start] if start else []))
                name = start or "as it chooses"
                rows.append({"dimension": dimension, "cells a unit": n, "start": name, **result})
                if dimension == 3 and n > 40:  # once takes long enough
                    break
    report.table(
        "bench-ratio",
        "Nonlinear solve against one linear elasticity solve",
        rows,
        "Example 7.2 with Hencky's law and friction, and a block in 3-D, from a zero initial "
        "guess. *cold*: on the mesh itself alone. *as it chooses*: by way of coarser meshes where "
        "that is faster; their time counts. `one`: assembly, set-up and solve of linear "
        "elasticity with the same solver. Seconds and ratios are medians of three runs in which "
        "the two take turns, of meshes of more than 30 cells a unit in 3-D of one. The error "
        "estimate and the remarks, `review`, are part of a solve, but not of the ratio *without "
        "review*. The memory is the peak of the process, with "
        "the loaded libraries and the linear solve.",
    )


def ranks(report: Report) -> None:
    """One rank against two."""
    rows = []
    sizes = {2: (32,), 3: (10,)} if report.coarse else {2: (256,), 3: (40, 56)}
    for dimension, n in ((d, n) for d, chosen in sizes.items() for n in chosen):
        one, two = (run("ratio", str(dimension), str(n), "cold", ranks=k) for k in (1, 2))
        rows.append(
            {
                "dimension": dimension,
                "unknowns": one["unknowns"],
                "1 rank (s)": one["seconds"],
                "2 ranks (s)": two["seconds"],
                "speed-up": one["seconds"] / two["seconds"],
                "of a linear solve": one["one"] / two["one"],
            }
        )
    report.table("bench-ranks", "One rank against two, cold", rows)


def memory(report: Report) -> None:
    """Memory of ranks."""
    rows = []
    for dimension, n in ((2, 32), (3, 8)) if report.coarse else ((2, 128), (3, 20)):
        first, least = np.nan, np.nan
        for count in (1, 2, 4):
            found, alone = (
                measured([*command(name), str(dimension), str(n)], count)
                for name in ("ranks", "library")
            )
            size, of_library = found["bytes an unknown"], alone["bytes an unknown"]
            first, least = (size, of_library) if count == 1 else (first, least)
            rows.append(
                {
                    "dimension": dimension,
                    "unknowns": found["unknowns"],
                    "ranks": count,
                    "bytes an unknown": size,
                    "over one rank": size / first if first > 0 else np.nan,
                    "linear solve": of_library,
                    "its over one rank": of_library / least if least > 0 else np.nan,
                }
            )
    report.table(
        "bench-memory",
        "Memory of all ranks together",
        rows,
        "Peaks of the whole run beyond the memory of the loaded libraries, and those of one "
        "linear solve by dolfinx and PETSc alone.",
    )


def against_getfem(report: Report) -> None:
    """Solve the same mesh, material and friction in GetFEM."""
    rows = []
    for n in (16, 32) if report.coarse else (32, 64, 128):
        for mu in ("0.2", "0.6"):
            rows.append({"problem": "bar", "cells": n, "mu": mu, **pair("bar", str(n), mu)})
    with tempfile.TemporaryDirectory() as folder:
        for n in (10,) if report.coarse else (20, 40, 80):
            mesh = str(Path(folder, f"disc-{n}.msh"))
            sizes = {"contact_size": 2.7231 / n, "contact_width": 3.4, "growth": 0.2}
            write("quarter_disc", mesh, version=2.2, size=max(0.8, 16 / n), **sizes)
            for mu in ("0.0", "0.2"):
                rows.append({"problem": "Hertz", "cells": n, "mu": mu, **pair("hertz", mesh, mu)})
    for n in (4,) if report.coarse else (8, 12):
        rows.append({"problem": "block", "cells": n, "mu": "0.3", **pair("block", str(n), "0.3")})
    report.table(
        "bench-getfem",
        "Against GetFEM: Example 7.2 with a linear material, Example 7.1, and a block in 3-D",
        rows,
        "*cells*: per unit length of the bar and the block, and on Hertz's half-width. Seconds "
        "of the whole Newton solve, both warm; a run of GetFEM that took more than "
        f"{TIMEOUT:.0f} s is shown as inf. GetFEM has its integral contact brick, an augmented "
        "Lagrangian, r = E, and a residual of 1e-10. Its contact integrals and the nodal "
        "multipliers of this code are different discretisations of order h.",
    )
    script(report, "peer_pair")


def pair(problem: str, mesh: str, mu: str) -> Run:
    """Return our run beside GetFEM's."""
    ours = run(problem, mesh, mu)
    try:
        theirs = measured([*command("peer_getfem"), problem, mesh, mu], limit=TIMEOUT)
    except subprocess.TimeoutExpired:
        theirs = dict.fromkeys(("steps", "converged", "assembly", "max_displacement"), np.nan)
        theirs["solve"] = np.inf
    difference = ours["max_displacement"] / theirs["max_displacement"] - 1
    return {
        "unknowns": ours["unknowns"],
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


def phases(report: Report) -> None:
    """Where the time goes."""
    for dimension, n in ((2, 32), (3, 8)) if report.coarse else ((2, 256), (3, 28)):
        found = measured([*command("phases"), str(dimension), str(n)])
        rows = [
            {"phase": name, "linear: times": k, "seconds": one, "nonlinear: times": m, "s": whole}
            for name, (k, one, m, whole) in found["phases"].items()
            if k + m > 0
        ]
        rows.append({"phase": "all", "seconds": found["linear"], "s": found["whole"]})
        report.table(
            f"bench-phases-{dimension}d",
            f"Where the time goes, {found['unknowns']} unknowns in {dimension}-D",
            rows,
            "One linear solve and the nonlinear one in one process; seconds of the processor.",
        )


#: Part -> its function, and the tables that it writes, in the order of the page.
PARTS: dict[str, tuple[Callable[[Report], None], tuple[str, ...]]] = {
    "solve": (against_one_solve, ("bench-ratio",)),
    "solvers": (partial(script, name="solvers"), ("solvers",)),
    "phases": (phases, ("bench-phases-2d", "bench-phases-3d")),
    "steps": (partial(script, name="steps"), ("bench-steps",)),
    "ranks": (ranks, ("bench-ranks",)),
    "memory": (memory, ("bench-memory",)),
    "getfem": (against_getfem, ("bench-getfem", "peer-pair")),
    "dolfinx": (partial(script, name="peer_plain"), ("peer-plain",)),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the parts that are asked for, and write the page."""
    made = parser(__doc__, "bench")
    made.add_argument("--parts", nargs="+", default=list(PARTS), choices=list(PARTS))
    given = made.parse_args(arguments)
    report = Report(given.out, given.coarse)
    begin = time.perf_counter()
    names = [name for _, written in PARTS.values() for name in written]
    failed = []
    for part in given.parts:
        try:
            PARTS[part][0](report)
        except (RuntimeError, OSError) as error:
            print(f"part {part}: {error}", file=sys.stderr)
            failed.append(part)
        print(f"part {part}: {time.perf_counter() - begin:.0f} s since the start", flush=True)
        # Measurements stay, whatever becomes of the rest.
        if not given.coarse:
            write_page(given.out, names, PAGE)
            write_memory(PAGE.with_suffix(""), SCALING)
    if failed:
        sys.exit(f"not measured: {', '.join(failed)}")


if __name__ == "__main__":
    main()
