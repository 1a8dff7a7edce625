"""The same ball as a body of revolution and as a quarter in space."""

import numpy as np
import pytest

pytest.importorskip("gmsh")
from contact import solve
from contact.case.file import parse_case
from contact.output.balances import charge_balance
from scripts.studies.indentation import COUPLING, THESIS

DEPTH = 0.6


def ball(space: bool, n: float, degree: int = 1):
    """Return half a ball of radius 10 that is pressed on a plate, with elements of size 1/n."""
    mesh = {"radius": 10.0, "size": 6.0 / n, "contact_size": 2.4 / n, "contact_width": 3.0}
    mesh |= {"generator": "sphere" if space else "quarter_disc", "growth": 1.2 / n}
    free = ["free", "free"] if space else ["free"]
    fixed = [{"on": "top", "displacement": [*free, -DEPTH]}]
    if space:
        fixed.append({"on": "symmetry_x", "displacement": [0.0, "free", "free"]})
        fixed.append({"on": "symmetry_y", "displacement": ["free", 0.0, "free"]})
    else:
        fixed.append({"on": "symmetry", "displacement": [0.0, "free"]})
    zero = [0.0] * len(free)
    plane = {"shape": "plane", "point": [*zero, 0.0], "normal": [*zero, 1.0]}
    elements = {"degree": degree}
    if not space:
        elements["kinematics"] = "axisymmetric"
    return parse_case(
        {
            "mesh": mesh,
            "space": elements,
            "material": {"young": 1000.0, "poisson": 0.3},
            "fixed": fixed,
            "contact": {"on": "contact", "foundation": plane},
        }
    )


def poled(space: bool, n: float, degree: int, conducting: bool):
    """Return the ball of the thesis's material, poled along its axis, grounded on its cut."""
    data = ball(space, n, degree).model_dump(exclude_unset=True)
    data["material"] = {**THESIS, "piezo": COUPLING}
    data["fixed"][0]["potential"] = 0.0
    if conducting:
        data["electric"] = {"law": "shifted", "k_e": 100.0, "delta": 10.0, "phi_f": 0.002}
    return parse_case(data)


def test_a_quarter_in_space_tends_to_the_body_of_revolution():
    exact = solve(ball(False, 32, 2)).contact_force[1]
    for space, sizes in ((False, (2, 4, 8)), (True, (2, 4, 6))):
        turn = 4 if space else 1
        forces = [turn * solve(ball(space, n)).contact_force[-1] for n in sizes]
        errors = np.array(forces) / exact - 1
        # Coarse bodies of straight facets are too stiff.
        assert np.all(errors > 0)
        assert errors[-1] < 0.02
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert order > (1.2 if space else 1.7), (space, errors)


@pytest.mark.parametrize("conducting", [False, True])
def test_a_piezoelectric_quarter_in_space_tends_to_the_body_of_revolution(conducting):
    """Force, and the charge drawn or the potential at the tip, of the thesis's material."""

    def measured(space, n, degree=1):
        solution = solve(poled(space, n, degree, conducting))
        turn, problem = 4 if space else 1, solution.problem
        tip = np.argmin(np.linalg.norm(problem.nodes.points, axis=1))
        charge = turn * charge_balance(problem, solution.state).foundation
        phi = problem.equilibrium.phi_scale * solution.nodal[tip, -1]
        return turn * solution.contact_force[-1], charge if conducting else phi

    exact = np.array(measured(False, 32, 2))
    for space, sizes in ((False, (2, 4, 8)), (True, (4, 6, 8))):
        errors = np.array([measured(space, n) for n in sizes]) / exact - 1
        assert np.all(errors > 0)
        assert np.all(errors[-1] < 0.02)
        order = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        assert np.all(order > 1.6), (space, errors)
