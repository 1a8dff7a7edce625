"""Bodies that a layer without a rigid part alone holds: it bears less than stiffness x limit."""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Layer, Linear, Load, Problem
from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.methods import fallbacks
from contact.problem.checks import check_rigid_modes
from contact.solving import solve
from forms.laws import PotentialFactor

SELF = MPI.COMM_SELF
STIFFNESS, LIMIT = 500.0, 0.003
LARGEST = STIFFNESS * LIMIT

#: Mesh, sides of symmetry, and area of the base, of blocks of height 1.
BLOCKS = {
    "plane": (("rectangle", [2.0, 1.0], [6, 3]), {"left": "x"}, 2.0),
    "solid": (("box", [2.0, 1.0, 1.0], [3, 2, 2]), {"left": "x", "front": "y"}, 2.0),
    "revolved": (("rectangle", [2.0, 1.0], [6, 3]), {}, 4 * np.pi),
}


def block(kind: str, share: float, mu: float = 0.0, **more) -> dict:
    """Return a block that a share of the largest pressure presses on the layer."""
    (generator, size, cells), sides, _ = BLOCKS[kind]
    revolved = {"kinematics": "axisymmetric"} if kind == "revolved" else {}
    return {
        "mesh": {"generator": generator, "size": size, "cells": cells},
        "space": revolved,
        "material": {"young": 1000.0, "poisson": 0.0},
        "fixed": [{"on": side, "symmetry": axis} for side, axis in sides.items()],
        "load": [{"on": "top", "pressure": share * LARGEST}],
        "contact": {
            "on": "bottom",
            "law": "compliance",
            "layer": np.inf,
            "stiffness": STIFFNESS,
            "limit": LIMIT,
        },
        "friction": {"law": "coulomb", "mu": mu} if mu else {"law": "none"},
        **more,
    }


@pytest.mark.core
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("share", [0.05, 0.6, 0.95, 0.999])
@pytest.mark.parametrize("kind", BLOCKS)
def test_a_layer_bears_up_to_its_limit(kind, share, mu):
    """From a third of the limit on Newton's method ended at displacements of 1e13."""
    solution = solve(parse_case(block(kind, share, mu)), comm=SELF)
    assert solution.converged, solution.outcome.reason
    pressed = share * LARGEST
    assert solution.pressure == pytest.approx(pressed, rel=1e-6)
    # The base sinks by p/k, the top by the compression p/E more.
    assert solution.max_displacement == pytest.approx(pressed / STIFFNESS + pressed / 1e3, rel=1e-6)


@pytest.mark.core
@pytest.mark.parametrize("kind", BLOCKS)
def test_loads_beyond_the_limit_are_refused_with_both(kind):
    area = BLOCKS[kind][2]
    with pytest.raises(InputError, match=r"\[saturated\]") as refused:
        solve(parse_case(block(kind, 1.02)), comm=SELF)
    message = str(refused.value)
    forces = f"they are {1.02 * LARGEST * area:.6g}, it bears less than {LARGEST * area:.6g}"
    assert forces in message
    assert f"largest pressure of {LARGEST:.4g} (stiffness x limit)" in message


@pytest.mark.parametrize("excess", [1e-5, 1e-8])
def test_loads_just_beyond_the_limit_are_told_from_it(excess):
    """With six digits both read alike."""
    with pytest.raises(InputError, match=r"\[saturated\]") as refused:
        solve(parse_case(block("plane", 1 + excess)), comm=SELF)
    words = r"they are (\S+), it bears less than (\S+),"
    loads, borne = re.search(words, str(refused.value)).groups()
    assert loads != borne and float(loads) > float(borne)


@pytest.mark.core
@pytest.mark.parametrize("kind", BLOCKS)
def test_a_load_of_exactly_the_limit_is_refused(kind):
    """Its position is undetermined, as without a support; a hundred-thousandth less is borne."""
    with pytest.raises(InputError, match=r"\[saturated\]"):
        build_problem(parse_case(block(kind, 1.0)), SELF)
    build_problem(parse_case(block(kind, 1.0 - 1e-5)), SELF)


#: Friction whose bound is no multiple of the pressure at its node.
GIVEN_BOUNDS = {
    "tresca": {"law": "tresca", "bound": 0.4 * LARGEST},
    "smoothed": {"law": "coulomb", "mu": 0.3, "radius": 0.7},
}


@pytest.mark.parametrize("friction", GIVEN_BOUNDS)
@pytest.mark.parametrize("kind", BLOCKS)
def test_other_friction_laws_leave_the_limit_as_it_is(kind, friction):
    """They were not analysed: the body fell through the layer."""
    more = {"friction": GIVEN_BOUNDS[friction]}
    solution = solve(parse_case(block(kind, 0.97, **more)), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.pressure == pytest.approx(0.97 * LARGEST, rel=1e-6)
    with pytest.raises(InputError, match=r"\[saturated\]"):
        solve(parse_case(block(kind, 1.02, **more)), comm=SELF)


@pytest.mark.parametrize(("share", "constrained"), [(0.95, True), (1.05, False)])
@pytest.mark.parametrize("kind", ["plane", "solid"])
def test_a_given_friction_bound_holds_along_the_layer(kind, share, constrained):
    """A body force along the base slides the block where it is more than the bound on its area."""
    case = block(kind, 0.5, friction=GIVEN_BOUNDS["tresca"])
    case["fixed"] = case["fixed"][1:]
    along = [share * 0.4 * LARGEST, *[0.0] * (1 if kind == "plane" else 2)]
    case["load"].append({"everywhere": True, "body_force": along})
    if constrained:
        build_problem(parse_case(case), SELF)
        return
    with pytest.raises(InputError, match=r"along it by more than friction holds.*\[pulled-off\]"):
        build_problem(parse_case(case), SELF)


@pytest.mark.parametrize("kind", BLOCKS)
def test_forces_are_told_of_a_translation_of_several_parts(kind):
    """Of a body and the plate on top of it, which move as one, a ratio was told."""
    case = block(kind, 0.0)
    force = 1.02 * LARGEST * BLOCKS[kind][2]
    across = [0.0] * (2 if kind == "solid" else 1)
    plate = {"on": "top", "displacement": [*across, "free"], "force": [*across, -force]}
    case |= {"load": [], "fixed": [], "rigid": [plate]}
    with pytest.raises(InputError, match=r"\[saturated\]") as refused:
        build_problem(parse_case(case), SELF)
    assert f"they are {force:.6g}, it bears less than {force / 1.02:.6g}" in str(refused.value)


def tilted(kind: str, stiffness: float) -> tuple[dict, float]:
    """Return a block that tilts on its saturated layer against springs, and its displacement.

    Of its load P the half of the layer next to it bears all, with the moment P/2; the linear part
    of the load has the moment 2/3 P. Springs along x on the right side bear the rest, by a rotation
    about their middle with the stiffness k/12. The node in the middle of the base stays.
    """
    case = block(kind, 0.0, elastic=[{"on": "right", "stiffness": [stiffness, 0.0, 0.0]}])
    if kind == "plane":
        case["elastic"][0]["stiffness"].pop()
    case["fixed"] = case["fixed"][1:]
    case["material"]["young"] = 1e6
    case["load"] = [{"on": "top", "pressure": f"{LARGEST}*(0.5 + x - 1)"}]
    rotation = LARGEST / 6 / (stiffness / 12)
    return case, rotation * np.hypot(1.0, 0.5)


@pytest.mark.core
@pytest.mark.parametrize("stiffness", [1.0, 30.0])
@pytest.mark.parametrize("kind", ["plane", "solid"])
def test_springs_bear_a_moment_that_is_too_large_for_the_layer(kind, stiffness):
    """Secants came nearer by 8 % each, and Newton's method ended at displacements of 1e11."""
    case, displacement = tilted(kind, stiffness)
    case["mesh"]["cells"][0] = 6
    for method in ("newton", "uzawa", "penalty"):
        solution = solve(parse_case({**case, "solver": {"method": method}}), comm=SELF)
        assert solution.converged, solution.outcome.reason
        assert solution.max_displacement == pytest.approx(displacement, rel=2e-2)


@pytest.mark.parametrize("limit", [LIMIT, np.inf])
@pytest.mark.parametrize("share", [0.05, 0.6, 0.95])
@pytest.mark.parametrize("kind", BLOCKS)
def test_the_penalty_method_presses_on_a_layer_that_touches(kind, share, limit):
    """Its first matrix had no stiffness at a layer that just touches, and all of it stayed at 0."""
    case = block(kind, share, solver={"method": "penalty"})
    case["contact"]["limit"] = limit
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    pressed = share * LARGEST
    assert solution.pressure == pytest.approx(pressed, rel=1e-6)
    assert solution.max_displacement == pytest.approx(pressed / STIFFNESS + pressed / 1e3, rel=1e-6)


def test_a_load_aside_tilts_a_block_until_the_layer_is_saturated_there():
    """Its moment is M; rigid and linear, the pressure F/A + M x/I would be above the limit."""
    case = block("plane", 0.0, fixed=[{"on": "left", "displacement": ["free", 0.0]}])
    case["fixed"] = []
    case["material"]["young"] = 1e6
    case["friction"] = {"law": "coulomb", "mu": 0.3}
    case["load"] = [{"on": "top", "traction": ["0", f"-{LARGEST}*0.6*(0.1+0.9*x)"]}]
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.contact_force[1] == pytest.approx(-2 * LARGEST * 0.6, rel=1e-6)
    assert solution.pressure.max() == pytest.approx(LARGEST, rel=1e-9)


def pulled(kind: str, height: float, share: float, part: float, **more) -> dict:
    """Return a block on the layer that a part of the largest friction, 0.3 F, pulls along it."""
    case = block(kind, 0.0, mu=0.3, fixed=[], **more)
    size = [4.0, height] if kind == "plane" else [4.0, 2.0, height]
    cells = [16, 4 if height == 1.0 else 2] if kind == "plane" else [8, 4, 2]
    across = [0.0] * (len(size) - 2)
    case["mesh"] |= {"size": size, "cells": cells}
    case["material"]["poisson"] = 0.3
    down = share * LARGEST
    case["load"] = [{"on": "top", "traction": [part * 0.3 * down, *across, -down]}]
    return case


@pytest.mark.core
@pytest.mark.parametrize(
    ("height", "share", "part"),
    [(1.0, 0.53, 0.9), (1.0, 0.8, 0.97), (0.2, 0.53, 0.9), (0.2, 0.93, 0.97)],
)
@pytest.mark.parametrize("kind", ["plane", "solid"])
def test_friction_alone_holds_a_block_along_the_layer(kind, height, share, part):
    """The elastic bed of the first secant was not solved: the block slid by 1e12."""
    solutions = [
        solve(parse_case(pulled(kind, height, share, part, solver={"method": method})), comm=SELF)
        for method in ("newton", "uzawa")
    ]
    for solution in solutions:
        assert solution.converged, solution.outcome.reason
    newton, uzawa = solutions
    down = share * LARGEST * (4.0 if kind == "plane" else 8.0)
    assert newton.contact_force[[0, -1]] == pytest.approx([part * 0.3 * down, -down], rel=1e-6)
    assert newton.max_displacement == pytest.approx(uzawa.max_displacement, rel=1e-4)


@pytest.mark.parametrize("height", [1.0, 2.0])
def test_the_block_relaxation_fits_r_to_the_layer_below_a_stiff_body(height):
    """With the r of a block it stalled at .03 and .3: the layer is 1e6 times softer."""
    case = pulled("plane", height, 0.05, 0.7)
    case["mesh"]["cells"] = [10, 2 + round(height)]
    case["material"]["young"] = 1e9
    newton, uzawa = (
        solve(parse_case({**case, "solver": {"method": method}}), comm=SELF)
        for method in ("newton", "uzawa")
    )
    assert newton.converged and uzawa.converged, uzawa.outcome.reason
    assert uzawa.max_displacement == pytest.approx(newton.max_displacement, rel=1e-6)


@pytest.mark.parametrize(("share", "limit"), [(0.8, LIMIT), (0.99, LIMIT), (0.8, 100 * LIMIT)])
@pytest.mark.parametrize("height", [0.2, 2.0])
@pytest.mark.parametrize("kind", ["plane", "solid"])
def test_a_body_that_slides_is_not_said_to_be_pushed_through(kind, height, share, limit):
    """It tilts too, so that a part of the layer resisted; no larger limit would hold it."""
    case = pulled(kind, height, share, 1.4)
    case["contact"]["limit"] = limit
    with pytest.raises(InputError, match=r"along it by more than friction holds.*\[pulled-off\]"):
        build_problem(parse_case(case), SELF)


def test_pressures_out_of_balance_prove_no_sliding(monkeypatch):
    """Pressures of half the load bound friction to half: "cannot hold the body" was false."""
    monkeypatch.setattr(fallbacks, "layer_secants", lambda _: None)
    lost = solve(parse_case(pulled("plane", 1.0, 0.53, 0.9)), comm=SELF)
    assert not lost.converged and not lost.outcome.overloaded
    assert not any("[not-held]" in text for text in lost.warnings)


@pytest.mark.parametrize("share", [0.3, 0.95])
def test_a_layer_bears_a_piezoelectric_body(share):
    """It had stalled with the whole layer saturated, and beyond the limit it fell through."""
    crystal = {"c11": 126.0, "c12": 79.5, "c13": 84.1, "c33": 117.0, "c44": 23.0}
    piezo = {"e31": -6.5, "e33": 23.3, "e15": 17.0, "beta11": 15.0, "beta33": 13.0}
    case = block("plane", share) | {"material": {"law": "anisotropic", **crystal, "piezo": piezo}}
    case["fixed"].append({"on": ["top", "bottom"], "potential": 0.0})
    case["contact"]["potential_factor"] = 1.0
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.pressure == pytest.approx(share * LARGEST, rel=1e-2)
    case["load"][0]["pressure"] = 1.02 * LARGEST
    with pytest.raises(InputError, match=r"\[saturated\]"):
        solve(parse_case(case), comm=SELF)


@pytest.mark.parametrize("share", [0.6, 0.97, 1.5])
def test_an_elastic_support_bears_what_the_layer_does_not(share):
    """It is weaker than the layer, so that the active set cycled; k u + p = share P."""
    case = block("plane", share) | {"elastic": [{"on": "top", "normal": 1.0}]}
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    lifted = 2.0 * share * LARGEST + solution.contact_force[1]
    assert lifted == pytest.approx(2.0 * solution.max_displacement, rel=1e-6)


def test_load_steps_end_where_the_layer_is_saturated():
    """The load 0.6 t (3 - t) of the limit is above it from t = 0.736 on, and 0 at the end."""
    case = block("plane", 0.0, evolution={"times": [0.0, 3.0], "steps": [6]})
    case["load"] = [{"on": "top", "traction": ["0", f"-{0.6 * LARGEST}*t*(3 - t)"]}]
    solution = solve(parse_case(case), comm=SELF)
    when = (3 - np.sqrt(9 - 4 / 0.6)) / 2
    assert not solution.converged
    words = r"from t = (\S+) on the loads push the body through the layer"
    said = re.search(words, solution.outcome.reason)
    assert said is not None and float(said[1]) == pytest.approx(when, rel=1e-5)
    # Halves of a step come as near as 1/16 of it.
    assert when - 0.5 / 16 <= solution.steps[-1].row["t"] <= when


def test_a_saturated_layer_under_a_held_body_is_no_fault():
    case = block("plane", 3.0)
    case["fixed"].append({"on": "right", "displacement": [0.0, 0.0]})
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged, solution.outcome.reason
    assert solution.pressure.max() == pytest.approx(LARGEST, rel=1e-9)


@dataclass
class Falling:
    """p_nu(s) = s e^(1 - s/a) is largest at s = a, and 0 far beyond."""

    a: float = LIMIT

    def __call__(self, s):
        depth = np.maximum(s, 0.0)
        return depth * np.exp(1 - depth / self.a)

    def derivative(self, s):
        depth = np.maximum(s, 0.0)
        return np.where(s > 0, (1 - depth / self.a) * np.exp(1 - depth / self.a), 0.0)


@pytest.mark.core
@pytest.mark.parametrize("law", ["log", "linear"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize(("down", "limit"), [(0.01, 0.002), (0.02, 0.001), (0.1, 0.002)])
def test_a_layer_that_saturates_before_a_rigid_part(down, limit, mu, law):
    """Newton's method went from all open to all closed and back; pressed onto the rigid part too.

    The rigid part is 0.05 behind a layer that is nearly touched; the body moves by more than the
    limit.
    """
    young, stiffness, thickness, apart = 0.2, 2.45, 0.05, 1e-9
    material = {"young": young, "poisson": 0.0}
    if law == "log":
        material |= {"law": "log", "yield_strain": 10.0}
    solution = solve(
        parse_case(
            {
                "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [9, 5]},
                "material": material,
                "fixed": [{"on": "top", "displacement": [0.0, -down]}],
                "contact": {
                    "on": "bottom",
                    "gap": thickness + apart,
                    "law": "compliance",
                    "layer": thickness,
                    "stiffness": stiffness,
                    "limit": limit,
                },
                "friction": {"law": "coulomb", "mu": mu} if mu else {"law": "none"},
            }
        ),
        comm=SELF,
    )
    assert solution.converged, solution.outcome.reason
    # E (down - s) = k min(s, limit) without a rigid part, else s = 0.05 and the rest is on that.
    below = young * down / (young + stiffness)
    sinks = below if below < limit else down - stiffness * limit / young
    pressed = young * (down - min(sinks, thickness))
    assert solution.pressure == pytest.approx(pressed, rel=1e-6)


def test_a_layer_that_falls_is_not_said_to_be_saturated():
    """It bears a load though its pressure far inside is 0, which was taken for its largest."""
    domain = build_problem(parse_case(block("plane", 0.5)), SELF).domain
    layer = Layer(np.inf, Falling(), PotentialFactor(STIFFNESS))
    load = Load("top", [0.0, -0.5 * LARGEST])
    body = Body(Linear(1e3, 0.0), [Fixed("left", [0.0, "free"])], [load])
    problem = Problem(domain, body, Contact("bottom", layer=layer))
    check_rigid_modes(problem)
    assert np.isinf(problem.interface.largest_pressure).all()


@pytest.mark.parallel
def test_ranks_agree_on_a_saturated_layer():
    case = parse_case(block("solid", 0.95, 0.3))
    shared, alone = solve(case), solve(case, comm=SELF)
    assert shared.converged
    assert np.allclose(shared.contact_force, alone.contact_force, rtol=1e-8, atol=1e-10)
    with pytest.raises(InputError, match=r"\[saturated\]"):
        solve(parse_case(block("solid", 1.02)))
