"""Small cases whose outputs are looked at: blocks pressed on a foundation, and what they write."""

import csv
import json
from pathlib import Path

from contact.case.file import Case, parse_case
from contact.solution import Solution
from contact.writing import write_outputs
from tests.problems.rigid import PIEZO


def block(dim: int, degree: int = 1, **sections: object) -> Case:
    """Return a block pressed on a plane and pushed aside, sticking and sliding."""
    size = [2.0, 1.0] if dim == 2 else [2.0, 1.0, 1.0]
    return parse_case(
        {
            "title": "Block",
            "mesh": {
                "generator": "rectangle" if dim == 2 else "box",
                "size": size,
                "cells": [8 if degree == 1 else 4, 4] if dim == 2 else [4, 2, 2],
            },
            "space": {"degree": degree},
            "material": {"law": "log", "young": 10.0, "poisson": 0.3, "yield_strain": 0.02},
            "fixed": [{"on": "top", "displacement": [0.02, *[0.0] * (dim - 2), "-0.02-0.02*x"]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 0.3},
            **sections,
        }
    )


def electric(dim: int) -> Case:
    """Return a piezoelectric block on a conductive foundation."""
    return block(
        dim,
        material={"young": 58.7, "poisson": 0.39, "piezo": PIEZO},
        electric={"k_e": 1.0, "phi_f": 3.0},
        fixed=[{"on": "top", "displacement": [0.0] * (dim - 1) + [-0.02], "potential": 0.0}],
    )


def written(
    solution: Solution, folder: Path, figures: bool = False
) -> tuple[dict[str, object], list[dict[str, str]]]:
    """Write the outputs; return the summary and the rows of the contact table."""
    write_outputs(solution, folder, figures)
    summary = json.loads((folder / "summary.json").read_text())
    return summary, rows_of(folder / "contact.csv")


def rows_of(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table, by the names of the columns."""
    with path.open() as file:
        return list(csv.DictReader(file))
