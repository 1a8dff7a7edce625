"""The places of scripts/fx side by side: `FENICSX=wheels make places`.

Versions, the demo with nothing compiled and once more, and the first rows of the benchmark. The
places take turns, and each figure is the least of some rounds. From within a Debian root no other
place can be entered, hence FENICSX=wheels.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from collections.abc import Sequence

from contact.errors import counted
from scripts.reporting import Report

#: Those that `FENICSX` names, and their heads in the table.
PLACES = {"debian": "Debian 13", "wheels": "wheels", "sid": "Debian sid"}

#: Dimension and cells a unit of the rows of the benchmark, from zero as the program begins.
SOLVES = (("2", "64"), ("2", "128"), ("3", "20"))

#: How often each is measured.
ROUNDS = 3

VERSIONS = """
import json, gmsh, pyvista
from contact._compat import versions
print(json.dumps(versions() | {"pyvista": pyvista.__version__, "gmsh": gmsh.__version__}))
"""


def inside(place: str, forms: str, *words: str) -> tuple[str, float, float]:
    """Run Python in a place, with a folder for compiled forms.

    Return the last line of its output, its seconds of the processor and its memory (MB).
    """
    command = ["scripts/fx", "env", f"XDG_CACHE_HOME={forms}", "python3", *words]
    variables = {**os.environ, "FENICSX": place, "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        output = process.stdout.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} failed in {place}")
    return output.splitlines()[-1], used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def figures(place: str, solves: Sequence[tuple[str, str]]) -> dict[str, float]:
    """Return one round of measurements: seconds of the processor, megabytes."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        words = f"-m contact solve scripts/cases/bar.toml --out {folder}/bar --overwrite --plot"
        demo = words.split()
        for name in ("`make demo`, the first time (s)", "`make demo` again (s)"):
            _, found[name], found["its memory (MB)"] = inside(place, folder, *demo)
        for dimension, cells in solves:
            words = ("-m", "scripts.benchmarks.bench_one", "ratio", dimension, cells)
            row = json.loads(inside(place, folder, *words)[0])
            size = f"{row['unknowns']:,} unknowns in {dimension}-D"
            found[f"solve, {size} (s)"] = row["CPU seconds"]
            found[f"one linear solve, {size} (s)"] = row["one"]
            found[f"memory, {size} (MB)"] = row["bytes an unknown"] * row["unknowns"] / 1e6
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write the table."""
    report = Report.of(__doc__, "places", arguments)
    number, solves = (1, SOLVES[:1]) if report.coarse else (ROUNDS, SOLVES)
    rounds = [{place: figures(place, solves) for place in PLACES} for _ in range(number)]
    rows, heads = [], PLACES.items()
    said = {place: json.loads(inside(place, "/tmp", "-c", VERSIONS)[0]) for place in PLACES}
    for name in said["debian"]:
        rows.append({"place": name} | {head: said[place][name] for place, head in heads})
    for name in rounds[0]["debian"]:
        least = {place: min(measured[place][name] for measured in rounds) for place in PLACES}
        rows.append({"place": name} | {head: f"{least[place]:.3g}" for place, head in heads})
    report.table(
        "places",
        "The three places of scripts/fx",
        rows,
        f"Seconds of the processor with one BLAS thread, the least of {counted(number, 'round')} "
        f"in which the places take turns; {os.cpu_count()} cores, which others may use too. "
        "*solve*: Example 7.2 in the plane and the block of the [benchmarks](benchmarks.md), with "
        "Hencky's law and friction; *one linear solve*: elasticity by the same linear solver.",
    )


if __name__ == "__main__":
    main()
