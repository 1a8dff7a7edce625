"""Closed forms of indentation: piezoelectric half spaces of class 6mm, poled along the normal.

Solutions (A J1, B J0, C J0) exp(-lambda k z) of the equations, z into the body, give the transforms
of depth and potential under a normal load without shear, [u_z, phi] = M [p, D_z]/k. All that
follows is that of isotropic elasticity with other constants: Giannakopoulos and Suresh, Acta
Mater. 47 (1999) 2153; Karapetian, Kachanov and Kalinin, Phil. Mag., 2005.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact.typing import Array


@dataclass(frozen=True, eq=False)
class HalfSpace:
    """A half space whose poling axis is its inward normal."""

    #: In Voigt's notation with X3 along the axis, shapes (6, 6), (3, 6) and (3, 3), in any units
    #: that agree.
    stiffness: Array
    coupling: Array
    permittivity: Array

    def _system(self, lam: complex) -> Array:
        c, e, k = self.stiffness, self.coupling, self.permittivity
        c11, c13, c33, c44 = c[0, 0], c[0, 2], c[2, 2], c[3, 3]
        e31, e33, e15, k11, k33 = e[2, 0], e[2, 2], e[0, 4], k[0, 0], k[2, 2]
        square = lam**2
        return np.array(
            [
                [c44 * square - c11, (c13 + c44) * lam, (e31 + e15) * lam],
                [-(c13 + c44) * lam, c33 * square - c44, e33 * square - e15],
                [-(e31 + e15) * lam, e33 * square - e15, k11 - k33 * square],
            ]
        )

    @cached_property
    def surface(self) -> Array:
        """The matrix M, shape (2, 2): depth and potential of pressure and D_z, times k."""
        c, e, k = self.stiffness, self.coupling, self.permittivity
        # The determinant is a polynomial of degree 3 in lambda^2.
        at = np.array([0.0, 0.5, 1.0, 2.0])
        values = [np.linalg.det(self._system(np.sqrt(square))).real for square in at]
        squares = np.roots(np.polyfit(at, values, 3))
        lam = np.sqrt(squares.astype(complex))
        modes = np.array([np.linalg.svd(self._system(x))[2][-1].conj() for x in lam])
        a, b, phi = modes.T
        pressure = -c[0, 2] * a + lam * (c[2, 2] * b + e[2, 2] * phi)
        shear = -lam * c[3, 3] * a - c[3, 3] * b - e[0, 4] * phi
        charge = e[2, 0] * a - lam * (e[2, 2] * b - k[2, 2] * phi)
        amplitudes = np.linalg.solve(np.array([pressure, charge, shear]), np.eye(3)[:, :2])
        return np.asarray((np.array([b, phi]) @ amplitudes).real)

    @cached_property
    def inverse(self) -> Array:
        """N = M^-1: pressure and D_z of depth and potential, over k."""
        return np.asarray(np.linalg.inv(self.surface))

    @property
    def insulating(self) -> float:
        """E* under an insulating indenter, 2/M_11."""
        return float(2 / self.surface[0, 0])

    @property
    def conducting(self) -> float:
        """E* under a conducting indenter, 2 N_11."""
        return float(2 * self.inverse[0, 0])

    @property
    def charge_ratio(self) -> float:
        """Q/P under a grounded indenter, N_21/N_11."""
        return float(self.inverse[1, 0] / self.inverse[0, 0])


@dataclass(frozen=True)
class Indentation:
    """Force and moment on an indenter."""

    #: P, and Q = the integral of D_z; 0 where it insulates.
    force: float
    charge: float
    #: delta and a.
    depth: float
    radius: float


def punch(body: HalfSpace, radius: float, depth: float, potential: float | None) -> Indentation:
    """Return a flat circular punch; a potential of None for one that insulates."""
    if potential is None:
        return Indentation(2 * body.insulating * radius * depth, 0.0, depth, radius)
    force, charge = 4 * radius * body.inverse @ [depth, potential]
    return Indentation(float(force), float(charge), depth, radius)


def ball(body: HalfSpace, curvature: float, radius: float, potential: float | None) -> Indentation:
    """Return a paraboloid with a radius of curvature, at a given contact radius."""
    a, r = radius, curvature
    if potential is None:
        return Indentation(4 / 3 * body.insulating * a**3 / r, 0.0, a**2 / r, a)
    n = body.inverse
    depth = a**2 / r - n[0, 1] / n[0, 0] * potential
    force = 8 / 3 * n[0, 0] * a**3 / r
    charge = 4 * (n[1, 0] * (a * depth - a**3 / (3 * r)) + n[1, 1] * a * potential)
    return Indentation(float(force), float(charge), float(depth), a)


def cone(body: HalfSpace, half_angle: float, radius: float, potential: float | None) -> Indentation:
    """Return a cone by its half angle (degrees), at a given contact radius."""
    a, slope = radius, 1 / np.tan(np.deg2rad(half_angle))
    if potential is None:
        return Indentation(
            np.pi / 2 * body.insulating * a**2 * slope, 0.0, np.pi / 2 * a * slope, a
        )
    n = body.inverse
    depth = np.pi * a * slope / 2 - n[0, 1] / n[0, 0] * potential
    force = np.pi * n[0, 0] * a**2 * slope
    # The charge of [u_z, phi] = [delta - r cot, phi_0] by superposition of flat punches.
    charge = 4 * (n[1, 0] * (a * depth - np.pi * a**2 * slope / 4) + n[1, 1] * a * potential)
    return Indentation(float(force), float(charge), float(depth), a)


def potential_beneath(body: HalfSpace, depth: float) -> float:
    """Return phi under an insulating indenter where the surface is depressed, (M_21/M_11) u_z."""
    return float(body.surface[1, 0] / body.surface[0, 0] * depth)
