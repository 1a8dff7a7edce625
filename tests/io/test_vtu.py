"""Fields that other programs open: pyvista and meshio read what was solved."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from pyvista import UnstructuredGrid

from contact.io.fields import gathered, write_grid
from contact.mesh.cells import TRIANGLE, VTK
from contact.plot.run import read_grid
from contact.results.contact_nodes import Grid
from contact.solving import solve
from contact.writing import write_outputs
from tests.problems.written import block

ROOT = MPI.COMM_WORLD.rank == 0


@pytest.mark.core("2-1-triangle line", "3-2-tetra10 triangle6", "2-2-quad9 line3")
@pytest.mark.parallel
@pytest.mark.parametrize(
    ("dim", "degree", "kinds"),
    [
        (2, 1, "triangle line"),
        (2, 2, "triangle6 line3"),
        (3, 1, "tetra triangle"),
        (3, 2, "tetra10 triangle6"),
        (2, 1, "quad line"),
        (2, 2, "quad9 line3"),
        (3, 1, "hexahedron quad"),
        (3, 2, "hexahedron27 quad9"),
    ],
)
def test_other_programs_read_what_was_solved(
    dim: int, degree: int, kinds: str, shared_tmp_path: Path
) -> None:
    meshio = pytest.importorskip("meshio")
    cell = None
    if "quad" in kinds:
        cell = "quadrilateral" if dim == 2 else "hexahedron"
    case = block(dim, degree)
    mesh = case.mesh.model_copy(update={"cell": cell})
    solution = solve(case.model_copy(update={"mesh": mesh}))
    write_outputs(solution, shared_tmp_path)
    force, volume = solution.contact_force, 2.0
    if not ROOT:
        return
    for name, kind in zip(("fields.vtu", "contact.vtu"), kinds.split(), strict=True):
        seen = meshio.read(shared_tmp_path / name)
        other = read_grid(shared_tmp_path / name)
        assert [cells.type for cells in seen.cells] == [kind]
        assert set(seen.point_data) == set(other.point_data)
        assert set(seen.cell_data) == set(other.cell_data)
        for field, values in other.point_data.items():
            np.testing.assert_array_equal(values, seen.point_data[field])
        for field, values in other.cell_data.items():
            np.testing.assert_array_equal(values, seen.cell_data[field][0])
        np.testing.assert_array_equal(other.points, seen.points)
        if kind == "hexahedron27":  # of which VTK has no sizes; edges are straight
            corners = other.cells_dict[VTK["hexahedron"][1]][:, :8]
            other = UnstructuredGrid({VTK["hexahedron"][0]: corners}, other.points)
        sizes = other.compute_cell_sizes().cell_data
        length = {"l": "Length", "h": "Volume"}.get(kind[0], "Area")
        length = "Volume" if kind.startswith("tetra") else length
        size = sizes[length].sum()
        assert size == pytest.approx(volume, rel=1e-12)
    # The middle nodes lie between their corners: the order is VTK's.
    body = read_grid(shared_tmp_path / "fields.vtu")
    assert body.point_data["displacement"][:, -1 if dim == 3 else 1].min() == pytest.approx(-0.06)
    contact = read_grid(shared_tmp_path / "contact.vtu").point_data
    known = contact["row"] >= 0
    total = contact["weight"][known] @ contact["traction"][known]
    # By symmetry a component may be 0, and rounding.
    np.testing.assert_allclose(total[:dim], force, rtol=1e-12, atol=1e-15)


@pytest.mark.parallel
def test_ranks_with_nothing(shared_tmp_path: Path) -> None:
    """Shares of any size are one grid."""
    comm = MPI.COMM_WORLD
    for sizes in ([0, 1, 0], [1, 0, 2], [5, 1, 1]):
        n = sizes[comm.rank] if comm.size > 1 else sum(sizes)
        first = sum(sizes[: comm.rank]) if comm.size > 1 else 0
        points = np.random.default_rng(comm.rank).random((3 * n, 2))
        cells = 3 * first + np.arange(3 * n).reshape(-1, 3)
        share = Grid(points, cells, TRIANGLE, {"number": np.arange(3 * n)}, {"v": points[:n]})
        whole, path = gathered(comm, share), shared_tmp_path / "ranks.vtu"
        write_grid(comm, share, path)
        if whole is None or not len(whole.cells):
            continue
        read = read_grid(path)
        np.testing.assert_array_equal(read.points[:, :2], whole.points)
        np.testing.assert_array_equal(read.cells.reshape(-1, 4)[:, 1:], whole.cells)
        np.testing.assert_array_equal(read.point_data["number"], whole.at_points["number"])
        np.testing.assert_array_equal(read.cell_data["v"][:, :2], whole.in_cells["v"])
