"""The gallery of examples: each case is solved, and its results set beside reference values.

`python3 -m scripts.gallery [--out docs/examples] [NAME ...]` writes for each example a table, which
its page of the documentation includes, and its figure; for some a table of other meshes, too.
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from contact import load_case, solve, write_outputs
from contact.library.materials import find
from scripts.cases import CASES
from scripts.studies.half_space import HalfSpace, ball
from scripts.studies.hertz_exact import line_contact

#: Where the tables and figures are.
FOLDER = Path(__file__).parents[1] / "docs" / "examples"

#: Half cylinders: E* and relative radius, and Coulomb's coefficient.
MODULUS, RELATIVE, MU = 1000.0 / (2 * 0.91), 5.0, 0.3


@dataclass(frozen=True)
class Run:
    """The written files of a run."""

    #: The folder of results.
    folder: Path

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The contents of summary.json."""
        return dict(json.loads((self.folder / "summary.json").read_text()))

    def rows(self, name: str) -> list[dict[str, str]]:
        """Return the rows of a table."""
        with (self.folder / name).open() as stream:
            return list(csv.DictReader(stream))

    def columns(self, name: str = "contact.csv") -> dict[str, np.ndarray]:
        """Return the columns of a table that are numbers."""
        rows = self.rows(name)
        numbers = [key for key in rows[0] if key not in ("on", "status")]
        return {key: np.array([float(row[key] or "nan") for row in rows]) for key in numbers}

    def sticks(self) -> np.ndarray:
        """Return which contact nodes stick."""
        return np.array([row["status"] == "stick" for row in self.rows("contact.csv")])


#: Name of a quantity, its computed and its reference value.
Compared = tuple[str, float, float]


@dataclass(frozen=True)
class Example:
    """An example."""

    #: Name of the case file.
    case: str
    #: Sets results beside reference values.
    compare: Callable[[Run], Iterator[Compared]]
    #: Source of the reference.
    source: str
    #: The largest relative difference that is expected.
    within: float
    #: Name of the figure of the run.
    figure: str = "figure-contact.png"
    #: Changed keys of the case.
    changes: tuple[str, ...] = ()
    #: Names and changed keys of other meshes, a coarse one first, its own next, the finest last.
    meshes: tuple[tuple[str, tuple[str, ...]], ...] = ()


def _hertz(run: Run) -> Iterator[Compared]:
    a, p_0 = line_contact(160.0, 2000.0 / (1 - 0.3**2), 8.0)
    table = run.columns()
    load = table["weight"] * table["pressure"]
    moment = 2 * np.sqrt(np.sum(load * table["x"] ** 2) / np.sum(load))
    yield "half width", float(moment), a
    yield "largest pressure", run.summary["max_pressure"], p_0


def _cattaneo(run: Run) -> Iterator[Compared]:
    table = run.columns()
    x, force = table["x"], float(np.sum(table["weight"] * table["pressure"]))
    share = float(np.sum(table["weight"] * table["tau"])) / (MU * force)
    a, p_0 = line_contact(force, MODULUS, RELATIVE)
    spacing = float(np.mean(np.diff(x[np.abs(x) < a])))
    stick = float(np.abs(x[run.sticks()]).max()) + spacing / 2
    yield "share c/a that sticks", stick / a, float(np.sqrt(1 - share))
    yield "largest pressure", run.summary["max_pressure"], p_0


def _loop(run: Run) -> Iterator[Compared]:
    table = run.columns("steps.csv")
    cycle = table["t"] >= 2.0
    way, force = table["driven_x"][cycle], table["driven_force_x"][cycle]
    area = float(np.sum(np.diff(way) * (force[1:] + force[:-1]) / 2))
    yield "dissipation of a cycle", float(np.sum(table["dissipation"][cycle][1:])), abs(area)


def _lame(run: Run) -> Iterator[Compared]:
    modulus, nu, a, b, overlap = 210e3, 0.3, 1.0, 2.0, 0.002
    lame = modulus * overlap / (a * (1 + nu)) * (b**2 - a**2) / ((1 - 2 * nu) * a**2 + b**2)
    table = run.columns()
    mean = np.sum(table["weight"] * table["pressure"]) / np.sum(table["weight"])
    yield "mean pressure", float(mean), lame


def _nafems(run: Run) -> Iterator[Compared]:
    yield "half width", run.summary["contact_area"], 6.215
    yield "largest pressure", run.summary["max_pressure"], 3585.4


def _plates(run: Run) -> Iterator[Compared]:
    reactions = run.summary["reactions"]
    yield "force on the lower plate", reactions["lower_bottom"][1], -reactions["upper_top"][1]


def _half_space(run: Run) -> Iterator[Compared]:
    entry = find("PZT-4")
    body = HalfSpace(entry.stiffness / 1e9, entry.coupling, entry.permittivity * 1e9)
    exact = ball(body, 1.0, 0.1, 0.0)
    yield "force", abs(run.summary["rigid"]["force"][1]), exact.force
    yield "charge", abs(run.summary["charges"]["foundation"]), abs(exact.charge)


def _column(run: Run) -> Iterator[Compared]:
    yield "potential at the foot", run.summary["phi_max"], 12.663908
    yield "displacement of the top", run.summary["max_displacement"], 1.0155856


def _layer(run: Run) -> Iterator[Compared]:
    modulus, c, touch, driven = (1 - 0.3) / (1.3 * 0.4), 5.0, 0.01, 0.05
    u = (modulus * driven + c * touch) / (modulus + c)
    yield "pressure", run.summary["max_pressure"], c * (u - touch)


def _balance(run: Run) -> Iterator[Compared]:
    table = run.columns("steps.csv")
    lost = np.sum(table["dissipation"]) + np.sum(table["plastic_dissipation"])
    yield (
        "energy stored and dissipated, over the work",
        float((table["energy"][-1] + lost) / np.sum(table["work"])),
        1.0,
    )


def row(run: Run) -> dict[str, float]:
    """Return the row of a run in the table of meshes."""
    found = run.summary
    return {
        "unknowns": found["dofs"],
        "largest displacement": found["max_displacement"],
        "force on the floor": -found["contact_force"][2],
        "estimated error": found["error"]["energy"],
    }


def on_meshes(name: str, folder: Path = FOLDER) -> list[dict[str, str]]:
    """Return the rows of the table of meshes of an example."""
    with (folder / f"{name}-meshes.csv").open() as stream:
        return list(csv.DictReader(stream))


def _hexahedra(run: Run) -> Iterator[Compared]:
    found, finest = row(run), on_meshes("bracket")[-1]
    for quantity in ("largest displacement", "force on the floor"):
        yield quantity, found[quantity], float(finest[quantity])


#: Cells of the reference.
FINEST = ("mesh.cell=hexahedron", "mesh.size=6.0", "mesh.contact_size=2.5")


#: Name of a page, without `example-` -> its example.
EXAMPLES = {
    "hertz": Example("hertz-small", _hertz, "Hertz", 0.01),
    "partial-slip": Example(
        "two-half-cylinders", _cattaneo, "Cattaneo and Mindlin", 0.01, changes=("space.degree=2",)
    ),
    "fretting": Example("fretting", _loop, "the area of the loop", 0.01, "figure-loop.png"),
    "press-fit": Example("press-fit", _lame, "Lamé", 0.001, "figure-deformed.png"),
    "cylinder-block": Example(
        "cylinder-on-block",
        _nafems,
        "Hertz, NAFEMS R0094-1",
        0.005,
        changes=("space.degree=2", "friction.mu=0.0"),
    ),
    "ball-plates": Example("ball-between-plates", _plates, "balance", 1e-6, "figure-deformed.png"),
    "indentation": Example("indent-pzt4-conducting", _half_space, "half space", 0.02),
    "column": Example("piezo-column", _column, "closed form", 1e-6, "figure-deformed.png"),
    "layer": Example("layer-column", _layer, "closed form", 1e-6),
    "bimorph": Example("bimorph-stop", _balance, "balance of energy", 0.05, "figure-deformed.png"),
    "bracket": Example(
        "bracket",
        _hexahedra,
        "hexahedra of degree 2",
        0.01,
        "figure-deformed.png",
        meshes=(
            (
                "curved tetrahedra of twice the size, degree 2",
                ("mesh.size=16.0", "mesh.contact_size=6.0"),
            ),
            ("curved tetrahedra, degree 2", ()),
            ("hexahedra, degree 1", (*FINEST, "space.degree=1")),
            ("hexahedra, degree 2", FINEST),
        ),
    ),
}


def solved(
    example: Example, folder: Path, figures: bool = True, changes: tuple[str, ...] = ()
) -> Run:
    """Solve an example, with further changes, into a folder."""
    solution = solve(load_case(CASES / f"{example.case}.toml", (*example.changes, *changes)))
    assert solution.converged, solution.outcome.reason
    write_outputs(solution, folder, figures=figures)
    return Run(folder)


def table(example: Example, run: Run) -> str:
    """Return the table of an example, results beside reference values."""
    lines = [f"| quantity | computed | reference ({example.source}) | apart |", "|---|---|---|---|"]
    for name, computed, reference in example.compare(run):
        apart = abs(computed / reference - 1)
        shown = f"{100 * apart:.2g} %" if apart >= 1e-6 else "below 1e-6"
        lines.append(f"| {name} | {computed:.5g} | {reference:.5g} | {shown} |")
    return "\n".join(lines) + "\n"


def write_meshes(name: str, out: Path) -> None:
    """Solve an example on several meshes and write the table of its results."""
    rows = []
    for words, changes in EXAMPLES[name].meshes:
        with tempfile.TemporaryDirectory() as place:
            run = solved(EXAMPLES[name], Path(place), figures=False, changes=changes)
            rows.append({"cells": words, **row(run)})
    with (out / f"{name}-meshes.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [*rows[0]])
        writer.writeheader()
        writer.writerows(rows)
    lines = [f"| {' | '.join(rows[0])} |", "|" + "---|" * len(rows[0])]
    for results in rows:
        *values, error = results.values()
        shown = [f"{v:.4g}" if isinstance(v, float) else f"{v}" for v in values]
        lines.append(f"| {' | '.join(shown)} | {100 * error:.2g} % |")
    (out / f"{name}-meshes.md").write_text("\n".join(lines) + "\n")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write tables and figures of the examples named, or of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=FOLDER)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(EXAMPLES))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.names or EXAMPLES:
        example = EXAMPLES[name]
        if example.meshes:
            write_meshes(name, given.out)
        with tempfile.TemporaryDirectory() as place:
            run = solved(example, Path(place))
            text = table(example, run)
            (given.out / f"{name}.md").write_text(text)
            shutil.copy(run.folder / example.figure, given.out / f"{name}.png")
        print(f"{name}\n{text}", flush=True)


if __name__ == "__main__":
    main()
