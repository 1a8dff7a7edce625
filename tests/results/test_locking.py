"""Meshes that lock are seen, whatever the law, and no others."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case, solve
from contact.case.build import build_problem
from contact.cli.check import expectations
from forms.elasticity import isotropic
from scripts.studies.discretisation import punch
from tests.problems.bar import changed

YIELDING = {"material__yield_strain": 0.005, "load__0__traction": [0.0, -0.05]}
SOFT = {"material__law": "linear", "material__yield_strain": None, "material__poisson": 0.4999}


@pytest.mark.parametrize("changes", [YIELDING, SOFT])
def test_locking_is_seen_on_elements_of_degree_1_alone(changes):
    data = changed(mesh__cells=[32, 8], **changes)
    locked = solve(parse_case(data))
    assert locked.error.stiffness_ratio > 20
    assert any("the mesh may lock" in text for text in locked.warnings)
    data["space"]["degree"] = 2
    assert not any("the mesh may lock" in text for text in solve(parse_case(data)).warnings)


def says(solution):
    return any("the mesh may lock" in text for text in solution.warnings)


def pressed(cell, degree, element="standard", steps=8):
    return solve(punch(2, degree, element, cell, steps), comm=MPI.COMM_SELF)


def test_plastic_flow_does_not_lock_where_the_dilatation_is_its_mean():
    assert not says(pressed("triangle", 2, "mean_dilatation"))


@pytest.mark.parametrize("steps", [2, 16])
def test_the_ratio_of_a_plastic_body(steps):
    """A cylinder in uniaxial stress Y at the strain eps: e is elastic and plastic."""
    young, poisson, strength, eps = 1000.0, 0.3, 1.0, 0.05
    tables = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [2, 2]},
        "space": {"kinematics": "axisymmetric"},
        "material": {"law": "j2", "young": young, "poisson": poisson, "yield_stress": strength},
        "fixed": [{"on": "top", "displacement": ["free", f"{-eps}*t"]}],
        "contact": {"on": "bottom"},
        "evolution": {"times": [0.0, 1.0], "steps": [steps]},
    }
    found = solve(parse_case(tables), comm=MPI.COMM_SELF).error
    elastic = strength / young
    across = poisson * elastic + (eps - elastic) / 2
    shear = np.sqrt(2 / 3) * strength / (2 * np.sqrt(2 / 3) * (eps + across))
    assert found.stiffness_ratio == pytest.approx(young / (3 - 6 * poisson) / shear, rel=1e-6)


def tube(material, degree=1):
    """Return a tube of revolution under pressure, between smooth plates."""
    return {
        "mesh": {"generator": "rectangle", "origin": [1, 0], "size": [1, 1], "cells": [8, 8]},
        "space": {"kinematics": "axisymmetric", "degree": degree},
        "material": material,
        "fixed": [{"on": ["bottom"], "symmetry": "y"}, {"on": ["top"], "symmetry": "y"}],
        "load": [{"on": "left", "pressure": 1e-3}],
        "contact": {"on": "right", "gap": 1.0},
    }


def crystal(poisson):
    return {"law": "anisotropic", "stiffness": isotropic(1.0, poisson).tolist()}


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_a_crystal_that_is_isotropic_has_the_ratio_of_an_isotropic_body(poisson):
    """It had none: the tube is 40 % too stiff."""
    found = [
        solve(parse_case(tube(material)), comm=MPI.COMM_SELF)
        for material in (crystal(poisson), {"young": 1.0, "poisson": poisson})
    ]
    ratios = [one.error.stiffness_ratio for one in found]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-6)
    assert [says(one) for one in found] == [poisson > 0.4] * 2
    assert not says(solve(parse_case(tube(crystal(poisson), 2)), comm=MPI.COMM_SELF))


def test_fibres_lock():
    """Hardly a stretch along 30 degrees: degree 1 bends far too little, on any triangles."""
    tables = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [16, 8]},
        "material": {
            "law": "anisotropic", "c11": 1.35, "c12": 0.58, "c13": 0.58, "c33": 1e4, "c44": 0.385,
            "poling": 30.0,
        },
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "right", "traction": [0.0, -1e-3]}],
        "contact": {"on": "bottom", "gap": 1.0},
    }  # fmt: skip
    locked = solve(parse_case(tables), comm=MPI.COMM_SELF)
    lines = expectations(build_problem(parse_case(tables)))
    assert any("times as stiff as another" in line for line in lines)
    free = solve(parse_case({**tables, "space": {"degree": 2}}), comm=MPI.COMM_SELF)
    assert locked.max_displacement < 0.6 * free.max_displacement
    assert says(locked) and not says(free)


@pytest.mark.parametrize("sides", [["left"], ["left", "right"]])
def test_exact_solutions_do_not_lock(sides):
    """Uniform strains of a nearly incompressible block: it was said to be too stiff."""
    tables = {
        "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [4, 4]},
        "material": {"young": 1.0, "poisson": 0.4999},
        "fixed": [{"on": side, "symmetry": "x"} for side in sides],
        "load": [{"on": "top", "traction": [0.0, -1e-3]}],
        "contact": {"on": "bottom"},
    }
    solution = solve(parse_case(tables), comm=MPI.COMM_SELF)
    assert solution.error.stiffness_ratio > 1000
    assert solution.error.relative < 1e-6
    assert not says(solution)
