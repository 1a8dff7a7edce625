"""The piezoelectric material, its two forms, the electric contact, charges and balances."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from contact.body.description import Load
from contact.case.material import Material
from contact.errors import InputError
from contact.interface.friction import Friction
from contact.materials import piezo, rotation
from contact.methods.fixed_point import FixedPoint
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.output.balances import charge_balance, force_balance, mean_potential, sensor
from contact.problem.problem import ContactProblem
from forms.laws import (
    PerfectConductivity,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)
from forms.piezo import (
    VOIGT,
    Piezo,
    coupling_number,
    coupling_stress,
    electric_displacement,
    from_voigt,
    saddle_form,
    symmetrised_form,
)
from tests.problems.piezo import (
    COUPLING,
    PERMITTIVITY,
    SCALED,
    SI,
    example,
    hencky,
    potential,
    pzt,
)

COMM = MPI.COMM_WORLD
CRYSTAL = SCALED.crystal()


def solve(problem, tolerance=1e-9, **options):
    solver = FixedPoint(problem, FixedPointOptions(tolerance=tolerance, **options))
    _, outcome = solver.solve()
    assert outcome.converged, outcome.reason
    return solver


# The material


def voigt(crystal: Piezo):
    e = np.array([[crystal.e[i, j, k] for j, k in VOIGT] for i in range(3)])
    return e, crystal.beta


def test_short_form_is_the_full_matrix():
    e = [
        [0, 0, 0, 0, COUPLING["e15"], 0],
        [0, 0, 0, COUPLING["e15"], 0, 0],
        [COUPLING["e31"], COUPLING["e31"], COUPLING["e33"], 0, 0, 0],
    ]
    beta = np.diag([PERMITTIVITY["beta11"], PERMITTIVITY["beta11"], PERMITTIVITY["beta33"]])
    full = from_voigt(e, beta)
    assert np.array_equal(full.e, CRYSTAL.e)
    assert np.array_equal(full.beta, CRYSTAL.beta)
    assert np.array_equal(voigt(full)[0], e)


def test_plane_reduction_is_the_printed_law():
    """Equation (8.2) with (x, y) = (X2, X3)."""
    a, b, c, p, q = 0.3, -0.7, 0.2, 1.1, -0.4  # eps_xx, eps_yy, eps_xy, phi_x, phi_y
    eps = ufl.as_matrix([[a, c], [c, b]])
    square = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    x = ufl.SpatialCoordinate(square)
    phi = p * x[0] + q * x[1]
    plane = CRYSTAL.in_plane()
    d = [value(electric_displacement(plane, eps, phi)[i], square) for i in range(2)]
    s = [[value(coupling_stress(plane, phi)[i, j], square) for j in range(2)] for i in range(2)]
    e31, e33, e15 = COUPLING["e31"], COUPLING["e33"], COUPLING["e15"]
    b11, b33 = PERMITTIVITY["beta11"], PERMITTIVITY["beta33"]
    assert d == pytest.approx([2 * e15 * c - b11 * p, e31 * a + e33 * b - b33 * q], rel=1e-13)
    assert np.allclose(s, [[e31 * q, e15 * p], [e15 * p, e33 * q]], rtol=1e-13)


def value(expression, domain) -> float:
    return float(fem.assemble_scalar(fem.form(expression * ufl.dx(domain))))


def test_quarter_turns_and_poling_axis():
    turned = CRYSTAL.poled_along([0.0, 1.0, 0.0])
    assert np.allclose(turned.e[1, 1, 1], COUPLING["e33"])
    assert np.allclose(turned.e[1, 0, 0], COUPLING["e31"])
    assert np.allclose(turned.beta, np.diag([*np.diag(CRYSTAL.beta)[[0, 2]], CRYSTAL.beta[0, 0]]))
    back = turned.rotated([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert np.allclose(back.e, CRYSTAL.e, atol=1e-14)
    flipped = CRYSTAL.poled_along([0.0, 0.0, -1.0])
    assert np.allclose(flipped.e, -CRYSTAL.e)
    # Class 6mm is isotropic about its axis, and the plane reduction is a turn of it.
    c, s = np.cos(0.3), np.sin(0.3)
    about = CRYSTAL.rotated([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    assert np.allclose(about.e, CRYSTAL.e, atol=1e-14)
    assert np.allclose(CRYSTAL.in_plane().e, turned.e, atol=1e-14)


@pytest.mark.parametrize("axis", [[0.0, 0.0, 0.0], [1.0, 0.0], [np.nan, 0.0, 1.0]])
def test_bad_axis_is_refused(axis):
    with pytest.raises(ValueError, match="a vector"):
        CRYSTAL.poled_along(axis)


def crystal_of(dim: int, **changes) -> Piezo:
    constants = {**COUPLING, **PERMITTIVITY, **changes}
    section = Material(young=1.0, poisson=0.3, piezo=constants)
    made = piezo(section, rotation(section.axis[1], dim))
    assert made is not None
    return made


def test_poling_of_the_case_file():
    assert np.array_equal(crystal_of(3).e, CRYSTAL.e)
    axis = np.array([1.0, -2.0, 0.5])
    turned = crystal_of(3, poling=axis.tolist())
    unit = axis / np.linalg.norm(axis)
    along = np.einsum("ijk,i,j,k", turned.e, unit, unit, unit)
    assert along == pytest.approx(COUPLING["e33"], rel=1e-14)
    assert unit @ turned.beta @ unit == pytest.approx(PERMITTIVITY["beta33"], rel=1e-14)
    # In the plane by an angle from x; upwards unless said otherwise.
    assert np.allclose(crystal_of(2).e, crystal_of(2, poling=90.0).e, atol=1e-14)
    right = crystal_of(2, poling=0.0)
    assert right.e[0, 0, 0] == pytest.approx(COUPLING["e33"], rel=1e-14)
    assert right.e[0, 1, 1] == pytest.approx(COUPLING["e31"], rel=1e-14)
    assert right.e[1, 0, 1] == pytest.approx(COUPLING["e15"], rel=1e-14)


BAD = {
    "shape": (np.zeros((3, 5)), np.eye(3), "3 x 6"),
    "not symmetric": (np.zeros((3, 6)), np.eye(3) + np.eye(3, k=1), "symmetric"),
    "indefinite": (np.zeros((3, 6)), np.diag([1.0, -1.0, 1.0]), "positive definite"),
    "infinite": (np.full((3, 6), np.inf), np.eye(3), "finite"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_material_is_refused(name):
    e, beta, message = BAD[name]
    with pytest.raises(ValueError, match=message):
        from_voigt(e, beta)


def test_bad_tensors_are_refused():
    lopsided = CRYSTAL.e.copy()
    lopsided[0, 1, 2] += 1.0
    with pytest.raises(ValueError, match="last two indices"):
        Piezo(lopsided, CRYSTAL.beta).check()
    with pytest.raises(ValueError, match="orthogonal"):
        CRYSTAL.rotated(2 * np.eye(3))
    with pytest.raises(ValueError, match="determinant"):
        CRYSTAL.rotated(-np.eye(3))
    with pytest.raises(ValueError, match="out of it"):
        CRYSTAL.poled_along([1.0, 1.0, 1.0]).check_plane()


def test_plane_body_refuses_a_crystal_that_leaves_the_plane(monkeypatch):
    monkeypatch.setattr("tests.problems.piezo.pzt", lambda *_: CRYSTAL.poled_along([1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match="plane strain"):
        example(COMM, (4, 2))


def test_coupling_number():
    """The coupling of a strain e: (e:eps)^2/(beta C) is maximal over all strains."""
    number = coupling_number(SCALED.law(), CRYSTAL)
    shear = COUPLING["e15"] ** 2 / (SCALED.law().shear * PERMITTIVITY["beta11"])
    assert 0.88 < shear < number < 1.0
    assert coupling_number(SI.law(), SI.crystal()) == pytest.approx(number, rel=1e-12)
    turned = CRYSTAL.poled_along([1.0, -2.0, 0.5])
    assert coupling_number(SCALED.law(), turned) == pytest.approx(number, rel=1e-12)


def test_stored_energy_is_positive():
    """B(x; y, y) = 2 W(eps, grad phi) > 0: the coupling cancels, however large."""
    square = mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    space = fem.functionspace(square, ("Lagrange", 1, (3,)))
    rng = np.random.default_rng(1)
    for scale in (0.0, 1.0, 1e3):
        crystal = SCALED.crystal(scale).in_plane()
        x = fem.Function(space)
        x.x.array[:] = rng.standard_normal(x.x.array.size)
        u, phi = ufl.as_vector([x[0], x[1]]), x[2]
        form = saddle_form(SCALED.law(), crystal, u, u, phi, u, phi)
        bare = saddle_form(SCALED.law(), Piezo(0 * crystal.e, crystal.beta), u, u, phi, u, phi)
        assert value(form, square) == pytest.approx(value(bare, square), rel=1e-9)
        assert value(form, square) > 0


# The two forms


def both_forms(dim: int, degree: int, law):
    """Return the matrices of the saddle and the symmetrised form, and their space."""
    if dim == 2:
        body = mesh.create_unit_square(MPI.COMM_SELF, 4, 3)
    else:
        body = mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 1)
    space = fem.functionspace(body, ("Lagrange", degree, (dim + 1,)))
    frozen = fem.Function(space)
    frozen.interpolate(lambda x: np.array([0.5 * x[0] * x[1]] * dim + [0 * x[0]]))
    trial, test = ufl.TrialFunction(space), ufl.TestFunction(space)

    def split(f):
        return ufl.as_vector([f[i] for i in range(dim)]), f[dim]

    (u, phi), (v, xi), (u_0, _) = split(trial), split(test), split(frozen)
    dx = ufl.Measure("dx", body, metadata={"quadrature_degree": 4})
    matrices = []
    for form in (saddle_form, symmetrised_form):
        compiled = fem.form(form(law, pzt(dim), u_0, u, phi, v, xi) * dx)
        matrices.append(fem.assemble_matrix(compiled).to_scipy())
    return space, matrices


@pytest.mark.parametrize("law", [SCALED.law(), hencky(0.1)], ids=["linear", "log"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_forms_agree_entry_by_entry(dim, degree, law):
    _, (saddle, symmetrised) = both_forms(dim, degree, law)
    sign = np.ones(saddle.shape[0])
    sign[dim :: dim + 1] = -1.0
    saddle, symmetrised = saddle.toarray(), symmetrised.toarray()
    size = np.abs(saddle).max()
    assert np.abs(saddle * sign[:, None] - symmetrised).max() <= 1e-15 * size
    assert np.abs(symmetrised - symmetrised.T).max() <= 1e-14 * size
    assert np.abs(saddle - saddle.T).max() > 1e-2 * size
    assert np.linalg.eigvalsh(saddle + saddle.T).min() > -1e-12 * size
    assert np.linalg.eigvalsh(symmetrised).min() < -1e-2 * size


@pytest.mark.parametrize("dim", [2, 3])
def test_solutions_of_both_forms_agree(dim):
    space, (saddle, symmetrised) = both_forms(dim, 1, SCALED.law())
    x = space.tabulate_dof_coordinates()
    free = np.flatnonzero(np.repeat(x[:, 0] > 1e-9, dim + 1))
    load = np.random.default_rng(2).standard_normal(saddle.shape[0])
    sign = np.ones(load.size)
    sign[dim :: dim + 1] = -1.0
    a = np.linalg.solve(saddle.toarray()[np.ix_(free, free)], load[free])
    b = np.linalg.solve(symmetrised.toarray()[np.ix_(free, free)], (sign * load)[free])
    assert np.abs(a - b).max() <= 1e-10 * np.abs(a).max()


# Turned bodies


@pytest.mark.parametrize("cells", [(16, 8), (4, 2, 3)], ids=["plane", "space"])
def test_turned_body(cells):
    """Rotated body, load and poling axis: the rotated solution to rounding."""
    found = []
    for degrees in (0.0, 37.0):
        problem = example(COMM, cells, -10.0, degrees=degrees)
        solver = solve(problem, 1e-12)
        nodal = problem.nodal(solver.state)
        normal = problem.nodes.normal_component(nodal)
        along = np.linalg.norm(problem.nodes.tangential_component(nodal), axis=1)
        found.append(
            (solver.state.forces.pressure, normal, along, potential(problem, solver.state))
        )
    for straight, turned in zip(*found, strict=True):
        assert np.abs(straight - turned).max() <= 1e-9 * np.abs(straight).max() + 1e-10


def test_turned_frictionless_body_to_rounding():
    found = []
    for degrees in (0.0, 37.0):
        problem = example(COMM, (16, 8), -10.0, friction=Friction(), degrees=degrees)
        solver = solve(problem, 1e-13)
        found.append((solver.state.forces.pressure, potential(problem, solver.state)))
    for straight, turned in zip(*found, strict=True):
        assert np.abs(straight - turned).max() <= 1e-11 * np.abs(straight).max()


# Electric contact


def test_conductivity_laws():
    s = np.array([-1.0, -0.5, -0.25, 0.0, 0.1, 1.0])
    shifted = ShiftedConductivity(2.0, 2.0)
    assert np.allclose(shifted(s), [0, 0, 1, 2, 2, 2])
    ramp = RampConductivity(2.0, 2.0)
    assert np.allclose(ramp(s), [0, 0, 0, 0, 0.4, 2])
    assert np.allclose(PerfectConductivity(2.0).at(s, s > 0, s > 0), [0, 0, 0, 0, 2, 2])
    assert np.allclose(Truncation(0.3)(s), [-0.3, -0.3, -0.25, 0, 0.1, 0.3])


def test_printed_ramp_does_not_conduct(monkeypatch):
    monkeypatch.setattr("tests.problems.piezo.ShiftedConductivity", RampConductivity)
    ramp = example(COMM, (16, 8), -10.0)
    bare = example(COMM, (16, 8), -10.0, k_e=0.0)
    found, expected = (potential(one, solve(one).state) for one in (ramp, bare))
    assert np.allclose(found, expected, rtol=1e-8)


def test_truncation_limits_the_charge():
    problem = example(COMM, (16, 8), -10.0, limit=3.0)
    solver = solve(problem)
    charge = charge_balance(problem, solver.state)
    assert np.abs(potential(problem, solver.state) - 32.0).min() > 3.0
    # The node at the clamped end is an electrode's; the foundation takes 3 k_e elsewhere.
    assert charge.foundation == pytest.approx(-3.0 * problem.nodes.weight.sum(), rel=1e-9)


OPTIONS = {Newton: NewtonOptions(), FixedPoint: FixedPointOptions()}


@pytest.mark.parametrize("limit", [np.inf, 1.0])
@pytest.mark.parametrize("method", OPTIONS)
def test_body_without_ground(method, limit):
    """The foundation alone sets the level of the potential, also where its charge is truncated."""
    found = []
    for phi_f in (0.0, 32.0):
        problem = example(COMM, (16, 8), -10.0, phi_f=phi_f, limit=limit, grounded=False)
        solver = method(problem, OPTIONS[method])
        assert solver.solve()[1].converged
        assert charge_balance(problem, solver.state).imbalance < 1e-8
        found.append(potential(problem, solver.state) - phi_f)
    assert np.allclose(found[0], found[1], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("k_e", [1e-3, 1e-2, 1e-1])
def test_lagged_and_implicit_current_agree(k_e):
    found = []
    for lagged in (False, True):
        problem = example(COMM, (16, 8), k_e=k_e, lagged=lagged)
        solver = solve(problem)
        found.append((potential(problem, solver.state), len(solver.history.records)))
    assert np.allclose(found[0][0], found[1][0], rtol=1e-7, atol=1e-7)
    assert found[0][1] <= found[1][1]


# Charges, balances and the sensor


@pytest.mark.parallel
@pytest.mark.parametrize("law", [None, hencky(1.0)], ids=["linear", "log"])
@pytest.mark.parametrize("cells", [(16, 8), (4, 2, 3)], ids=["plane", "space"])
def test_global_balances(cells, law):
    problem = example(COMM, cells, law=law)
    solver = solve(problem)
    charges, forces = charge_balance(problem, solver.state), force_balance(problem, solver.state)
    assert charges.imbalance < 1e-8
    assert forces.imbalance < 1e-8
    depth = 1.0 if len(cells) == 2 else 2.0
    assert forces.applied[-1] == pytest.approx(-480.0 * depth, rel=1e-12)
    assert charges.electrodes["left"] == pytest.approx(-charges.foundation, rel=1e-7)
    assert charges.foundation < 0  # it comes from a foundation at 32


def test_given_charges_balance():
    from tests.problems.mechanics import constant

    problem = example(COMM, (8, 4), k_e=0.5)
    charges = [Load("right", charge=constant(0.7, 2)), Load(None, charge=constant(-0.2, 2))]
    problem = ContactProblem(
        problem.domain,
        replace(problem.body, loads=[*problem.body.loads, *charges]),
        problem.contacts,
    )
    solver = solve(problem)
    charges = charge_balance(problem, solver.state)
    assert charges.given["right"] == pytest.approx(0.7 * 4.0, rel=1e-12)
    assert charges.body == pytest.approx(-0.2 * 32.0, rel=1e-12)
    assert charges.imbalance < 1e-8


def test_sensor_reads_in_proportion_to_the_load():
    """Linear material, full contact, no friction and no conduction: everything is linear."""
    readings = []
    for load in (-5.0, -10.0):
        problem = example(COMM, (16, 8), load, friction=Friction(), k_e=0.0)
        solver = solve(problem, 1e-11)
        shorted = sensor(problem, solver.state, "left")
        strip = sensor(problem, solver.state, "top")
        assert strip.charge is None
        assert shorted.potential == pytest.approx(0.0, abs=1e-12)
        readings.append(
            (shorted.charge, strip.potential, mean_potential(problem, solver.state, "bottom"))
        )
    assert np.allclose(2 * np.array(readings[0]), readings[1], rtol=1e-8, atol=1e-9)


def test_charges_need_a_potential():
    from tests.problems.mechanics import bar

    problem = bar(COMM, 2)
    solver = FixedPoint(problem, FixedPointOptions(max_outer=0))
    with pytest.raises(InputError, match="piezoelectric"):
        charge_balance(problem, solver.state)
