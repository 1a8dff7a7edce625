"""Curved bodies with straight edges on curved rigid foundations: exact pressures at degree 2 too."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Load, NewtonOptions, Problem, solve_problem
from contact.mesh.refinement import refined
from contact.output.review import review
from scripts.studies import curved_foundations as study
from tests.problems.curved import two_rings


def check(ratios, mean, node):
    """Mean pressure and that of each node are the exact one but for these shares."""
    p, w = ratios
    assert p @ w / w.sum() == pytest.approx(1, abs=mean)
    assert np.abs(p - 1).max() < node


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["ring on a shaft", "ring in a bore"])
def test_rings(name, degree):
    """With mid-edge nodes on chords: 2.19 times the pressure, and nodes between 0 and 3 times."""
    check(study.rings(name, 0.1, degree), 0.005, 0.04)


@pytest.mark.parametrize("degree", [1, 2])
def test_hertz(degree):
    """With chords degree 2 is 7 % off."""
    check(study.hertz(0.1, degree), 0.004, 0.01)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["2-D", "revolution"])
@pytest.mark.parametrize("name", ["sphere", "formula", "punch edge"])
def test_hydrostatic_pressure_in_the_plane(name, kind, degree):
    check(study.hydrostatic(name, 0.05, degree, kind), 0.002, 0.08)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["sphere", "cylinder", "triangles"])
def test_hydrostatic_pressure_in_space(name, degree):
    check(study.hydrostatic(name, 0.1, degree, "3-D"), 0.007, 0.1)


@pytest.mark.parametrize(("degree", "warned"), [(1, True), (2, False)])
def test_two_rings_with_a_small_interference_are_warned_of(degree, warned):
    """Gaps of degree 1 are those of the facets: the warning has both lengths."""
    solution = two_rings(0.1, degree)
    review(solution)
    found = [text for text in solution.warnings if "deviate by up to 0.001" in text]
    assert bool(found) == warned
    assert all("at most 0.0" in text for text in found)


def test_refined_chords_are_warned_of():
    domain = refined(study.mesh(study.RING, 0.2, 2))
    sides = [Fixed("side0", [None, 0.0]), Fixed("side2", [0.0, None])]
    shaft = study.Sphere(centre=(0.0, 0.0), radius=1.002)
    problem = Problem(domain, Body(Linear(1e3, 0.3), sides), Contact("contact", shape, press=True))
