"""A body in a clearance: a rigid motion costs nothing, and the least of all is taken.

The block relaxation of bodies that friction alone keeps from sliding.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.optimize import minimize

from contact import FixedPointOptions, NewtonOptions, build_problem, parse_case, solve
from contact.methods.newton import Newton
from contact.methods.unconstrained_modes import UnconstrainedModes, _least_distance
from contact.problem.rigid_modes import groups
from contact.thesis.fixed_point import FixedPoint
from scripts.studies.robustness.bodies import Bodies
from scripts.studies.robustness.check import write_msh
from tests.problems import pairs
from tests.problems.rings import between_plates, squeezed

COMM = MPI.COMM_WORLD


@pytest.mark.core
@pytest.mark.parallel
def test_the_least_of_all_places():
    """The lid is lifted: the ring may go anywhere in between. It does not depend on the ranks."""
    solution = solve(squeezed("newton", way=0.01), domain=between_plates(COMM, 0))
    problem, state, nodes = solution.problem, solution.state, solution.problem.nodes
    assert solution.converged
    assert nodes.maximum(solution.multipliers.contact) < 1e-14  # rounding of E
    assert solution.outcome.reason.startswith("all residuals <= 1e-08")
    (said,) = [text for text in solution.warnings if "nothing holds" in text]
    motions = "translation along x, translation along y, rotation"
    assert f"nothing holds ring against rigid motions ({motions})" in said

    modes, body = UnconstrainedModes.of(problem), problem.body
    found = modes.free_motion(problem, state)
    assert not found.limited
    assert np.abs(found.motion).max() < 1e-9
    # Whatever motion is added, the least of all takes it off.
    (group,) = groups(problem)
    ring = int(np.argsort(group.centres[:, 1])[1])
    columns = group.moved[:, 3 * ring : 3 * ring + 3]
    for amounts in ([0.01, 0.0, 0.0], [0.0, 0.02, 0.01], [-0.3, -0.2, 0.1]):
        elsewhere = replace(state, x=body.updated(state.x, columns @ np.array(amounts)))
        found = modes.free_motion(problem, elsewhere)
        assert not found.limited
        back = body.updated(elsewhere.x, -found.motion)
        np.testing.assert_allclose(nodes.jump(back), nodes.jump(state.x), rtol=0, atol=1e-9)
    # Relative to the lid that were half of its way.
    lifted = body.nodal(state.x)[: group.connected_component.size]
    assert (
        nodes.comm.allreduce(
            np.abs(lifted[group.connected_component == ring]).max(initial=0), MPI.MAX
        )
        < 1e-9
    )


@pytest.mark.parallel
def test_a_ring_that_a_lid_pushes_aside():
    """Without friction nothing presses: rounding was compared with none, 2e16 for a residual."""
    tables = {
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [
            {"on": "plate_bottom", "displacement": [0.0, 0.0]},
            {"on": "lid_top", "displacement": [0.0, -0.002]},
        ],
        "contact": [
            {"on": "plate_top", "against": "ring_outside"},
            {"on": "ring_outside", "against": "lid_bottom"},
        ],
    }
    case = parse_case(tables)
    solution = solve(case, domain=between_plates(COMM, 1))
    assert solution.converged, solution.outcome.reason
    assert solution.problem.nodes.maximum(solution.multipliers.contact) == 0
    assert solution.outcome.residuals.equilibrium < 1e-12
    # Strains are rounding: the estimate was 59 % of them, and a warning.
    assert solution.error is not None and solution.error.relative == 0


@pytest.mark.filterwarnings("error::RuntimeWarning")  # NumPy warned of steps that went too far
@pytest.mark.parametrize("seed", [1, 2, 6, 8])
def test_a_loaded_ring_that_lies_on_a_plate(seed):
    """By friction at all nodes that may touch, it would hang between the plates at first."""
    case = squeezed("newton", way=0.3, traction=(0.0, -1e-3))
    solution = solve(case, domain=between_plates(COMM, seed))
    assert solution.converged
    nodes = solution.problem.nodes
    pressed = nodes.sum(solution.multipliers.contact * nodes.normal[:, 1])
    assert abs(pressed) == pytest.approx(1e-3 * np.pi, rel=0.02)  # a polygon in a circle


@pytest.mark.core
@pytest.mark.parametrize("seed", range(5))
def test_least_distance_by_another_method(seed):
    rng = np.random.default_rng(seed)
    root, cone, wanted = rng.standard_normal((4, 3)), rng.standard_normal((6, 3)), rng.random(3)
    products, room = root.T @ root, rng.random(6) / 10
    found = _least_distance(products, wanted, cone, -room)
    other = minimize(
        lambda q: (q - wanted) @ products @ (q - wanted),
        np.zeros(3),
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda q: cone @ q + room},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert np.all(cone @ found + room > -1e-12)
    np.testing.assert_allclose(found, other.x, rtol=0, atol=1e-6)


def pads(folder, seed):
    """Return two pads that a lid presses, and lets go."""
    bodies = Bodies(np.random.default_rng(seed))
    for name, (left, right, low, high) in {
        "base": (-2.0, 2.0, -1.0, 0.0), "p0": (-1.4, -0.8, 0.0, 0.4),
        "p1": (0.8, 1.4, 0.0, 0.4), "lid": (-2.0, 2.0, 0.4, 1.0),
    }.items():  # fmt: skip
        bodies.block(name, [[left, low], [right, low], [right, high], [left, high]], 0.2)
    write_msh(bodies.mesh(), folder / "pads.msh")
    young = {"base": 1.0, "p0": 1.0, "p1": 1.0, "lid": 1.0}
    return parse_case({
        "mesh": {"file": str(folder / "pads.msh")},
        "material": [{"on": on, "young": value, "poisson": 0.3} for on, value in young.items()],
        "fixed": [
            {"on": "base_bottom", "displacement": [0.0, 0.0]},
            {"on": "lid_top", "displacement": [0.0021, -0.003], "amplitude": "d"},
        ],
        "contact": [
            {"on": f"{pad}_{side}", "against": other, "friction": {"law": "coulomb", "mu": 0.2}}
            for pad in ("p0", "p1")
            for side, other in (("bottom", "base_top"), ("top", "lid_bottom"))
        ],
        "evolution": {
            "times": [0.0, 1.0, 2.0],
            "steps": [1, 3],
            "amplitudes": {"d": {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, -0.3]}},
        },
    })  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_two_pads_that_are_lifted_off_stay_where_they_were(seed, tmp_path):
    """Nothing presses any more, and forces are rounding: one was returned as far as 1e10 away."""
    solution = solve(pads(tmp_path, seed), comm=MPI.COMM_SELF)
    assert solution.converged
    assert np.abs(solution.state.x).max() < 0.01


def between_jaws(folder, weight):
    """Return a block that jaws touch aslant: it turns out of their way, and falls."""
    bodies = Bodies(np.random.default_rng(0))
    turn = np.array([[np.cos(0.05), np.sin(0.05)], [-np.sin(0.05), np.cos(0.05)]])
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) @ turn
    x = float(square[:, 0].max())
    bodies.block("a", [[-2.0, -0.6], [-x, -0.6], [-x, 0.6], [-2.0, 0.6]], 0.25)
    bodies.block("m", square.tolist(), 0.2)
    bodies.block("z", [[x, -0.6], [2.0, -0.6], [2.0, 0.6], [x, 0.6]], 0.25)
    write_msh(bodies.mesh(), folder / "row.msh")
    friction = {"law": "coulomb", "mu": 0.2}
    return parse_case({
        "mesh": {"file": str(folder / "row.msh")},
        "material": {"young": 1.0, "poisson": 0.1},
        "fixed": [
            {"on": "a_left", "displacement": [0.0015, 0.0]},
            {"on": "z_right", "displacement": [-0.0015, 0.0]},
        ],
        "load": [{"everywhere": True, "body_force": [0.0, -weight]}],
        "contact": [
            {"on": "m_left", "against": "a_right", "friction": friction},
            {"on": "m_right", "against": "z_left", "friction": friction},
        ],
    })  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_falling_body_overflows_without_a_word(tmp_path, monkeypatch):
    """Where nothing tells that it falls, steps end with infinite forces: NumPy warned of NaN."""
    monkeypatch.setattr(UnconstrainedModes, "overloaded", lambda *_: False)
    lost = solve(between_jaws(tmp_path, 0.1), comm=MPI.COMM_SELF)
    assert not lost.converged and not lost.outcome.overloaded
    # That it has moved far, and that the nodes that touch at last do not hold it, proves nothing.
    assert not any("[not-held]" in text for text in lost.warnings)


@pytest.mark.parametrize("weight", [1e-5, 1e-3])
def test_a_block_that_jaws_touch_aslant_is_said_to_fall(weight, tmp_path):
    """The end was "not converged" after 350 solves, and no more."""
    solution = solve(between_jaws(tmp_path, weight), comm=MPI.COMM_SELF)
    assert not solution.converged
    (said,) = [text for text in solution.warnings if "[not-held]" in text]
    assert "cannot hold m (" in said
    assert "translation along y" in said


def boxes(folder, **blocks):
    """Write a mesh of rectangles, name=(left, right, low, high, size), and return its file."""
    bodies = Bodies(np.random.default_rng(0))
    for name, (left, right, low, high, size) in blocks.items():
        bodies.block(name, [[left, low], [right, low], [right, high], [left, high]], size)
    write_msh(bodies.mesh(), folder / "boxes.msh")
    return {"file": str(folder / "boxes.msh")}


@pytest.mark.parametrize("method", ["newton", "uzawa", "penalty"])
def test_two_pads_that_a_lid_pushes_go_no_farther_than_they_must(method, tmp_path):
    """By 0.02 and 0.03 downwards: they had turned, as gaps where they just touch are rounding."""
    case = {
        "mesh": boxes(tmp_path, base=(-2.0, 2.0, -1.0, 0.0, 0.5), low=(-1.0, 0.2, 0.05, 0.55, 0.25),
                      high=(-0.8, 0.9, 0.56, 1.0, 0.25), lid=(-2.0, 2.0, 1.02, 1.5, 0.5)),
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [
            {"on": "base_bottom", "displacement": [0.0, 0.0]},
            {"on": "lid_top", "displacement": [0.01, -0.05]},
        ],
        "contact": [
            {"on": "low_bottom", "against": "base_top"},
            {"on": "low_top", "against": "high_bottom"},
            {"on": "high_top", "against": "lid_bottom"},
        ],
        "friction": {"law": "coulomb", "mu": 0.3},
        "solver": {"method": method},
    }  # fmt: skip
    solution = solve(parse_case(case), comm=MPI.COMM_SELF)
    assert solution.converged, solution.outcome.reason
    body = solution.problem.body
    heights, moved = body.space.tabulate_dof_coordinates()[:, 1], body.nodal(solution.state.x)
    for low, high, way in ((0.04, 0.555, -0.02), (0.555, 1.01, -0.03)):
        own = moved[(heights > low) & (heights < high), :2]
        np.testing.assert_allclose(own, np.broadcast_to([0.0, way], own.shape), atol=1e-8)


@pytest.mark.parametrize("degree", [1, 2])
def test_least_displacements_are_orthogonal_to_rigid_motions(degree, tmp_path):
    """In L2, by UFL: of degree 2 they were off by up to 1e-2 of the displacements."""
    case = {
        "mesh": boxes(
            tmp_path, base=(-2.0, 2.0, -1.0, 0.0, 0.5), free=(-1.0, 0.2, 0.05, 0.75, 0.3)
        ),
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "base_bottom", "displacement": [0.0, 0.0]}],
        "load": [
            {"on": "free_left", "traction": ["-0.02*(y - 0.4)**3", 0.0]},
            {"on": "free_right", "traction": ["0.02*(y - 0.4)**3", 0.0]},
        ],
        "contact": [{"on": "free_bottom", "against": "base_top"}],
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    solution = solve(parse_case(case), comm=MPI.COMM_SELF)
    body = solution.problem.body
    u = fem.Function(body.space)
    u.x.array[:] = solution.state.x[: u.x.array.size]
    x = ufl.SpatialCoordinate(body.space.mesh)
    free = ufl.conditional(ufl.gt(x[1], 0.02), 1.0, 0.0)

    def product(first, second):
        return fem.assemble_scalar(fem.form(free * ufl.inner(first, second) * ufl.dx))

    motions = [ufl.as_vector([1.0, 0.0]), ufl.as_vector([0.0, 1.0]), ufl.as_vector([-x[1], x[0]])]
    assert solution.converged and product(u, u) > 0
    for motion in motions:
        size = np.sqrt(product(u, u) * product(motion, motion))
        assert abs(product(u, motion)) < 1e-9 * size


def pushed(push):
    """Return a block that friction alone holds."""
    return {
        "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [16, 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "top", "traction": [0.4 * push * 0.01, -0.01]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.4},
    }


def stack():
    """Return two blocks on a plane, which friction alone holds."""
    case = pairs.case(
        load=[{"on": "upper_top", "traction": [0.45, -1.0]}],
        friction={"law": "coulomb", "mu": 0.6},
        contact=[{"on": "upper_bottom", "against": "lower_top"}, {"on": "lower_bottom"}],
    )
    del case["fixed"]
    return case


def on_a_bent_one():
    """Return a block that lies lightly on one that is bent."""
    return pairs.case(
        load=[{"on": "upper_top", "traction": [0, -1e-6]}],
        fixed=[{"on": "lower_bottom", "displacement": ["1e-3*x", "1e-3*x*x"]}],
    )


def relaxed(case):
    """Return the loop that has solved a case by block relaxation, and its state."""
    loop = FixedPoint(
        build_problem(parse_case(case), MPI.COMM_SELF), FixedPointOptions(tolerance=1e-9)
    )
    state, outcome = loop.solve()
    assert outcome.converged, outcome.reason
    return loop, state


@pytest.mark.core
@pytest.mark.parametrize("case", [pushed(0.3), pushed(0.97), stack()], ids=["0.3", "0.97", "stack"])
def test_what_friction_alone_holds_is_stuck_at_first(case):
    """Without friction, as the thesis begins, it would slide away: it stalled at 1e-2."""
    loop, state = relaxed(case)
    exact, outcome = Newton(loop.problem, NewtonOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    np.testing.assert_allclose(state.x, exact.x, rtol=0, atol=1e-7 * np.abs(exact.x).max())


def test_a_body_that_lies_lightly_on_one_that_is_bent():
    """What bends the lower one is far more than friction has to bear: it stalled at 4e-1."""
    loop, state = relaxed(on_a_bent_one())
    problem = loop.problem
    pressed = problem.interface.nodes.sum(state.multipliers.contact * problem.nodes.normal[:, 1])
    assert abs(pressed) == pytest.approx(2e-6, rel=1e-6)  # 2 wide
