"""Nodal stresses are averaged in each region alone; regions, strains and principal stresses."""

import json

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from mpi4py import MPI

from contact import build_problem, load_case, parse_case, solve, write_outputs
from contact.io.fields import body_share, gathered, regions_of
from contact.plot.run import read_grid
from contact.results.fields import DerivedFields
from forms.kinematics import principal_values
from scripts.cases import CASES
from tests.forms.test_piezo import numbers

COMM = MPI.COMM_WORLD


def coated(degree=1, layer="layer"):
    """Return a block whose upper half is 25 times as stiff, stretched along x: uniaxial strain."""
    return {
        "mesh": {"file": layer} if layer.endswith(".msh") else MESH,
        "space": {"degree": degree},
        "material": [
            {"on": "lower", "young": 10.0, "poisson": 0.0},
            {"on": "upper", "young": 250.0, "poisson": 0.0},
        ],
        "fixed": [
            {"on": "left", "displacement": [0.0, "free"]},
            {"on": "right", "displacement": [0.01, "free"]},
        ],
        "contact": {"on": "bottom"},
    }


def domain(comm=COMM):
    from contact.mesh.domain import from_mesh
    from contact.mesh.grid import rectangle

    made = rectangle(comm, (0.0, 0.0), (2.0, 1.0), (6, 4))
    halves = {
        "lower": lambda x: x[1] <= 0.5 + 1e-12,
        "upper": lambda x: x[1] >= 0.5 - 1e-12,
    }
    return from_mesh(made.mesh, made.parts, regions=halves)


MESH = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [6, 4]}


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_averages_stay_inside_a_region(degree):
    """sigma_xx = E 0.005 in each half, at the interface too; u_x is the same on both sides."""
    solution = solve(parse_case(coated(degree)), domain=domain(), comm=COMM)
    problem = solution.problem
    grid = gathered(COMM, body_share(problem, solution.state))
    if COMM.rank > 0:
        return
    stress = grid.at_points["stress"][:, 0]
    young = np.where(grid.at_points["stress"][:, 0] > 0.5, 250.0, 10.0)
    assert np.allclose(stress, 0.005 * young, rtol=1e-9)
    at_interface = np.isclose(grid.points[:, 1], 0.5)
    assert np.count_nonzero(at_interface) == 2 * (6 * degree + 1)
    for side in (10.0, 250.0):
        assert np.count_nonzero(at_interface & (young == side)) == 6 * degree + 1
    # Each cell has the points of its own half.
    middle = grid.points[grid.cells].mean(axis=1)[:, 1]
    own = young[grid.cells]
    assert (own == np.where(middle > 0.5, 250.0, 10.0)[:, None]).all()
    assert np.allclose(grid.at_points["displacement"][:, 0], 0.005 * grid.points[:, 0])
    nodes = (6 * degree + 1) * (4 * degree + 1)
    assert len(grid.points) == nodes + 6 * degree + 1


@pytest.mark.parallel
def test_one_region_has_a_point_a_node():
    case = load_case(CASES / "bar.toml", ["mesh.cells=[8, 4]"])
    solution = solve(case, comm=COMM)
    derived = DerivedFields(solution.problem.body, solution.state)
    assert derived.group_count == 1 and (derived.groups == 0).all()
    grid = gathered(COMM, body_share(solution.problem, solution.state))
    if COMM.rank == 0:
        assert len(grid.points) == 9 * 5
        assert np.isfinite(grid.at_points["stress"]).all()


@pytest.mark.parallel
def test_functions_at_the_nodes_are_discontinuous_between_regions_alone():
    solution = solve(parse_case(coated()), domain=domain(), comm=COMM)
    fields = DerivedFields(solution.problem.body, solution.state)
    found = fields.nodes()["stress"].x.array.reshape(-1, 9)[:, 0]
    assert {*np.round(found, 8).tolist()} <= {0.05, 1.25}


def test_the_region_is_a_field_of_the_cells(tmp_path):
    solution = solve(load_case(CASES / "two-blocks.toml"))
    write_outputs(solution, tmp_path / "out")
    grid = read_grid(tmp_path / "out" / "fields.vtu")
    names = sorted(solution.problem.domain.regions)
    region = grid.cell_data["region"]
    assert {*region.tolist()} == {*range(len(names))}
    middle = grid.cell_centers().points[:, 1]
    assert middle[region == names.index("upper")].min() > middle[region == 0].max()
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["regions"] == names
    assert (regions_of(solution.problem) == region).all()


@pytest.mark.parallel
def test_the_smallest_of_several_regions_is_the_one_of_a_cell():
    """A region in another one wins over it, whatever their names are; the rest is the other's."""
    overrides = ["mesh.cells=[8, 4]", 'mesh.regions={"tip" = "(x > 1.5) * (y > 0.5)"}']
    problem = build_problem(load_case(CASES / "bar.toml", overrides), COMM)
    names = sorted(problem.domain.regions)
    assert names == ["body", "tip"]
    owned = np.arange(len(regions_of(problem)), dtype=np.int32)
    middles = compute_midpoints(problem.domain.mesh, 2, owned).reshape(-1, 3)
    inside = (middles[:, 0] > 1.5) & (middles[:, 1] > 0.5)
    assert (regions_of(problem) == np.where(inside, 1, 0)).all()


@pytest.mark.core
def test_strains_and_principal_stresses():
    solution = solve(load_case(CASES / "hertz-small.toml"))
    fields = DerivedFields(solution.problem.body, solution.state)
    found, averaged = fields.cells(), fields.nodes()
    nodal = averaged["stress"].x.array.reshape(-1, 3, 3)
    known = np.linalg.eigvalsh(nodal)[:, ::-1].ravel()
    apart = averaged["principal_stress"].x.array - known
    assert np.abs(apart).max() <= 1e-12 * np.abs(known).max()
    dev = nodal - np.trace(nodal, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    of_average = np.sqrt(1.5 * np.sum(dev**2, axis=(1, 2)))
    assert (averaged["von_mises"].x.array >= of_average * (1 - 1e-12)).all()
    stress, strain = (found[k].x.array.reshape(-1, 3, 3) for k in ("stress", "strain"))
    principal = found["principal_stress"].x.array.reshape(-1, 3)
    known = np.linalg.eigvalsh(stress)[:, ::-1]
    assert np.allclose(principal, known, rtol=0, atol=1e-7 * np.abs(known).max())
    law = solution.problem.description.law
    trace = np.einsum("cii->c", strain)[:, None, None] * np.eye(3)
    hooke = (law.bulk - 2 * law.shear / 3) * trace + 2 * law.shear * strain
    assert np.allclose(hooke, stress, rtol=0, atol=1e-9 * np.abs(stress).max())


@pytest.mark.core
@pytest.mark.parametrize("values", [(3.0, 1.0, -2.0), (2.0, 2.0, -1.0), (0.0, 0.0, 0.0), (5,) * 3])
def test_eigenvalues_of_known_tensors(values):
    import ufl

    q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    tensor = q @ np.diag(values) @ q.T
    found = numbers(principal_values(ufl.as_tensor(tensor.tolist())), (3,))
    assert np.allclose(found, sorted(values, reverse=True), atol=2e-8 * max(map(abs, values)))
