"""Whatever a field is given as, it is the same field: numbers, functions, UFL, Functions."""

from typing import Any

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import (
    Body,
    Bolt,
    Contact,
    Domain,
    Fixed,
    Friction,
    InputError,
    Linear,
    Load,
    Problem,
    SlipCoefficient,
    solve,
)
from contact.model.fields import field

pytestmark = pytest.mark.parallel(2)


def square() -> tuple[dmesh.Mesh, dmesh.MeshTags]:
    mesh = dmesh.create_rectangle(MPI.COMM_WORLD, [[0, 0], [2, 1]], [8, 4])
    sides = [lambda x: np.isclose(x[1], 0), lambda x: np.isclose(x[1], 1)]
    found = [dmesh.locate_entities_boundary(mesh, 1, side) for side in sides]
    facets = np.concatenate(found)
    values = np.repeat(np.array([3, 7], dtype=np.int32), [f.size for f in found])
    order = np.argsort(facets)
    return mesh, dmesh.meshtags(mesh, 1, facets[order], values[order])


def forms_of_one_field(mesh: dmesh.Mesh) -> dict[str, Any]:
    """Return 0.3 - 0.1 x in all ways that Python offers."""
    x = ufl.SpatialCoordinate(mesh)
    function = fem.Function(fem.functionspace(mesh, ("Lagrange", 1)))
    function.interpolate(lambda x: 0.3 - 0.1 * x[0])
    return {
        "arithmetic": lambda x: 0.3 - 0.1 * x[0],
        "NumPy": lambda x: np.add(0.3, np.multiply(-0.1, x[0])),
        "a formula": "0.3 - 0.1*x",
        "UFL": 0.3 - 0.1 * x[0],
        "Function": function,
        "of Functions": 2 * function - 0.3 + 0.1 * x[0],
    }


WAYS = list(forms_of_one_field(square()[0]))


@pytest.mark.parametrize("way", WAYS)
def test_values_and_forms(way: str) -> None:
    mesh, _ = square()
    given = field(forms_of_one_field(mesh)[way])
    inside = mesh.geometry.x[:, :2]
    np.testing.assert_allclose(given.numpy(inside), 0.3 - 0.1 * inside[:, 0], atol=1e-12)
    form = fem.form(given.ufl(ufl.SpatialCoordinate(mesh)) * ufl.ds(domain=mesh))
    integral = mesh.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)
    assert integral == pytest.approx(2 * (0.3 * 2 - 0.1 * 2) + 0.3 + 0.1, rel=1e-12)


@pytest.mark.parallel
def test_tags_name_parts_inside_of_the_body() -> None:
    """A bolt that is cut in the middle, with tags of facets and cells."""
    mesh = dmesh.create_unit_square(MPI.COMM_WORLD, 4, 4)
    chosen = {3: (1, 0.0), 7: (1, 1.0), 5: (1, 0.5), 9: (0, 0.0)}
    facets = {
        tag: dmesh.locate_entities(mesh, 1, lambda x, i=i, at=at: np.isclose(x[i], at))
        for tag, (i, at) in chosen.items()
    }
    indices = np.concatenate([*facets.values()])
    values = np.repeat([*facets], [len(found) for found in facets.values()]).astype(np.int32)
    order = np.argsort(indices)
    tags = dmesh.meshtags(mesh, 1, indices[order], values[order])
    every = np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
    cells = dmesh.meshtags(mesh, 2, every, np.full(every.size, 2, dtype=np.int32))
    domain = Domain.from_mesh(
        mesh, tags, {"low": 3, "top": 7, "left": 9}, cells, {"all": 2}, inside={"cut": 5}
    )
    assert [*domain.inside] == ["cut"] and [*domain.regions] == ["all"]
    body = Body(
        Linear(10.0, 0.0),
        [Fixed(side, [0.0, 0.0]) for side in ("low", "top")],
        bolts=[Bolt("cut", shortening=0.01)],
    )
    solution = solve(Problem(domain, body, Contact("left", 1.0)))
    assert solution.movements["bolts"]["cut"]["force"] == pytest.approx(0.1, rel=1e-8)


def problem(mesh: dmesh.Mesh, tags: dmesh.MeshTags, given: Any) -> Problem:
    """Return a block with the field everywhere: pressure, displacement, gap and friction."""
    domain = Domain.from_mesh(mesh, tags, {"bottom": 3, "top": 7})
    body = Body(
        Linear(10.0, 0.3),
        [Fixed("top", [given, "free"])],
        [Load("top", pressure=given), Load(body_force=[given, 0.0])],
    )
    return Problem(domain, body, Contact("bottom", given), Friction(mu=given))


def test_a_problem_without_a_case_file() -> None:
    """Numbers agree whichever way the fields are given, friction and gap included."""
    mesh, tags = square()
    ways = forms_of_one_field(mesh)
    first = solve(problem(mesh, tags, ways.pop(WAYS[0])))
    assert first.converged
    for way, given in ways.items():
        other = solve(problem(mesh, tags, given))
        assert other.converged, way
        np.testing.assert_allclose(other.contact_force, first.contact_force, rtol=1e-8, err_msg=way)
        np.testing.assert_allclose(other.state.x, first.state.x, atol=1e-9, err_msg=way)


def test_vectors() -> None:
    mesh, _ = square()
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (2,))))
    u.interpolate(lambda x: np.array([x[0], 2 * x[1]]))
    points = mesh.geometry.x[:, :2]
    for given in (u, ufl.as_vector([ufl.SpatialCoordinate(mesh)[0], 2 * u[1] / 2])):
        x, y = Load("top", traction=given).traction
        np.testing.assert_allclose(x.numpy(points), points[:, 0], atol=1e-12)
        np.testing.assert_allclose(y.numpy(points), 2 * points[:, 1], atol=1e-12)
    assert Fixed("top", ["free", None], 0.0).displacement == ("free", "free")
    for given in (["free", 1.0], [None, 1.0]):
        with pytest.raises(InputError, match=r"\[formula\]"):
            Load("top", traction=given)


def test_a_function_of_another_mesh() -> None:
    elsewhere = dmesh.create_rectangle(MPI.COMM_SELF, [[5, 5], [6, 6]], [1, 1])
    function = fem.Function(fem.functionspace(elsewhere, ("Lagrange", 1)))
    with pytest.raises(InputError, match=r"\[field\]"):
        field(function).numpy(np.zeros((1, 2)))


def test_a_coefficient_that_depends_on_the_slip_is_a_coefficient() -> None:
    weaker = SlipCoefficient(0.3, 0.2, 10.0)
    assert Friction(mu=weaker) == Friction(weaker)
