"""Adaptive refinement: rates, marks that ranks do not change, names, two bodies, evolutions."""

import csv
import json

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, load_case, parse_case, solve, write_outputs
from contact.adapting import marked
from contact.mesh.domain import from_mesh
from contact.mesh.grid import box, rectangle
from contact.mesh.transfer import refined
from tests.problems.bar import changed

LINEAR = {"material__law": "linear", "material__yield_strain": None, "friction__mu": 0.6}


def bar(comm=MPI.COMM_SELF, cells=(8, 2), **adapt):
    data = changed(mesh__cells=list(cells), **LINEAR)
    data["mesh"]["adapt"] = adapt
    solution = solve(parse_case(data), comm=comm)
    assert solution.converged, solution.outcome.reason
    return solution


def test_the_error_of_the_bar_falls_like_one_over_the_root_of_unknowns():
    rows = bar(error=0.03).adaptation
    unknowns, error = (np.array([row[name] for row in rows]) for name in ("unknowns", "error"))
    assert np.all(np.diff(unknowns) > 0) and error[-2] > 0.03 >= error[-1]
    rate = np.log(error[-4] / error[-1]) / np.log(unknowns[-1] / unknowns[-4])
    assert rate > 0.45
    # Uniform meshes of as many unknowns: 0.05 on 16 cells a unit, 2210 unknowns.
    uniform = solve(parse_case(changed(mesh__cells=[64, 16], **LINEAR)))
    assert uniform.error.relative > 1.5 * error[-1]
    assert uniform.problem.equilibrium.layout.unknowns > unknowns[-1]


@pytest.mark.parallel
def test_ranks_mark_the_same_cells():
    alone, together = (bar(comm, error=0.05).adaptation for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert len(alone) == len(together) > 3
    for one, other in zip(alone, together, strict=True):
        assert one["unknowns"] == other["unknowns"]
        for name in ("error", "contact_force_y", "max_displacement", "max_pressure"):
            assert other[name] == pytest.approx(one[name], rel=1e-8)


@pytest.mark.parallel
def test_marks_have_the_share_of_the_sum_with_ties():
    comm = MPI.COMM_WORLD
    squares = np.array([4.0, 1.0, 2.0]) if comm.rank == 0 else np.array([1.0])
    found = marked(comm, squares, 0.4 if comm.size == 1 else 4 / (7 + comm.size - 1))
    assert found.tolist() == ([0] if comm.rank == 0 else [])
    every = marked(comm, np.full(3, 2.0) * (1 + 1e-12 * comm.rank), 0.1)
    assert every.tolist() == [0, 1, 2]


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
        old, new = (d.volume(d.ds(name)) for d in (domain, fine))
        assert new == pytest.approx(old, rel=1e-13)
    for name in regions:
        assert fine.volume(fine.dx_in(name)) == pytest.approx(1.0, rel=1e-13)


def test_the_files_have_the_history(tmp_path):
    solution = bar(max_unknowns=300)
    write_outputs(solution, tmp_path)
    rows = list(csv.DictReader((tmp_path / "adapt.csv").open()))
    assert [int(row["unknowns"]) for row in rows] == [r["unknowns"] for r in solution.adaptation]
    assert len(rows) > 1 and int(rows[-1]["unknowns"]) <= 300
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert float(rows[-1]["error"]) == pytest.approx(summary["error"]["energy"])
    assert float(rows[-1]["contact_force_y"]) == pytest.approx(summary["contact_force"][1])
    assert "[mesh.adapt]" in summary["case"]


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
    unknowns = first.problem.equilibrium.layout.unknowns
    limit = [f"mesh.adapt.max_unknowns={3 * unknowns}"]
    solution = solve(load_case(path, limit))
    assert solution.converged and len(solution.adaptation) > 1
    assert solution.error.relative < 0.8 * first.error.relative
    assert solution.contact_force == pytest.approx(first.contact_force, rel=0.05, abs=1e-4)


def test_what_does_not_go_with_it_is_refused():
    data = changed(mesh__adapt={"error": 2.0})
    with pytest.raises(InputError, match=r"mesh.adapt.error: given 2.0; accepted: a number betw"):
        parse_case(data)
    data = changed(mesh__adapt={}, solver__nested=True)
    with pytest.raises(InputError, match=r"nested: given together with \[mesh.adapt\]"):
        solve(parse_case(data))
