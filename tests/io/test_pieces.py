"""Large problems: a file a rank, with the numbers of the one file."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case
from contact.case.file import Case
from contact.errors import InputError
from contact.io import formats
from contact.io.files import write_outputs
from contact.plot.run import read_grid, read_run
from contact.ranks import on_root
from contact.solving import solve
from tests.problems import pairs
from tests.problems.written import block

COMM = MPI.COMM_WORLD

EVOLUTION = {"times": [0.0, 1.0], "steps": [2]}
CASES = {
    "block": lambda: block(3),
    "steps": lambda: block(2, 2, evolution=EVOLUTION),
    "pair": lambda: parse_case(pairs.case(evolution=EVOLUTION, space={"degree": 2})),
}


def rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.core("pair")
@pytest.mark.parallel
@pytest.mark.parametrize("name", CASES)
def test_pieces_hold_what_one_file_holds(
    name: str, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case: Case = CASES[name]()
    solution = solve(case)
    write_outputs(solution, shared_tmp_path / "whole")
    # The same folder: pieces replace one file, and one file pieces.
    write_outputs(solution, shared_tmp_path / "pieces")
    monkeypatch.setattr(formats, "TOGETHER", 0)
    del solution.__dict__["listed_contact"]
    write_outputs(solution, shared_tmp_path / "pieces")
    on_root(COMM, lambda: compare(shared_tmp_path))
    monkeypatch.undo()
    del solution.__dict__["listed_contact"]
    write_outputs(solution, shared_tmp_path / "pieces")
    on_root(COMM, lambda: same_names(shared_tmp_path / "whole", shared_tmp_path / "pieces"))


def same_names(*folders: Path) -> None:
    """Check that folders hold files of the same names."""
    names = [sorted(path.name for path in folder.iterdir()) for folder in folders]
    assert names[0] == names[1]


def compare(folder: Path) -> None:
    """Compare the two folders."""
    whole, pieces = folder / "whole", folder / "pieces"
    listed = json.loads((pieces / "summary.json").read_text())["files"]
    assert sorted(path.name for path in pieces.iterdir()) == listed
    if COMM.size == 1:
        same_names(whole, pieces)
        return
    for path in whole.glob("contact*.csv"):
        assert path.name not in listed
        tables = [rows(formats.piece(pieces / path.name, k)) for k in range(COMM.size)]
        every = sorted(list(row.values()) for table in tables for row in table)
        assert every == sorted(list(row.values()) for row in rows(path)), path.name
    grids = [*whole.glob("*.vtu")]
    assert len(grids) >= 2
    for path in grids:
        assert path.name not in listed
        one, many = read_grid(path), read_grid(pieces / path.with_suffix(".pvtu").name)
        np.testing.assert_array_equal(one.points, many.points)
        np.testing.assert_array_equal(one.cells, many.cells)
        assert {*one.point_data, "node"} == set(many.point_data)
        assert set(one.cell_data) == set(many.cell_data)
        for field in set(one.point_data) - {"row"}:
            np.testing.assert_array_equal(one.point_data[field], many.point_data[field], field)
        for field in one.cell_data:
            np.testing.assert_array_equal(one.cell_data[field], many.cell_data[field], field)
    for path in pieces.glob("*.pvd"):
        assert ".pvtu" in path.read_text()


@pytest.mark.parallel
def test_figures_of_a_body_in_pieces(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They see it as that of one file; a contact part in pieces is refused."""
    solution = solve(block(3))
    monkeypatch.setattr(formats, "TOGETHER", solution.problem.nodes.size)
    write_outputs(solution, shared_tmp_path / "body")
    monkeypatch.setattr(formats, "TOGETHER", 0)
    del solution.__dict__["listed_contact"]
    write_outputs(solution, shared_tmp_path / "both")
    if COMM.rank > 0:
        return
    run = read_run(shared_tmp_path / "body")
    assert (shared_tmp_path / "body" / "fields.pvtu").exists() == (COMM.size > 1)
    assert run.body.n_points == 5 * 3 * 3
    # No facets between pieces are seen: those of the box alone, two triangles each.
    assert run.body.extract_surface().n_cells == 2 * 2 * (4 * 2 + 4 * 2 + 2 * 2)
    if COMM.size > 1:
        with pytest.raises(InputError, match="the contact part is in pieces"):
            read_run(shared_tmp_path / "both")
