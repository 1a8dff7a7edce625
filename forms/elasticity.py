"""Linear elasticity of any symmetry: sigma_ij = c_ijkl eps_kl."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.crystal import (
    VOIGT,
    in_plane,
    isotropic_about_x3,
    stiffness_tensor,
    stiffness_voigt,
    turned,
)
from forms.kinematics import embed


class ElasticConstants(Protocol):
    """The elastic constants of small strains, which every law of the stress has."""

    @property
    def young(self) -> float:
        """Young's modulus E > 0 (stress)."""

    @property
    def poisson(self) -> float:
        """Poisson's ratio, -1 < nu < 1/2."""

    @property
    def bulk(self) -> float:
        """Bulk modulus k0 = E / (3 - 6 nu), equation (7.9)."""

    @property
    def shear(self) -> float:
        """Shear modulus mu1 = E / (2 + 2 nu), equation (7.9)."""


@dataclass(frozen=True, eq=False)
class Anisotropic:
    """A linear elastic material by its stiffness matrix.

    Its elastic constants are Voigt's means over all directions: scales, for solvers alone.

    Parameters
    ----------
    stiffness
        C in Voigt's notation (11, 22, 33, 23, 13, 12), shape (6, 6), in the axes of the body, or a
        UFL expression of that shape (stress).
    placed
        True if a crystal's axes are turned into those of the body, by `rotated` or `in_plane`.
    """

    stiffness: NDArray[np.float64] | Expr
    placed: bool = False

    @property
    def bulk(self) -> float:
        """Voigt's mean of the bulk modulus."""
        c = np.asarray(self.stiffness, dtype=float)
        return float(c[:3, :3].sum()) / 9

    @property
    def shear(self) -> float:
        """Voigt's mean of the shear modulus."""
        c = np.asarray(self.stiffness, dtype=float)
        across = float(c[0, 1] + c[0, 2] + c[1, 2])
        return float(c[0, 0] + c[1, 1] + c[2, 2] - across + 3 * np.trace(c[3:, 3:])) / 15

    @property
    def young(self) -> float:
        """Young's modulus of the means."""
        return 9 * self.bulk * self.shear / (3 * self.bulk + self.shear)

    @property
    def poisson(self) -> float:
        """Poisson's ratio of the means."""
        return (3 * self.bulk - 2 * self.shear) / (6 * self.bulk + 2 * self.shear)

    @property
    def eigenvalues(self) -> NDArray[np.float64]:
        """Eigenvalues of eps -> sigma, ascending, shape (6,) (stress)."""
        return np.asarray(np.linalg.eigvalsh(mandel(self.stiffness)), dtype=np.float64)

    def stress(self, eps: Expr) -> Expr:
        """Return the 3 x 3 stress of a strain."""
        e = embed(eps)
        strains = [e[i, j] if i == j else 2 * e[i, j] for i, j in VOIGT]
        c = self.stiffness
        s = [sum(c[a, b] * strains[b] for b in range(6)) for a in range(6)]
        return ufl.as_tensor([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])

    def energy_density(self, eps: Expr) -> Expr:
        """Return eps : C eps / 2."""
        return ufl.inner(self.stress(eps), embed(eps)) / 2

    def rotated(self, rotation: ArrayLike) -> Anisotropic:
        """Return the material turned by a rotation matrix of shape (3, 3).

        Raises
        ------
        ValueError
            If the matrix is no rotation.
        """
        tensor = stiffness_tensor(np.asarray(self.stiffness))
        return Anisotropic(stiffness_voigt(turned(tensor, rotation)), placed=True)

    def in_plane(self, degrees: float = 90.0) -> Anisotropic:
        """Return the material in a plane body, its X3 at an angle from x: along y by default."""
        return self.rotated(in_plane(degrees))

    def check(self) -> None:
        """Check the matrix, however it was made.

        Raises
        ------
        ValueError
            If it is not 6 x 6, symmetric and positive definite.
        """
        c = np.asarray(self.stiffness, dtype=float)
        if c.shape != (6, 6) or not np.all(np.isfinite(c)):
            raise ValueError("the stiffness must be a finite 6 x 6 matrix")
        if not np.allclose(c, c.T, rtol=1e-10, atol=1e-12 * np.abs(c).max()):
            raise ValueError("the stiffness must be symmetric")
        least, largest = self.eigenvalues[[0, -1]]
        if not least > 1e-12 * largest:
            raise ValueError(
                f"the stiffness must be positive definite; its least eigenvalue is {least:.4g}"
            )

    def check_plane(self) -> None:
        """Check that a plane body in (x, y) stays plane.

        Raises
        ------
        ValueError
            If strains in the plane, or across it, shear the body out of it, or the axis X3 of a
            crystal points out of it without having been turned there.
        """
        c = np.asarray(self.stiffness, dtype=float)
        tensor = stiffness_tensor(c)
        if not self.placed and isotropic_about_x3(tensor):
            if not np.allclose(self.in_plane().stiffness, c, rtol=0, atol=1e-8 * np.abs(c).max()):
                raise ValueError(
                    "the crystal's axis X3 points out of the plane; accepted: law.in_plane(), X3 "
                    "along y, or law.rotated(np.eye(3)) where it is to point there"
                )
        if np.abs(c[3:5][:, [0, 1, 2, 5]]).max() > 1e-10 * np.abs(c).max():
            raise ValueError(
                "the crystal couples strains in the plane with shear out of it: plane strain "
                "does not hold; accepted: law.in_plane() or law.rotated(...) by which it does, "
                "or 3-D"
            )


def mandel(stiffness: ArrayLike) -> NDArray[np.float64]:
    """Return a stiffness matrix in the orthonormal basis of symmetric tensors."""
    factor = np.array([1.0, 1.0, 1.0, *[np.sqrt(2.0)] * 3])
    return np.asarray(stiffness, dtype=float) * np.outer(factor, factor)


def moduli(young: float, poisson: float) -> tuple[float, float]:
    """Return the bulk modulus k0 and the shear modulus mu1 of an isotropic material, (7.9)."""
    return young / (3 - 6 * poisson), young / (2 + 2 * poisson)


def isotropic(young: float, poisson: float) -> NDArray[np.float64]:
    """Return the stiffness matrix of an isotropic material, shape (6, 6)."""
    _, shear = moduli(young, poisson)
    c = np.diag([2 * shear] * 3 + [shear] * 3)
    c[:3, :3] += young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return c


def hexagonal(c11: float, c12: float, c13: float, c33: float, c44: float) -> NDArray[np.float64]:
    """Return the stiffness matrix of class 6mm about X3, shape (6, 6): c66 = (c11 - c12)/2."""
    c = np.diag([c11, c11, c33, c44, c44, (c11 - c12) / 2])
    c[0, 1] = c[1, 0] = c12
    c[:2, 2] = c[2, :2] = c13
    return c
