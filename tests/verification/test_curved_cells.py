"""Cells of second order: full orders on round bodies, in front of foundations and between bodies.

The exact solutions are Lame's: a ring that is pressed on a shaft, and two rings about each other.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, InputError, Sphere
from contact.mesh.cells import SHAPES
from contact.mesh.geometry import area, volume
from contact.mesh.transfer import refined
from contact.problem.problem import ContactProblem
from contact.results.error_estimate import estimated
from scripts.force_balance import force_balance
from scripts.reporting import Report
from scripts.studies import cell_orders, curved_cells
from scripts.studies.curved_cells import solved, two_rings
from scripts.studies.lame_rings import LAME, LAW, Lame, error, on_a_shaft, rings, supports
from tests.problems.mechanics import state_of
from tests.problems.written import rows_of

COMM = MPI.COMM_WORLD
NAMES = [shape.name for shape in SHAPES]


@pytest.mark.core("triangle", "quadrilateral")
@pytest.mark.parallel
@pytest.mark.parametrize("name", NAMES)
def test_a_ring_on_a_shaft_converges_with_the_third_order(name: str) -> None:
    """With the second on tetrahedra, whose contact ends at free edges, 1 deep."""
    found = [solved(on_a_shaft(rings(COMM, name, 2, (1.0, 2.0), (n,)), 2)) for n in (2, 4)]
    if name == "tetrahedron":
        assert found[1][0] < found[0][0] / 2**1.9 < 1.3e-3
    else:
        assert found[1][0] < found[0][0] / 2**2.8 < 5e-4
    np.testing.assert_allclose(found[1][1], LAME.pressure, rtol=0.03)


@pytest.mark.parallel
@pytest.mark.parametrize("on", ["outer0", "inner1"])
@pytest.mark.parametrize("name", NAMES)
def test_two_rings_converge_with_the_third_order(name: str, on: str) -> None:
    """On meshes that do not match, whichever is the slave."""
    radii = (1.0, 1.5, 2.0)
    found = [solved(two_rings(rings(COMM, name, 2, radii, (n, n + 1)), 2, on)) for n in (2, 4)]
    assert found[1][0] < found[0][0] / 2**2.8 < 5e-4
    pressure = -float(LAME.radial(np.array(1.5)))
    np.testing.assert_allclose(found[1][1], pressure, rtol=0.06)


@pytest.mark.parametrize("name", NAMES[:2])
def test_straight_cells_have_the_second_order(name: str) -> None:
    """On the polygon that they are: curved ones are ten times as exact."""
    straight, curved = (
        [solved(on_a_shaft(rings(COMM, name, order, (1.0, 2.0), (n,)), 2))[0] for n in (4, 8)]
        for order in (1, 2)
    )
    assert straight[0] / straight[1] < 2**2.1
    assert curved[1] < straight[1] / 10


@pytest.mark.parallel
@pytest.mark.parametrize(("name", "most"), [("triangle", 0.11), ("quadrilateral", 0.07)])
def test_pressures_of_two_rings_on_straight_cells_are_off_by_a_share(name, most, monkeypatch):
    """Gaps are those of arcs: with parabolas or gaps along normals the load decides the share."""
    found = []
    for load in (1e-2, 1e-5):
        monkeypatch.setattr(curved_cells, "LAME", Lame(pressure=load))
        problem = curved_cells.problem_of("two rings", name, 1, 2, 8)
        np.testing.assert_allclose(problem.nodes.gap, 0, atol=1e-14)
        found.append(solved(problem)[1] / -float(curved_cells.LAME.radial(np.array(1.5))))
    assert np.abs(found[0] - 1).max() < most
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_pressures_on_straight_cells_are_off_by_the_displacements_of_chords() -> None:
    """With the exact jump between the chords as the gap they are right to a quarter of that."""
    pressure = -float(LAME.radial(np.array(1.5)))

    def with_exact_jump(problem):
        """Return the problem with the jump of the exact displacements for the gap."""
        x = problem.body.space.tabulate_dof_coordinates()[:, :2]
        radius = np.linalg.norm(x, axis=1)
        u = (LAME.displacement(radius) / radius)[:, None] * x
        (geometry,) = problem.geometries
        nodes, jumps = geometry.nodes, geometry.jumps
        jump = jumps.D @ u[jumps.slaves] - jumps.M @ u[jumps.masters]
        exact = replace(nodes, gap=np.einsum("nd,nd->n", jump, nodes.normal))
        return problem.with_geometry([replace(geometry, nodes=exact)])

    def largest(problem):
        """Return the largest error of a nodal pressure."""
        return np.abs(solved(problem)[1] / pressure - 1).max()

    problems = [curved_cells.problem_of("two rings", "triangle", 1, 2, n) for n in (4, 8, 16)]
    chords = [largest(problem) for problem in problems]
    exact = [largest(with_exact_jump(problem)) for problem in problems]
    np.testing.assert_allclose(chords, [0.153, 0.102, 0.058], rtol=0.02)
    np.testing.assert_allclose(exact, [0.052, 0.023, 0.0085], rtol=0.02)


@pytest.mark.parametrize("name", NAMES)
def test_displacements_of_degree_1_on_curved_cells(name: str) -> None:
    found = [
        solved(on_a_shaft(rings(MPI.COMM_SELF, name, 2, (1.0, 2.0), (n,)), 1))[0] for n in (2, 4)
    ]
    assert found[1] < found[0] / 2**1.4


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("name", NAMES)
def test_volumes_and_areas_are_those_of_round_bodies(name: str) -> None:
    domain = rings(COMM, name, 2, (1.0, 2.0), (4,))
    assert domain.order == 2
    exact = 3 * np.pi / 4
    assert volume(domain) == pytest.approx(exact, rel=1e-5)
    assert area(domain, "inner0") == pytest.approx(np.pi / 2, rel=1e-5)
    nodes = on_a_shaft(domain, 2).nodes
    assert nodes.sum(np.ones(nodes.nodes.size)) == pytest.approx(np.pi / 2, rel=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_estimates_follow_the_error(name: str) -> None:
    found = []
    for n in (2, 4):
        problem = on_a_shaft(rings(MPI.COMM_SELF, name, 2, (1.0, 2.0), (n,)), 2)
        found.append(estimated(problem, state_of(problem, 1e-11)).relative)
    assert found[1] < found[0] / 2.5 < 0.05


def test_curved_cells_are_neither_refined_nor_of_mean_dilatation() -> None:
    domain = rings(MPI.COMM_SELF, "triangle", 2, (1.0, 2.0), (2,))
    for marked in (None, np.array([0], dtype=np.int32)):
        with pytest.raises(InputError, match=r"mesh\.refine.*\[refine\]"):
            refined(domain, marked)
    body, contact = Body(LAW, supports(2)), Contact("inner0", Sphere((0.0, 0.0), 1.0))
    with pytest.raises(InputError, match=r"\[value\]"):
        ContactProblem(domain, body, contact, degree=2, element="mean_dilatation")


def test_the_resultants_balance_on_curved_facets() -> None:
    problem = two_rings(rings(MPI.COMM_SELF, "triangle", 2, (1.0, 1.5, 2.0), (2, 3)), 2)
    assert force_balance(problem, state_of(problem, 1e-11)).imbalance < 1e-9


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_the_error_in_l2_is_that_of_ufl(name: str, order: int) -> None:
    domain = rings(MPI.COMM_SELF, name, order, (1.0, 2.0), (2,))
    problem = on_a_shaft(domain, 2)
    state = state_of(problem, 1e-11)

    def exact(x: np.ndarray) -> np.ndarray:
        radius = np.hypot(x[0], x[1])
        return LAME.displacement(radius) / radius * x * np.array([1, 1, 0])[: len(x), None]

    known = error(problem.body.space, state.x, LAME)
    assert cell_orders.l2_error(problem, state.x, exact) == pytest.approx(known, rel=1e-3)


@pytest.mark.parallel
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", NAMES)
def test_moved_grids_have_the_sides_of_the_cube(name: str, order: int) -> None:
    domain = cell_orders.grid(COMM, name, order, 4)
    assert domain.order == order
    assert volume(domain) == pytest.approx(1.0, rel=1e-12)
    assert len(domain.parts) == 2 * domain.dim
    for side in domain.parts:
        assert area(domain, side) == pytest.approx(1.0, rel=1e-12)


def test_known_contacts_on_moved_cells(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(cell_orders, "CELLS", {(2, 1): (8, 32), (2, 2): (8, 16)})
    known = {name: row for name, row in cell_orders.KNOWN.items() if row[1] == 2}
    monkeypatch.setattr(cell_orders, "KNOWN", known)
    found = cell_orders.orders(Report(tmp_path))
    assert len(found) == 12
    for (_, _, _, degree), (displacement, _, dual) in found.items():
        assert displacement > (1.6, 2.0)[degree - 1]
        assert degree == 2 or dual > 1.4  # of degree 2, two meshes show no order of the pressure
    for row in rows_of(tmp_path / "known-contacts.csv"):
        assert float(row["p in L2"]) < 0.017
        assert float(row["p in H^-1/2"]) < 0.012


def test_the_study_sees_both_orders(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(curved_cells, "SHAPES", SHAPES[:1])
    monkeypatch.setattr(curved_cells, "rim", lambda *_: {})
    monkeypatch.setattr(cell_orders, "orders", lambda *_: {})
    monkeypatch.setattr(cell_orders, "times", lambda *_: {})
    orders = curved_cells.main(["--coarse", "--out", str(tmp_path)])
    for kind in ("shaft", "two rings"):
        assert orders[kind, "triangle", 2, 2] > 2.8 > 2.3 > orders[kind, "triangle", 1, 2]
    assert (tmp_path / "curved-cells.md").exists()


def test_tetrahedra_on_a_shaft_are_of_order_2_by_their_forces_alone(tmp_path) -> None:
    found = curved_cells.rim(Report(tmp_path, coarse=True))
    assert found["load"] > 3 > 2.5 > found["shaft"] > 1.9
