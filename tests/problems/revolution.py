"""Bodies of revolution whose solution is known."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, Friction, GapFunction, Load, Material
from contact._compat import geometry_dofmap
from contact.mesh.domain import from_mesh, revolved
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Hencky, Linear, Log
from forms.laws import ConstantCoefficient
from forms.piezo import Piezo
from scripts.studies.exact_solutions import Given
from tests.problems.mechanics import constant, flat
from tests.problems.meshes import assembled, midpoints

ZERO = constant(0.0, 2)


def half_plane(comm: MPI.Comm, inner: float, outer: float, height: float, n: int) -> Domain:
    """Return a tube, or a cylinder, of n cells along the radius."""
    cells = [n, max(1, round(n * height / (outer - inner)))]
    return revolved(rectangle(comm, [inner, 0.0], [outer - inner, height], cells))


@dataclass(frozen=True)
class Tube:
    """Lame's thick tube in plane strain along its axis: inner pressure, outer rigid casing."""

    law: Linear = field(default_factory=lambda: Linear(1.0, 0.3))
    inner: float = 1.0
    outer: float = 2.0
    pressure: float = 0.2
    gap: float = 0.05

    @property
    def constants(self) -> tuple[float, float]:
        """A and B of u_r = A r + B/r: sigma_r(inner) = -pressure, u_r(outer) = gap."""
        a, b = self.inner, self.outer
        volumetric = 2 * (self.law.bulk + self.law.shear / 3)
        matrix = [[volumetric, -2 * self.law.shear / a**2], [b, 1 / b]]
        first, second = np.linalg.solve(matrix, [-self.pressure, self.gap])
        return float(first), float(second)

    @property
    def casing(self) -> float:
        """Pressure on the casing."""
        first, second = self.constants
        volumetric = 2 * (self.law.bulk + self.law.shear / 3)
        return 2 * self.law.shear * second / self.outer**2 - volumetric * first

    def displacement(self, x: Any) -> Any:
        """Return the displacement as a UFL vector."""
        first, second = self.constants
        return ufl.as_vector([first * x[0] + second / x[0], 0.0])

    def problem(
        self,
        n: int,
        degree: int = 1,
        comm: MPI.Comm = MPI.COMM_WORLD,
        element: str = "standard",
    ) -> ContactProblem:
        domain = half_plane(comm, self.inner, self.outer, 0.5, n)
        supports = [Fixed(side, [None, ZERO]) for side in ("bottom", "top")]
        load = Load("left", pressure=constant(self.pressure, 2))
        body = Body(self.law, supports, [load])
        contact = Contact("right", flat(self.gap))
        return ContactProblem(domain, body, contact, degree=degree, element=element)


@dataclass(frozen=True)
class Layers:
    """Two tubes, one in the other, under an inner pressure: one body of two materials, or two."""

    laws: tuple[Linear, Linear] = (Linear(1.0, 0.3), Linear(4.0, 0.2))
    radii: tuple[float, float, float] = (1.0, 1.5, 2.0)
    pressure: float = 0.2
    height: float = 0.5

    @property
    def constants(self) -> np.ndarray:
        """A and B of u_r = A r + B/r in each: shape (2, 2)."""
        a, c, b = self.radii
        (m, g), (n, k) = ((2 * (law.bulk + law.shear / 3), 2 * law.shear) for law in self.laws)
        system = [
            [m, -g / a**2, 0, 0],  # sigma_r at r is m A - g B/r^2
            [c, 1 / c, -c, -1 / c],
            [m, -g / c**2, -n, k / c**2],
            [0, 0, b, 1 / b],
        ]
        return np.linalg.solve(system, [-self.pressure, 0, 0, 0]).reshape(2, 2)

    def displacement(self, x: Any) -> Any:
        """Return the displacement as a UFL vector."""
        first, second = ((float(a) * x[0] + float(b) / x[0]) for a, b in self.constants)
        radial = ufl.conditional(ufl.lt(x[0], self.radii[1]), first, second)
        return ufl.as_vector([radial, 0.0])

    def problem(self, n: int, degree: int, bodies: int) -> ContactProblem:
        """Return the problem with n cells a unit, one body or two. Collective."""
        a, c, b = self.radii
        ends = [(a, c, n), (c, b, 2 * n // 3)] if bodies == 2 else [(a, b, n)]
        points, cells = np.zeros((0, 2)), np.zeros((0, 3), dtype=np.int64)
        for inner, outer, count in ends:
            number = [round((outer - inner) * count), round(self.height * count)]
            corners = [[inner, 0.0], [outer, self.height]]
            tube = dmesh.create_rectangle(MPI.COMM_SELF, corners, number)
            cells = np.concatenate([cells, geometry_dofmap(tube) + len(points)])
            points = np.concatenate([points, tube.geometry.x[:, :2]])
        mesh = assembled(MPI.COMM_WORLD, points, cells)
        regions = {"in": lambda x: x[0] < c + 1e-9, "out": lambda x: x[0] > c - 1e-9}
        domain = revolved(from_mesh(mesh, self._parts(mesh, bodies), regions=regions))
        fixed = [Fixed("ends", [None, 0.0]), Fixed("outside", [0.0, None])]
        load = Load("inside", pressure=constant(self.pressure, 2))
        materials = [Material(law, on=name) for law, name in zip(self.laws, regions, strict=True)]
        if bodies == 2:
            contact = Contact("inner", against="outer")
        else:
            contact = Contact("inside", flat(10.0))
        return ContactProblem(domain, Body(materials, fixed, [load]), contact, degree=degree)

    def _parts(self, mesh: dmesh.Mesh, bodies: int) -> dict[str, Any]:
        a, c, b = self.radii

        def at(radius: float) -> Any:
            return lambda x: np.abs(x[0] - radius) < 1e-9

        def on_end(x: np.ndarray) -> Any:
            return np.abs(np.abs(x[1] - self.height / 2) - self.height / 2) < 1e-9

        parts = {"inside": at(a), "outside": at(b), "ends": on_end}
        if bodies == 1:
            return parts
        facets, middle, inside, _ = midpoints(mesh)
        between, within = at(c)(middle.T), inside[:, 0] < c
        return {**parts, "inner": facets[between & within], "outer": facets[between & ~within]}


@dataclass(frozen=True)
class Drum:
    """A smooth cylinder r, z < 1 with u_r = a r (1 + (z-1)^2), u_z = b z (3/2 - z)."""

    law: Hencky = field(default_factory=lambda: Log(1.0, 0.3, yield_strain=0.06))
    a: float = 0.05
    b: float = 0.3

    def displacement(self, x: Any) -> Any:
        """Return the displacement as a UFL vector."""
        return ufl.as_vector([self._radial(x), self._axial(x)])

    def _radial(self, x: Any) -> Any:
        return self.a * x[0] * (1 + (x[1] - 1) ** 2)

    def _axial(self, x: Any) -> Any:
        return self.b * x[1] * (1.5 - x[1])

    def stresses(self, x: Any) -> tuple[Any, Any, Any, Any]:
        """Return sigma_r, sigma_theta, sigma_z, sigma_rz, written by hand in (r, z)."""
        radial = self.a * (1 + (x[1] - 1) ** 2)
        axial = self.b * (1.5 - 2 * x[1])
        shear = self.a * x[0] * (x[1] - 1)
        volume = 2 * radial + axial
        q = 2 * radial**2 + axial**2 + 2 * shear**2 - volume**2 / 3
        g = self.law.secant_modulus(q)
        mean = (self.law.bulk - 2 * g / 3) * volume
        hoop = mean + 2 * g * radial
        return hoop, hoop, mean + 2 * g * axial, 2 * g * shear

    def problem(self, n: int, degree: int = 1, comm: MPI.Comm = MPI.COMM_WORLD) -> ContactProblem:
        domain = half_plane(comm, 0.0, 1.0, 1.0, n)
        x = ufl.SpatialCoordinate(domain.mesh)
        s_r, s_theta, s_z, s_rz = self.stresses(x)
        force = [
            -(s_r.dx(0) + s_rz.dx(1) + (s_r - s_theta) / x[0]),
            -(s_rz.dx(0) + s_z.dx(1) + s_rz / x[0]),
        ]
        load = Load(None, [Given(lambda _, f=f: f) for f in force])
        given = [Given(self._radial), Given(self._axial)]
        body = Body(self.law, [Fixed("right", given), Fixed("bottom", given)], [load])
        gap = GapFunction(lambda points: self._axial(points.T))
        return ContactProblem(domain, body, Contact("top", gap), degree=degree)


def pressed_cylinder(
    comm: MPI.Comm, n: int = 6, degree: int = 1, radius: float = 0.0, mu: float = 0.3
) -> ContactProblem:
    """Return a solid cylinder pressed on a rough plate by a pressure that grows outwards."""
    domain = half_plane(comm, 0.0, 1.0, 1.0, n)
    load = Load("top", pressure=Given(lambda x: 0.02 + 0.03 * x[0] ** 2))
    law = Log(1.0, 0.3, yield_strain=0.02)
    friction = Friction(ConstantCoefficient(mu), radius=radius)
    body = Body(law, [Fixed("left", [ZERO, None])], [load])
    return ContactProblem(domain, body, Contact("bottom", flat()), friction, degree=degree)


@dataclass(frozen=True)
class PoledCylinder:
    """A cylinder poled along its axis, lifted by u_z < 0 onto a plate; its fields are uniform."""

    law: Linear
    piezo: Piezo
    squeeze: float = 1e-2
    voltage: float = 2e-3

    @property
    def radial(self) -> float:
        """The radial strain: sigma_r = 0."""
        lam = self.law.bulk - 2 * self.law.shear / 3
        e31 = float(self.piezo.e[1, 0, 0])
        return (lam * self.squeeze - e31 * self.voltage) / (2 * (lam + self.law.shear))

    @property
    def force(self) -> float:
        """Force on the plate, over the full turn."""
        lam = self.law.bulk - 2 * self.law.shear / 3
        e33 = float(self.piezo.e[1, 1, 1])
        axial = 2 * lam * self.radial - (lam + 2 * self.law.shear) * self.squeeze
        return -np.pi * (axial + e33 * self.voltage)

    @property
    def charge(self) -> float:
        """D.nu of the upper electrode, over the full turn."""
        e, beta = self.piezo.e, np.asarray(self.piezo.beta)
        d = 2 * e[1, 0, 0] * self.radial - e[1, 1, 1] * self.squeeze - beta[1, 1] * self.voltage
        return float(np.pi * d)

    def problem(self, degree: int = 1, comm: MPI.Comm = MPI.COMM_WORLD) -> ContactProblem:
        domain = half_plane(comm, 0.0, 1.0, 1.0, 4)
        top = Fixed("top", [None, constant(-self.squeeze, 2)], constant(self.voltage, 2))
        body = Body(self.law, [top, Fixed("bottom", None, ZERO)], (), self.piezo)
        return ContactProblem(domain, body, Contact("bottom", flat()), degree=degree)
