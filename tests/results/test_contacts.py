"""Results of each contact, by its name."""

import json
from pathlib import Path
from typing import Any

import pytest

from contact import parse_case, sensitivity, solve, write_outputs
from contact.case.file import Case
from contact.results import quantities as registry
from contact.results.quantity import CONTACTS, Quantity
from tests.problems.written import rows_of


def between_plates(**more: Any) -> Case:
    """Return a block that two rigid plates press: 1 % from above, with friction at one of them."""
    tables: dict[str, Any] = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]},
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "left", "displacement": [0.0, "free"]}],
        "contact": [
            {
                **{"on": "top", "name": "lid", "friction": {"law": "coulomb", "mu": 0.2}},
                "foundation": {"shape": "plane", "point": [0.0, 1.0], "normal": [0.0, -1.0]},
                "rigid": {"displacement": ["0.01*max(0, t - 1)", "-0.01*min(t, 1)"]},
            },
            {"on": "bottom"},
        ],
        "evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, 1]},
    }
    return parse_case(tables | more)


@pytest.mark.parallel
def test_a_block_between_two_plates():
    """A stress of 1 % of E; the lid drags by mu p over a way that the block cannot follow whole."""
    solution = solve(between_plates())
    assert solution.converged
    lid, bottom = solution.contacts["lid"], solution.contacts["bottom"]
    assert solution.contact_force[1] == pytest.approx(0.0, abs=1e-9)
    assert lid.force[1] == pytest.approx(0.02, rel=0.05)
    assert bottom.force[1] == pytest.approx(-lid.force[1], rel=1e-8)
    assert lid.force[0] == pytest.approx(-0.2 * lid.force[1] * lid.slip, rel=1e-6)
    assert lid.stick + lid.slip == pytest.approx(1.0)
    assert bottom.dissipation == 0.0 < lid.dissipation
    assert lid.dissipation == pytest.approx(solution.dissipation, rel=1e-12)
    assert lid.area == pytest.approx(2.0) and bottom.area == pytest.approx(2.0)
    assert lid.mean_pressure == pytest.approx(lid.force[1] / lid.area, rel=1e-12)
    assert lid.max_pressure >= lid.mean_pressure
    half = solution.contacts["bottom"].moment[0] / bottom.force[1]
    assert half == pytest.approx(1.0, abs=0.1)  # p is nearly even over x from 0 to 2


def test_they_stand_in_the_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """And so does one that is entered for each contact."""
    size = Quantity("size", "area", "", lambda c: c.problem.nodes.sum(c.own / 1.0), (CONTACTS,))
    monkeypatch.setattr(registry, "QUANTITIES", (*registry.QUANTITIES, size))
    solution = solve(between_plates())
    write_outputs(solution, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert list(summary["contacts"]) == ["lid", "bottom"]
    assert summary["contacts"]["lid"]["force"] == pytest.approx(solution.contacts["lid"].force)
    rows = rows_of(tmp_path / "steps.csv")
    total = sum(float(row["dissipation_lid"]) for row in rows)
    assert summary["contacts"]["lid"]["dissipation"] == pytest.approx(total)
    assert float(rows[-1]["contact_force_y_lid"]) == pytest.approx(
        summary["contacts"]["lid"]["force"][1]
    )
    assert float(rows[0]["stick_lid"]) == 1.0
    assert float(rows[0]["size_lid"]) == summary["contacts"]["lid"]["size"] == pytest.approx(2.0)
    moment = summary["contacts"]["lid"]["moment"]
    assert moment == [pytest.approx(float(rows[-1]["contact_moment_lid"]))]
    assert list(summary["contacts"]["lid"])[:-1] == [
        "force", "moment", "area", "max_pressure", "mean_pressure", "stick", "slip", "dissipation"
    ]  # fmt: skip


def test_derivatives_of_the_force_on_one_contact():
    """By Hooke's law it is E times the strain; that of the sum of both is 0."""
    case = between_plates()
    solution = solve(case)
    names = ["contact_force_y_lid", "contact_force_y_bottom", "max_pressure_lid"]
    names += ["contact_moment_lid", "contact_moment_bottom", "mean_pressure_lid"]
    found = sensitivity(solution, names, ["material.young"])
    for name in (*names[:2], *names[3:]):
        value = solution.steps[-1].row[name]
        assert found[name]["material.young"] == pytest.approx(value, rel=1e-6)
    assert found[names[2]]["material.young"] == pytest.approx(
        solution.contacts["lid"].max_pressure, rel=1e-6
    )
    # Without friction there is no force along the plate: the adjoint is rounding.
    none = sensitivity(solution, ["contact_force_x_bottom"], ["material.young"], "adjoint")
    assert abs(none["contact_force_x_bottom"]["material.young"]) < 1e-15
