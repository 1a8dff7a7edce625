"""docs/output.md: every key, column and field that is written is described, and no other."""

import csv
import json
import re
from pathlib import Path

import pytest

from contact import sensitivity, solve, write_outputs
from contact.case.file import number_at, with_number
from contact.io.tables import files_help
from contact.plot.run import read_grid
from contact.results import quantities as registry
from contact.results.functionals import Integral
from contact.results.quantities import QUANTITIES, quantities
from contact.results.quantity import BODY, HISTORY, NODES, STEPS, SUMMARY, SURFACE, SWEEP, Quantity
from scripts.output_page import PAGE, page
from tests.problems.rigid import column, indented, plate
from tests.problems.written import block, electric, rows_of
from tests.results.test_steps import case_of as steps_case


def two_contacts():
    parts = {"piece": {"side": "bottom", "from": 0.5, "to": 1.5}}
    return block(
        2,
        mesh={"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4], "parts": parts},
        contact=[{"on": "piece"}, {"on": "right"}],
        friction={},
    )


def bolted():
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]}
    mesh["inside"] = {"cut": "abs(y - 0.5) < 1e-6"}
    return block(2, mesh=mesh, bolt=[{"on": "cut", "shortening": 0.001}])


def rigid():
    return indented(n=4), plate(), column()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return folders with the results of all kinds of problems."""
    folders = []
    metal = {"law": "j2", "young": 10.0, "poisson": 0.3, "yield_stress": 0.05}
    plastic = block(2, 2, material=metal)
    for case in (
        block(2),
        block(3),
        plastic,
        electric(2),
        electric(3),
        two_contacts(),
        bolted(),
        *rigid(),
    ):
        folders.append(tmp_path_factory.mktemp("out"))
        write_outputs(solve(case), folders[-1])
    return folders


def fits(quantity: Quantity, name: str) -> bool:
    """Whether a key, column or field is the quantity's."""
    parts = (quantity.component.format(name=quantity.name, axis=axis) for axis in "xyz")
    known = [re.sub("PART|KEY|AXIS", ".+", each) for each in (quantity.name, *parts)]
    return any(re.fullmatch(each, name) for each in known)


def agree(found: list[list[str]], file: str) -> None:
    """All that is found is described, in its order, and all that is described is found."""
    described = quantities(file)
    for names in found:
        places = [next(i for i, q in enumerate(described) if fits(q, name)) for name in names]
        assert file == SUMMARY or places == sorted(places)
    for quantity in described:
        assert any(fits(quantity, name) for names in found for name in names), quantity.name


def header(path: Path) -> list[str]:
    return next(csv.reader(path.open()))


def test_summary(written: list[Path]) -> None:
    agree([list(json.loads((f / SUMMARY).read_text())) for f in written], SUMMARY)


@pytest.mark.parametrize("name", [NODES, HISTORY])
def test_tables(name: str, written: list[Path]) -> None:
    agree([header(folder / name) for folder in written], name)


def test_fields(written: list[Path]) -> None:
    for name in (BODY, SURFACE):
        fields = [read_grid(folder / name) for folder in written]
        for quantity in quantities(name):
            assert any(
                quantity.name in found.point_data or quantity.name in found.cell_data
                for found in fields
            )
        for found in fields:
            known = {quantity.name for quantity in quantities(name)}
            assert set(found.point_data) <= known
            derived = set(found.point_data) - {"displacement", "potential"}
            assert name == SURFACE or set(found.cell_data) == {
                "error",
                "region",
                *(f"{k}_cell" for k in derived),
            }


def test_one_entry_is_a_key_a_column_and_a_derivative(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Further quantities stand in summary, steps, sweep, page, help and sensitivities."""
    files = (SUMMARY, STEPS, SWEEP)
    mean = Quantity(
        "mean_pressure", "stress", "Mean contact pressure.",
        lambda r: r.problem.nodes.sum(r.pressure) / r.contact_area, files,
    )  # fmt: skip
    sink = Quantity(
        "sink", "length", "Integral of u_y.", files=files, functional=Integral(lambda u, phi: u[1])
    )
    monkeypatch.setattr(registry, "QUANTITIES", (*QUANTITIES, mean, sink))
    solution = solve(steps_case())
    write_outputs(solution, tmp_path)
    rows = rows_of(tmp_path / STEPS)
    summary = json.loads((tmp_path / SUMMARY).read_text())
    for name in ("mean_pressure", "sink"):
        assert float(rows[-1][name]) == summary[name] != 0
        assert all(name in files_help(file) for file in files)
    assert "| `mean_pressure` | stress | Mean contact pressure. |" in page()
    key = "load.0.traction.1"
    found = sensitivity(solution, ["sink"], [key])["sink"][key]
    case, value = solution.source, number_at(solution.source, key)
    ends = [
        solve(with_number(case, key, value * way)).steps[-1].row for way in (1 + 1e-4, 1 - 1e-4)
    ]
    assert found == pytest.approx((ends[0]["sink"] - ends[1]["sink"]) / (2e-4 * value), rel=1e-5)


def test_the_page_is_made_from_this() -> None:
    assert PAGE.read_text() == page(), "python3 -m scripts.output_page"
