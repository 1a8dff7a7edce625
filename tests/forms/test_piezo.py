"""The piezoelectric material: tensors turned, refused, and the two forms.

Anisotropic elasticity: isotropic constants, rotations, definiteness.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from forms.crystal import (
    VOIGT,
    about_z,
    in_plane,
    isotropic_about_x3,
    stiffness_tensor,
    stiffness_voigt,
    to_axis,
    turned,
)
from forms.elasticity import Anisotropic, hexagonal, isotropic
from forms.hencky import Linear, energy_density, stress
from forms.piezo import (
    Piezo,
    coupling_number,
    coupling_stress,
    electric_displacement,
    from_voigt,
    saddle_form,
    symmetrised_form,
)
from forms.piezo import hexagonal as piezo
from tests.problems.piezo import COUPLING, PERMITTIVITY, SCALED, SI, hencky, pzt

CRYSTAL = SCALED.crystal()


def voigt(crystal: Piezo):
    e = np.array([[crystal.e[i, j, k] for j, k in VOIGT] for i in range(3)])
    return e, crystal.beta


@pytest.mark.core
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


@pytest.mark.core
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


@pytest.mark.core
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


@pytest.mark.core
def test_coupling_number():
    """The coupling of a strain e: (e:eps)^2/(beta C) is maximal over all strains."""
    number = coupling_number(SCALED.law(), CRYSTAL)
    shear = COUPLING["e15"] ** 2 / (SCALED.law().shear * PERMITTIVITY["beta11"])
    assert 0.88 < shear < number < 1.0
    assert coupling_number(SI.law(), SI.crystal()) == pytest.approx(number, rel=1e-12)
    turned = CRYSTAL.poled_along([1.0, -2.0, 0.5])
    assert coupling_number(SCALED.law(), turned) == pytest.approx(number, rel=1e-12)


@pytest.mark.core
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


def both_forms(dim: int, degree: int, law):
    """Return the matrices of the saddle and the symmetrised form."""
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
    for form in (saddle_form, symmetrised_form):
        compiled = fem.form(form(law, pzt(dim), u_0, u, phi, v, xi) * dx)
        yield fem.assemble_matrix(compiled).to_scipy().toarray()


@pytest.mark.core
@pytest.mark.parametrize("law", [SCALED.law(), hencky(0.1)], ids=["linear", "log"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_forms_agree_entry_by_entry(dim, degree, law):
    saddle, symmetrised = both_forms(dim, degree, law)
    sign = np.ones(saddle.shape[0])
    sign[dim :: dim + 1] = -1.0
    size = np.abs(saddle).max()
    assert np.abs(saddle * sign[:, None] - symmetrised).max() <= 1e-15 * size
    assert np.abs(symmetrised - symmetrised.T).max() <= 1e-14 * size
    assert np.abs(saddle - saddle.T).max() > 1e-2 * size
    assert np.linalg.eigvalsh(saddle + saddle.T).min() > -1e-12 * size
    assert np.linalg.eigvalsh(symmetrised).min() < -1e-2 * size


PZT = hexagonal(139.0, 77.8, 74.3, 113.0, 25.6)


def numbers(expression, shape):
    return np.array([float(expression[index]) for index in np.ndindex(shape)]).reshape(shape)


@pytest.mark.core
def test_isotropic_constants_give_the_isotropic_law():
    law, other = Linear(7.0, 0.3), Anisotropic(isotropic(7.0, 0.3))
    for name in ("young", "poisson", "bulk", "shear"):
        assert getattr(other, name) == pytest.approx(getattr(law, name), rel=1e-12)
    eps = np.random.default_rng(0).normal(size=(3, 3))
    eps = ufl.as_tensor((eps + eps.T).tolist())
    one, two = (numbers(stress(m, eps), (3, 3)) for m in (law, other))
    assert np.abs(one - two).max() < 1e-12 * np.abs(one).max()
    energies = [float(energy_density(m, eps)) for m in (law, other)]
    assert energies[0] == pytest.approx(energies[1], rel=1e-12)
    crystal = piezo(-5.4, 15.8, 12.3, 8.1, 7.3)
    assert coupling_number(law, crystal) == pytest.approx(
        coupling_number(other, crystal), rel=1e-10
    )


@pytest.mark.core
def test_rotated_material_and_strain_give_the_rotated_stress():
    q = to_axis([1.0, -2.0, 0.7]) @ about_z(33.0)
    eps = np.random.default_rng(1).normal(size=(3, 3))
    eps = eps + eps.T
    here = numbers(Anisotropic(PZT).stress(ufl.as_tensor(eps.tolist())), (3, 3))
    there = Anisotropic(PZT).rotated(q).stress(ufl.as_tensor((q @ eps @ q.T).tolist()))
    assert np.allclose(numbers(there, (3, 3)), q @ here @ q.T, rtol=0, atol=1e-11)
    eigenvalues = Anisotropic(PZT).rotated(q).eigenvalues
    assert np.allclose(eigenvalues, Anisotropic(PZT).eigenvalues, rtol=1e-12)


@pytest.mark.core
def test_class_6mm_in_the_plane():
    """Along x and y are X2 and X3: c11 along x, c33 along y."""
    c = Anisotropic(PZT).rotated(in_plane()).stiffness
    assert np.diag(c) == pytest.approx([139.0, 113.0, 139.0, 25.6, 30.6, 25.6], rel=1e-12)
    assert (c[0, 1], c[0, 2], c[1, 2]) == pytest.approx((74.3, 77.8, 74.3), rel=1e-12)
    along_x = Anisotropic(PZT).rotated(in_plane(0.0)).stiffness
    assert np.diag(along_x) == pytest.approx([113.0, 139.0, 139.0, 30.6, 25.6, 25.6], rel=1e-12)
    Anisotropic(c).check_plane()


@pytest.mark.core
def test_voigt_and_tensor():
    matrix = np.arange(36.0).reshape(6, 6)
    matrix = matrix + matrix.T
    assert np.array_equal(stiffness_voigt(stiffness_tensor(matrix)), matrix)
    assert np.allclose(turned(stiffness_tensor(PZT), about_z(17.0)), stiffness_tensor(PZT))
    assert isotropic_about_x3(stiffness_tensor(PZT))
    assert not isotropic_about_x3(turned(stiffness_tensor(PZT), to_axis([1.0, 0.0, 0.0])))


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.eye(5), "6 x 6"),
        (np.full((6, 6), np.nan), "finite"),
        (np.eye(6) + 0.1 * np.eye(6, k=1), "symmetric"),
        (hexagonal(1.0, 1.1, 0.0, 1.0, 1.0), "positive definite"),
        (hexagonal(1.0, 0.5, 2.0, 1.0, 1.0), "positive definite"),
    ],
)
def test_what_is_no_stiffness_is_refused(matrix, words):
    with pytest.raises(ValueError, match=words):
        Anisotropic(matrix).check()


def test_a_crystal_that_leaves_the_plane_is_refused():
    tilted = Anisotropic(PZT).rotated(to_axis([1.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="out of it"):
        tilted.check_plane()
