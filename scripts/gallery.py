"""The gallery of examples: each case is solved, and its results set beside reference values.

`python3 -m scripts.gallery [--out docs/examples] [NAME ...]` writes for each example a table, which
its page of the documentation includes, and its figure.
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
from scripts.studies.two_bodies import MODULUS, MU, RELATIVE, half_width

#: Where the tables and figures are.
FOLDER = Path(__file__).parents[1] / "docs" / "examples"


@dataclass(frozen=True)
class Run:
    """The written files of a run.

    Attributes
    ----------
    folder
        The folder of results.
    """

    folder: Path

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The contents of summary.json."""
        return dict(json.loads((self.folder / "summary.json").read_text()))

    def columns(self, name: str = "contact.csv") -> dict[str, np.ndarray]:
        """Return the columns of a table that are numbers."""
        with (self.folder / name).open() as stream:
            rows = list(csv.DictReader(stream))
        numbers = [key for key in rows[0] if key not in ("on", "status")]
        return {key: np.array([float(row[key] or "nan") for row in rows]) for key in numbers}

    def sticks(self) -> np.ndarray:
        """Return which contact nodes stick."""
        with (self.folder / "contact.csv").open() as stream:
            return np.array([row["status"] == "stick" for row in csv.DictReader(stream)])


#: Name of a quantity, its computed and its reference value.
Compared = tuple[str, float, float]


@dataclass(frozen=True)
class Example:
    """An example.

    Attributes
    ----------
    case
        Name of the case file.
    compare
        Sets results beside reference values.
    source
        Source of the reference.
    within
        The largest relative difference that is expected.
    figure
        Name of the figure of the run.
    changes
        Changed keys of the case.
    """

    case: str
    compare: Callable[[Run], Iterator[Compared]]
    source: str
    within: float
    figure: str = "figure-contact.png"
    changes: tuple[str, ...] = ()


def _hertz(run: Run) -> Iterator[Compared]:
    a, p_0 = half_width(160.0, 2000.0 / (1 - 0.3**2), 8.0)
    table = run.columns()
    load = table["weight"] * table["pressure"]
    moment = 2 * np.sqrt(np.sum(load * table["x"] ** 2) / np.sum(load))
    yield "half width", float(moment), a
    yield "largest pressure", run.summary["max_pressure"], p_0


def _cattaneo(run: Run) -> Iterator[Compared]:
    table = run.columns()
    x, force = table["x"], float(np.sum(table["weight"] * table["pressure"]))
    share = float(np.sum(table["weight"] * table["tau"])) / (MU * force)
    a, p_0 = half_width(force, MODULUS, RELATIVE)
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
    assert entry.coupling is not None and entry.permittivity is not None
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


def _hexahedra(run: Run) -> Iterator[Compared]:
    yield "largest displacement", run.summary["max_displacement"], 0.93089
    yield "force on the floor", -run.summary["contact_force"][2], 3067.9


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
    "bracket": Example("bracket", _hexahedra, "hexahedra of degree 2", 0.01, "figure-deformed.png"),
}


def solved(example: Example, folder: Path, figures: bool = True) -> Run:
    """Solve an example into a folder."""
    solution = solve(load_case(CASES / f"{example.case}.toml", example.changes))
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


def main(arguments: Sequence[str] | None = None) -> None:
    """Write tables and figures of the examples named, or of all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=FOLDER)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(EXAMPLES))
    given = parser.parse_args(arguments)
    given.out.mkdir(parents=True, exist_ok=True)
    for name in given.names or EXAMPLES:
        example = EXAMPLES[name]
        with tempfile.TemporaryDirectory() as place:
            run = solved(example, Path(place))
            text = table(example, run)
            (given.out / f"{name}.md").write_text(text)
            shutil.copy(run.folder / example.figure, given.out / f"{name}.png")
        print(f"{name}\n{text}", flush=True)


if __name__ == "__main__":
    main()
