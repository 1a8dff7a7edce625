"""Plane stress: a strip, a plate with a hole's ring, Cook's membrane, plasticity, a ceramic."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from contact import Body, Contact, Fixed, Linear, Load, Log, Material, Problem, parse_case, solve
from contact.case.build import build_problem
from contact.errors import InputError
from forms.hencky import Isotropic
from forms.history import Response, differential, isotropic_stiffness
from forms.j2 import J2, Voce
from forms.plane_stress import ACROSS, HenckyAtPoints, PlaneStressHistory, in_plane_stress
from tests.body.test_rollers import sector
from tests.problem.test_electrodes_inside import BETA33, C11, C13, C33, CERAMIC, E31, E33
from tests.problems.mechanics import at_points
from tests.problems.membrane import membrane

COMM = MPI.COMM_WORLD
YOUNG, POISSON = 200.0, 0.3

LAWS = {
    "linear": {"law": "linear"},
    "log": {"law": "log", "yield_strain": 0.003},
    "j2": {"law": "j2", "yield_stress": 1.0, "hardening": 20.0},
}


def strip(material, pull=1.2, kinematics="plane_stress", degree=1, **more):
    """Return a strip that is pulled along x, free across."""
    data = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]},
        "space": {"kinematics": kinematics, "degree": degree},
        "material": {"young": YOUNG, "poisson": POISSON} | material,
        "fixed": [{"on": "left", "symmetry": "x"}, {"on": "bottom", "symmetry": "y"}],
        "load": [{"on": "right", "traction": [pull, 0.0]}],
        "contact": {"on": "top", "gap": 10.0},
        "solver": {"tolerance": 1e-12},
    }
    return parse_case(data | more)


def corner(solution):
    """Return the displacement of the corner far from the supports. Collective."""
    body = solution.problem.body
    u = body.nodal(solution.state.x)[: body.owned // body.block_size, :2]
    there = np.isclose(body.layout.points.sum(axis=1), 3.0)
    return np.concatenate(COMM.allgather(u[there]))[0]


def uniaxial(name, stress):
    """Return the strains along and across of a bar under a stress."""
    elastic = stress / YOUNG
    if name == "linear":
        return elastic, -POISSON * elastic
    if name == "j2":
        plastic = max(stress - 1.0, 0.0) / 20.0
        return elastic + plastic, -POISSON * elastic - plastic / 2
    # |dev sigma| = 2 g t, and Hooke's law for the volume
    law = Log(YOUNG, POISSON, yield_strain=0.003)
    t = np.linspace(0.0, 0.1, 2_000_001)
    size = np.interp(np.sqrt(2 / 3) * stress, 2 * law.secant_modulus(t**2) * t, t)
    deviator, volume = size * np.sqrt(2 / 3), stress / (3 * law.bulk)
    return deviator + volume / 3, -deviator / 2 + volume / 3


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", LAWS)
def test_a_strip_is_a_bar(name, degree):
    """Its strains are those of the uniaxial curve, in the plane and across it."""
    solution = solve(strip(LAWS[name], degree=degree), comm=COMM)
    assert solution.converged
    along, across = uniaxial(name, 1.2)
    assert corner(solution) == pytest.approx([2 * along, across], rel=1e-8)
    strain, stress = (at_points(solution, name) for name in ("strain", "stress"))
    assert np.allclose(strain[:, 2, 2], across, rtol=1e-7, atol=0)
    assert np.allclose(stress[:, 0, 0], 1.2, rtol=1e-8, atol=0)
    assert np.abs(stress[:, [1, 2], [1, 2]]).max(initial=0.0) < 1e-8
    made, volume = solution.deformation, (1 + along) * (1 + across) ** 2
    assert made.largest_strain == pytest.approx(np.hypot(along, np.sqrt(2) * across), rel=1e-8)
    assert [made.least_volume, made.largest_volume] == pytest.approx([volume] * 2, rel=1e-9)


def test_the_strain_across_counts_among_large_strains():
    """In the plane |eps| is 0.098, and 0.102 with that across."""
    solution = solve(strip(LAWS["linear"], pull=0.094 * YOUNG))
    assert any("[small-strain]" in text for text in solution.warnings)


@pytest.mark.core
@pytest.mark.parallel(2)
def test_a_ring_pressed_inside_is_lames_in_plane_stress():
    """U = p a^2/(E (b^2 - a^2)) ((1 - nu) r + (1 + nu) b^2/r), a = 1 and b = 2."""
    pressure, off = 0.5, []
    for around in (8, 16):
        material = Material(Linear(YOUNG, POISSON)).plane_stress()
        supports = [Fixed("bottom", [None, 0.0]), Fixed("top", [0.0, None])]
        body = Body(material, supports, Load("left", pressure=pressure))
        domain = sector(COMM, around, 90.0)
        solution = solve(Problem(domain, body, Contact("right", 10.0), degree=2))
        assert solution.problem.kinematics == "plane_stress"
        equilibrium = solution.problem.body
        u, x = (
            equilibrium.nodal(solution.state.x)[: equilibrium.owned // 2],
            equilibrium.layout.points,
        )
        r = np.linalg.norm(x, axis=1)
        radial = pressure / YOUNG / 3 * ((1 - POISSON) * r + (1 + POISSON) * 4 / r)
        error = np.abs(u - (radial / r)[:, None] * x).max(initial=0.0)
        off.append(COMM.allreduce(error, op=MPI.MAX) / (pressure / YOUNG))
    assert off[1] < 5e-3
    assert np.log2(off[0] / off[1]) > 1.8  # straight edges of a circle


@pytest.mark.parallel(2)
def test_cooks_membrane():
    """E = 1, nu = 1/3, a shear of 1: the middle of the end rises by 23.96 (Cook 1974; Bergan)."""
    material = Material(Linear(1.0, 1 / 3)).plane_stress()
    body = Body(material, Fixed("left", [0.0, 0.0]), Load("right", traction=[0.0, 1 / 16]))
    solution = solve(Problem(membrane(16, "quadrilateral"), body, Contact("top", 1e3), degree=2))
    equilibrium = solution.problem.body
    u = equilibrium.nodal(solution.state.x)[: equilibrium.owned // 2, 1]
    end = np.all(np.isclose(equilibrium.layout.points, [48.0, 52.0]), axis=1)
    assert np.concatenate(COMM.allgather(u[end]))[0] == pytest.approx(23.96, rel=2e-3)


@pytest.mark.core
@pytest.mark.parallel(2)
def test_a_ceramic_sheet_under_a_voltage_and_a_pull():
    """Strains are those of the whole compliance and of d, in all three directions."""
    voltage, pull = 0.02, 0.03
    ceramic = {key: value for key, value in CERAMIC.items() if key != "law"}
    solution = solve(
        strip(
            {"law": "anisotropic"} | ceramic | {"young": None, "poisson": None},
            pull,
            fixed=[
                {"on": "left", "symmetry": "x"},
                {"on": "bottom", "symmetry": "y", "potential": 0.0},
                {"on": "top", "potential": voltage},
            ],
        ),
        comm=COMM,
    )
    c = np.array([[C11, 7.95, C13], [7.95, C11, C13], [C13, C13, C33]])  # X1, X2, X3
    e = np.array([E31, E31, E33])
    # across, x, y; phi grows along y, by which the field is -voltage
    strain = np.linalg.solve(c, np.array([0.0, pull, 0.0]) - e * voltage)
    assert corner(solution) == pytest.approx([2 * strain[1], strain[2]], rel=1e-9)
    found = at_points(solution, "strain")
    assert np.allclose(found[:, 2, 2], strain[0], rtol=1e-8, atol=0)
    charge = solution.charges.electrodes["top"]
    displacement = e @ strain - BETA33 * voltage
    assert charge == pytest.approx(2 * displacement, rel=1e-9)


@pytest.mark.core
@pytest.mark.parametrize(
    "law",
    [
        J2(YOUNG, POISSON, yield_stress=1.0, hardening=Voce(saturation=0.5, rate=50.0)),
        J2(YOUNG, POISSON, yield_stress=1.0, kinematic=[(30.0, 5.0)]),
        HenckyAtPoints(Log(YOUNG, POISSON, yield_strain=0.003)),
    ],
    ids=["voce", "back stress", "log"],
)
def test_the_tangent_is_the_derivative_of_the_stress(law):
    law, _ = in_plane_stress(law)
    random = np.random.default_rng(2)
    strain = 0.01 * random.standard_normal((40, 4))
    strain[:, 2] = 0.0
    first = {name: np.array([value] * 40) for name, value in law.variables(4).items()}
    variables = law.respond(strain, first).variables
    strain = strain + 0.01 * random.standard_normal((40, 4)) * [1, 1, 0, 1]
    found = law.respond(strain, variables, "tangent")
    moved = random.standard_normal((40, 4)) * [1, 1, 0, 1]
    still = {name: np.zeros_like(value) for name, value in variables.items()}
    known = differential(law, strain, variables, moved, still).stress
    change = np.einsum("nij,nj->ni", found.stiffness, moved)
    assert np.abs(change - known).max() < 1e-4 * np.abs(known).max()
    full = strain.copy()
    full[:, 2] = found.variables[ACROSS]
    own = {name: value for name, value in variables.items() if name != ACROSS}
    whole = law.base.respond(full, own).stress
    assert np.abs(whole[:, 2]).max() < 1e-11
    assert np.allclose(whole[:, [0, 1, 3]], found.stress[:, [0, 1, 3]])


class Counted(HenckyAtPoints):
    """The same, and how often it was asked."""

    asked: ClassVar[int] = 0

    def respond(self, strain, variables, kind=""):
        Counted.asked += 1
        return super().respond(strain, variables, kind)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0])
@pytest.mark.parametrize("argument", ["norm", "square"])
@pytest.mark.parametrize("poisson", [-0.95, 0.3, 0.4999])
def test_the_strain_across_is_that_of_a_bracket(poisson, argument, size):
    """Also beyond e xi_0, where the deviator softens; it ended after 100 steps for nu = .4999."""
    base = Counted(Log(YOUNG, poisson, yield_strain=0.003, argument=argument))
    strain = size * np.random.default_rng(3).standard_normal((20, 4)) * [1, 1, 0, 1]
    Counted.asked = 0
    found = PlaneStressHistory(base).respond(strain, {ACROSS: np.zeros(20)}).variables[ACROSS]
    assert Counted.asked <= 15

    def stress(across, row):
        return base.respond(np.array([[*row[:2], across, row[3]]]), {}).stress[0, 2]

    for row, value in zip(strain, found, strict=True):
        end = abs(row[0] + row[1])
        known = brentq(stress, -end, end, (row,), xtol=1e-15 * size, rtol=1e-14)
        assert value == pytest.approx(known, rel=1e-9, abs=1e-12 * size)


@dataclass(frozen=True)
class Steep(Isotropic):
    """A stress across like arctan, from which Newton's method runs away; or none but tension."""

    swollen: float = 0.0

    def variables(self, size):
        return {}

    def respond(self, strain, variables, kind=""):
        stiffness = isotropic_stiffness(self.bulk, self.shear, strain.shape[1])
        stiffness[2] = stiffness[:, 2] = 0.0
        stress = strain @ stiffness
        shifted = 1e3 * (strain[:, 2] - 0.3)
        stress[:, 2] = self.young * (np.arctan(shifted) + self.swollen)
        found = np.tile(stiffness, (len(strain), 1, 1))
        found[:, 2, 2] = self.young * (1.0 if kind == "secant" else 1e3 / (1 + shifted**2))
        return Response(stress, {}, found)


@pytest.mark.core
def test_the_strain_across_is_found_by_bisection():
    strain = np.array([[0.1, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0], [1e-9, 0.0, 0.0, 0.0]])
    for start in (0.0, 0.301, -50.0):
        found = PlaneStressHistory(Steep(YOUNG, POISSON)).respond(
            strain, {ACROSS: np.full(3, start)}, "tangent"
        )
        assert found.variables[ACROSS] == pytest.approx(0.3, abs=1e-14)
        assert np.all(found.stress[:, 2] == 0)


def test_no_strain_without_stress_across_is_no_solution():
    """The stress is then no number, and the law has no value there."""
    law = PlaneStressHistory(Steep(YOUNG, POISSON, swollen=10.0))
    found = law.respond(np.full((2, 4), 1e-3), {ACROSS: np.zeros(2)}, "tangent")
    assert np.isnan(found.stress).all()
    problem = build_problem(strip({}), law=Steep(YOUNG, POISSON, swollen=10.0))
    with pytest.raises(InputError, match=r"\[overflow\]"):
        solve(problem)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (
            {"space": {"kinematics": "plane_stress", "element": "mean_dilatation", "degree": 2}},
            r"\[plane-stress\]",
        ),
        (
            {
                "material": LAWS["log"] | {"piezo": CERAMIC["piezo"]},
                "fixed": [{"on": "left", "displacement": [0, 0], "potential": 0.0}],
            },
            r"\[plane-stress\]",
        ),
    ],
)
def test_what_is_refused(data, words):
    with pytest.raises(InputError, match=words):
        build_problem(strip(**{"material": {"law": "linear"}} | data))
