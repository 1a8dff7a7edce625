"""Anisotropic elasticity: isotropic constants, rotations, definiteness."""

import numpy as np
import pytest
import ufl

from forms.crystal import (
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
from forms.piezo import coupling_number
from forms.piezo import hexagonal as piezo

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
