"""Derivatives by every parameter of cases whose constraint, units or values at 0 are in the way."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import load_case, parse_case, sensitivity, solve
from contact.case.text import number_at, with_number
from scripts.studies.derivatives import values

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


def keys_of_plate(data):
    """Return the keys of the plate, its mesh and its material."""
    dim, (rigid,) = len(data["mesh"]["size"]), data["rigid"]
    found = ["material.young", "material.poisson", "friction.mu"]
    found += [f"mesh.size.{i}" for i in range(dim)]
    for name, value in rigid.items():
        many = value if isinstance(value, list) else [value]
        for i, one in enumerate(many):
            if isinstance(one, float):
                found.append(f"rigid.0.{name}" + (f".{i}" if isinstance(value, list) else ""))
    return found


def check(case, names, keys, way=1e-5, tolerance=1e-6):
    """Compare tangent and adjoint with each other, and with central differences of solutions."""
    run = solve(case, comm=SELF)
    tangent, adjoint = (sensitivity(run, names, keys, m) for m in ("tangent", "adjoint"))
    size = np.abs(values(run, names))
    for key in keys:
        at = number_at(case, key)
        step = way * (abs(at) or 1.0)
        ends = [solve(with_number(case, key, at + by), comm=SELF) for by in (step, -step)]
        apart = np.subtract(*(values(end, names) for end in ends)) / (2 * step)
        own, other = (np.array([found[name][key] for name in names]) for found in (tangent, adjoint))
        scale = np.maximum(np.abs(apart), 1e-2 * size / (abs(at) or 1.0))
        assert np.all(np.abs(own - apart) <= tolerance * scale), (key, own, apart)
        assert np.all(np.abs(own - other) <= 1e-10 * np.maximum(np.abs(own), size)), key


@pytest.mark.parametrize(
    ("dim", "turning", "revolved"),
    [(2, True, False), (2, False, False), (3, True, False), (3, False, False), (2, False, True)],
)
def test_a_rigid_part_by_all_of_its_parameters(dim, turning, revolved):
    """The moment arms of a free part, and the tie of its nodes, move with the parameter."""
    data = plate(dim, turning, revolved)
    names = ["max_pressure", "max_displacement"] + ["contact_force_x"] * (not revolved)
    # The force along x is given where the plate is free; the pressure knows of its arms.
    check(parse_case(data), names, keys_of_plate(data))


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
