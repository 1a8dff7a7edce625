"""Derivatives by every parameter of cases whose constraint, units or values at 0 are in the way."""

import logging

import numpy as np
import pytest
from mpi4py import MPI

from contact import InputError, load_case, parse_case, sensitivity, solve
from contact.case.file import number_at, with_number
from tests.problems.taylor import taylor

SELF = MPI.COMM_SELF


def plate(dim=2, turning=True, revolved=False):
    """Return a block under a rigid plate, on a bowl with friction.

    The plate is free under a force and a moment about a centre beside it, or moved and turned.
    """
    size, cells = ([2.0, 1.0], [6, 3]) if dim == 2 else ([2.0, 1.0, 1.0], [4, 2, 2])
    forces = [0.0004, -0.02] if dim == 2 else [0.0003, 0.0002, -0.02]
    if revolved:
        motion = {"displacement": [0.0, "free"], "force": [0.0, -0.03]}
    elif turning:
        turns = 1 if dim == 2 else 3
        moment = [0.0007, 0.0004, 0.0001][:turns]
        motion = {
            "displacement": ["free"] * dim,
            "force": forces,
            "rotation": "free" if dim == 2 else ["free"] * 3,
            "moment": moment[0] if dim == 2 else moment,
            "centre": [1.1, 0.9] if dim == 2 else [1.1, 0.4, 0.9],
        }
    else:
        motion = {
            "displacement": [0.002, -0.015] if dim == 2 else [0.002, 0.001, -0.015],
            "rotation": 0.13 if dim == 2 else [0.1, 0.13, 0.05],
            "centre": [0.7, 1.0] if dim == 2 else [0.7, 0.4, 1.0],
        }
    gap = "0.002*(x - 0.9)**2" + (" + 0.002*(y - 0.4)**2" if dim == 3 else "")
    return {
        "mesh": {"generator": "rectangle" if dim == 2 else "box", "size": size, "cells": cells},
        "space": {"kinematics": "axisymmetric", "degree": 2} if revolved else {},
        "material": {"young": 1.2, "poisson": 0.31},
        "rigid": [{"on": "top", **motion}],
        "contact": {"on": "bottom", "gap": gap},
        "friction": {"law": "coulomb", "mu": 0.5},
        "solver": {"tolerance": 1e-13},
    }


def keys_of_plate(data, revolved):
    """Return the keys of the plate, its mesh and its material."""
    dim, (rigid,) = len(data["mesh"]["size"]), data["rigid"]
    found = ["material.young", "material.poisson", "friction.mu"]
    found += [f"mesh.size.{i}" for i in range(dim)]
    for name, value in rigid.items():
        many = value if isinstance(value, list) else [value]
        for i, one in enumerate(many):
            if isinstance(one, float) and not (revolved and one == 0):
                found.append(f"rigid.0.{name}" + (f".{i}" if isinstance(value, list) else ""))
    return found


def check(case, names, keys, sizes=None):
    """Compare derivatives by each key with Taylor's series; `sizes` has those of numbers at 0."""
    run = solve(case, comm=SELF)
    for key in keys:
        size = (sizes or {}).get(key) or abs(number_at(case, key)) or 1.0
        found = taylor(run, names, {key: size}, np.ones(1))
        assert found.apart < 1e-6, key
        assert found.adjoint < 1e-10, key


@pytest.mark.parametrize(
    ("dim", "turning", "revolved"),
    [
        (2, False, False),
        *(pytest.param(dim, True, False, marks=pytest.mark.slow) for dim in (2, 3)),
        pytest.param(3, False, False, marks=pytest.mark.slow),
        pytest.param(2, False, True, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_rigid_part_by_all_of_its_parameters(dim, turning, revolved):
    """The moment arms of a free part, and the tie of its nodes, move with the parameter."""
    data = plate(dim, turning, revolved)
    names = ["max_pressure", "max_displacement"] + ["contact_force_x"] * (not revolved)
    # The force along x is given where the plate is free; the pressure knows of its arms.
    check(parse_case(data), names, keys_of_plate(data, revolved))


def test_a_contact_force_where_all_is_open_and_supports_hold_nodes():
    """The adjoint of a component that a support holds has no equation, and went on for ever."""
    data = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [
            {"on": "left", "displacement": [0.0, 0.0]},
            {"on": "right", "displacement": ["free", 0.01]},
        ],
        "contact": {"on": "bottom", "foundation": {"shape": "sphere", "centre": [1.0, -2.0],
                    "radius": 1.5}},
        "friction": {"law": "coulomb", "mu": 0.3},
    }  # fmt: skip
    run = solve(parse_case(data), comm=SELF)
    for name in ("contact_force_x", "contact_force_y"):
        for method in ("tangent", "adjoint"):
            found = sensitivity(run, [name], ["friction.mu", "material.young"], method)
            assert [*found[name].values()] == pytest.approx([0, 0], abs=1e-12)


def test_a_ring_off_its_mandrel():
    given = ["solver.tolerance=1e-13", "mesh.cells=[4,3]", "evolution.steps=[3,3]"]
    ring = load_case("scripts/cases/ring-on-mandrel.toml", given)
    found = sensitivity(solve(ring, comm=SELF), ["contact_force_y"], ["friction.mu"], "adjoint")
    assert found["contact_force_y"]["friction.mu"] == pytest.approx(0, abs=1e-9)


def at_zero(length=1.0, young=1.2, apart=0.0):
    """Return a block under a ball, many of whose numbers are 0, in any units."""
    return {
        "mesh": {"generator": "rectangle", "origin": [0.0, 0.0], "size": [2 * length, length],
                 "cells": [8, 4], "rotation": 0.0},
        "material": {"young": young, "poisson": 0.0},
        "fixed": [{"on": "bottom", "displacement": [0.0, 0.0]}],
        "load": [{"on": "right", "traction": [0.0, 0.0]}],
        "contact": {
            "on": "top",
            "foundation": {"shape": "sphere", "centre": [0.0, (3 + apart) * length],
                           "radius": 2 * length},
            "rigid": {"displacement": [0.0, -(0.05 + apart) * length], "rotation": 0.0,
                      "centre": [0.0, 0.0]},
        },
        "friction": {"law": "coulomb", "mu": {"law": "slip", "a": 0.3, "b": 0.0, "rho": 0.0}},
        "solver": {"tolerance": 1e-13},
    }  # fmt: skip


@pytest.mark.parametrize(("length", "young"), [(1e-6, 200e9), (1e3, 1.2)])
def test_numbers_that_are_0_in_any_units(length, young):
    # A gap of 0 has one-sided derivatives by the places of both.
    data = at_zero(length, young, apart=0.01)
    sizes = {
        "mesh.origin.0": length,
        "mesh.origin.1": 5e-3 * length,
        "mesh.rotation": 5.0,
        "material.poisson": 0.5,
        "fixed.0.displacement.0": 0.05 * length,
        "fixed.0.displacement.1": 0.05 * length,
        "load.0.traction.0": 0.5 * young,
        "load.0.traction.1": 0.5 * young,
        "contact.foundation.centre.0": 0.5 * length,
        "contact.rigid.displacement.0": 0.05 * length,
        "contact.rigid.rotation": 5.0,
        "friction.mu.b": 5.0,
        "friction.mu.rho": 50 / length,
    }
    run, names = solve(parse_case(data), comm=SELF), ["contact_force_x", "contact_force_y"]
    # All of them grow: friction and conductivity of less than 0 are refused.
    found = taylor(run, [*names, "max_pressure"], sizes, np.ones(len(sizes)))
    assert found.apart < 2e-6 and found.adjoint < 1e-10


@pytest.mark.parametrize(
    ("key", "way"), [("contact.foundation.centre.1", 1), ("mesh.origin.1", -1)]
)
def test_bodies_that_touch_have_the_derivatives_of_the_side_on_which_they_are_apart(key, way):
    """Overlaps of rounding are gaps of 0: the mean of both sides was given before."""
    case, names = parse_case(at_zero()), ["contact_force_y", "max_pressure"]
    run, begin, step = solve(case, comm=SELF), number_at(case, key), way * 1e-5
    found = sensitivity(run, names, [key])
    forces = [
        solve(with_number(case, key, begin + k * step), comm=SELF).contact_force[1]
        for k in range(3)
    ]
    exact = (4 * forces[1] - 3 * forces[0] - forces[2]) / (2 * step)
    assert found["contact_force_y"][key] == pytest.approx(exact, rel=1e-4)


def test_a_parameter_that_overlaps_both_ways_is_refused():
    data = at_zero()
    data["contact"] = {"on": "top", "foundation": {"shape": "plane", "point": [1.0, 1.0],
                       "normal": [0.0, -1.0]}}  # fmt: skip
    run = solve(parse_case(data), comm=SELF)
    with pytest.raises(InputError, match=r"overlap beside 0.*\[border\]"):
        sensitivity(run, ["contact_force_y"], ["contact.foundation.normal.0"])


@pytest.mark.parametrize("method", ["tangent", "adjoint"])
@pytest.mark.parametrize(("gap", "down"), [(0.06, 0.01), (0.05, 0.0)])
def test_a_layer_that_just_touches_is_said(gap, down, method, monkeypatch):
    """Its stiffness jumps there, and the mean of both sides came without a word."""
    said, logger = [], logging.getLogger("contact.sensitivity")
    monkeypatch.setattr(logger, "warning", lambda text, *_: said.append(text))
    layer = {"law": "compliance", "layer": 0.05, "stiffness": 2.0}
    for more, count in ((0.0, 5), (1e-3, 0), (-1e-3, 0)):
        contact = {"on": "bottom", "gap": gap + more, **layer}
        run = solve(
            block(fixed=[{"on": "top", "displacement": [0, -down]}], contact=contact), comm=SELF
        )
        found = sensitivity(run, ["contact_force_y"], ["contact.gap"], method)
        assert len(found.weakly_active) == count and len(said) == min(count, 1)
        said.clear()


def test_a_gap_of_1e_12_has_the_derivative_of_0():
    """Of a layer, from whose place steps of 2e-18 were lost: it was exactly 0."""
    layer, found = {"law": "compliance", "layer": 0.05, "stiffness": 2.0}, []
    for gap in (0.0, 1e-12):
        contact = {"on": "bottom", "gap": gap, **layer}
        run = solve(
            block(fixed=[{"on": "top", "displacement": [0, -0.01]}], contact=contact), comm=SELF
        )
        found.append(sensitivity(run, ["contact_force_y"], ["contact.gap"]))
    assert found[1]["contact_force_y"]["contact.gap"] > 1.0
    assert found[1]["contact_force_y"] == pytest.approx(found[0]["contact_force_y"], rel=1e-6)


def test_numbers_near_0():
    """A number of 1e-12 has the derivative of 0, up to rounding."""
    found = []
    for at in (0.0, 1e-12, 1e-8, -1e-10):
        data = at_zero()
        data["contact"]["foundation"]["centre"][0] = at
        run = solve(parse_case(data), comm=SELF)
        by = sensitivity(run, ["contact_force_x"], ["contact.foundation.centre.0"])
        found.append(by["contact_force_x"]["contact.foundation.centre.0"])
    assert found == pytest.approx([found[0]] * 4, rel=1e-6)


def test_electric_numbers_that_are_0():
    piezo = {"e31": 0.0, "e33": 15.8, "e15": 0.0, "beta11": 8.13866, "beta33": 7.37455}
    data = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]},
        "material": {"young": 100.0, "poisson": 0.3, "piezo": piezo},
        "fixed": [{"on": "top", "displacement": [0.004, -0.02], "potential": 0.0}],
        "load": [{"on": "left", "charge": 0.0}],
        "contact": {"on": "bottom", "gap": 0.0},
        "friction": {"law": "coulomb", "mu": 0.2},
        "electric": {"law": "perfect", "k_e": 0.0, "phi_f": 0.0},
        "solver": {"tolerance": 1e-13},
    }
    sizes = {
        "material.piezo.e31": 50.0,
        "material.piezo.e15": 50.0,
        "fixed.0.potential": 0.05,
        "load.0.charge": 0.5,
        "electric.k_e": 5.0,
        "contact.gap": 5e-3,
    }
    # All of the charge is 0.
    check(parse_case(data), ["contact_force_y", "max_pressure"], [*sizes], sizes)


def test_a_parameter_of_a_generator_stands_where_the_case_has_it():
    case = parse_case({
        "mesh": {"generator": "half_disc", "radius": 1.0},
        "material": {"young": 1.0, "poisson": 0.3},
        "contact": {"on": "bottom"},
    })  # fmt: skip
    assert number_at(case, "mesh.radius") == number_at(case, "mesh.parameters.radius") == 1.0


def test_a_number_with_a_single_value_is_refused():
    run = solve(parse_case(plate(revolved=True)), comm=SELF)
    with pytest.raises(InputError, match=r"\[rigid-part\]"):
        sensitivity(run, ["max_pressure"], ["rigid.0.displacement.0"])


def block(material=None, **more):
    """Return a block whose top is moved."""
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]},
            "material": material or {"young": 3.0, "poisson": 0.3},
            "contact": {"on": "bottom", "gap": 0.0},
            "solver": {"tolerance": 1e-12},
            **more,
        }
    )


@pytest.mark.parametrize("method", ["tangent", "adjoint"])
def test_all_nodes_have_the_largest_displacement(method):
    """Lifted off: the derivative is that at one node, constrained or free."""
    run = solve(block(fixed=[{"on": "top", "displacement": [-0.003, 0.004]}]), comm=SELF)
    key = "fixed.0.displacement.0"
    found = sensitivity(run, ["max_displacement"], [key], method)["max_displacement"][key]
    assert found == pytest.approx(-0.6, rel=1e-6)


def test_a_body_that_touches_unmoved_has_one_sided_derivatives():
    run = solve(block(fixed=[{"on": "top", "displacement": [0.0, 0.0]}]), comm=SELF)
    found = sensitivity(run, ["contact_force_y"], ["fixed.0.displacement.1"])
    assert len(found.weakly_active) == 5


def test_solutions_of_a_penalty_have_none():
    given = block(
        fixed=[{"on": "top", "displacement": [0.0, -0.02]}],
        solver={"method": "penalty", "tolerance": 1e-10},
    )
    with pytest.raises(InputError, match=r"\[penalised\]"):
        sensitivity(solve(given, comm=SELF), ["contact_force_y"], ["material.young"])


def test_a_number_that_brings_a_variable_of_the_material_has_none_at_0():
    steel = {"law": "j2", "young": 200e3, "poisson": 0.3, "yield_stress": 250.0, "kinematic": 0.0}
    given = block(steel, fixed=[{"on": "top", "displacement": [0.0, -0.009]}])
    with pytest.raises(InputError, match=r"material\.kinematic.*\[border\]"):
        sensitivity(solve(given, comm=SELF), ["contact_force_y"], ["material.kinematic"])
