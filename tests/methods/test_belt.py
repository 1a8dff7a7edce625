"""A strap around a drum, pulled at both ends: friction multiplies the tension along it.

Loads that friction cannot balance: a linear program tells, and methods end.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Solution, build_problem, parse_case, solve
from contact.mesh.domain import Domain
from contact.mesh.grid import rectangle
from contact.methods.interior_point import interior_point
from contact.methods.newton import Newton
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import groups, sliding_mode
from contact.results.remarks import untouched

#: Tension at the end that is pulled more, and Young's modulus.
PULL, YOUNG = 0.005, 1.0


def strap(cells: int, thickness: float) -> Domain:
    """Return a strap around the upper half of a drum of radius 1, with straight ends 0.5 long."""
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [np.pi + 1, thickness], [cells, 1])
    x = domain.mesh.geometry.x
    along, across = x[:, 0] - 0.5, x[:, 1].copy()
    angle = np.clip(along, 0.0, np.pi)
    beyond = np.minimum(along, 0.0) + np.minimum(np.pi - along, 0.0)
    x[:, 0] = -(1 + across) * np.cos(angle)
    x[:, 1] = (1 + across) * np.sin(angle) + beyond
    return domain


def around_a_drum(cells, ratio, mu, degree, thickness) -> ContactProblem:
    """Return the problem of a strap whose one end is pulled `ratio` times as much."""
    case = {
        "mesh": {"generator": "rectangle", "size": [np.pi + 1, thickness], "cells": [cells, 1]},
        "space": {"degree": degree},
        "material": {"young": YOUNG, "poisson": 0.2},
        "fixed": [{"on": "right", "displacement": [0.0, "free"]}],
        "load": [
            {"on": "left", "traction": [0.0, -PULL]},
            {"on": "right", "traction": [0.0, -PULL / ratio]},
        ],
        "contact": {
            "on": "bottom",
            "overlap": "press",
            "foundation": {"shape": "sphere", "centre": [0.0, 0.0], "radius": 1.0},
        },
        "friction": {"law": "coulomb", "mu": mu},
    }
    return build_problem(parse_case(case), MPI.COMM_SELF, domain=strap(cells, thickness))


#: Cells, ratio of the pulls, coefficient of friction, degree and thickness of straps.
STRAPS = [(37, 1.2, 0.4, 1, 0.08), (53, 1.5, 0.3, 1, 0.2), (50, 1.1, 0.4, 2, 0.08)]


@pytest.mark.core
@pytest.mark.parametrize(("cells", "ratio", "mu", "degree", "thickness"), STRAPS)
def test_a_strap_around_a_drum(cells, ratio, mu, degree, thickness):
    """Friction bounds of Newton's cycling active sets came back for ever: residuals up to 0.8."""
    solution = solve(around_a_drum(cells, ratio, mu, degree, thickness))
    assert solution.converged, solution.outcome.reason
    # The drum bears both pulls, and the moment of friction their difference.
    force = -solution.contact_force
    assert force[1] == pytest.approx(PULL * thickness * (1 + 1 / ratio), rel=1e-9)


def belt(angle: float, mu: float, share: float, cells: int = 16) -> tuple[Solution, float]:
    """Pull a belt around a part of a drum of radius 1 with a share of the limit of Eytelwein.

    Nothing but friction holds it. The tensions act in the middle of its thickness.
    """
    thickness, tension = 0.02, 1e-7
    domain = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [angle, thickness], [cells, 1])
    x = domain.mesh.geometry.x
    at, radius = x[:, 0].copy(), 1 + x[:, 1]
    x[:, 0], x[:, 1] = -radius * np.cos(at), radius * np.sin(at)
    ratio = 1 + share * (np.exp(mu * angle) * (1 - thickness) - 1)
    pull = [float(c) for c in ratio * tension * np.array([np.sin(angle), np.cos(angle)])]
    case = {
        "mesh": {"generator": "rectangle", "size": [angle, thickness], "cells": [cells, 1]},
        "space": {"kinematics": "plane_stress"},
        "material": {"young": YOUNG, "poisson": 0.0},
        "load": [{"on": "left", "force": [0.0, -tension]}, {"on": "right", "force": pull}],
        "contact": {
            **{"on": "bottom", "overlap": "press"},
            "foundation": {"shape": "sphere", "centre": [0.0, 0.0], "radius": 1.0},
        },
        "friction": {"law": "coulomb", "mu": mu},
    }
    solution = solve(build_problem(parse_case(case), MPI.COMM_WORLD, domain=domain))
    return solution, float(np.hypot(*(np.array(pull) - [0.0, tension])))


@pytest.mark.core("180-0.3-0.95")
@pytest.mark.parallel
@pytest.mark.parametrize(
    ("degrees", "mu", "share"), [(180, 0.3, 0.95), (270, 0.15, 0.9), (100, 0.5, 0.95)]
)
def test_a_belt_that_friction_alone_holds(degrees, mu, share):
    """Up to 5 % below exp(mu theta); the last friction bounds were said not to hold it."""
    solution, force = belt(np.deg2rad(degrees), mu, share)
    assert solution.converged, solution.outcome.reason
    assert np.linalg.norm(solution.contact_force) == pytest.approx(force, rel=1e-6)
    assert not any("[not-held]" in warning for warning in solution.warnings)


def test_a_belt_that_slips_is_said_to():
    """At 1.1 times the limit no friction holds it."""
    solution, _ = belt(np.pi, 0.3, 1.1)
    assert not solution.converged
    assert any("[not-held]" in warning for warning in solution.warnings)


def test_a_leaf_spring_between_two_plates_is_twice_its_half():
    """Its ends rest on one plate, its crown bears the other: friction alone holds it."""
    long, rise, thick, mu, cells = 100.0, 5.0, 1.0, 0.1, 20
    radius = (long**2 / 4 + rise**2) / (2 * rise)
    half = float(np.arcsin(long / 2 / radius))

    def pressed(begin: float, number: int, force: float, fixed: list) -> Solution:
        domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [half - begin, thick], [number, 2])
        x = domain.mesh.geometry.x
        at, r = x[:, 0] + begin, radius + x[:, 1]
        x[:, 0], x[:, 1] = r * np.sin(at), rise - radius + r * np.cos(at)
        lid = {"displacement": [0.0, "free"], "force": [0.0, -force]}
        plates = [([0.0, float(x[:, 1].min())], [0.0, 1.0]), ([0.0, rise + thick], [0.0, -1.0])]
        low, high = ({"shape": "plane", "point": p, "normal": n} for p, n in plates)
        case = {
            "mesh": {"generator": "rectangle", "size": [half - begin, thick], "cells": [number, 2]},
            "space": {"degree": 2, "kinematics": "plane_stress"},
            "material": {"young": 200e3, "poisson": 0.0},
            "fixed": fixed,
            "contact": [
                {"on": "bottom", "foundation": low},
                {"on": "top", "foundation": high, "rigid": lid},
            ],
            "friction": {"law": "coulomb", "mu": mu},
        }
        return solve(build_problem(parse_case(case), MPI.COMM_SELF, domain=domain))

    whole = pressed(-half, 2 * cells, 6.0, [])
    right = pressed(0.0, cells, 3.0, [{"on": "left", "displacement": [0.0, "free"]}])
    assert whole.converged and right.converged, whole.outcome.reason
    sinks = [s.movements["rigid"]["displacement"][1] for s in (whole, right)]
    assert sinks[0] == pytest.approx(sinks[1], rel=1e-3)


MU, PRESS = 0.3, 1e-3


def wall(dim, part, angle=0.0, **contact):
    """Return a unit block pressed to a wall, and along it by a part of the force friction holds.

    Without Poisson's effect the wall presses by E times the way of the other side.
    """
    free = ["free"] * (dim - 1)
    along = np.array([-1.0] if dim == 2 else [np.sin(angle), -np.cos(angle)]) * part * MU * PRESS
    return parse_case({
        "mesh": {"generator": "rectangle" if dim == 2 else "box", "size": [1.0] * dim,
                 "cells": [4] * dim},
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "right", "displacement": [-PRESS, *free]}],
        "load": [{"everywhere": True, "body_force": [0.0, *along.tolist()]}],
        "contact": {"on": "left", **contact},
        "friction": {"law": "coulomb", "mu": MU},
    })  # fmt: skip


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "angle"), [(2, 0.0), (3, 0.0), (3, 0.3)])
def test_the_friction_that_holds_a_block(dim, angle):
    """A thousandth more than its load holds it, a thousandth less does not, in any direction."""
    problem = build_problem(wall(dim, 1.0, angle), MPI.COMM_WORLD)
    (group,) = groups(problem)
    loads, friction = problem.body.external(1.0), problem.nodes.weight * MU * PRESS
    assert sliding_mode(group, loads, 1.001 * friction) is None
    # Without any, all modes of the box along which loads act are alike.
    assert sliding_mode(group, loads, 0.0 * friction) is not None
    for part in (0.3, 0.999):
        mode = sliding_mode(group, loads, part * friction)
        named = {name: abs(size) for name, size in zip(group.names, mode, strict=True)}
        assert max(named, key=named.get) == f"translation along {'xyz'[dim - 1]}"


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_the_friction_that_holds_a_block_on_a_layer(dim):
    """Behind a layer without a rigid part the gap is infinite: its friction was not counted."""
    case = wall(dim, 1.0, law="compliance", layer=np.inf, stiffness=1.0)
    problem = build_problem(case, MPI.COMM_WORLD)
    (group,) = groups(problem)
    loads, friction = problem.body.external(1.0), problem.nodes.weight * MU * PRESS
    assert sliding_mode(group, loads, 1.001 * friction) is None
    assert sliding_mode(group, loads, 0.999 * friction) is not None


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_at_a_wall_is_held_or_not(dim):
    """At a hundredth more than friction can hold; it was lost without a word of friction."""
    constrained, lost = (solve(wall(dim, part), comm=MPI.COMM_WORLD) for part in (0.99, 1.01))
    assert constrained.converged and not constrained.outcome.overloaded
    assert not lost.converged and lost.outcome.overloaded
    assert lost.outcome.reason.startswith("the friction of the pressures that were found does not")
    (said,) = [text for text in lost.warnings if "[not-held]" in text]
    found = "the friction of the pressures that were found"
    assert f"{found} cannot hold the body (translation along {'xyz'[dim - 1]})" in said
    # Where the method stopped no node may touch: a foundation too far away is not the cause then.
    open_nodes = (replace(found, state=found.problem.start()) for found in (lost, constrained))
    assert [len(list(untouched(found))) for found in open_nodes] == [0, 1]


@pytest.mark.parametrize(
    "material",
    [{"law": "j2", "yield_stress": 5e-4}, {"law": "log", "yield_strain": 1e-3}, {"law": "linear"}],
)
def test_limit_analysis_of_friction_is_of_linear_bodies(material):
    """Of a plastic belt beyond its limit load it was said that friction cannot hold it."""
    case = wall(2, 1.01)
    tables = case.model_dump(exclude_unset=True)
    tables["material"] = {"young": 1.0, "poisson": 0.0, **material}
    problem = build_problem(parse_case(tables), MPI.COMM_SELF)
    _, outcome = interior_point(Newton(problem).semismooth)
    assert not outcome.converged
    assert outcome.overloaded == (material["law"] == "linear")


def test_a_body_without_hardening_is_said_to_have_a_limit_load():
    """A strip that friction would hold is pulled with more than its yield stress, or with less."""
    said = {}
    for tension in (16.0, 12.0):
        case = parse_case({
            "mesh": {"generator": "rectangle", "size": [8.0, 1.0], "cells": [8, 1]},
            "space": {"kinematics": "plane_stress"},
            "material": {"law": "j2", "young": 1e4, "poisson": 0.0, "yield_stress": 15.0},
            "load": [
                {"on": "top", "traction": [0.0, -5.0]},
                {"on": "right", "traction": [tension, 0.0]},
            ],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 0.5},
            "solver": {"max_outer": 5},
        })  # fmt: skip
        solution = solve(case)
        assert solution.converged == (tension < 15.0)
        said[tension] = [text for text in solution.warnings if "[limit-load]" in text]
        assert not any("[not-held]" in text for text in solution.warnings)
    assert len(said[16.0]) == 1 and not said[12.0]
