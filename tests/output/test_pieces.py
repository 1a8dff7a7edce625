"""Contact nodes of large problems: a file a rank, with the numbers of the one file."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
import pyvista
from mpi4py import MPI

from contact.output import solved
from contact.output.figures.run import read_grid
from contact.output.files import write_outputs
from contact.ranks import on_root
from contact.solving import solve
from tests.problems.written import block

COMM = MPI.COMM_WORLD


def rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a table."""
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 2), (3, 1)])
def test_pieces_hold_what_one_file_holds(
    dim: int, degree: int, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solution = solve(block(dim, degree))
    write_outputs(solution, shared_tmp_path / "whole")
    # The same folder: pieces replace one file, and one file pieces.
    write_outputs(solution, shared_tmp_path / "pieces")
    monkeypatch.setattr(solved, "TOGETHER", 0)
    del solution.__dict__["listed_contact"]
    write_outputs(solution, shared_tmp_path / "pieces")
    on_root(COMM, lambda: compare(shared_tmp_path, dim))
    monkeypatch.undo()
    del solution.__dict__["listed_contact"]
    write_outputs(solution, shared_tmp_path / "pieces")
    on_root(COMM, lambda: same_names(shared_tmp_path / "whole", shared_tmp_path / "pieces"))


def same_names(*folders: Path) -> None:
    """Check that folders hold files of the same names."""
    names = [sorted(path.name for path in folder.iterdir()) for folder in folders]
    assert names[0] == names[1]


def compare(folder: Path, dim: int) -> None:
    """Compare the two folders."""
    whole, pieces = folder / "whole", folder / "pieces"
    listed = json.loads((pieces / "summary.json").read_text())["files"]
    assert sorted(path.name for path in pieces.iterdir()) == listed
    if COMM.size == 1:
        assert "contact.csv" in listed and "contact.pvtu" not in listed
        return
    assert "contact.csv" not in listed
    tables = [rows(pieces / f"contact.{k:04d}.csv") for k in range(COMM.size)]
    assert dim == 2 or sum(len(table) > 0 for table in tables) > 1
    axes = "xyz"[:dim]
    every = sorted(
        (row for table in tables for row in table), key=lambda r: [float(r[a]) for a in axes]
    )
    assert every == sorted(rows(whole / "contact.csv"), key=lambda r: [float(r[a]) for a in axes])
    one, many = read_grid(whole / "contact.vtu"), pyvista.read(pieces / "contact.pvtu")
    assert one.n_cells == many.n_cells
    assert set(one.point_data) == set(many.point_data)
    place = np.array([one.find_closest_point(point) for point in many.points])
    np.testing.assert_array_equal(one.points[place], many.points)
    assert set(place) == set(range(one.n_points))
    for name in set(one.point_data) - {"row"}:
        np.testing.assert_array_equal(one.point_data[name][place], many.point_data[name], name)
    assert many.point_data["row"].max() == max(map(len, tables)) - 1
