"""Adaptive refinement: rates, marks that ranks do not change, names, two bodies, evolutions."""

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints, entities_to_geometry
from mpi4py import MPI

from contact import InputError, build_problem, load_case, parse_case, solve
from contact.mesh.domain import from_mesh
from contact.mesh.geometry import area, volume
from contact.mesh.grid import box, rectangle
from contact.mesh.transfer import refined
from contact.refining import GROWTH, grown, marked
from tests.problems.bar import changed

PLANE = {
    "contact": {
        "on": "contact",
        "foundation": {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
        "direction": "foundation",
    }
}
LINEAR = {"material__law": "linear", "material__yield_strain": None, "friction__mu": 0.6}


def bar(comm=MPI.COMM_SELF, cells=(8, 2), degree=1, **adapt):
    data = changed(mesh__cells=list(cells), space__degree=degree, **LINEAR)
    data["mesh"]["adapt"] = adapt
    solution = solve(parse_case(data), comm=comm)
    assert solution.converged, solution.outcome.reason
    return solution


@pytest.mark.core
def test_the_error_of_the_bar_falls_like_one_over_the_root_of_unknowns():
    rows = bar(error=0.008).adaptation
    unknowns, error = (np.array([row[name] for row in rows]) for name in ("unknowns", "error"))
    assert np.all(np.diff(unknowns) > 0) and error[-2] > 0.008 >= error[-1]
    decade = unknowns > unknowns[-1] / 12
    assert -np.polyfit(np.log(unknowns[decade]), np.log(error[decade]), 1)[0] > 0.47
    # Uniform meshes, here 24 cells a unit, need more than twice the unknowns for the same error.
    uniform = solve(parse_case(changed(mesh__cells=[96, 24], **LINEAR)))
    needed = np.interp(-np.log(uniform.error.relative), -np.log(error), np.log(unknowns))
    assert uniform.problem.body.layout.unknowns > 2 * np.exp(needed)


@pytest.mark.parametrize(("degree", "asked"), [(1, 0.01), (2, 2e-3)])
def test_meshes_grow_so_that_the_last_one_costs_the_most(degree, asked):
    """Of degree 2 three meshes of nearly as many unknowns followed each other at the corners."""
    data = changed(mesh__cells=[16, 4], space__degree=degree, **LINEAR)
    data["mesh"]["adapt"] = {"error": asked, "max_unknowns": 100_000}
    unknowns = np.array([row["unknowns"] for row in solve(parse_case(data)).adaptation])
    growth = unknowns[1:] / unknowns[:-1]
    assert len(unknowns) > 2 and np.all(growth > GROWTH / 2 * 0.9)
    assert unknowns.sum() < 1.75 * unknowns[-1]  # 1 + (1 + 1/4 + ...)/2 and a little


@pytest.mark.core
@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize(
    ("degree", "error"),
    [(1, 0.03), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1, 0.012), (2, 0.004)))],
)
def test_ranks_mark_the_same_cells(degree, error):
    comm = MPI.COMM_WORLD
    alone, together = (bar(part, degree=degree, error=error) for part in (MPI.COMM_SELF, comm))
    assert len(alone.adaptation) == len(together.adaptation) > 3
    for one, other in zip(alone.adaptation, together.adaptation, strict=True):
        assert one["unknowns"] == other["unknowns"]
        for name in (
            "error",
            "contact_force_x",
            "contact_force_y",
            "max_displacement",
            "max_pressure",
        ):
            assert other[name] == pytest.approx(one[name], rel=1e-8)
    places = []
    for domain in (alone.problem.domain, together.problem.domain):
        own = np.arange(domain.mesh.topology.index_map(2).size_local, dtype=np.int32)
        middles = compute_midpoints(domain.mesh, 2, own)[:, :2]
        every = np.concatenate(domain.comm.allgather(middles))
        places.append(every[np.lexsort(np.round(every, 9).T)])
    assert places[0] == pytest.approx(places[1], abs=1e-12)


@pytest.mark.parallel
def test_marks_have_the_share_of_the_sum_with_ties():
    comm = MPI.COMM_WORLD
    squares = np.array([4.0, 1.0, 2.0]) if comm.rank == 0 else np.array([1.0])
    found = marked(comm, squares, 0.4 if comm.size == 1 else 4 / (7 + comm.size - 1))
    assert found.tolist() == ([0] if comm.rank == 0 else [])
    every = marked(comm, np.full(3, 2.0) * (1 + 1e-12 * comm.rank), 0.1)
    assert every.tolist() == [0, 1, 2]


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("fraction", [0.1, 0.5, 0.97, 1.0])
def test_marks_are_the_fewest_with_the_share(fraction):
    """As one finds them who has sorted those of all ranks; the last of them has none."""
    comm = MPI.COMM_WORLD
    every = 10 ** np.random.default_rng(0).uniform(-4, 4, 100) * (np.arange(100) % 7 > 0)
    shares = max(comm.size - 1, 1)
    bounds = [100 * min(k, shares) // shares for k in (comm.rank, comm.rank + 1)]
    order = np.argsort(-every)
    count = 1 + np.searchsorted(np.cumsum(every[order]), (1 - 1e-12) * fraction * every.sum())
    expected = np.sort(order[:count])
    found = bounds[0] + marked(comm, every[slice(*bounds)], fraction)
    np.testing.assert_array_equal(np.concatenate(comm.allgather(found)), expected)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_names_are_inherited_where_some_cells_are_refined(dim):
    comm = MPI.COMM_WORLD
    make = rectangle if dim == 2 else box
    plain = make(comm, [0.0] * dim, [2.0, *[1.0] * (dim - 1)], [4, *[2] * (dim - 1)])
    regions = {"near": lambda x: x[0] <= 1 + 1e-9, "far": lambda x: x[0] >= 1 - 1e-9}
    domain = from_mesh(plain.mesh, plain.parts, regions=regions)
    fine = refined(domain, domain.cells("near")[:1])
    count = [d.mesh.topology.index_map(dim).size_global for d in (domain, fine)]
    assert count[0] < count[1] < 2**dim * count[0]
    for name in domain.parts:
        old, new = (area(d, name) for d in (domain, fine))
        assert new == pytest.approx(old, rel=1e-13)
    for name in regions:
        assert volume(fine, name) == pytest.approx(1.0, rel=1e-13)


def test_intervals_hold_the_values_of_a_much_finer_mesh():
    """The pressure at the clamped corner is infinite, and has none."""
    solution = bar(max_unknowns=3000, fraction=1)
    assert [row["unknowns"] for row in solution.adaptation] == [54, 170, 594, 2210]
    # By P2 on 16,000 adapted unknowns.
    known = {
        "contact_force_x": 1.6308e-4,
        "contact_force_y": -0.010040,
        "max_displacement": 0.0057987,
    }
    for name, value in known.items():
        low, high = solution.intervals[name]
        assert low <= value <= high and high - low < 0.2 * abs(value)
    assert solution.intervals["max_pressure"] is None
    assert bar(max_unknowns=600).intervals is None


def test_uniform_meshes_cut_each_edge_in_two():
    """Also where a cell has no error, and where twice as fine a mesh again would reach the goal."""
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [1.0, 1.0], [4, 4])
    squares = np.ones(32)
    squares[:7] = 0.0
    finer = grown(domain, squares, 1.0, goal=0.1, room=100.0, degree=1)
    assert finer.mesh.topology.index_map(2).size_global == 128


def test_the_steps_of_an_evolution_have_one_mesh():
    """The load moves from one end to the other: both are refined."""
    data = changed(mesh__cells=[16, 4], **LINEAR)
    data["fixed"] = [{"on": "top", "displacement": ["0.002*t", -0.002]}]
    data["load"] = []
    data["evolution"] = {"times": [0.0, 1.0, 2.0], "steps": [1, 1]}
    data["mesh"]["adapt"] = {"max_unknowns": 600}
    solution = solve(parse_case(data))
    assert solution.converged and len(solution.steps) == 2
    assert [row["unknowns"] for row in solution.adaptation][-1] > 300


@pytest.mark.parametrize("name", ["indent-cone", "two-blocks"])
def test_revolution_and_two_bodies(name):
    path = f"scripts/cases/{name}.toml"
    first = solve(load_case(path))
    unknowns = first.problem.body.layout.unknowns
    limit = [f"mesh.adapt.max_unknowns={3 * unknowns}"]
    solution = solve(load_case(path, limit))
    assert solution.converged and len(solution.adaptation) > 1
    assert solution.error.relative < 0.8 * first.error.relative
    assert solution.contact_force == pytest.approx(first.contact_force, rel=0.05, abs=1e-4)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("generator", "off"), [("quarter_disc", 1e-12), ("sphere", 3e-5)])
def test_new_nodes_of_curved_boundaries_follow_the_curve(generator, off):
    """The chords of the first mesh are 5e-3 and 7e-3 off."""
    comm = MPI.COMM_WORLD
    mesh = {"generator": generator, "radius": 1.0, "size": 0.4, "contact_size": 0.2}
    case = parse_case({"mesh": mesh, "material": {"young": 1.0, "poisson": 0.3}, **PLANE})
    domain = case.mesh.build(comm)
    cells = [domain.mesh.topology.index_map(domain.dim).size_global]
    for _ in range(2):
        owned = domain.mesh.topology.index_map(domain.dim).size_local
        domain = refined(domain, np.arange(0, owned, 2, dtype=np.int32))
        cells.append(domain.mesh.topology.index_map(domain.dim).size_global)
    assert cells[2] > 2 * cells[1] > 4 * cells[0]
    facets = domain.parts["contact"]
    if facets.size > 0:  # dolfinx divides by their number
        nodes = np.unique(entities_to_geometry(domain.mesh, domain.dim - 1, facets))
        x = domain.mesh.geometry.x[nodes] - np.eye(3)[domain.dim - 1]
        radii = np.linalg.norm(x[:, : domain.dim], axis=1)
        assert np.abs(radii - 1).max() < off


def test_a_first_mesh_that_sees_nothing_does_not_reach_the_goal():
    """A circle between two nodes touches none of them, and all estimates are 0."""
    case = changed(mesh__cells=[6, 3], **LINEAR)
    case["load"] = []
    case["fixed"] = [{"on": "left", "displacement": [0.0, 0.0]}]
    circle = {"shape": "sphere", "centre": [1.0, -0.0997], "radius": 0.1}
    case["contact"] = {"on": "bottom", "foundation": circle, "overlap": "press"}
    case["mesh"]["adapt"] = {"error": 0.2}
    solution = solve(parse_case(case))
    assert solution.adaptation[0]["error"] == 0
    assert len(solution.adaptation) > 1
    assert solution.adaptation[-1]["contact_force_y"] != 0


@pytest.mark.parametrize("mesh", [{"order": 2}, {"cell": "quadrilateral"}])
def test_cells_that_cannot_be_refined_alone_are_refused_before_the_first_solve(mesh):
    table, on = {"generator": "quarter_disc", "radius": 1.0, "size": 0.5}, "contact"
    if "cell" in mesh:
        table, on = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [2, 2]}, "bottom"
    case = {"mesh": {**table, **mesh, "adapt": {}}, "material": {"young": 1.0, "poisson": 0.3}}
    with pytest.raises(InputError, match=r"mesh.adapt.*\[refine\]"):
        build_problem(parse_case({**case, "contact": {"on": on}}))


@pytest.mark.parallel
@pytest.mark.parametrize("goal", [{}, {"error": 1e-3}])
@pytest.mark.parametrize(
    ("key", "value"),
    [
        # Numbers at the nodes of the first mesh, and none at one of a finer mesh.
        ("contact__gap", "1e-3 * sqrt(abs(x - 1.125) - 0.02)"),
        ("friction__mu", "0.2 * sqrt(abs(x - 2.25) - 0.05)"),
    ],
)
def test_a_finer_mesh_that_is_refused_leaves_the_solution_before(key, value, goal):
    """A finer mesh was said to overlap, and the solution on the first one was lost."""
    case = changed(mesh__cells=[8, 2], **(LINEAR | {key: value}))
    first = solve(parse_case(case), comm=MPI.COMM_WORLD)
    case["mesh"]["adapt"] = {"fraction": 1.0, "max_unknowns": 5000, **goal}
    solution = solve(parse_case(case), comm=MPI.COMM_WORLD)
    assert solution.converged
    pressed = first.problem.nodes.maximum(first.pressure)
    assert solution.adaptation[0]["max_pressure"] == pytest.approx(pressed, rel=1e-8)
    (said,) = [text for text in solution.warnings if text.endswith("[adapt]")]
    assert "the next mesh is refused, " in said and "[not-finite]" in said
    assert ("mesh.adapt.error = 0.001" in said) == bool(goal)
