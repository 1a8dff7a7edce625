"""The files of fields, and the checkpoint, read back."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, build_problem, solve, write_outputs
from contact.case.file import with_number
from contact.history import BodyState
from contact.io.checkpoint import read_checkpoint
from contact.problem.residuals import evaluate
from contact.results.fields import DerivedFields
from contact.results.options import OutputOptions
from tests.problems.written import block, electric, written


@pytest.mark.core
def test_fields_can_be_read_back(shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """fields.bp holds all fields at the nodes, with the values of the solution."""
    # Debian's adios2 takes its serial library in a run without mpirun, which will not do.
    monkeypatch.setenv("ADIOS2_ALWAYS_USE_MPI", "1")
    adios2 = pytest.importorskip("adios2")
    solution = solve(block(2))
    solution.output = OutputOptions(fields="vtx")
    written(solution, shared_tmp_path)
    with adios2.FileReader(str(shared_tmp_path / "fields.bp"), MPI.COMM_SELF) as file:
        names = set(file.available_variables())
        u = file.read("displacement")
    assert {"displacement", "stress", "von_mises", "dev_strain"} <= names
    largest = np.linalg.norm(u, axis=1).max()
    x = solution.state.x.reshape(-1, 2)
    assert largest == pytest.approx(np.linalg.norm(x, axis=1).max(), rel=1e-12)


@pytest.mark.core
@pytest.mark.parallel
def test_xdmf(shared_tmp_path: Path) -> None:
    """Without VTX the fields go to XDMF, for P2 interpolated to P1."""
    solution = solve(block(2, 2))
    solution.output = OutputOptions(fields="xdmf")
    written(solution, shared_tmp_path)
    text = (shared_tmp_path / "fields.xdmf").read_text()
    assert all(name in text for name in ("displacement", "stress", "von_mises", "dev_strain"))
    assert sorted(path.name for path in shared_tmp_path.iterdir()) == [
        "contact.csv",
        "contact.vtu",
        "fields.h5",
        "fields.xdmf",
        "history.csv",
        "summary.json",
    ]


@pytest.mark.parametrize("format_", ["xdmf", "vtx"])
def test_a_failed_write_leaves_the_earlier_results(
    format_: str, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of a run take their places when all of them are complete."""
    from dolfinx import io

    def fail(*_: Any, **__: Any) -> None:
        raise OSError("no space left on device")

    solution = solve(block(2))
    written(solution, shared_tmp_path)
    solution.output = OutputOptions(fields=format_)
    monkeypatch.setattr(io.XDMFFile, "write_function", fail)
    monkeypatch.setattr(io, "VTXWriter", fail)
    before = json.loads((shared_tmp_path / "summary.json").read_text())
    with pytest.raises(OSError, match="no space"):
        write_outputs(solution, shared_tmp_path)
    assert sorted(path.name for path in shared_tmp_path.iterdir()) == before["files"]
    assert json.loads((shared_tmp_path / "summary.json").read_text()) == before


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_derived_fields_of_a_known_strain(degree: int) -> None:
    """Homogeneous compression: the stress is (1.13), in the cells and at the nodes."""
    problem = build_problem(block(2, degree))
    points = problem.body.space.tabulate_dof_coordinates()
    x = problem.body.zero_displacement()
    x[1::2] = -0.05 * points[:, 1]
    fields = DerivedFields(problem.body, BodyState(x))
    law, t = problem.description.law, 0.05 * np.sqrt(2 / 3)
    g = float(law.secant_modulus(t**2))
    across = -0.05 * (law.bulk - 2 * g / 3)
    stress = np.diag([across, across - 0.1 * g, across]).ravel()
    for made in (fields.cells(), fields.nodes()):
        np.testing.assert_allclose(made["stress"].x.array.reshape(-1, 9) - stress, 0, atol=1e-12)
        np.testing.assert_allclose(made["von_mises"].x.array, 0.1 * g, rtol=1e-10)
        np.testing.assert_allclose(made["dev_strain"].x.array, t, rtol=1e-10)
    assert max(e.strain for e in fields.extremes()) == pytest.approx(t, rel=1e-12)


@pytest.mark.core
@pytest.mark.parametrize(
    "kind", [pytest.param("P1", marks=pytest.mark.parallel), "P2", "piezoelectric"]
)
def test_checkpoint(kind: str, shared_tmp_path: Path) -> None:
    """A problem that is restored from it is solved already, on any number of ranks."""
    case = electric(2) if kind == "piezoelectric" else block(2, int(kind[1]))
    solution = solve(case)
    solution.output = OutputOptions(checkpoint=True)
    written(solution, shared_tmp_path)
    path = shared_tmp_path / "checkpoint.npz"
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        problem = build_problem(case, comm)
        assert evaluate(problem, read_checkpoint(path, problem)).largest <= 1e-8
        MPI.COMM_WORLD.barrier()
        if kind == "piezoelectric":  # potentials are those of the file, whatever their unit
            stiffer = build_problem(with_number(case, "material.young", 4 * problem.scales.young))
            assert stiffer.body.phi_scale == pytest.approx(2 * problem.body.phi_scale)
            one, two = (read_checkpoint(path, p).x for p in (problem, stiffer))
            size = problem.body.block_size
            np.testing.assert_allclose(2 * two[size - 1 :: size], one[size - 1 :: size])
            np.testing.assert_allclose(two[::size], one[::size])
    other = build_problem(block(2, fixed=[{"on": "left", "displacement": [0.0, 0.0]}]))
    with pytest.raises(InputError, match=r"\[other-checkpoint\]"):
        read_checkpoint(path, other)
    for damaged in (b"", b"no archive"):
        MPI.COMM_WORLD.barrier()
        if MPI.COMM_WORLD.rank == 0:
            path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"\[no-checkpoint\]"):
            read_checkpoint(path, problem if MPI.COMM_WORLD.size == 1 else build_problem(case))
