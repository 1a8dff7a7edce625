"""Surfaces by their heights: as their shapes, and a rough one beside a half-plane code."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact import Heights, InputError, build_problem, parse_case, solve

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 10.0, 0.3


def write(path, x, heights):
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(x.tolist(), heights.tolist(), strict=True))
    path.write_text(f"x,y\n{rows}\n")


def pressed(foundation, approach=0.02, size=0.02):
    """Return the half plane that is pressed up onto a foundation; the half x > 0."""
    return parse_case(
        {
            "mesh": {
                "generator": "half_space",
                "parameters": {
                    **{"radius": 1.0, "extent": 30.0, "size": 4.0, "growth": 0.15},
                    **{"contact_size": size, "edge_size": size},
                },
            },
            "material": {"young": YOUNG, "poisson": POISSON},
            "fixed": [
                {"on": "bottom", "displacement": [0.0, approach]},
                {"on": "side", "displacement": [0.0, approach]},
                {"on": "axis", "displacement": [0.0, "free"]},
            ],
            "contact": {"on": "contact", "foundation": foundation},
        }
    )


@pytest.mark.parallel
def test_a_parabola_by_its_heights_is_one(shared_tmp_path):
    """Cubic splines through the points of a parabola are that parabola."""
    file = shared_tmp_path / "parabola.csv"
    x = np.linspace(-1.2, 1.2, 25)
    if COMM.rank == 0:
        write(file, x, x**2 / 4)
    COMM.barrier()
    paraboloid = {"shape": "paraboloid", "apex": [0.0, 0.0], "axis": [0.0, 1.0], "radius": 2.0}
    heights = {"shape": "heights", "file": str(file), "above": True}
    found = [solve(pressed(given)).contact_force[1] for given in (paraboloid, heights)]
    assert found[0] > 0.01
    # Distances to a shape are those to its nearest point, by heights those along y to first order.
    assert found[1] == pytest.approx(found[0], rel=2e-3)


@pytest.mark.core
def test_distances_and_normals_of_heights():
    """In 3-D, with one direction other than the other, above and below."""
    x, y = np.linspace(0.0, 2.0, 21), np.linspace(-1.0, 1.0, 31)
    slope = np.array([0.3, -0.2])
    plane = slope[0] * x[:, None] + slope[1] * y[None]
    points = np.array([[0.5, 0.2, 1.0], [1.7, -0.6, -1.0], [0.1, 0.9, 0.0]])
    length = np.sqrt(1 + slope @ slope)
    expected = (points[:, 2] - points[:, :2] @ slope) / length
    for above, side in ((False, 1.0), (True, -1.0)):
        distance, normal = Heights((x, y), plane, above=above).distance(points)
        assert distance == pytest.approx(side * expected, abs=1e-13)
        assert normal == pytest.approx(
            np.tile(side * np.array([*-slope, 1.0]) / length, (3, 1)), abs=1e-12
        )
    # Beyond the last point it goes on level.
    distance, normal = Heights((x, y), plane).distance(np.array([[5.0, 0.0, 1.0]]))
    assert distance[0] == pytest.approx((1.0 - 0.6) / np.linalg.norm([slope[1], 1.0]))
    assert normal[0] == pytest.approx(np.array([0.0, 0.2, 1.0]) / np.hypot(0.2, 1.0))


def test_places_beyond_the_heights():
    """In 3-D, beside either axis; half a spacing beyond the last place is known."""
    given = Heights((np.linspace(0.0, 2.0, 5), np.linspace(0.0, 1.0, 11)), np.zeros((5, 11)))
    points = np.array(
        [[-0.25, 0.0], [2.25, 1.05], [1.0, 0.5], [-0.26, 0.0], [2.26, 1.0], [1, 1.06]]
    )
    found = given.beyond(np.column_stack([points, np.ones(6)]))
    assert found.tolist() == [False] * 3 + [True] * 3


@pytest.mark.parametrize("file", ["grid.csv", "grid.npy"])
def test_arrays_and_columns_are_one_surface(tmp_path, file):
    """An image of heights with its spacing, and its rows in any order."""
    x, y = 0.5 + 0.25 * np.arange(9), -1.0 + 0.5 * np.arange(5)
    heights = 0.01 * np.cos(2 * x[:, None]) * (1 + 0.3 * y[None])
    rows = [(a, b, heights[i, j]) for i, a in enumerate(x) for j, b in enumerate(y)]
    np.random.default_rng(0).shuffle(rows)
    foundation = {"shape": "heights", "file": str(tmp_path / file)}
    if file.endswith(".csv"):
        words = "\n".join(",".join(map(repr, map(float, row))) for row in rows)
        (tmp_path / file).write_text(f"x,y,z\n{words}\n")
    else:
        np.save(tmp_path / file, heights)
        foundation |= {"spacing": [0.25, 0.5], "origin": [0.5, -1.0]}
    case = parse_case(
        {
            "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [2, 2, 2]},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "top", "displacement": [0.0, 0.0, -0.1]}],
            "contact": {"on": "bottom", "foundation": foundation},
        }
    )
    shape = case.contact.foundation
    points = np.random.default_rng(1).uniform([0.5, -1, -1], [2.5, 1, 1], (20, 3))
    known = Heights((x, y), heights).distance(points)
    for one, other in zip(shape.distance(points), known, strict=True):
        assert one == pytest.approx(other, abs=1e-12)


BAD = {
    "a row twice": ("x,y\n0,0\n1,0\n1,1\n", "(1) stands twice"),
    "a hole": ("x,y,z\n0,0,0\n1,0,0\n0,1,0\n", "no height at (1, 1), of the grid of 2 by 2 points"),
    "no grid": (
        "x,y,z\n" + "".join(f"{k},{k},0\n" for k in range(9)),
        "9 points of the grid of 9 by 9 points that their coordinates make; accepted: each point",
    ),
    "names": ("a,b\n0,0\n1,0\n", "accepted: columns x, y in the plane"),
    "no number": ("x,y\n0,0\n1,nan\n", "accepted: a number at each place"),
    "one point": ("x,y\n0,0\n", "accepted: two places or more a direction"),
    "words": ("x,y\n0,zero\n", "accepted: a row of names, then rows of numbers"),
}


@pytest.mark.parametrize("name", BAD)
def test_heights_that_are_none(tmp_path, name):
    text, message = BAD[name]
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError) as error:
        build_problem(moved_towards(tmp_path / "bad.csv", 0.0))
    assert message in str(error.value)


def flat(tmp_path, x, approach):
    """Return a block that is moved towards heights of 0 in some places."""
    write(tmp_path / "flat.csv", np.asarray(x), np.zeros(len(x)))
    return moved_towards(tmp_path / "flat.csv", approach)


def moved_towards(file, approach):
    """Return a block that is moved towards the heights of a file."""
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [20, 10]},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "top", "displacement": [0.0, approach]}],
            "contact": {"on": "bottom", "foundation": {"shape": "heights", "file": str(file)}},
        }
    )


@pytest.mark.parallel
@pytest.mark.parametrize("direction", ["foundation", "body"])
def test_contact_beyond_the_heights_is_told(shared_tmp_path, direction):
    """0.55 to 1.35, half a spacing of 0.1 beyond the points, is known: 8 of 20 cells."""
    places = 0.6 + 0.1 * np.arange(8)
    case = flat(shared_tmp_path, places, -0.01)
    contact = case.contact.model_copy(update={"direction": direction})
    case = case.model_copy(update={"contact": contact})
    warned = "60.0% of the area of bottom lie beyond the last place of the heights"
    (said,) = (w for w in solve(case).warnings if "[part-end]" in w)
    assert warned in said
    away = solve(flat(shared_tmp_path, places, 0.01))
    whole = solve(flat(shared_tmp_path, np.linspace(0.05, 1.95, 20), -0.01))
    assert not any("[part-end]" in text for text in [*away.warnings, *whole.warnings])


def half_plane(x, heights, load):
    """Return pressures under a rigid surface that is pressed onto a half plane with a load.

    Elements of constant pressure with Flamant's kernel, and an active set (plane strain).
    """
    step = x[1] - x[0]
    distance = x[:, None] - x[None]

    def integral(t):
        return t * np.log(np.where(t == 0, 1.0, np.abs(t))) - t

    plane = YOUNG / (1 - POISSON**2)
    kernel = -2 / (np.pi * plane) * (integral(distance + step / 2) - integral(distance - step / 2))
    on = np.ones(x.size, dtype=bool)
    for _ in range(200):
        size = int(on.sum())
        system = np.zeros((size + 1, size + 1))
        system[:size, :size] = kernel[np.ix_(on, on)]
        system[:size, -1], system[-1, :size] = -1.0, step
        *found, approach = np.linalg.solve(system, [*-heights[on], load])
        pressure = np.zeros(x.size)
        pressure[on] = found
        gap = heights + kernel @ pressure - approach
        after = np.where(on, pressure > 0, gap < 0)
        if np.array_equal(on, after):
            return pressure
        on = after
    raise AssertionError("the active set cycles")


def test_a_rough_profile_beside_a_half_plane_code(tmp_path):
    """A parabola with waves of random phases, 1000 points of a file."""
    x = np.linspace(-1.0, 1.0, 1000)
    rng = np.random.default_rng(4)
    waves = sum(
        a * np.cos(2 * np.pi * k * x) * np.cos(rng.uniform(0, 2 * np.pi))
        for k, a in ((2, 2e-5), (3, 1.5e-5), (5, 1e-5), (9, 1e-5))
    )
    # Slopes of some 0.001: the half-plane code leaves out that points move along the surface.
    heights = x**2 / 800 + waves
    write(tmp_path / "rough.csv", x, heights)
    foundation = {"shape": "heights", "file": str(tmp_path / "rough.csv"), "above": True}
    solution = solve(pressed(foundation, approach=2e-3, size=0.005))
    assert solution.converged
    force, nodes = 2 * solution.contact_force[1], solution.problem.nodes
    pressure = solution.state.multipliers.contact
    ratio = nodes.weight[pressure > 1e-6 * pressure.max()].sum() / nodes.weight.sum()
    middle = -1.0 + (np.arange(800) + 0.5) / 400
    known = half_plane(middle, np.interp(middle, x, heights), abs(force))
    assert 0.1 < ratio < 0.9
    assert ratio == pytest.approx(np.mean(known > 0), rel=0.01)
    assert pressure.max() == pytest.approx(known.max(), rel=0.01)
    # Several patches: more than one hill carries.
    edges = np.count_nonzero(np.diff((known > 0).astype(int)) != 0)
    assert edges >= 4
    places = nodes.points[:, 0]
    order = np.argsort(places)
    there = np.interp(middle[middle > 0], places[order], pressure[order])
    assert np.abs(there - known[middle > 0]).mean() < 0.02 * known.mean()
