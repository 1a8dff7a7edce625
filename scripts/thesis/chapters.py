"""Which script makes which tables and figures, in the order of the results page."""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mpi4py import MPI


@dataclass(frozen=True)
class Part:
    """A script."""

    #: Its name, and that of the folder that it writes into.
    script: str
    #: On the results page.
    heading: str
    #: Whether it makes tables, and figures.
    tables: bool = True
    figures: bool = True
    #: Where the script is.
    package: str = "thesis"
    #: Name of the page, one of `PAGES`.
    page: str = "thesis-studies"

    @property
    def module(self) -> str:
        """Return the name to import."""
        return f"scripts.{self.package}.{self.script}"


#: Name of a page of results -> its title.
PAGES = {
    "thesis-mechanics": "Chapters 3, 4 and 7: elasto-plastic bodies",
    "thesis-piezo": "Chapters 5 and 8: electro-elasto-plastic bodies",
    "thesis-compliance": "Chapters 6 and 8: compliant and conductive foundations",
    "thesis-studies": "Studies beside the thesis",
}

PARTS = (
    Part(
        "setups",
        "Set-ups and constants: Figures 1.1, 1.2, 7.1, 7.3, 8.1, 8.8, Table 8.1",
        page="thesis-mechanics",
    ),
    Part("hertz", "Example 7.1: Hertz's cylinder, and a sphere", page="thesis-mechanics"),
    Part(
        "table_7_1",
        "Example 7.2: Table 7.1, Algorithms 1 and 2",
        figures=False,
        page="thesis-mechanics",
    ),
    Part(
        "figures_mechanics",
        "Example 7.2: Figures 7.4, 7.5, 7.7 and 7.8",
        tables=False,
        page="thesis-mechanics",
    ),
    Part(
        "table_7_2",
        "Example 7.2: Table 7.2, the penalty method, Theorem 4.2",
        figures=False,
        page="thesis-mechanics",
    ),
    Part(
        "convergence_mechanics",
        "Figure 7.6 and Theorems 3.2, 4.3 and 4.5",
        package="studies",
        page="thesis-mechanics",
    ),
    Part(
        "corner",
        "The singular corner of Example 7.2",
        figures=False,
        package="studies",
        page="thesis-mechanics",
    ),
    Part(
        "pressure_convergence",
        "Convergence of the contact pressure",
        figures=False,
        package="studies",
    ),
    Part("curved_foundations", "Curved foundations", figures=False, package="studies"),
    Part("pressure_on_axis", "Pressure on the axis", figures=False, package="studies"),
    Part("nonlocal_friction", "Non-local friction at work", package="studies"),
    Part(
        "tables_piezo",
        "Examples 8.1 and 8.2: Tables 8.2 and 8.3",
        figures=False,
        page="thesis-piezo",
    ),
    Part(
        "figures_piezo",
        "Examples 8.1 and 8.2: Figures 8.2 to 8.7",
        tables=False,
        page="thesis-piezo",
    ),
    Part(
        "tables_compliance",
        "Examples 8.3 and 8.4: Table 8.4",
        figures=False,
        page="thesis-compliance",
    ),
    Part(
        "stopping_8_3",
        "Example 8.3: the thesis's two iterations",
        figures=False,
        page="thesis-compliance",
    ),
    Part(
        "figures_compliance",
        "Examples 8.3 and 8.4: figures",
        tables=False,
        page="thesis-compliance",
    ),
    Part(
        "limit_theorem",
        "Theorems 6.3 to 6.5: limits of the compliant foundation",
        package="studies",
        page="thesis-compliance",
    ),
    Part("refinement_8", "Chapter 8 on finer meshes", figures=False, package="studies"),
    Part(
        "sensitivity",
        "Parameters that the thesis does not print",
        figures=False,
        package="studies",
    ),
    Part("agreement", "Agreement of the methods", figures=False, package="studies"),
)


def add_only(parser: argparse.ArgumentParser) -> None:
    """Add the option --only, names of scripts."""
    names = [part.script for part in PARTS]
    parser.add_argument(
        "--only", nargs="+", choices=names, metavar="SCRIPT", help="these scripts alone"
    )


def wanted(only: Sequence[str] | None, parts: Sequence[Part] = PARTS) -> list[Part]:
    """Return the parts of the scripts named; all where none is."""
    return [part for part in parts if not only or part.script in only]


def run(parts: Sequence[Part], text: str, arguments: Sequence[str] | None = None) -> None:
    """Run scripts into folders side by side. Collective."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results"))
    parser.add_argument("--coarse", action="store_true", help="coarse meshes, for tests")
    add_only(parser)
    chosen = parser.parse_args(arguments)
    for part in wanted(chosen.only, parts):
        begin = time.perf_counter()
        flags = ["--out", str(chosen.out / part.script), *["--coarse"] * chosen.coarse]
        importlib.import_module(part.module).main(flags)
        if MPI.COMM_WORLD.rank == 0:
            print(f"\n== {part.script}: {time.perf_counter() - begin:.0f} s", flush=True)
