"""Contact problems in local variables, and their files."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.linear.operator import Counters
from contact.methods.convex import fclib
from contact.methods.convex.local import LocalProblem, on_cones
from contact.methods.exchange import local_problem
from contact.problem.condensed import Condensation
from contact.solving import solve
from tests.methods.test_sure import TIP, beam

SELF = MPI.COMM_SELF


def random_problem(k: int, d: int, mu: float, seed: int) -> LocalProblem:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((k * d, k * d))
    q = rng.standard_normal(k * d)
    return LocalProblem(root @ root.T + 0.1 * np.eye(k * d), q, np.full(k, mu))


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(3))
def test_random_contacts_meet_the_law_of_fclib(d, mu, seed):
    """Conditions of FCLIB written out: both cones, orthogonality, u = W r + q."""
    problem = random_problem(8, d, mu, seed)
    found = problem.solve(1e-10)
    assert found.converged, found.message
    u, r = found.jump, found.force
    raised = u[:, 0] + mu * np.linalg.norm(u[:, 1:], axis=1)
    size = np.abs(r).max() * np.abs(u).max()
    assert np.allclose(u.ravel(), problem.flexibility @ r.ravel() + problem.free, atol=1e-8)
    assert np.all(np.linalg.norm(r[:, 1:], axis=1) <= mu * r[:, 0] + 1e-8 * np.abs(r).max())
    assert np.all(raised >= mu * np.linalg.norm(u[:, 1:], axis=1) - 1e-8 * np.abs(u).max())
    work = raised * r[:, 0] + np.sum(u[:, 1:] * r[:, 1:], axis=1)
    assert np.abs(work).max() <= 1e-7 * size
    assert np.any(r[:, 0] > 0) and np.any(r[:, 0] == 0)
    assert problem.residual(u, r) < 1e-7
    assert problem.residual(u, 1.01 * r) > 1e-3
    disturbed = u.copy()
    disturbed[:, 0] += 0.1 * np.abs(u).max()
    assert problem.residual(disturbed, r) > 1e-3


def test_projection_onto_cones():
    """Inside, in the polar cone, and between both, by hand for mu = 1."""
    vectors = np.array([[2.0, 1.0], [-2.0, 1.0], [0.0, 2.0], [0.0, -2.0]])
    expected = np.array([[2.0, 1.0], [0.0, 0.0], [1.0, 1.0], [1.0, -1.0]])
    assert np.allclose(on_cones(vectors, np.ones(4)), expected)


def condensed(case: dict):
    problem = build_problem(parse_case(case), comm=SELF)
    small = Condensation(problem, Counters()).linearise("secant", problem.start())
    assert small is not None
    return small


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_cantilever_in_local_variables_has_the_same_forces(mu):
    case = beam(20.0, [40, 2], {"on": "right", "traction": [0.0, -1e-3]}, 0.5, mu)
    problem = local_problem(condensed(case))
    assert problem.coefficient.size == 40  # of 41 nodes one is clamped
    found = problem.solve()
    assert found.converged, found.message
    solution = solve(parse_case(case), comm=SELF)
    pressed, rubbed = np.abs(solution.contact_force[::-1])
    assert found.force[:, 0].sum() == pytest.approx(pressed, rel=1e-7)
    assert abs(found.force[:, 1].sum()) == pytest.approx(rubbed, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"friction": {"law": "tresca", "bound": 1e-3}}, "constant mu"),
        ({"fixed": [{"on": "left", "displacement": [0.0, "free"]}]}, "cannot slip"),
        ({"fixed": [{"on": "top", "displacement": [0.0, "free"]}]}, "contact alone holds"),
    ],
)
def test_what_has_no_place_in_local_variables_is_refused(change, words):
    case = {**beam(4.0, [8, 2], TIP, 0.5, 0.3), **change}
    with pytest.raises(InputError, match=words):
        local_problem(condensed(case))


def test_a_singular_flexibility_is_refused():
    problem = LocalProblem(np.diag([1.0, 0.0]), np.array([-1.0, 0.0]), np.array([0.3]))
    with pytest.raises(InputError, match="singular"):
        problem.solve()


def test_without_h5py_it_says_what_to_install(tmp_path, monkeypatch):
    def missing(name: str):
        raise ImportError(name)

    monkeypatch.setattr(fclib, "import_module", missing)
    with pytest.raises(InputError, match="python3-h5py"):
        fclib.read_fclib(tmp_path / "a.hdf5")


@pytest.mark.parametrize("storage", ["columns", "rows", "triplets"])
def test_a_file_of_fclib_is_read_in_all_its_storages(tmp_path, storage):
    """Written by hand as FCLIB's C code does, not by what reads it here."""
    h5py = pytest.importorskip("h5py")
    matrix = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.25], [0.0, 0.25, 3.0]])
    rows, columns = np.nonzero(matrix)
    by_column = np.lexsort((rows, columns))
    nz, p, i = {
        "columns": (-1, [0, 2, 5, 7], rows[by_column]),
        "rows": (-2, [0, 2, 5, 7], columns),
        "triplets": (7, rows, columns),
    }[storage]
    x = matrix[rows, columns]  # symmetric: the same by columns
    path = tmp_path / "hand.hdf5"
    with h5py.File(path, "w") as file:
        for name, value in {"m": 3, "n": 3, "nzmax": 7, "nz": nz}.items():
            file[f"fclib_local/W/{name}"] = np.array([value], dtype=np.int32)
        for name, values in {"p": p, "i": i}.items():
            file[f"fclib_local/W/{name}"] = np.asarray(values, dtype=np.int32)
        file["fclib_local/W/x"] = x
        file["fclib_local/vectors/q"] = [-1.0, 0.5, 0.2]
        file["fclib_local/vectors/mu"] = [0.3]
        file["fclib_local/spacedim"] = np.array([3], dtype=np.int32)
    problem = fclib.read_fclib(path)
    assert np.array_equal(problem.flexibility, matrix)
    assert problem.dim == 3 and problem.coefficient == [0.3]
    found = problem.solve()
    assert problem.residual(found.jump, found.force) < 1e-8


def test_what_is_written_is_read_again(tmp_path):
    h5py = pytest.importorskip("h5py")
    problem = random_problem(4, 3, 0.4, 5)
    path = tmp_path / "random.hdf5"
    solution = problem.solve()
    fclib.write_fclib(path, problem, "random", solution)
    again = fclib.read_fclib(path)
    assert np.array_equal(again.flexibility, problem.flexibility)
    assert np.array_equal(again.free, problem.free)
    assert np.array_equal(again.coefficient, problem.coefficient)
    with h5py.File(path) as file:
        assert np.array_equal(file["solution/r"][()], solution.force.ravel())
    with h5py.File(path, "r+") as file:
        del file["fclib_local/vectors/q"]
        file["fclib_local/vectors/q"] = np.zeros(5)
    with pytest.raises(InputError, match="sizes that fit"):
        fclib.read_fclib(path)
