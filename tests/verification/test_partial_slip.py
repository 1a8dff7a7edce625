"""Partial slip of two cylinders, with its derivatives by the coefficient of friction.

They are pressed on each other by P and moved along by Q = 2/3 mu P. Displacement, half width of the
stick zone and the derivatives of both by mu have closed forms.

References
----------
Johnson, Contact Mechanics, Cambridge University Press (1985), section 7.2.
Ciavarella, The generalized Cattaneo partial slip plane contact problem, Int. J. Solids Struct. 35
(1998) 2349.
"""

import numpy as np
import pytest

from contact import parse_case, sensitivity, solve
from contact.results.quantities import named_functionals
from scripts.studies.mindlin import MODULUS, MU, POISSON, cylinders

#: Q/(mu P), how near the first runs come to it, and the steps of the last run: so many, so far
#: about it that the stick zone loses one or more rings of nodes.
SHARE, NEAR, STEPS, ABOUT = 2 / 3, 1e-2, 9, 0.06

#: First step of the shear, in which all stick, over the last.
FIRST = 1e-3

MU_KEY, WAY_KEY = "friction.mu", "fixed.0.displacement.0"


def closed_form(share):
    """Return displacement, its derivative, c/a and its derivative at Q = share mu P.

    By Ciavarella and Jaeger the way is mu (d(P) - d(P - Q/mu)), d being the approach under a force,
    of stiffness -k ln(P) but for a constant: the way has no origin, and is that beyond the straight
    line of Q that all would stick on. It is over k P, k = 2 (1 - nu^2)/(pi E).
    """
    y, by_mu = np.sqrt(1 - share), share + np.log(1 - share)
    way = MU * (share + (1 - share) * np.log(1 - share))
    return np.array([way, by_mu, y, share / (2 * MU * y)])


def sheared(elements, ways):
    """Press two cylinders on each other, and move one along, first by a little."""
    shares = [0.0, 0.0, FIRST, *(float(way / ways[-1]) for way in ways)]
    times = [float(k) for k in range(len(shares))]
    amplitudes = {
        "press": {"time": [0.0, 1.0, times[-1]], "value": [0.0, 1.0, 1.0]},
        "shear": {"time": times, "value": shares},
    }
    steps = {"times": times, "steps": [1] * (len(times) - 1), "amplitudes": amplitudes}
    case = cylinders(elements, 1, float(ways[-1]))
    solution = solve(parse_case({**case, "solver": {"tolerance": 1e-11}, "evolution": steps}))
    assert solution.converged, solution.outcome.reason
    return solution


def stick(problem, state):
    """Return |q|/p at the contact node nearest the middle, mu (1 - c/a) of the closed form."""
    at = int(np.argmin(np.linalg.norm(problem.nodes.points[:, :-1], axis=1)))
    return float(np.linalg.norm(state.multipliers.friction[at]) / state.multipliers.contact[at])


def forces(solution, step):
    """Return the tangential and the normal force at the end of a step."""
    row = solution.steps[step].row
    return row["contact_force_x"], abs(row["contact_force_y"])


@pytest.mark.slow
def test_partial_slip_and_its_derivatives_by_the_friction_coefficient():
    """Nodes stick or slip as a whole: derivatives scatter, and their means are compared."""
    share, way, elements = 0.0, 0.02, 24
    while abs(share - SHARE) > NEAR:
        solution = sheared(elements, [way])
        results = {"force": named_functionals(solution.problem)["contact_force_x"]}
        by_way = sensitivity(solution, results, [WAY_KEY], "tangent")["force"][WAY_KEY]
        force, normal = forces(solution, -1)
        way, share = way + (SHARE * MU * normal - force) / by_way, force / (MU * normal)
    ways = way + np.linspace(-ABOUT, ABOUT, STEPS) * MU * normal / by_way
    solution = sheared(elements, ways)
    found = sensitivity(solution, {**results, "stick": stick}, [MU_KEY, WAY_KEY], "tangent").steps
    stiffness = found["force"][WAY_KEY][1] / FIRST
    ratios = []
    for k, driven in enumerate(ways, start=2):
        force, normal = forces(solution, k)
        unit = 2 * (1 - POISSON**2) / (np.pi * MODULUS) * normal
        by, ratio = driven / ways[-1], stick(solution.problem, solution.steps[k].state)
        by_mu = -found["force"][MU_KEY][k] / (found["force"][WAY_KEY][k] / by)
        slope = found["stick"][MU_KEY][k] + found["stick"][WAY_KEY][k] / by * by_mu
        beyond = (driven - force / stiffness) / unit
        values = [beyond, by_mu / unit, 1 - ratio / MU, ratio / MU**2 - slope / MU]
        ratios.append(values / closed_form(force / (MU * normal)))
    assert np.mean(ratios, axis=0) == pytest.approx(1, abs=0.04)
    assert np.mean(ratios, axis=0)[1:] == pytest.approx(1, abs=0.025)
    assert np.mean(ratios, axis=0)[2:] == pytest.approx(1, abs=5e-3)
    assert np.std(ratios, axis=0)[1] < 0.07
