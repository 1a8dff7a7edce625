"""Bodies that bend over a gap: active sets cycle, a working set or an interior point solves.

Rings and arches that are pressed flat.
"""

import re
from unittest.mock import patch

import numpy as np
import pytest
from mpi4py import MPI

from contact import Domain, FixedPointOptions, NewtonOptions, build_problem, parse_case, solve
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.methods import fallbacks, newton
from contact.methods.report import Outcome
from contact.problem.residuals import evaluate
from contact.solution import Solution
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.softest_mode import softest_mode
from tests.problems.clamped import clamped
from tests.problems.everywhere import agree

SELF = MPI.COMM_SELF


def beam(length: float, cells: list[int], load: dict, gap: float, mu: float = 0.0, **more) -> dict:
    """Return a beam of height 1, clamped at the left, over a foundation below it."""
    friction = {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"}
    tables = {"load": [load], "contact": {"on": "bottom", "gap": gap}, "friction": friction}
    return clamped([length, 1.0], cells, **tables | more)


TIP = {"on": "right", "traction": [0.0, -1e-4]}
FRICTION = [-2.9026178e-05, -9.9516588e-05]
UNIFORM = {"on": "top", "traction": [0.0, -1e-5]}


@pytest.mark.core
@pytest.mark.parametrize(
    ("case", "force", "nodes", "fallback"),
    [
        (beam(100.0, [200, 2], TIP, 0.5), [0.0, -9.9734515e-05], 1, "working set"),
        (beam(100.0, [200, 2], TIP, 0.5, 0.3), FRICTION, 1, "working set"),
        (beam(100.0, [400, 4], UNIFORM, 0.5), [0.0, -8.3181908e-04], 303, "interior point"),
    ],
    ids=["tip", "friction", "uniform"],
)
def test_a_cantilever_that_touches_a_stop(case, force, nodes, fallback):
    """Newton's method alone ended at a residual of 0.9 with no contact at all."""
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert np.allclose(solution.contact_force, force, rtol=0, atol=1e-7 * np.abs(force).max())
    assert np.count_nonzero(solution.status != "open") == nodes
    assert fallback in solution.history[-1].note


def test_a_fine_mesh_of_a_long_beam_touches_at_a_working_set():
    """Nine steps came first there, in vain, and then others at its nodes."""
    load = {"on": "top", "traction": [0.0, -1e-13]}
    case = beam(1000.0, [400, 1], load, 0.1, 0.8, space={"degree": 2})
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert {record.note for record in solution.history} == {"", "working set"}


@pytest.mark.parallel
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_bridge_that_touches_at_several_nodes_is_that_of_an_interior_point(mu):
    """A beam clamped at both ends, over a foundation that is nearest at two places."""
    load = {"on": "top", "traction": [0.0, -2.5e-7]}
    case = beam(100.0, [100, 1], load, 0.0, mu, space={"degree": 2})
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    case["contact"]["gap"] = "0.5 + 0.2*(1 - cos(6*pi*x/100))"
    found = solve(parse_case(case))
    with patch.object(fallbacks, "working_set", lambda *_: None):
        other = solve(parse_case(case))
    assert found.converged and other.converged
    notes = [" ".join(r.note for r in s.history) for s in (found, other)]
    assert "working set" in notes[0] and "interior point" not in notes[0]
    assert "interior point" in notes[1]
    touching = np.count_nonzero(found.status != "open")
    assert found.problem.comm.allreduce(touching) == 2
    size = np.abs(other.contact_force).max()
    assert np.allclose(found.contact_force, other.contact_force, rtol=0, atol=1e-6 * size)


@pytest.mark.parametrize(("mu", "force"), [(0.0, [0, -9.9734515e-05]), (0.3, FRICTION)])
def test_a_soft_body_that_cannot_be_condensed_is_solved_as_a_whole(mu, force):
    """With two digits of each solve the one node that touches was released again and again."""
    case = beam(100.0, [200, 2], TIP, 0.5, mu, solver={"linear": "iterative"})
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert np.allclose(solution.contact_force, force, rtol=0, atol=1e-7 * np.abs(force).max())
    assert solution.counters.contact_solves == 0


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_working_set_with_a_smoothed_pressure():
    """Others have infinite gaps there, and a bound that does not follow their own pressure."""
    case = beam(100.0, [100, 2], TIP, 0.5)
    case["friction"] = {"law": "coulomb", "mu": 0.3, "radius": 1.0}
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert "working set" in solution.history[-1].note


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_plate_over_a_gap_is_solved_without_its_dense_matrix(mu):
    """As with more than 4200 unknowns at the contact nodes, on which it has to lie down."""
    case = {
        "mesh": {"generator": "box", "size": [30.0, 30.0, 1.0], "cells": [10, 10, 1]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, 0.0, -1e-4]}],
        "contact": {"on": "bottom", "gap": 0.5},
        "friction": {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"},
    }
    dense, sparse = (
        solve(parse_case({**case, "solver": {"linear": kind}}), comm=SELF)
        for kind in ("auto", "iterative")
    )
    assert sparse.converged, sparse.outcome.reason
    assert any("interior point" in record.note for record in sparse.history)
    assert np.count_nonzero(dense.status != "open") > 3
    size = np.abs(dense.contact_force).max()
    assert np.allclose(sparse.contact_force, dense.contact_force, rtol=0, atol=1e-7 * size)


@pytest.mark.core
def test_the_force_of_the_stop_is_that_of_a_beam():
    """Euler and Bernoulli: F - 3 E' I gap/L^3, but for shear, (h/L)^2 of the difference."""
    case = beam(100.0, [200, 2], TIP, 0.5, space={"degree": 2})
    solution = solve(parse_case(case), comm=SELF)
    bending = 3 * 1 / (1 - 0.3**2) / 12 * 0.5 / 100.0**3
    assert solution.converged
    assert 1e-4 + solution.contact_force[1] == pytest.approx(bending, rel=2e-3)


def test_a_beam_clamped_at_both_ends_is_pressed_to_the_ground():
    """Its load steps ended at 0.656 of the load, and were called converged."""
    load = {"on": "top", "traction": [0.0, -3.90625e-5]}
    case = beam(40.0, [160, 4], load, 0.3, 0.3)
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert "interior point" in solution.history[-1].note
    other = solve(parse_case({**case, "solver": {"method": "penalty", "eps_contact": 1e-2}}))
    assert np.allclose(solution.contact_force[1], other.contact_force[1], rtol=2e-2)


#: A load that rounding of a long beam is not small beside.
LIGHT = {"on": "top", "traction": [0.0, -1e-13]}


def test_rounding_does_not_keep_a_long_beam_from_its_solution():
    """It cancels to 1e-5 of the loads: the condensed beam went on to the block relaxation."""
    case = beam(1000.0, [100, 1], LIGHT, 0.1, 0.8, space={"degree": 2})
    solution = solve(parse_case({**case, "solver": {"tolerance": 1e-10}}), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert 1e-10 < solution.outcome.residuals.equilibrium_rounding < 1e-7
    assert any("rounding decides how well the forces balance" in w for w in solution.warnings)


def test_an_end_that_rounding_alone_grants_is_said_to_be_to_rounding():
    """It was called converged at 1e-12, with all residuals 0."""
    case = beam(1000.0, [100, 1], LIGHT, 0.1, 0.8, space={"degree": 2})
    solution = solve(parse_case({**case, "solver": {"tolerance": 1e-12}}), comm=SELF)
    kkt = solution.outcome.residuals
    assert solution.converged
    assert 1e-12 < kkt.equilibrium <= kkt.floors[0] < 1e-6
    words = f"to rounding: the equilibrium residual is {kkt.equilibrium:.2e}, its floor "
    assert words + f"{kkt.floors[0]:.2e}" in solution.outcome.reason


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_beam_whose_tip_is_lifted_off(degree, mu):
    load = {"on": "right", "traction": [0.0, 1e-5]}
    case = beam(20.0, [80, 4], load, 0.0, mu, space={"degree": degree})
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    free = solve(parse_case({**case, "contact": {"on": "bottom", "gap": 100.0}}), comm=SELF)
    exact = free.displacement.x.array
    assert np.abs(solution.displacement.x.array - exact).max() <= 1e-2 * np.abs(exact).max()


def bent() -> dict:
    """Return a piezoelectric beam that voltage and load bend onto a conducting foundation."""
    pzt = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}
    load = {"on": "right", "traction": [0.0, -58.7 * 0.2 / 20.0**3]}
    case = beam(20.0, [80, 4], load, 0.05, 0.3)
    case["material"] = {"young": 58.7102, "poisson": 0.3912, "piezo": pzt}
    case["fixed"].append({"on": "top", "potential": 0.1})
    case["electric"] = {"k_e": 1.0, "phi_f": 0.0, "delta": 10.0}
    return case


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_beam_with_many_contact_nodes_takes_the_sparse_interior_point(mu):
    """Dense steps took five times as long; they remain for where the sparse ones fail."""
    case = parse_case(beam(100.0, [600, 2], UNIFORM, 0.5, mu))

    def none(newton, *_):
        residuals = evaluate(newton.problem, newton.last)
        return newton.last, Outcome(residuals, newton.options.allowed, "no interior point")

    sparse = solve(case, comm=SELF)
    whole = fallbacks.interior_point
    first = [none]
    with patch.object(
        fallbacks, "interior_point", lambda *a: (first.pop() if first else whole)(*a)
    ):
        dense = solve(case, comm=SELF)
    assert sparse.converged and dense.converged
    assert sparse.counters.contact_solves == 0 < dense.counters.contact_solves
    assert np.count_nonzero(sparse.status != "open") > 300
    size = np.abs(dense.contact_force).max()
    assert np.allclose(sparse.contact_force, dense.contact_force, rtol=0, atol=1e-7 * size)


#: Force at the tip of a beam on the ground.
PRESSED = 9.25925926e-11


def on_the_ground() -> dict:
    """Return a beam on the ground whose tip is pressed."""
    case = beam(300.0, [60, 3], {"on": "right", "traction": [0.0, -PRESSED]}, 0.0)
    case |= {"space": {"degree": 2}, "friction": {"law": "tresca", "bound": 8.23045267e-12}}
    case["material"]["poisson"] = 0.0
    return case


@pytest.mark.parametrize("condense", [True, False])
def test_a_beam_on_the_ground_whose_tip_is_pressed(condense):
    """From the gaps of its working set the interior point took all its steps in vain."""
    case = on_the_ground()
    solution = solve(parse_case(case), NewtonOptions(condense=condense), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.contact_force[1] == pytest.approx(-PRESSED, rel=1e-4)


@pytest.mark.parametrize("most", [4, 20])
def test_half_of_the_steps_remain_for_the_condensed_body(most):
    """The last steps after the interior point took all, and so did a single step that was left."""
    case = beam(30.0, [100, 2], {"on": "top", "traction": [0.0, -6e-4]}, 0.3, 0.3)
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    case["material"]["poisson"] = 0.45
    case["solver"] = {"max_outer": most}
    with patch.object(newton, "condensation_pays", return_value=False):
        solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.counters.contact_solves > 0
    assert len(solution.history) <= most


@pytest.mark.core
@pytest.mark.parallel
def test_ranks_agree_on_the_working_set():
    case = beam(100.0, [100, 1], TIP, 0.5, 0.3)

    def quantities(solution):
        assert solution.converged and solution.counters.contact_solves > 0
        return {"force": solution.contact_force}

    agree(lambda comm: solve(parse_case(case), comm=comm), quantities, 1e-7)


@pytest.mark.parametrize(
    ("case", "force"),
    [
        (beam(100.0, [200, 2], TIP, 0.5), [0.0, -9.9734515e-05]),
        (beam(100.0, [200, 2], TIP, 0.5, 0.3), FRICTION),
        (
            beam(80.0, [240, 3], {"on": "right", "traction": [0.0, -2e-4]}, 0.3, 0.25)
            | {"material": {"young": 2.0, "poisson": 0.3}},
            [-4.8438046e-05, -1.9908977e-04],
        ),
    ],
    ids=["tip", "friction", "stiffer"],
)
def test_the_block_relaxation_fits_r_to_a_beam(case, force):
    """With the r of a block it stalled at 1: the softest mode is 1e8 times softer."""
    solution = solve(parse_case(case), FixedPointOptions(), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert np.allclose(solution.contact_force, force, rtol=0, atol=1e-7 * np.abs(force).max())
    assert solution.counters.factorizations <= 3


def bridge(length: float) -> dict:
    """Return a beam clamped at both ends, whose middle lies on the ground."""
    load = {"on": "top", "traction": [0.0, -5 * 0.3 * 384 / 12 / length**4]}
    case = beam(length, [100, 1], load, 0.3, 0.25, space={"degree": 2})
    case["fixed"][0]["on"] = ["left", "right"]
    return case


@pytest.mark.slow
def test_the_block_relaxation_goes_on_where_contact_and_friction_fall_in_turn():
    """It ended at 2e-3 after three relaxations in which the larger one had not fallen."""
    case = parse_case(bridge(200.0))
    newton, solution = solve(case, comm=SELF), solve(case, FixedPointOptions(), comm=SELF)
    assert solution.converged, solution.outcome.reason
    size = np.abs(newton.contact_force).max()
    assert np.allclose(solution.contact_force, newton.contact_force, rtol=0, atol=1e-7 * size)


def test_a_slender_body_is_the_reason_of_a_stall():
    """By Euler and Bernoulli sigma_min is (4.73/L)^4 E' h^3/12; sigma_max is that of a block."""
    solution = solve(parse_case(bridge(120.0)), FixedPointOptions(max_outer=2), comm=SELF)
    assert not solution.converged
    found = re.search(r"by a factor of (\S+) in stiffness.*method newton", solution.outcome.reason)
    scales = solution.problem.scales
    block = 1.1 * scales.plane_modulus / scales.height
    softest = (4.73 / 120.0) ** 4 * scales.plane_modulus / 12
    assert found is not None
    assert float(found[1]) == pytest.approx(scales.c**2 / block / softest, rel=0.05)


def test_load_steps_keep_the_r_of_a_slender_body():
    """Near the solution they stall at 1e-6 with the r of a block, where no other is fitted."""
    case = beam(100.0, [200, 2], TIP, 0.5, 0.3, evolution={"times": [0.0, 1.0], "steps": [3]})
    case["load"] = [{"on": "right", "traction": ["0", "-1e-4*t"]}]
    newton = solve(parse_case(case), comm=SELF)
    solution = solve(parse_case(case), FixedPointOptions(), comm=SELF)
    assert solution.converged, solution.outcome.reason
    size = np.abs(newton.contact_force).max()
    assert np.allclose(solution.contact_force, newton.contact_force, rtol=0, atol=1e-6 * size)


def test_an_r_of_the_user_stays():
    """Another r than the given one would be a surprise in a study of r."""
    case = parse_case(beam(100.0, [200, 2], TIP, 0.5))
    solution = solve(case, FixedPointOptions(r=2.0), comm=SELF)
    assert not solution.converged
    assert "with r = 2 stalls; accepted: method newton" in solution.outcome.reason


@pytest.mark.core
def test_the_softest_mode_of_a_cantilever_is_its_first_bending_mode():
    """With masses at the contact nodes: (1.8751/L)^4 E' h^3/12, but for its shear."""
    case = parse_case(beam(40.0, [160, 2], TIP, 0.5, space={"degree": 2}))
    problem = build_problem(case, comm=SELF)
    operator = FixedPoint(problem, FixedPointOptions()).operator
    shift = 1e-12 * problem.scales.c
    found = softest_mode(problem, operator, problem.start(), shift)
    assert found == pytest.approx(1.8751**4 / 40.0**4 * problem.scales.plane_modulus / 12, rel=5e-3)


@pytest.mark.core
def test_the_softest_mode_is_the_same_over_a_foundation_with_a_given_motion():
    """Forces on the motion of a foundation stand behind those on the nodes."""
    found = []
    for rigid in ({}, {"rigid": {"displacement": [0.0, 0.1]}}):
        case = beam(10.0, [40, 2], TIP, 0.5)
        case["contact"] |= rigid
        problem = build_problem(parse_case(case), comm=SELF)
        operator = FixedPoint(problem, FixedPointOptions()).operator
        shift = 1e-12 * problem.scales.c
        found.append(softest_mode(problem, operator, problem.start(), shift))
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def test_the_block_relaxation_solves_iteratively_over_a_foundation_with_a_given_motion():
    case = beam(2.0, [20, 10], {"on": "top", "traction": [0.0, -1e-2]}, 0.0, 0.3)
    case["contact"]["rigid"] = {"displacement": [0.0, 1e-3]}
    newton = solve(parse_case(case), comm=SELF)
    solution = solve(parse_case(case), FixedPointOptions(linear="iterative"), comm=SELF)
    assert solution.converged, solution.outcome.reason
    size = np.abs(newton.contact_force).max()
    assert np.allclose(solution.contact_force, newton.contact_force, rtol=0, atol=1e-6 * size)


@pytest.mark.parametrize(("poisson", "far"), [(0.3, False), (0.4999, True)])
def test_what_clamps_bear_does_not_hide_what_is_left_of_the_loads(poisson, far):
    """Two methods were 4e-4 apart, and said nothing: clamps bear 5000 times the loads."""
    load = {"on": "top", "traction": [0.0, -6e-10]}
    supports = [{"on": side, "displacement": [0.0, 0.0]} for side in ("left", "right")]
    case = beam(300.0, [300, 1], load, 0.3, space={"degree": 2}, fixed=supports)
    case["material"]["poisson"] = poisson
    case["solver"] = {"tolerance": 1e-7}  # what is granted to rounding is below it
    found = solve(parse_case(case), comm=SELF)
    assert found.converged and found.equilibrium_rounding < 1e-7
    assert any("of loads and contact forces are out of" in w for w in found.warnings) == far


def curved(thickness: float, begin: float, end: float, cells: list[int]) -> Domain:
    """Return a piece of a ring with the radius 10; left and right are its ends."""
    made = rectangle(MPI.COMM_SELF, [0.0, 0.0], [1.0, 1.0], cells)
    x = made.mesh.geometry.x
    angle, radius = begin + (end - begin) * x[:, 0], 10.0 + thickness * (x[:, 1] - 0.5)
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return from_mesh(made.mesh, {name: made.facets(name) for name in made.names})


def flattened(kind: str, thickness: float, mu: float) -> Solution:
    """Press half a ring by 8 of 20, or an arch of 60 degrees with fixed feet, on a plane."""
    case = beam(1.0, [200, 2], TIP, 0.0, mu)
    if kind == "ring":
        domain = curved(thickness, -np.pi / 2, np.pi / 2, [200, 2])
        supports, part, level = [[0.0, "free"], [0.0, -8.0]], "top", -10.0 - thickness / 2
        case["load"] = []
    else:
        domain = curved(thickness, np.pi / 3, 2 * np.pi / 3, [200, 2])
        supports, part, level = [[0.0, 0.0]] * 2, "bottom", 10.0 * np.sin(np.pi / 3) - thickness
        pressed = 0.6 * thickness * max(thickness, 0.1)
        case["load"] = [{"on": "top", "traction": [0.0, -pressed]}]
    ends = zip(("left", "right"), supports, strict=True)
    case["fixed"] = [{"on": side, "displacement": given} for side, given in ends]
    plane = {"shape": "plane", "point": [0.0, level], "normal": [0.0, 1.0]}
    case["contact"] = {"on": part, "foundation": plane}
    return solve(parse_case(case), domain=domain)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("thickness", [0.1, 1.0])
@pytest.mark.parametrize("kind", ["ring", "arch"])
def test_rings_and_arches_pressed_flat(kind, thickness, mu):
    solution = flattened(kind, thickness, mu)
    assert solution.converged, solution.outcome.reason
    touching = np.count_nonzero(solution.status != "open")
    assert touching >= 2 if kind == "ring" else touching > 100
