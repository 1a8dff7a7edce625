"""Pairs of bodies that are refused, and what is said of the others."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    InputError,
    Linear,
    Problem,
    build_problem,
    parse_case,
    solve,
)
from contact.cli.check import expectations
from contact.mesh.domain import from_mesh
from tests.problems.meshes import midpoints
from tests.problems.overlapping import boxes
from tests.problems.pairs import case

COMM = MPI.COMM_WORLD


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"contact": {"on": "upper_bottom", "against": "upper_left"}},
            r"contact\.against.*\[pair\]",
        ),
        (
            {"contact": {"on": "upper_bottom", "against": "upper_top"}},
            r"\[pair\]",
        ),
        (
            {"contact": {"on": "upper_top", "against": "lower_top"}, "load": []},
            r"contact\.against.*\[pair\]",
        ),
        (
            {
                "contact": [
                    {"on": "upper_bottom", "against": "lower_top"},
                    {"on": "lower_top", "against": "upper_bottom"},
                ]
            },
            r"\[contact-cycle\]",
        ),
        (
            {
                "fixed": [
                    {"on": "lower_bottom", "displacement": [0.0, 0.0]},
                    {"on": "upper_bottom", "displacement": [0.0, "free"]},
                ]
            },
            r"\[held-side\]",
        ),
    ],
)
def test_what_is_refused(more, message):
    with pytest.raises(InputError, match=message):
        build_problem(parse_case(case(**more)))


def test_bodies_that_may_pass_through_each_other_are_named():
    """Only the upper block can touch a foundation: nothing keeps it off the lower one."""
    foundation = {"shape": "plane", "point": [0.0, -0.05], "normal": [0.0, 1.0]}
    contact = {"on": "upper_bottom", "foundation": foundation}
    solution = solve(parse_case(case(contact=contact)))
    assert solution.converged
    assert any("2 of them can pass through the others" in w for w in solution.warnings)
    checked = "\n".join(expectations(solution.problem))
    assert (
        "# warning: the mesh has 2 connected components" in checked
        and "2 of them can pass through" in checked
    )
    apart = solve(parse_case(case()))
    assert not any("pass through" in w for w in (*apart.warnings, *expectations(apart.problem)))


@pytest.mark.parallel
@pytest.mark.parametrize("along", ["free", 0.0])
def test_supports_of_the_first_along_its_surface(along):
    """Its rim is constrained along z; on its facets only y may be, as that of the second is."""
    mesh = boxes(COMM, "hexahedron", 1, [[1, 4, 1], [2, 2, 2]])
    facets, middle, *_ = midpoints(mesh)
    (x, y, z), first = middle[:, :3].T, middle[:, 0] < 1.5
    rim = first & (np.minimum(z, 1 - z) < 1e-9) & (y < 0.5)
    places = {"end": x < 1e-9, "on": first & (x > 1 - 1e-9), "rim": rim, "base": x > 3 - 1e-9}
    places["against"] = ~first & (x < 2 + 1e-9)
    mesh.geometry.x[mesh.geometry.x[:, 0] > 1.5, 0] -= 1
    domain = from_mesh(mesh, {name: facets[there] for name, there in places.items()}, 2.0)
    supports = [
        Fixed("end", [1e-3, "free", "free"]), Fixed("base", [0.0, 0.0, 0.0]),
        Fixed("rim", ["free", "free", 0.0]), Fixed("on", ["free", 0.0, along]),
        Fixed("against", ["free", 0.0, "free"]),
    ]  # fmt: skip
    given = Body(Linear(1.0, 0.3), supports), Contact("on", against="against"), Friction(mu=0.3)
    if along == "free":
        assert COMM.allreduce(Problem(domain, *given).nodes.weight.size) >= 4
    else:
        with pytest.raises(InputError, match=r"\[held-side\]"):
            Problem(domain, *given)
