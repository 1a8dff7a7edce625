"""Amplitudes from CSV files, and symmetry by name."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, load_case, parse_case, solve
from contact.case.digest import digest
from contact.case.file import to_toml
from tests.problems.bar import changed

STEPS = {"times": [0.0, 1.0, 3.0], "steps": [1, 2]}


def with_file(name="press.csv"):
    amplitudes = {"press": {"file": name}}
    return changed(evolution=STEPS | {"amplitudes": amplitudes}, load__0__amplitude="press")


@pytest.mark.parametrize(
    "text",
    [
        "t,factor\n0,0\n1,1\n3,-0.5\n",
        "time, force, more\n0, 0, 7\n1, 1, 7\n3, -0.5, 7\n\n",
    ],
)
def test_an_amplitude_from_a_file(tmp_path, text):
    (tmp_path / "press.csv").write_text(text)
    case = parse_case(with_file(), tmp_path)
    factor = case.evolution.amplitudes["press"]
    assert [factor(t) for t in (0.0, 0.5, 1.0, 2.0, 3.0)] == [0.0, 0.5, 1.0, 0.25, -0.5]
    given = {"time": [0.0, 1.0, 3.0], "value": [0.0, 1.0, -0.5]}
    known = with_file()
    known["evolution"]["amplitudes"]["press"] = given
    rows = [
        [step.row["contact_force_y"] for step in solve(c, comm=MPI.COMM_SELF).steps]
        for c in (case, parse_case(known))
    ]
    assert rows[0] == rows[1]
    assert "evolution.amplitudes.press.file" in digest(case)
    (tmp_path / "case.toml").write_text(to_toml(case, anchored=True))
    assert load_case(tmp_path / "case.toml").evolution.amplitudes["press"](2.0) == 0.25


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,f\n", r"\[amplitude-file\]"),
        ("t\n0\n3\n", r"\[amplitude-file\]"),
        ("t,f\n0,0\n1,one\n3,1\n", r"\[data-file\]"),
        ("t,f\n0,0\n1,1\n1,2\n3,1\n", r"\[value\]"),
        ("t,f\n0,0\n1,1\n", r"\[value\]"),
        ("t,f\n0,0\n1,nan\n3,1\n", r"\[amplitude-file\]"),
        ("0,1\n1,1\n3,1\n", r"\[data-file\]"),  # no names
        # Decimal commas, which are no separators of columns.
        ("t;f\n0;0\n1,5;1\n3;0,5\n", r"\[data-file\]"),
        ("t f\n0,5 1\n3 0\n", r"\[data-file\]"),
        ("t,f\n0,0,0\n3,0,5\n", r"\[data-file\]"),
        (None, r"\[data-file\]"),
    ],
)
def test_other_files_are_refused(tmp_path, text, words):
    if text is not None:
        (tmp_path / "press.csv").write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        parse_case(with_file(), tmp_path)
    assert "evolution.amplitudes.press.file" in str(caught.value)
    assert "\n" not in str(caught.value)


HALF = {
    "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
    "material": {"young": 10.0, "poisson": 0.3},
    "load": [{"on": "top", "pressure": 0.1}],
    "contact": {"on": "bottom"},
}


@pytest.mark.parallel
def test_symmetry_is_a_displacement_of_zero_across_a_plane():
    comm = MPI.COMM_WORLD
    forms = {"symmetry": "x"}, {"displacement": [0.0, "free"]}
    one, two = (
        solve(parse_case(HALF | {"fixed": [{"on": "left", **form}]}), comm=comm) for form in forms
    )
    assert np.array_equal(one.pressure, two.pressure)
    assert np.array_equal(one.displacement.x.array, two.displacement.x.array)
    assert np.abs(one.displacement.x.array).max() > 1e-3
