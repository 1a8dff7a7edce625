"""A piezoelectric body that presses one of flow theory beyond yield."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, NewtonOptions, load_case, parse_case, solve
from contact.results.resultants import charge_balance
from scripts.cases import CASES

#: GPa, C/m^2, GV: a stack of PZT-5A's coupling and isotropic elasticity, and a metal.
STACK = {"young": 58.7102, "poisson": 0.3912}
COUPLING = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}
METAL = {"law": "j2", "young": 70.0, "poisson": 0.3, "yield_stress": 0.1}
VOLTS = {"time": [0.0, 1.0, 2.0, 3.0], "value": [0.0, -0.04, -0.03, 0.0]}


def pressed(mu=0.0, confined=True, size=1.0, coupling=COUPLING, metal=METAL, **more):
    """Return a stack between a fixed plate and a metal, which its voltage presses."""
    sides = {"upper_top": [0.0, 0.0], "lower_bottom": ["free" if confined else 0.0, 0.0]}
    if confined:
        names = [f"{body}_{side}" for body in ("upper", "lower") for side in ("left", "right")]
        sides |= {name: [0.0, "free"] for name in names}
    fixed = [{"on": name, "displacement": values} for name, values in sides.items()]
    if coupling is not None:
        fixed[0] |= {"potential": 1.0, "amplitude": "volts"}
        fixed.append({"on": "upper_bottom", "potential": 0.0})
    stack = {**STACK, **({} if coupling is None else {"piezo": coupling})}
    return parse_case(
        {
            "mesh": {
                **{"generator": "two_blocks", "upper_size": size, "lower_size": size},
                "lower_width": 2.0 if confined else 3.0,
            },
            "material": [{"on": "upper", **stack}, {"on": "lower", **metal}],
            "fixed": fixed,
            "contact": {
                **{"on": "upper_bottom", "against": "lower_top"},
                **({"friction": {"law": "coulomb", "mu": mu}} if mu else {}),
            },
            "solver": {"tolerance": 1e-10},
            "evolution": {"times": VOLTS["time"], "steps": [1] * 3, "amplitudes": {"volts": VOLTS}},
            **more,
        }
    )


def column():
    """Return stress, displacement of the interface and surface charge in the closed form.

    Strains are uniaxial: the stack bears C eps + e33 V/H, the metal K eps - 2Y/3 beyond yield.
    """
    e, nu = STACK["young"], STACK["poisson"]
    stack = e * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    e, nu, limit = METAL["young"], METAL["poisson"], METAL["yield_stress"]
    bulk, shear = e / (3 - 6 * nu), e / (2 + 2 * nu)
    metal, rows = bulk + 4 / 3 * shear, []
    for step, volts in enumerate(VOLTS["value"][1:]):
        active = COUPLING["e33"] * volts
        if step == 0:
            w = (active + 2 / 3 * limit) / (stack + bulk)
            assert 2 * shear * abs(w) > limit  # it yields, by far
            first = w, bulk * w - 2 / 3 * limit
        else:
            w = (active - first[1] + metal * first[0]) / (stack + metal)
            assert 2 * shear * abs(w - first[0]) < 2 * limit  # but not in reverse
        if (stress := active - stack * w) > 0:
            stress, w = 0.0, active / stack
        rows.append((stress, w, -COUPLING["e33"] * w - COUPLING["beta33"] * volts))
    return np.array(rows)


@pytest.mark.parametrize(
    "element", ["P1", *(pytest.param(name, marks=pytest.mark.slow) for name in ("P2", "mean"))]
)
def test_a_stack_presses_a_metal_beyond_yield_and_lets_it_go(element):
    space = {"degree": 1 if element == "P1" else 2}
    if element == "mean":
        space["element"] = "mean_dilatation"
    solution = solve(pressed(space=space))
    assert solution.converged and len(solution.steps) == 3
    body = solution.problem.body
    bottom = np.abs(body.layout.points[:, 1]) < 1e-9
    for step, (stress, w, surface) in zip(solution.steps, column(), strict=True):
        assert step.row["contact_force_y"] == pytest.approx(2.0 * stress, abs=1e-8)
        moved = body.nodal(step.state.x)[: bottom.size][bottom, 1]
        assert np.abs(moved - w).min() < 1e-9
        problem = solution.problem.at(step.state.time, step.state.history)
        charges = charge_balance(problem, step.state).electrodes
        assert abs(charges["upper_top"]) == pytest.approx(2.0 * abs(surface), rel=1e-7, abs=1e-9)
    assert solution.steps[-1].row["contact_force_y"] == 0.0
    assert solution.equivalent_plastic_strain > 5e-4


def test_methods_agree_with_friction():
    """Nothing is homogeneous: free sides, a wider metal with hardening, and friction."""
    given = pressed(0.3, False, metal={**METAL, "hardening": 2.0, "kinematic": 1.0})
    names = ("contact_force_x", "contact_force_y", "plastic_dissipation", "dissipation")
    found = {}
    for name, options in {
        "condensed": NewtonOptions(tolerance=1e-10),
        "whole": NewtonOptions(tolerance=1e-10, condense=False),
        "uzawa": FixedPointOptions(tolerance=1e-10, max_outer=2000),
    }.items():
        solution = solve(given, options)
        assert solution.converged, (name, solution.outcome.reason)
        found[name] = np.array([[step.row[n] for n in names] for step in solution.steps])
    scale = np.abs(found["whole"]).max(axis=0)
    assert scale[2] > 0 and scale[3] > 0
    for name, values in found.items():
        assert np.abs((values - found["whole"])[:, 1:] / scale[1:]).max() < 1e-7, name


def test_without_coupling_the_field_changes_nothing():
    """The same displacements as without potentials, where a plate presses both."""
    driven = [
        {"on": "upper_top", "displacement": [0.0, -0.004], "amplitude": "press"},
        {"on": "lower_bottom", "displacement": [0.0, 0.0]},
    ]
    times = {"time": [0.0, 1.0, 2.0, 3.0], "value": [0.0, 1.0, 0.7, 1.2]}
    found = []
    none = dict.fromkeys(("e31", "e33", "e15"), 0.0)
    for coupling in (None, {**COUPLING, **none}):
        evolution = {
            "times": times["time"],
            "steps": [1] * 3,
            "amplitudes": {"press": times, "volts": VOLTS},
        }
        potentials = [{"on": "upper_top", "potential": 1.0, "amplitude": "volts"}]
        fixed = driven + (potentials if coupling else [])
        closer = {"tolerance": 1e-12}
        given = pressed(
            0.3, False, coupling=coupling, fixed=fixed, evolution=evolution, solver=closer
        )
        solution = solve(given)
        assert solution.converged and solution.equivalent_plastic_strain > 5e-4
        body = solution.problem.body
        found.append([body.nodal(step.state.x)[:, :2] for step in solution.steps])
    assert np.abs(np.array(found[0]) - found[1]).max() < 1e-10 * np.abs(found[0]).max()


def test_a_bimorph_marks_its_stop():
    """The case on a coarse mesh: without a halved step, and later to touch the second time."""
    sizes = ["mesh.size=0.5", "mesh.contact_size=0.1", "evolution.steps=[4, 1, 4]"]
    case = load_case(CASES / "bimorph-stop.toml", sizes)
    solution = solve(case)
    assert case.title and solution.converged and len(solution.steps) == 9
    assert solution.outcome.residuals.largest <= case.solver.tolerance
    rows = [step.row for step in solution.steps]
    force, lost = (
        np.array([row[name] for row in rows]) for name in ("contact_force_y", "plastic_dissipation")
    )
    assert force[0] > 0 and force[4] == 0 and force[5] == 0
    assert (force[[6, 7, 8]] < force[[1, 2, 3]]).all() and force[8] > 0.9 * force[3]
    assert lost[2] > 0 and lost[5:].sum() < 0.2 * lost[:4].sum()


@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("degree", [1, 2])
def test_ranks_without_cells_of_a_metal(degree):
    """Volumes were first asked for where there are cells, by some of the ranks; others waited."""
    metal = {"law": "j2", "young": 200e3, "poisson": 0.3, "yield_stress": 250.0}
    data = {
        "mesh": {"generator": "two_blocks", "lower_size": 0.5, "upper_size": 0.4},
        "space": {"degree": degree},
        "material": [{"on": "upper", **metal}, {"on": "lower", **metal, "hardening": 4e3}],
        "fixed": [
            {"on": "upper_top", "displacement": [0.0, -4e-3]},
            {"on": "lower_bottom", "displacement": [0.0, 0.0]},
        ],
        "contact": {"on": "upper_bottom", "against": "lower_top"},
        "evolution": {"times": [0.0, 1.0], "steps": [2]},
    }
    alone, together = (solve(parse_case(data), comm=c) for c in (MPI.COMM_SELF, MPI.COMM_WORLD))
    for name in ("equivalent_plastic_strain", "plastic_volume"):
        assert getattr(together, name) == pytest.approx(getattr(alone, name), rel=1e-8)
    for name in ("max_pressure", "plastic_dissipation"):
        known, found = (sum(step.row[name] for step in one.steps) for one in (alone, together))
        assert known > 0
        assert found == pytest.approx(known, rel=1e-8)
    assert together.error.relative == pytest.approx(alone.error.relative, rel=1e-8)
