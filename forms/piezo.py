"""Piezoelectric bodies: material tensors, the forms A and A-check of the thesis.

Sign convention, stated once, equations (1.23) and (8.2), with the potential phi:

    sigma = F eps(u) + e^T grad(phi),     (e^T grad phi)_jk = e_ijk phi_,i
    D     = e eps(u) - beta grad(phi),    D_i = e_ijk eps_jk - beta_ij phi_,j

The solver takes `symmetrised_form`: A-check of (5.27), with B-check of the fixed point. It is
symmetric and indefinite, its quadratic form convex in u and concave in phi: the solution is a
saddle point of it.

`saddle_form` is A of (5.16), with B, for comparison in tests and notebooks: A-check with xi
negated. It is not symmetric, and positive:
B(x; x, x) = F eps : eps + beta grad(phi) . grad(phi). Its matrix [[F, e^T], [-e, beta]] is that of
the saddle-point system with the second row negated.

With the outward normal, D.nu = q_2 on a charged part, div D = q_0 in the body and
D.nu = psi(u_nu - rho) phi_L(phi - phi_F) on a conductive foundation. On the left-hand side of A
these are + q_2 xi, - q_0 xi and + psi phi_L xi, (5.10), (5.14), on that of A-check the opposite,
(5.28), (5.29).

The stored energy is (1/2) eps : F eps + (1/2) E . beta E with E = -grad(phi): the coupling
does no work on its own, so that it is positive if F and beta are, whatever e.

Tensors are three-dimensional; how a crystal lies in a plane body is said in `forms.crystal`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from numpy.typing import ArrayLike, NDArray
from ufl.core.expr import Expr

from forms.crystal import PLANE, VOIGT, coupling_tensor, to_axis, turned
from forms.elasticity import Anisotropic, isotropic, mandel
from forms.hencky import FormLaw, Law, secant_stress
from forms.kinematics import CARTESIAN, CellMean, Isochoric, Strained, embed, strain


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
        """Return the material turned by a rotation matrix of shape (3, 3).

        Raises
        ------
        ValueError
            If the matrix is no rotation.
        """
        return Piezo(turned(self.e, rotation), turned(self.beta, rotation))

    def poled_along(self, axis: ArrayLike) -> Piezo:
        """Return a material poled along z, turned the shortest way to another axis.

        Raises
        ------
        ValueError
            If the axis is no vector of three finite numbers, or zero.
        """
        return self.rotated(to_axis(axis))

    def check(self) -> None:
        """Check the tensors, however they were made.

        Raises
        ------
        ValueError
            If a shape is wrong, e_ijk is not symmetric in jk, or beta is not symmetric and
            positive definite: the stored energy would not be positive.
        """
        e, beta = np.asarray(self.e, dtype=float), np.asarray(self.beta, dtype=float)
        if e.shape != (3, 3, 3) or beta.shape != (3, 3):
            raise ValueError(f"e must be 3 x 3 x 3 and beta 3 x 3; got {e.shape} and {beta.shape}")
        if not (np.all(np.isfinite(e)) and np.all(np.isfinite(beta))):
            raise ValueError("e and beta must be finite")
        if not np.allclose(e, e.transpose(0, 2, 1), rtol=1e-10, atol=1e-12 * np.abs(e).max()):
            raise ValueError("the coupling e_ijk must be symmetric in its last two indices")
        if not np.allclose(beta, beta.T, rtol=1e-10, atol=1e-12 * np.abs(beta).max()):
            raise ValueError("the permittivity beta must be symmetric")
        if not np.all(np.linalg.eigvalsh(beta) > 0):
            raise ValueError("the permittivity beta must be positive definite")

    def check_plane(self) -> None:
        """Check that a plane body in (x, y) stays plane.

        Raises
        ------
        ValueError
            If a field in the plane would shear the body out of it (e_ij3 with i, j < 3), or none
            acts on it at all.
        """
        e = np.asarray(self.e, dtype=float)
        nothing = np.abs(e[:2]).max() <= 1e-10 * np.abs(e).max() and np.abs(e).max() > 0
        if nothing or np.abs(e[:2, :2, 2]).max() > 1e-10 * np.abs(e).max():
            raise ValueError(
                "the crystal is poled out of the plane, or aslant to it: a field in the "
                "plane shears the body out of it, or does not act on it; accepted: "
                "piezo.in_plane(), poled along y, or 3-D"
            )

    def in_plane(self) -> Piezo:
        """Return the material with the crystal's (X2, X3, X1) along the body's (x, y, z)."""
        return self.rotated(PLANE)


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
    material = Piezo(coupling_tensor(e), beta)
    material.check()
    return material


def hexagonal_voigt(
    e31: float, e33: float, e15: float, beta11: float, beta33: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the Voigt matrices of class 6mm poled along z, with e32 = e31 and e24 = e15."""
    e = np.zeros((3, 6))
    e[2, :3] = e31, e31, e33
    e[0, 4] = e[1, 3] = e15
    return e, np.diag([beta11, beta11, beta33])


def hexagonal(e31: float, e33: float, e15: float, beta11: float, beta33: float) -> Piezo:
    """Return a material of class 6mm poled along z."""
    return from_voigt(*hexagonal_voigt(e31, e33, e15, beta11, beta33))


def coupling_number(law: Law, piezo: Piezo) -> float:
    """Return the largest eps : e^T beta^-1 e eps / (eps : F eps) over all strains.

    It is the square of the electromechanical coupling: how much stiffer the body becomes
    without electrodes. diag(F, beta) preconditions the symmetrised form to a spectrum that it
    alone bounds, whatever the units and the mesh.
    """
    if isinstance(law, Anisotropic):
        stiffness = mandel(law.stiffness)
    else:
        stiffness = mandel(isotropic(law.young, law.poisson))
    # e on the orthonormal (Mandel) basis of tensors, where eps : F eps is a plain product.
    coupling = np.array([np.asarray(piezo.e)[:, j, k] for j, k in VOIGT]).T
    coupling[:, 3:] *= np.sqrt(2.0)
    induced = coupling.T @ np.linalg.solve(np.asarray(piezo.beta), coupling)
    return float(np.linalg.eigvals(np.linalg.solve(stiffness, induced)).real.max())


def _tensor(values: NDArray[np.float64] | Expr) -> Expr:
    """Return a tensor of numbers in UFL."""
    return ufl.as_tensor(values.tolist()) if isinstance(values, np.ndarray) else values


def gradient(phi: Expr, kinematics: Strained = CARTESIAN) -> Expr:
    """Return grad(phi) as a vector of three components, its mean where strains are means."""
    if isinstance(kinematics, Isochoric):
        return gradient(phi, kinematics.base)
    g = ufl.grad(phi)
    if isinstance(kinematics, CellMean):
        along = ufl.as_vector([phi, *[0.0] * (g.ufl_shape[0] - 1)])
        g = kinematics.gradient(along)[0, :]
    return g if g.ufl_shape == (3,) else ufl.as_vector([g[0], g[1], 0.0])


def coupling_stress(piezo: Piezo, phi: Expr, kinematics: Strained = CARTESIAN) -> Expr:
    """Return e^T grad(phi), a 3 x 3 stress."""
    i, j, k = ufl.indices(3)
    e = _tensor(piezo.e)
    return ufl.as_tensor(e[i, j, k] * gradient(phi, kinematics)[i], (j, k))


def electric_displacement(
    piezo: Piezo, eps: Expr, phi: Expr, kinematics: Strained = CARTESIAN
) -> Expr:
    """Return D = e eps - beta grad(phi), a vector of three components."""
    i, j, k = ufl.indices(3)
    e = _tensor(piezo.e)
    induced = ufl.as_tensor(e[i, j, k] * embed(eps)[j, k], (i,))
    return induced - ufl.dot(_tensor(piezo.beta), gradient(phi, kinematics))


def mechanical_work(
    law: FormLaw,
    piezo: Piezo,
    u_0: Expr,
    u: Expr,
    phi: Expr,
    v: Expr,
    kinematics: Strained = CARTESIAN,
) -> Expr:
    """Return sigma : eps(v) = F eps(u) : eps(v) + e^T grad(phi) : eps(v), with secants at u_0."""
    frozen, eps, test = (strain(f, kinematics) for f in (u_0, u, v))
    sigma = secant_stress(law, frozen, eps) + coupling_stress(piezo, phi, kinematics)
    return ufl.inner(sigma, test)


def electric_work(
    piezo: Piezo, u: Expr, phi: Expr, xi: Expr, kinematics: Strained = CARTESIAN
) -> Expr:
    """Return D . grad(xi) = e eps(u) . grad(xi) - beta grad(phi) . grad(xi)."""
    d = electric_displacement(piezo, strain(u, kinematics), phi, kinematics)
    return ufl.inner(d, gradient(xi, kinematics))


def saddle_form(
    law: FormLaw,
    piezo: Piezo,
    u_0: Expr,
    u: Expr,
    phi: Expr,
    v: Expr,
    xi: Expr,
    kinematics: Strained = CARTESIAN,
) -> Expr:
    """Return the integrand of B(x_0; x, y), at x_0 = x of A, (5.16): positive, not symmetric.

    For comparison: the solver takes `symmetrised_form`.
    x_0 = (u_0, .) is where the secant modulus is frozen, x = (u, phi) the unknown and
    y = (v, xi) the test function.
    """
    of_stresses = mechanical_work(law, piezo, u_0, u, phi, v, kinematics)
    return of_stresses - electric_work(piezo, u, phi, xi, kinematics)


def symmetrised_form(
    law: FormLaw,
    piezo: Piezo,
    u_0: Expr,
    u: Expr,
    phi: Expr,
    v: Expr,
    xi: Expr,
    kinematics: Strained = CARTESIAN,
) -> Expr:
    """Return the integrand of B-check(x_0; x, y) = B(x_0; x, (v, -xi)), (5.31): symmetric.

    At x_0 = x that of A-check, (5.27). Its quadratic form is convex in u and concave in phi.
    """
    of_stresses = mechanical_work(law, piezo, u_0, u, phi, v, kinematics)
    return of_stresses + electric_work(piezo, u, phi, xi, kinematics)
