"""Partial slip of any plane profile: Jaeger (1997), Ciavarella (1998).

q = mu (p(x; P) - p(x; P - Q/mu)), with pressures of the frictionless problem. It asks that shear
does not press: two equal bodies, else Dundurs' second parameter comes in with the friction that
pressing alone makes.
"""

import numpy as np
import pytest

pytest.importorskip("gmsh")
from contact import NewtonOptions, build_problem, evolve, parse_case

MU = 0.3


def profiles(size, below=1000.0, mu=MU):
    """Return two half cylinders whose gap has been altered, pressed together and pushed."""
    data = {
        "mesh": {"generator": "two_half_cylinders", "contact_size": size, "contact_width": 0.7},
        "material": [
            {"on": "upper", "young": 1000.0, "poisson": 0.3},
            {"on": "lower", "young": below, "poisson": 0.3},
        ],
        "fixed": [
            {"on": "upper_cut", "displacement": ["0.02*max(t-1, 0)", "-0.1*min(t, 1)"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0]},
        ],
        "contact": {
            "on": "upper_arc",
            "against": "lower_arc",
            "gap": "0.3*x**4 + 0.4*max(x, 0)**3",
        },
        "friction": {"law": "coulomb", "mu": mu} if mu else {"law": "none"},
        "evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, 1]},
    }
    return build_problem(parse_case(data))


def away(size, **bodies):
    """Return by how much friction and pressure are off, over their sums."""
    problem = profiles(size, **bodies)
    *_, last = evolve(problem, [1.0, 2.0], NewtonOptions())
    weight, pressure = problem.nodes.weight, last.multipliers.contact
    friction = last.multipliers.friction[:, 0] * np.sign(weight @ last.multipliers.friction[:, 0])
    smooth = profiles(size, **bodies, mu=None)
    presses = [s.multipliers.contact for s in evolve(smooth, np.linspace(0, 1, 41)[1:])]
    loads = np.array([weight @ p for p in presses])

    def under(load):
        """Return the pressure without friction, linear between loads."""
        k = int(np.clip(np.searchsorted(loads, load), 1, loads.size - 1))
        share = (load - loads[k - 1]) / (loads[k] - loads[k - 1])
        return (1 - share) * presses[k - 1] + share * presses[k]

    load, push = weight @ pressure, weight @ friction
    assert 0.35 < push / (MU * load) < 0.45
    full = under(load)
    exact = MU * (full - under(load - push / MU))
    return (
        weight @ np.abs(friction - exact) / (weight @ exact),
        weight @ np.abs(pressure - full) / load,
    )


def test_two_equal_bodies_slip_as_they_press():
    coarse, fine = (away(size) for size in (0.04, 0.02))
    # The shear of one body lifts what that of the other lowers.
    assert coarse[1] < 1e-5 and fine[1] < 1e-5
    assert fine[0] < 0.02
    assert fine[0] < 0.5 * coarse[0]


@pytest.mark.core
def test_unlike_bodies_do_not():
    friction, pressure = away(0.04, below=1e6)
    assert friction > 0.5
    assert pressure > 0.02
