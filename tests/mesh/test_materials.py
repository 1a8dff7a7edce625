"""Several materials by region: closed forms of layers, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    FixedPointOptions,
    Friction,
    InputError,
    Load,
    Material,
    NewtonOptions,
    Problem,
    build_problem,
    parse_case,
    solve,
)
from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.results.fields import DerivedFields
from forms.hencky import Linear
from forms.piezo import hexagonal
from scripts.studies.error_norms import errors
from tests.problems.mechanics import constant

COMM = MPI.COMM_WORLD
LOWER, UPPER = 2.0, 1000.0


def two_layers(split: float = 0.5, name: str = "upper"):
    """Return a square with the regions ``lower`` and ``upper``, which share their nodes."""
    mesh = rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (8, 8)).mesh
    sides = {
        "bottom": lambda x: np.isclose(x[1], 0.0),
        "top": lambda x: np.isclose(x[1], 1.0),
        "left": lambda x: np.isclose(x[0], 0.0),
        "right": lambda x: np.isclose(x[0], 1.0),
    }
    regions = {"lower": lambda x: x[1] < split + 1e-9, name: lambda x: x[1] > split - 1e-9}
    return from_mesh(mesh, sides, regions=regions)


def case(material, **more):
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [1.0, 1.0], "cells": [8, 8]},
            "material": material,
            "fixed": [{"on": side, "displacement": [0.0, "free"]} for side in ("left", "right")],
            "load": [{"on": "top", "pressure": 0.1}],
            "contact": {"on": "bottom"},
            **more,
        }
    )


def materials(first=None, second=None):
    return [
        {"on": "lower", "young": LOWER, "poisson": 0.3, **(first or {})},
        {"on": ["upper"], "young": UPPER, "poisson": 0.1, **(second or {})},
    ]


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("degree", [1, 2])
def test_layers_in_series(law: str, degree: int) -> None:
    """Held at its sides, each layer is compressed by p/(K + 4G/3): by its own material."""
    log = {"law": "log", "yield_strain": 10.0} if law == "log" else {}
    given = case(materials(first=log), space={"degree": degree})
    solution = solve(given, domain=two_layers())
    assert solution.converged
    problem = solution.problem
    laws = [material.law for material in problem.description.materials]
    moduli = [float(law.bulk + 4 / 3 * law.shear) for law in laws]
    assert problem.scales.young == LOWER
    y = problem.body.space.tabulate_dof_coordinates()[:, 1]
    depth = 0.1 * (np.minimum(y, 0.5) / moduli[0] + np.maximum(y - 0.5, 0) / moduli[1])
    u = solution.state.x.reshape(-1, 2)
    np.testing.assert_allclose(u[:, 1], -depth, rtol=0, atol=1e-10)
    across = DerivedFields(problem.body, solution.state).cells()["stress"]
    expected = [
        -0.1 * float(law.bulk - 2 / 3 * law.shear) / m for law, m in zip(laws, moduli, strict=True)
    ]
    stress = across.x.array.reshape(-1, 9)
    nearest = np.abs(stress[:, :1] - expected).min(axis=1, initial=np.inf)
    assert nearest.max(initial=0.0) < 1e-9
    np.testing.assert_allclose(stress[:, 4], -0.1, rtol=1e-8)
    fields = DerivedFields(problem.body, solution.state)
    strains = [largest.strain for largest in fields.extremes()]
    np.testing.assert_allclose(strains, 0.1 / np.array(moduli) * np.sqrt(2 / 3), rtol=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("beside", [True, False])
def test_a_soft_part_away_from_the_contact(beside: bool) -> None:
    """Gamma and r have the modulus at Gamma_3: with that of the soft part steps were 309, 2059."""
    grid = rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (16, 16), cell="quadrilateral")

    def soft(x):
        return (x[1] > 0.75 - 1e-9) & ((x[0] < 0.25 + 1e-9) | (not beside))

    sides = {"bottom": lambda x: np.isclose(x[1], 0.0), "top": lambda x: np.isclose(x[1], 1.0)}
    # Of cells with all their vertices in these places.
    hard = {"hard": lambda x: (x[1] < 0.75 + 1e-9) | ((x[0] > 0.25 - 1e-9) & beside)}
    domain = from_mesh(grid.mesh, sides, regions={"soft": soft, **hard})
    contact = Contact("bottom", lambda x: 0.01 * (x[0] - 0.4) ** 2, friction=Friction(mu=0.3))
    for ratio, relaxations in ((1e-4, 600), (1e-6, None)):
        laws = [(UPPER, "hard"), (ratio * UPPER, "soft")]
        materials = [Material(Linear(young, 0.3), on=name) for young, name in laws]
        body = Body(materials, [Fixed("top", [1e-3, -4e-3])])
        problem = Problem(domain, body, contact)
        assert problem.scales.young == ratio * UPPER
        assert problem.scales.contact_young == UPPER
        solution = solve(problem, NewtonOptions())
        assert solution.converged and solution.counters.contact_solves < 15
        if relaxations is not None:
            other = solve(problem, FixedPointOptions())
            assert other.converged and other.counters.linear_solves < relaxations
            assert other.contact_force == pytest.approx(solution.contact_force, rel=1e-6)


@pytest.mark.parallel
@pytest.mark.parametrize("factor", [1e-4, 100.0, 1e6])
def test_a_factor_is_part_of_the_modulus(factor: float) -> None:
    """Pressures were off by 9e-3 with a factor of 1e6 of a small modulus, and converged."""
    found = []
    for law, given in ((Linear(UPPER, 0.3), None), (Linear(UPPER / factor, 0.3), factor)):
        domain = rectangle(COMM, (0.0, 0.0), (1.0, 1.0), (8, 8))
        body = Body(Material(law, factor=given), [Fixed("top", [1e-3, -4e-3])])
        contact = Contact("bottom", lambda x: 0.01 * (x[0] - 0.4) ** 2, friction=Friction(mu=0.3))
        solution = solve(Problem(domain, body, contact))
        assert solution.converged
        assert solution.problem.scales.young == pytest.approx(UPPER)
        found.append(solution)
    one, other = found
    scale = one.problem.nodes.maximum(one.pressure)
    np.testing.assert_allclose(other.pressure, one.pressure, rtol=0, atol=1e-9 * scale)
    assert one.counters.contact_solves == other.counters.contact_solves


def test_the_energy_norm_knows_the_materials() -> None:
    laws = Linear(LOWER, 0.3), Linear(UPPER, 0.1)
    zero = constant(0.0, 2)
    body = Body(
        [Material(laws[0], on=("lower",)), Material(laws[1], on=("upper",))],
        [Fixed("bottom", [zero, zero])],
        [Load("top", pressure=constant(0.1, 2))],
    )
    equilibrium = BodyEquilibrium(two_layers(0.25), body)
    points = equilibrium.space.tabulate_dof_coordinates()
    x = np.zeros_like(equilibrium.zero_displacement())
    x[::2] = 0.1 * points[:, 1]
    energy = 0.01 * (0.25 * laws[0].shear + 0.75 * laws[1].shear)
    assert errors(equilibrium, x, None).energy == pytest.approx(np.sqrt(energy), rel=1e-12)
    # The nodal forces do this work.
    work = float(x @ equilibrium.internal_forces(BodyState(x)))
    assert COMM.allreduce(work) == pytest.approx(energy, rel=1e-12)


def test_one_material_for_both_regions_is_one_material() -> None:
    whole = solve(case({"young": LOWER, "poisson": 0.3}), domain=two_layers())
    both = {"on": ["lower", "upper"], "young": LOWER, "poisson": 0.3}
    for material in (both, [both], [{"young": LOWER, "poisson": 0.3}]):
        again = solve(case(material), domain=two_layers())
        np.testing.assert_array_equal(again.state.x, whole.state.x)


@pytest.mark.parallel
def test_a_soft_layer_far_from_the_contact_excuses_nothing() -> None:
    """Contact is weighed by its own modulus: by the layer's, gaps and slips were too small."""

    def force(young: float, method: str):
        soft = {"young": young, "poisson": 0.3}
        given = case(
            materials(second=soft),
            fixed=[{"on": "right", "displacement": [0.0, 0.0]}],
            load=[{"on": "top", "traction": [0.02, -0.1]}],
            friction={"law": "coulomb", "mu": 0.3},
            solver={"method": method},
        )
        solution = solve(given, domain=two_layers())
        assert solution.converged
        return solution.contact_force

    found = force(1e-3 * LOWER, "newton")
    assert force(1e-8 * LOWER, "newton") == pytest.approx(found, rel=5e-3)
    assert force(1e-3 * LOWER, "penalty") == pytest.approx(found, rel=0.2)


@pytest.mark.parallel
def test_an_elastic_part_carries_no_field() -> None:
    """An elastic layer under a piezoelectric one: the potential ends where that one ends."""
    piezo = hexagonal(-1.0, 3.0, 2.0, 8.0, 7.0).in_plane()
    zero, one = constant(0.0, 2), constant(1.0, 2)
    law = Linear(10.0, 0.3)
    body = Body(
        [Material(law, on=("lower",)), Material(law, piezo, ("upper",))],
        [Fixed("bottom", [zero, zero]), Fixed("top", None, one)],
    )
    equilibrium = BodyEquilibrium(two_layers(), body)
    free = equilibrium.free[:, -1]
    y = equilibrium.layout.points[:, 1]
    np.testing.assert_array_equal(free, (y > 0.49) & (y < 0.99))
    x = equilibrium.prescribe(equilibrium.zero_displacement())
    assert np.abs(equilibrium.internal_forces(BodyState(x))).max(initial=0.0) < np.inf


@pytest.mark.parametrize(
    ("material", "message"),
    [
        (materials()[:1], r"\[regions\]"),
        ([*materials()[:1], {"young": 1.0, "poisson": 0.3}], r"material\.1\.on.*\[missing\]"),
        (materials(second={"on": "uper"}), r"\[part-name\]"),
        (materials(second={"on": "upper", "yung": 1}), r"material\.1\.yung.*\[unknown-key\]"),
    ],
)
def test_what_is_refused(material, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build_problem(case(material), domain=two_layers())


def test_a_cell_has_one_material() -> None:
    given = case([{**materials()[0], "on": "lower"}, {**materials()[1], "on": "all"}])
    mesh = two_layers().mesh
    sides = {name: facets for name, facets in two_layers().parts.items()}
    regions = {"lower": lambda x: x[1] < 0.51, "all": lambda x: x[1] < 2.0}
    with pytest.raises(InputError, match=r"material\.1\.on.*\[regions\]"):
        build_problem(given, domain=from_mesh(mesh, sides, regions=regions))
    del regions["all"]
    alone = case([{**materials()[0], "on": "lower"}])
    with pytest.raises(InputError, match=r"\[regions\]"):
        build_problem(alone, domain=from_mesh(mesh, sides, regions=regions))
