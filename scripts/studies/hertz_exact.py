"""Hertz's contacts inside a half space: exact displacements, pressures and gaps.

The body is cut out of the half space, the action of the cut-off part is prescribed: nothing is
left of Hertz's assumptions, and all errors are those of the discretisation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from contact.typing import Array
from forms.hencky import Linear

#: Points of Gauss's rule for integrals over the disc of complex sources: for points at some
#: distance from its rim, to rounding.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(60)


def line_contact(force: float, modulus: float, radius: float) -> tuple[float, float]:
    """Return Hertz's half width and largest pressure of a line contact: F, E*, R given."""
    a = float(np.sqrt(4 * force * radius / (np.pi * modulus)))
    return a, 2 * force / (np.pi * a)


def components(displacement: Callable[[Array], Array], dim: int) -> list[Callable[[Array], Array]]:
    """Return the components of a displacement as boundary values."""
    return [lambda x, i=i: displacement(x)[i] for i in range(dim)]


@dataclass(frozen=True)
class Line:
    """The contact of a cylinder with the half plane y > 0, p = p_0 sqrt(1 - x^2/b^2)."""

    #: b and p_0.
    half_width: float = 0.53
    peak: float = 0.1
    #: Elastic constants, plane strain.
    law: Linear = field(default_factory=lambda: Linear(1.0, 0.3))

    def pressure(self, points: Array) -> Array:
        """Return the contact pressure at points of y = 0, shape (n,)."""
        share = 1 - (points[:, 0] / self.half_width) ** 2
        return np.asarray(self.peak * np.sqrt(np.maximum(share, 0.0)))

    def displacement(self, x: Array) -> Array:
        """Return (u_x, u_y) at points (x, y) of the half plane, shape (2, n).

        Kolosov's potential of a surface without shear: 2 G (u + i v) = kappa phi - conj(phi) -
        2 i y conj(phi'), with phi' = -p_0/(2 b) (sqrt(b^2 - z^2) + i z).
        """
        b, kappa = self.half_width, 3 - 4 * self.law.poisson
        y = np.maximum(x[1], 0.0)
        z = x[0] + 1j * y
        # With its cut on the contact, seen from above.
        s = np.sqrt(z - b) * np.sqrt(z + b)
        factor = -self.peak / (2 * b)
        slope = factor * 1j * (z - s)
        phi = factor * 1j * (z**2 / 2 - (z * s - b**2 * np.log((z + s) / 1j)) / 2)
        w = kappa * phi - np.conj(phi) - 2j * y * np.conj(slope)
        return np.stack([w.real, w.imag]) / (2 * self.law.shear)

    def gap(self, x: Array) -> Array:
        """Return the gap of the cylinder, u_nu where there is contact, along y = 0."""
        deepest = -self.displacement(np.zeros((2, 1)))[1, 0]
        modulus = self.law.young / (1 - self.law.poisson**2)
        return np.asarray(deepest + self.peak / (self.half_width * modulus) * x[0] ** 2)

    def problem(self, n: int, degree: int) -> ContactProblem:
        """Return the half [0, 1]^2, symmetric about x = 0, with n x n cells. Collective."""
        return self.on(rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, 1.0], [n, n]), degree)

    def on(self, domain: Domain, degree: int) -> ContactProblem:
        """Return the problem on another mesh of that half, with the same sides. Collective."""
        given = components(self.displacement, 2)
        fixed = [Fixed("left", [0.0, None]), *(Fixed(side, given) for side in ("right", "top"))]
        return ContactProblem(
            domain, Body(self.law, fixed), Contact("bottom", self.gap, press=True), degree=degree
        )


@dataclass(frozen=True)
class Point:
    """The contact of a ball with the half space z > 0, p = p_0 sqrt(1 - r^2/a^2)."""

    #: a and p_0.
    radius: float = 0.53
    peak: float = 0.1
    #: Elastic constants.
    law: Linear = field(default_factory=lambda: Linear(1.0, 0.3))

    def pressure(self, points: Array) -> Array:
        """Return the contact pressure at points of z = 0, shape (n,)."""
        share = 1 - (points[:, :2] ** 2).sum(axis=1) / self.radius**2
        return np.asarray(self.peak * np.sqrt(np.maximum(share, 0.0)))

    def displacement(self, x: Array) -> Array:
        """Return u at points of the half space away from the rim of the contact, shape (3, n).

        A surface without shear has 2 G u = (1 - 2 nu) grad phi + z grad phi_z in its plane and
        2 G u_z = -2 (1 - nu) phi_z + z phi_zz, with phi_zz = p on it: the potential of complex
        sources (a^2 - t^2) at z = -i t.
        """
        poisson, a = self.law.poisson, self.radius
        t = a * POINTS[:, None]
        source = -self.peak / 4 * (a**2 - t**2) * WEIGHTS[:, None]
        r2 = x[0] ** 2 + x[1] ** 2
        zeta = x[2] + 1j * t
        away = np.sqrt(r2 + zeta**2)
        # By r, which cancels the direction's.
        along = (source / away / (away + zeta)).sum(axis=0).real
        along_z = -(source / away**3).sum(axis=0).real
        phi_z = (source / away).sum(axis=0).real
        phi_zz = -(source * zeta / away**3).sum(axis=0).real
        outwards = (1 - 2 * poisson) * along + x[2] * along_z
        upwards = -2 * (1 - poisson) * phi_z + x[2] * phi_zz
        u = np.stack([outwards * x[0], outwards * x[1], upwards])
        return np.asarray(u / (2 * self.law.shear))

    def gap(self, x: Array) -> Array:
        """Return the gap of the ball, u_nu where there is contact, on z = 0."""
        a, modulus = self.radius, self.law.young / (1 - self.law.poisson**2)
        square = x[0] ** 2 + x[1] ** 2
        return np.asarray(-np.pi * self.peak / (4 * a * modulus) * (2 * a**2 - square))

    def on(self, domain: Domain, degree: int) -> ContactProblem:
        """Return the problem on a mesh of [0, 1]^3, a quarter by symmetry. Collective."""
        given = components(self.displacement, 3)
        fixed = [Fixed("left", [0.0, None, None]), Fixed("front", [None, 0.0, None])]
        fixed += [Fixed(side, given) for side in ("right", "back", "top")]
        return ContactProblem(
            domain, Body(self.law, fixed), Contact("bottom", self.gap, press=True), degree=degree
        )
