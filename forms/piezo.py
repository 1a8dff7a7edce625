"""Piezoelectric bodies: material tensors, the saddle form A and its symmetrised twin.

Sign convention, stated once, equations (1.23) and (8.2), with the potential phi:

    sigma = F eps(u) + e^T grad(phi),     (e^T grad phi)_jk = e_ijk phi_,i
    D     = e eps(u) - beta grad(phi),    D_i = e_ijk eps_jk - beta_ij phi_,j

Tensors are three-dimensional. A plane body lies in (x, y) = (X2, X3) of the crystal, whose
axis X3 is that of poling; X1 points out of the plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.hencky import Hencky, secant_stress
from forms.kinematics import embed, strain

#: Pairs of tensor indices in the order of Voigt's notation.
VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))

#: The crystal axes that a plane body's x, y and z stand for.
PLANE_AXES = (1, 2, 0)


@dataclass(frozen=True)
class Piezo:
    """Piezoelectric and dielectric tensors in the axes of the body.

    Parameters
    ----------
    e
        Coupling e_ijk, shape (3, 3, 3) or a UFL expression of that shape (charge/area).
    beta
        Permittivity, shape (3, 3) (charge/(potential length)).
    """

    e: NDArray[np.float64] | Expr
    beta: NDArray[np.float64] | Expr

    def rotated(self, rotation: ArrayLike) -> Piezo:
        """Return the material turned by a rotation matrix of shape (3, 3)."""
        q = np.asarray(rotation, dtype=float)
        e = np.einsum("ia,jb,kc,abc->ijk", q, q, q, self.e)
        return Piezo(e, q @ np.asarray(self.beta) @ q.T)

    def in_plane(self) -> Piezo:
        """Return the material with the crystal's (X2, X3, X1) along the body's (x, y, z)."""
        axes = np.array(PLANE_AXES)
        return Piezo(np.asarray(self.e)[np.ix_(axes, axes, axes)], self.beta[np.ix_(axes, axes)])


def from_voigt(e: ArrayLike, beta: ArrayLike) -> Piezo:
    """Return the material of Voigt matrices: e (3 x 6: xx yy zz yz xz xy), beta (3 x 3).

    Raises
    ------
    ValueError
        If a shape is wrong, or the permittivity is not symmetric positive definite: the
        stored energy would not be positive.
    """
    e, beta = np.asarray(e, dtype=float), np.asarray(beta, dtype=float)
    if e.shape != (3, 6) or beta.shape != (3, 3):
        raise ValueError(f"e must be 3 x 6 and beta 3 x 3; got {e.shape} and {beta.shape}")
    if not np.allclose(beta, beta.T, rtol=1e-10, atol=0):
        raise ValueError("the permittivity beta must be symmetric")
    if not np.all(np.linalg.eigvalsh(beta) > 0):
        raise ValueError("the permittivity beta must be positive definite")
    tensor = np.zeros((3, 3, 3))
    for column, (j, k) in enumerate(VOIGT):
        tensor[:, j, k] = tensor[:, k, j] = e[:, column]
    return Piezo(tensor, beta)


def hexagonal(e31: float, e33: float, e15: float, beta11: float, beta33: float) -> Piezo:
    """Return a material of class 6mm poled along z, with e32 = e31 and e24 = e15."""
    e = np.zeros((3, 6))
    e[2, :3] = e31, e31, e33
    e[0, 4] = e[1, 3] = e15
    return from_voigt(e, np.diag([beta11, beta11, beta33]))


def gradient(phi: Expr) -> Expr:
    """Return grad(phi) as a vector of three components."""
    g = ufl.grad(phi)
    return g if g.ufl_shape == (3,) else ufl.as_vector([g[0], g[1], 0.0])


def coupling_stress(piezo: Piezo, phi: Expr) -> Expr:
    """Return e^T grad(phi), a 3 x 3 stress."""
    i, j, k = ufl.indices(3)
    e = ufl.as_tensor(piezo.e.tolist()) if isinstance(piezo.e, np.ndarray) else piezo.e
    return ufl.as_tensor(e[i, j, k] * gradient(phi)[i], (j, k))


def electric_displacement(piezo: Piezo, eps: Expr, phi: Expr) -> Expr:
    """Return D = e eps - beta grad(phi), a vector of three components."""
    i, j, k = ufl.indices(3)
    e = ufl.as_tensor(piezo.e.tolist()) if isinstance(piezo.e, np.ndarray) else piezo.e
    beta = ufl.as_tensor(piezo.beta.tolist()) if isinstance(piezo.beta, np.ndarray) else piezo.beta
    induced = ufl.as_tensor(e[i, j, k] * embed(eps)[j, k], (i,))
    return induced - ufl.dot(beta, gradient(phi))


def _mechanical(law: Hencky, piezo: Piezo, u: Expr, v: Expr, eta: Expr, w: Expr) -> Expr:
    sigma = secant_stress(law, strain(u), strain(v)) + coupling_stress(piezo, eta)
    return ufl.inner(sigma, embed(strain(w)))


def saddle_form(
    law: Hencky, piezo: Piezo, u: Expr, v: Expr, eta: Expr, w: Expr, xi: Expr
) -> Expr:
    """Return the integrand of B(x; y, z): positive, not symmetric, equation (5.16).

    x = (u, .) is where the secant modulus is frozen, y = (v, eta) the unknown and
    z = (w, xi) the test function.
    """
    d = electric_displacement(piezo, strain(v), eta)
    return _mechanical(law, piezo, u, v, eta, w) - ufl.inner(d, gradient(xi))


def symmetrised_form(
    law: Hencky, piezo: Piezo, u: Expr, v: Expr, eta: Expr, w: Expr, xi: Expr
) -> Expr:
    """Return the integrand of B-check(x; y, z) = B(x; y, (w, -xi)), equations (5.27), (5.31).

    Symmetric and indefinite: convex in v, concave in eta.
    """
    return saddle_form(law, piezo, u, v, eta, w, -xi)
