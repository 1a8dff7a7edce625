"""Bolt preload: closed forms of a bar, and of a bolt through two flanges in series."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import (
    Body,
    Bolt,
    Contact,
    Fixed,
    Linear,
    Material,
    Motion,
    Problem,
    Rigid,
    parse_case,
    sensitivity,
    solve,
)
from contact.case.build import build_problem
from contact.errors import InputError
from contact.mesh.domain import from_mesh
from contact.methods.options import NewtonOptions
from contact.problem.checks import check_problem
from contact.results.fields import DerivedFields
from tests.problems.mechanics import at_points
from tests.problems.meshes import assembled, midpoints

COMM = MPI.COMM_WORLD
LENGTH, YOUNG = 2.0, 10.0


def bar(bolt, dim=2, degree=1, rotation=0.0, **more):
    """Return a bar, constrained at its ends, or at one, with a cut across it in the middle."""
    size, cells = [0.5, 0.4, LENGTH][3 - dim :], [2, 2, 5][3 - dim :]
    up = "xyz"[dim - 1]
    still = [0.0] * dim
    data = {
        "mesh": {
            "generator": "rectangle" if dim == 2 else "box",
            "size": size,
            "cells": cells,
            "rotation": rotation,
            "inside": {"cut": f"abs({up} - {0.4 * LENGTH}) < 1e-6"},
        },
        "space": {"degree": degree},
        "material": {"young": YOUNG, "poisson": 0.0},
        "fixed": [{"on": side, "displacement": still} for side in ("bottom", "top")],
        "bolt": [{"on": "cut"} | bolt],
        "contact": {"on": "right", "gap": 10.0},
        "solver": {"tolerance": 1e-12},
    }
    return parse_case(data | more)


@pytest.mark.core("force-2-1-lu", "shortening-2-1-lu", "shortening-2-2-lu")
@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
@pytest.mark.parametrize("given", ["force", "shortening"])
def test_a_bar_between_walls(given, dim, degree, linear):
    """N = E A s/L, whichever is given."""
    area = 0.4 if dim == 2 else 0.2
    s = 0.003
    force = YOUNG * area * s / LENGTH
    bolt = {given: {"force": force, "shortening": s}[given]}
    solver = {"tolerance": 1e-12, "linear": linear}
    solution = solve(bar(bolt, dim, degree, solver=solver), comm=COMM)
    assert solution.converged
    found = solution.movements["bolts"]["cut"]
    assert found == {"shortening": pytest.approx(s), "force": pytest.approx(force)}
    assert solution.reaction("bottom")[dim - 1] == pytest.approx(-force, rel=1e-8)
    stress = at_points(solution, "stress")[:, dim - 1, dim - 1]
    assert np.allclose(stress, force / area, rtol=1e-7, atol=0)
    energy = solution.energies
    assert energy is None or energy.energy == pytest.approx(force * s / 2, rel=1e-8)


@pytest.mark.parametrize("given", ["force", "shortening"])
def test_reactions_beside_a_cut_by_the_modulus(given):
    """The cells at the cut reach the support: N is given, or E A s/L."""
    area, s = 0.4, 0.003
    force = YOUNG * area * s / LENGTH
    cut = {"cut": f"abs(y - {0.8 * LENGTH}) < 1e-6"}
    grid = {"generator": "rectangle", "size": [0.4, LENGTH], "cells": [2, 5], "inside": cut}
    solution = solve(bar({given: {"force": force, "shortening": s}[given]}, mesh=grid), comm=COMM)
    names = [f"reaction_y_{part}" for part in ("bottom", "top")]
    found = sensitivity(solution, names, ["material.young"])
    exact = 0.0 if given == "force" else area * s / LENGTH
    for name, sign in zip(names, (-1, 1), strict=True):
        assert found[name]["material.young"] == pytest.approx(sign * exact, abs=1e-9)


#: Widths of the bolt and of the flanges, heights of these, Young's moduli of all.
WIDTHS, HEIGHTS, MODULI = (0.5, 1.0), (0.8, 1.2), (20.0, 10.0, 5.0)


def joint(comm, cut):
    """Return the mesh of a bolt beside two flanges, of which one lies on the other."""
    (b, f), (low, high) = WIDTHS, HEIGHTS
    boxes = [
        ((0.0, 0.0), (b, low + high), (2, 5)),
        ((1.0, 0.0), (1.0 + f, low), (2, 2)),
        ((1.0, low), (1.0 + f, low + high), (3, 3)),
    ]
    points, cells = [np.zeros((0, 2))], [np.zeros((0, 4), dtype=np.int64)]
    for start, end, (n, m) in boxes:
        x, y = np.meshgrid(
            np.linspace(start[0], end[0], n + 1), np.linspace(start[1], end[1], m + 1)
        )
        number = sum(map(len, points)) + np.arange(x.size).reshape(x.shape)
        points.append(np.stack([x.ravel(), y.ravel()], axis=1))
        quads = [number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]]
        cells.append(np.stack(quads, axis=2).reshape(-1, 4))
    mesh = assembled(comm, np.concatenate(points), np.concatenate(cells), "quadrilateral")
    top = low + high
    parts = {
        "foot": lambda x: np.isclose(x[1], 0.0),
        "head": lambda x: np.isclose(x[1], top),
        "sides": lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], 1.0),
    }
    facets, middle, inside, _ = midpoints(mesh)
    between = np.isclose(middle[:, 1], low) & (middle[:, 0] > 0.9)
    lower = inside[:, 1] < low
    return from_mesh(
        mesh,
        parts | {"joint_low": facets[between & lower], "joint_high": facets[between & ~lower]},
        regions={
            "bolt": lambda x: x[0] < b + 1e-9,
            "low": lambda x: (x[0] > 0.9) & (x[1] < low + 1e-9),
            "high": lambda x: (x[0] > 0.9) & (x[1] > low - 1e-9),
        },
        inside={"shank": lambda x: np.isclose(x[1], cut * top) & (x[0] < b + 1e-9)},
    )


def tightened(bolt, pull=0.0, amplitude=None, cut=0.4):
    """Return a joint with a rigid head that is pulled at."""
    domain = joint(COMM, cut)
    names = ("bolt", "low", "high")
    materials = [Material(Linear(e, 0.0), on=name) for e, name in zip(MODULI, names, strict=True)]
    motion = Motion([0.0, None], [0.0], [0.0, pull], [0.0], (0.0, 0.0), amplitude)
    supports = [Fixed("foot", [None, 0.0]), Fixed("sides", [0.0, None])]
    body = Body(materials, supports, rigid=Rigid("head", motion), bolts=bolt)
    return Problem(domain, body, Contact("joint_high", against="joint_low"))


def stiffnesses():
    """Return the stiffness of the bolt, and that of the flanges, one behind the other."""
    bolt = MODULI[0] * WIDTHS[0] / sum(HEIGHTS)
    flanges = [e * WIDTHS[1] / h for e, h in zip(MODULI[1:], HEIGHTS, strict=True)]
    return bolt, 1 / sum(1 / k for k in flanges)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize("cut", [0.4, 0.8])
def test_a_bolt_and_two_flanges_in_series(cut, linear):
    """N = s k_b k_f/(k_b + k_f); a given force asks for s = N (1/k_b + 1/k_f)."""
    bolt, flanges = stiffnesses()
    s = 0.004
    force = s / (1 / bolt + 1 / flanges)
    options = NewtonOptions(tolerance=1e-12, linear=linear)
    for given in ({"shortening": s}, {"force": force}):
        solution = solve(tightened(Bolt("shank", **given), cut=cut), options)
        assert solution.converged
        found = solution.movements["bolts"]["shank"]
        assert found["shortening"] == pytest.approx(s, rel=1e-9)
        assert found["force"] == pytest.approx(force, rel=1e-9)
        head = solution.movements["rigid_parts"]["head"]["displacement"][1]
        assert head == pytest.approx(-force / flanges, rel=1e-9)
        pressures = np.concatenate(COMM.allgather(solution.pressure))
        assert pressures == pytest.approx(force / WIDTHS[1], rel=1e-8)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("share", [0.5, 0.99, 1.5])
def test_a_tightened_joint_shares_a_load_until_it_opens(share):
    """The bolt takes k_b/(k_b + k_f) of it; once the flanges part, all."""
    bolt, flanges = stiffnesses()
    s = 0.004
    force = s / (1 / bolt + 1 / flanges)
    opens = force * (1 + bolt / flanges)
    pull = share * opens
    options = NewtonOptions(tolerance=1e-12)
    solution = solve(tightened(Bolt("shank", shortening=s), pull), options)
    found = solution.movements["bolts"]["shank"]["force"]
    shared = force + pull * bolt / (bolt + flanges)
    assert found == pytest.approx(shared if share < 1 else pull, rel=1e-8)
    assert (np.linalg.norm(solution.contact_force) > 1e-9) == (share < 1)


@pytest.mark.parallel
def test_an_inclined_bar_of_another_law_is_the_straight_one():
    """With a shift along the cut: the jump is along its normal alone."""
    material = {"law": "log", "young": YOUNG, "poisson": 0.3, "yield_strain": 0.001}
    found = [
        solve(bar({"force": 0.02}, material=material, rotation=angle), comm=COMM)
        for angle in (0.0, 40.0)
    ]
    assert all(solution.converged for solution in found)
    one, other = (solution.movements["bolts"]["cut"]["shortening"] for solution in found)
    assert other == pytest.approx(one, rel=1e-8)
    assert one > 1.05 * 0.02 * LENGTH / YOUNG / 0.4


@pytest.mark.parallel
def test_tightened_in_steps_its_work_is_stored():
    steps = {"evolution": {"times": [0.0, 1.0, 2.0], "steps": [2, 1]}}
    steps["evolution"]["amplitudes"] = {"turn": {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.5]}}
    solution = solve(bar({"shortening": 0.004, "amplitude": "turn"}, **steps), comm=COMM)
    rows = [step.row for step in solution.steps]
    stiffness = YOUNG * 0.4 / LENGTH
    assert [row["bolt_shortening_cut"] for row in rows] == pytest.approx([0.002, 0.004, 0.002])
    forces = [row["bolt_force_cut"] for row in rows]
    assert forces == pytest.approx([stiffness * s for s in (0.002, 0.004, 0.002)])
    energies = [row["energy"] for row in rows]
    assert energies == pytest.approx([stiffness / 2 * s**2 for s in (0.002, 0.004, 0.002)])
    assert sum(row["work"] for row in rows) == pytest.approx(energies[-1])


WRONG = {
    "both": ({"force": 1.0, "shortening": 1.0}, {}, r"bolt\.0\.shortening.*\[bolt\]"),
    "neither": ({}, {}, r"bolt\.0\.force.*\[bolt\]"),
    "a side": ({"on": "top", "force": 1.0}, {}, r"\[bolt\]"),
    "half a section": (
        {"force": 1.0},
        {"mesh": {"inside": {"cut": "(abs(y - 0.8) < 1e-6)*(x < 0.3)"}}},
        r"\[bolt\]",
    ),
    "two planes": (
        {"force": 1.0},
        {"mesh": {"inside": {"cut": "(abs(y - 0.8) < 1e-6) + (abs(y - 1.2) < 1e-6)"}}},
        r"\[bolt\]",
    ),
    "plastic": (
        {"force": 1.0},
        {"material": {"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 1.0}},
        r"\[bolt\]",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_refused(name):
    bolt, more, words = WRONG[name]
    base = {"generator": "rectangle", "size": [0.4, LENGTH], "cells": [4, 5]}
    more = more | ({"mesh": base | more["mesh"]} if "mesh" in more else {})
    with pytest.raises(InputError, match=words) as caught:
        build_problem(bar(bolt, **more))
    assert "\n" not in str(caught.value)


def two(one, other, cut="abs(y - 1.2) < 1e-6", **more):
    """Return the bar with a second cut."""
    data = bar(one, **more).model_dump(exclude_unset=True)
    data["mesh"]["inside"]["other"] = cut
    data["bolt"] = [*data["bolt"], {"on": "other"} | other]
    return parse_case(data)


@pytest.mark.parallel
def test_forces_in_series_leave_the_piece_between_to_nothing():
    """Its place is that of one bolt's shortening: where it is given, the other's force decides."""
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        solve(two({"force": 0.02}, {"force": 0.02}), comm=COMM)
    solution = solve(two({"force": 0.02}, {"shortening": 0.001}), comm=COMM)
    found = solution.movements["bolts"]
    assert found["other"]["force"] == pytest.approx(0.02)
    assert found["cut"]["shortening"] == pytest.approx(0.02 * LENGTH / YOUNG / 0.4 - 0.001)


@pytest.mark.parallel
def test_cuts_that_cross_make_four_pieces():
    supports = [{"on": on, "displacement": ["free", 0.0]} for on in ("bottom", "top")]
    supports.append({"on": "left", "displacement": [0.0, "free"]})
    bolts = {"force": 0.02}, {"force": -0.05}, "abs(x - 0.2) < 1e-6"
    solution = solve(two(*bolts, fixed=supports, contact={"on": "right"}), comm=COMM)
    stress = at_points(solution, "stress")
    assert np.allclose(stress[:, 1, 1], 0.02 / 0.4) and np.allclose(stress[:, 0, 0], -0.05 / LENGTH)
    free = two(*bolts, fixed=supports[::2], contact={"on": "top"})
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        check_problem(build_problem(free, COMM))


def frame(columns):
    """Return two stiff plates that some of three columns join, the outer ones with cuts."""
    n, cells = 6, []
    for row in range(6):
        for k in range(5):
            if row in (0, 5) or k in (2 * column for column in columns):
                first = row * n + k
                cells.append([first, first + 1, first + n, first + n + 1])
    used, quads = np.unique(np.array(cells, dtype=np.int64), return_inverse=True)
    x = np.stack([used % n, used // n], axis=1).astype(float)
    mesh = assembled(COMM, x, quads.reshape(-1, 4), "quadrilateral")
    outer = {"left": 0.5, "right": 4.5}
    return from_mesh(
        mesh,
        {"foot": lambda x: np.isclose(x[1], 0), "head": lambda x: np.isclose(x[1], 6)},
        inside={
            name: (lambda x, at=at: np.isclose(x[1], 3) & (np.abs(x[0] - at) < 0.6))
            for name, at in outer.items()
        },
    )


@pytest.mark.parallel
def test_two_bolts_beside_a_column_that_bears_them():
    """Both cuts leave the body in one piece, and the column between has both forces."""
    bolts = [Bolt("left", force=0.01), Bolt("right", force=0.01)]
    body = Body(Linear(YOUNG, 0.0), Fixed("foot", [0.0, 0.0]), bolts=bolts)
    solution = solve(Problem(frame((0, 1, 2)), body, Contact("head", gap=1.0)))
    assert solution.converged
    problem = solution.problem
    fields = DerivedFields(problem.body, solution.state)
    borne = []
    for cells, values in fields.chunks():
        middles = dmesh.compute_midpoints(problem.domain.mesh, 2, cells)
        at = np.all(np.isclose(middles[:, :2], [2.5, 1.5]), axis=1)
        borne += values[at][..., fields.columns["stress"]].reshape(-1, 3, 3)[:, 1, 1].tolist()
    assert np.mean(np.concatenate(COMM.allgather(borne))) == pytest.approx(-0.02, rel=1e-8)
    found = solution.movements["bolts"]
    assert found["left"] == pytest.approx(found["right"], rel=1e-8)
    alone = Problem(frame((0, 2)), body, Contact("head", gap=1.0))
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        check_problem(alone)


@pytest.mark.parallel
def test_a_force_that_nothing_bears_is_refused():
    supports = {"fixed": [{"on": "top", "displacement": [0.0, 0.0]}]}
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        solve(bar({"force": 0.02}, **supports, contact={"on": "bottom"}), comm=COMM)
    pressed = solve(bar({"force": -0.02}, **supports, contact={"on": "bottom"}), comm=COMM)
    assert pressed.contact_force[1] == pytest.approx(-0.02)
    with pytest.raises(InputError, match=r"\[unsupported\]"):
        solve(bar({"force": 0.02}, **supports), comm=COMM)


@pytest.mark.parallel
@pytest.mark.parametrize("kind", ["traction", "body force", "total"])
def test_loads_beside_a_cut_act_on_its_own_side(kind):
    """The section bears all that pulls at the bar above it, whichever cells that is."""
    pull, side = 0.03, {"on": "right", "traction": [0.0, 0.03]}
    load = {"traction": side, "body force": {"everywhere": True, "body_force": [0.0, pull / 0.4]}}
    load["total"] = {"on": "right", "force": [0.0, pull * LENGTH]}
    supports = [{"on": "bottom", "displacement": [0.0, 0.0]}]
    contact = {"on": "left", "gap": 10.0}
    case = bar({"shortening": 0.004}, fixed=supports, load=[load[kind]], contact=contact)
    solution = solve(case, comm=COMM)
    found = solution.movements["bolts"]["cut"]["force"]
    assert found == pytest.approx(pull * 0.6 * LENGTH, rel=1e-10)
    assert solution.reaction("bottom")[1] == pytest.approx(-pull * LENGTH, rel=1e-10)


@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_elastic_supports_beside_a_cut_hold_its_own_side(linear):
    """Two stiff halves on a side of stiffness k are drawn together."""
    k, s = 2.0, 0.004
    case = bar(
        {"shortening": s},
        fixed=[],
        material={"young": 1e6, "poisson": 0.0},
        elastic=[{"on": "left", "stiffness": [k, k]}],
        solver={"tolerance": 1e-12, "linear": linear},
    )
    solution = solve(case, comm=COMM)
    below, above = 0.4 * LENGTH, 0.6 * LENGTH
    force = k * s * below * above / LENGTH
    assert solution.movements["bolts"]["cut"]["force"] == pytest.approx(force, rel=1e-4)
    assert np.abs(solution.reaction("left")).max() < 1e-6 * force


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"fixed": [{"on": "left", "displacement": [0.0, "free"]}]}, ""),
        ({"fixed": [{"on": "left", "displacement": ["free", 0.0]}]}, "a support holds nodes"),
        ({"fixed": [{"on": "left", "normal": 0.0}], "rotation": 20.0}, ""),
        ({"contact": {"on": "right", "gap": 0.0}}, ""),
        ({"contact": {"on": "right"}, "friction": {"law": "coulomb", "mu": 0.3}}, "contact meets"),
    ],
)
def test_supports_and_contact_that_meet_a_cut(more, words):
    """They are refused where they act across it."""
    supports = [{"on": "bottom", "displacement": [0.0, 0.0]}, *more.pop("fixed", [])]
    case = bar({"shortening": 0.004}, rotation=more.pop("rotation", 0.0), fixed=supports, **more)
    if words:
        with pytest.raises(InputError, match=rf"{words}.*\[bolt-held\]"):
            build_problem(case, MPI.COMM_SELF)
    else:
        build_problem(case, MPI.COMM_SELF)
