"""Random problems: those that once took many solves, and others right by another assembly."""

import csv

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, parse_case, solve
from contact.mesh.cells import SHAPES
from contact.methods.options import NewtonOptions
from forms.laws import SlipCoefficient
from scripts.studies.robustness.__main__ import SMALL, judge, main
from scripts.studies.robustness.ablation import CLASSES, DEVICES, LINEAR, class_of
from scripts.studies.robustness.check import Mesh, internal_forces, recheck
from scripts.studies.robustness.problems import problems


@pytest.mark.parametrize("condense", [True, False])
def test_contact_forces_that_are_all_rounding_are_none(condense):
    """lifted-4: a beam on the ground pressed along it with nu 0, which asks for none."""
    case = next(problems("hard", "lifted-4")).case
    solution = solve(build_problem(case), NewtonOptions(condense=condense))
    assert solution.converged, solution.outcome.reason
    assert {record.note for record in solution.history} == {""}
    assert abs(solution.contact_force).max() < 1e-15
    # E A, and none of it in the supports of the contact
    assert abs(solution.displacement.x.array).max() == pytest.approx(1e-4 * 600, rel=1e-8)


def test_a_node_that_begins_to_slide_goes_on():
    """bar-67 on quadrilaterals: friction falls from 0.1 to 0.083 of the pressure within 1e-7."""
    tables = next(problems("plain", "bar-67")).tables
    case = parse_case({**tables, "mesh": tables["mesh"] | {"cell": "quadrilateral"}})
    solution = solve(build_problem(case), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    nodes = solution.problem.nodes
    slip = solution.problem.interface.slip_length(nodes.jump(solution.state.x))
    slides = (slip > 1e-6) & (solution.pressure > 1e-9)
    ratio = (
        np.linalg.norm(solution.multipliers.friction, axis=1)[slides] / solution.pressure[slides]
    )
    coefficient = SlipCoefficient(1 / 12, 1 / 30, 6e7)
    assert slides.sum() > 50
    np.testing.assert_allclose(ratio, coefficient(slip[slides]), rtol=1e-6)


def test_problems_on_cells_are_of_all_shapes_and_degrees():
    drawn = [problem.case for problem in problems("cells")]
    kinds = {(case.mesh.cell, case.mesh.order, case.space.degree) for case in drawn}
    assert len(drawn) == 200
    assert kinds == {(shape.name, a, b) for shape in SHAPES for a in (1, 2) for b in (1, 2)}


#: Two of the first problems of most families.
CHOSEN = [
    "rings-0", "stacks-1", "wedges-0", "wedges-2", "driven_wedges-1", "snap_fits-2",
    "lifted_off-0", "indenters-0", "tilted_blocks-1", "clouds-0", "layers-0", "small_bodies-0",
]  # fmt: skip


#: Those of them that take more than half a second.
LONG = (
    "rings-0", "stacks-1", "driven_wedges-1", "snap_fits-2", "lifted_off-0", "clouds-0",
    "small_bodies-0", "wedges-2",
)  # fmt: skip


def problem(name, folder):
    return next(problems("bodies", name, folder=folder))


@pytest.mark.core
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name in LONG else ()) for name in CHOSEN],
)
def test_results_are_right_by_another_assembly(name, tmp_path):
    drawn = problem(name, tmp_path)
    solution = solve(drawn.case, comm=MPI.COMM_SELF)
    assert solution.converged
    assert judge(drawn, solution, tmp_path / "out") == {}


def test_wrong_results_are_seen(tmp_path):
    """A thousandth of a pressure, of a friction stress or of a displacement along the normal."""
    drawn = problem("clouds-0", tmp_path)
    judge(drawn, solve(drawn.case, comm=MPI.COMM_SELF), tmp_path / "out")
    path = tmp_path / "out" / "contact.csv"
    right = path.read_text()
    for column, check in {"pressure": "equilibrium", "tau": "bound", "u_n": "penetration"}.items():
        header, *rows = (line.split(",") for line in right.splitlines())
        k, pressed = header.index(column), header.index("pressure")
        row = max(rows, key=lambda row: float(row[pressed]))
        row[k] = repr(1.001 * float(row[k]) + 1e-6 * (column == "u_n"))
        path.write_text("\n".join(",".join(row) for row in [header, *rows]) + "\n")
        assert recheck(drawn.mesh, drawn.tables, tmp_path / "out")[check] > SMALL, column


@pytest.mark.core
def test_forces_of_the_check():
    """A triangle stretched along x in plane strain: sigma by hand, linear and beyond its yield."""
    mesh = Mesh(
        np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), np.array([[0, 1, 2]]), np.array([0]),
        ["body"], {},
    )  # fmt: skip
    u = np.array([[0.0, 0.0], [0.03, 0.0], [0.0, 0.0]])
    one = {"on": "body", "young": 2.6, "poisson": 0.3}
    forces = internal_forces(mesh, [one], u)
    # lambda = 1.5, mu = 1: sigma_x = (lambda + 2 mu) eps, over half of each leg.
    np.testing.assert_allclose(forces[1], [3.5 * 0.03 / 2, 0.0], atol=1e-15)
    np.testing.assert_allclose(forces[2], [0.0, 1.5 * 0.03 / 2], atol=1e-15)
    size = 0.03 * np.sqrt(2 / 3)
    g = 0.01 / size * (np.log(size / 0.01) + 1)
    bulk = 2.6 / (3 - 1.8)
    forces = internal_forces(mesh, [one | {"law": "log", "yield_strain": 0.01}], u)
    np.testing.assert_allclose(forces[1, 0], (bulk + 4 * g / 3) * 0.03 / 2, rtol=1e-12)


@pytest.mark.parametrize("name", ["snap_fits-0", "snap_fits-1", "rings-24"])
def test_solutions_without_contact_forces(name, tmp_path):
    """A beam let go, and a ring that the lid pushes through its clearance: no force, no scale."""
    solution = solve(problem(name, tmp_path).case, comm=MPI.COMM_SELF)
    assert solution.converged
    assert solution.problem.nodes.maximum(solution.pressure) == 0


def test_the_table_of_the_study(tmp_path, capsys):
    """Both methods find the same displacements; results of several bodies are checked."""
    assert (
        main(["plain", "--only", "bar-7", "--methods", "newton", "uzawa", f"--out={tmp_path}"]) == 0
    )
    assert main(["bodies", "--only", "clouds-0", f"--out={tmp_path}"]) == 0
    with (tmp_path / "plain.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert [(row["family"], row["method"], row["problems"], row["right"]) for row in rows] == [
        ("bar", "newton", "1", "1"),
        ("bar", "uzawa", "1", "1"),
    ]
    assert float(rows[1]["largest difference"]) < 1e-7
    lines = (tmp_path / "bodies-problems.csv").read_text().splitlines()
    assert lines[1].startswith("clouds-0,newton,right")
    assert (tmp_path / "bodies.csv").read_text().startswith("family,problems,right,median solves")


def test_devices_are_there_to_be_switched_off():
    for name, device in (DEVICES | LINEAR).items():
        assert all(hasattr(owner, part) for owner, part, _ in device.changes), name
        assert not device.own or device.own in CLASSES
        with device.off() as options:
            assert isinstance(options, NewtonOptions)


def test_classes_of_the_ablation_have_problems_of_different_names() -> None:
    names = [problem.name for name in CLASSES for problem in class_of(name)]
    names += [problem.name for kind in ("plain", "hard") for problem in problems(kind)]
    assert len(names) == len({*names})
