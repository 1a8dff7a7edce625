"""Manufactured contacts with friction, of Hencky's bodies and of piezoelectric layers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import Body, Conductor, Contact, Domain, Fixed, Friction, Load, Material
from contact._compat import geometry_dofmap
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Hencky, Linear, stress
from forms.kinematics import strain
from forms.laws import ConstantCoefficient, PerfectConductivity
from forms.ops import positive_part
from forms.piezo import Piezo
from scripts.studies.exact_solutions import interpolated
from tests.problems.meshes import assembled, midpoints

#: A UFL expression, or a number.
Value: TypeAlias = Any

#: Sides of the blocks: part, axis, and sign of the normal.
SIDES = [("left", 0, -1.0), ("right", 0, 1.0), ("front", 1, -1.0), ("back", 1, 1.0)]


@dataclass(frozen=True)
class Sliding:
    """Blocks [0, 1]^(d-1) x [0, 1] on a foundation, or on another block, pressed and sheared.

    Along x the contact sticks, slips from `STICK` on, and is open from `END` on. The pressure p,
    the friction lambda = mu p r e, with |r| <= 1, and the slip s e, with r = 1 where s > 0, are
    given; the displacements a + z c + z^2 q of both blocks have these tractions and this jump at
    z = 0, body forces and tractions of the sides do the rest. Under Hencky's law, whose stress at
    z = 0 is another one, the difference is a load.
    """

    #: The material of the upper block, and of the lower one, if there is any.
    laws: tuple[Hencky, ...] = (Linear(1.0, 0.3),)
    #: 2 or 3.
    dim: int = 2
    #: Coefficient of friction.
    mu: float = 0.4

    #: Where slip begins, and contact ends: on lines of meshes of a multiple of eight cells.
    STICK, END = 0.375, 0.75
    #: Direction of the slip, from the x-axis.
    ANGLE = 0.5

    def pressure(self, x: Value) -> Value:
        """Return p."""
        return 0.06 * positive_part(1 - x[0] / self.END) ** 3 * self._across(x)

    def friction(self, x: Value) -> Value:
        """Return |lambda|."""
        return self.mu * (1 - 0.6 * positive_part(1 - x[0] / self.STICK) ** 3) * self.pressure(x)

    def slip(self, x: Value) -> Value:
        """Return s."""
        return 0.1 * positive_part(x[0] - self.STICK) ** 4 * self._across(x)

    def normal_gap(self, x: Value) -> Value:
        """Return the distance that is left."""
        return 0.1 * positive_part(x[0] - self.END) ** 4

    def gap(self, x: Value) -> Value:
        """Return the gap to a foundation."""
        return self.normal_gap(x) - self._depth(x)

    def _across(self, x: Value) -> Value:
        return 1 + 0.4 * x[1] if self.dim == 3 else 1.0

    @staticmethod
    def _depth(x: Value) -> Value:
        """Return u_z of the upper block at z = 0, less the normal gap of two blocks."""
        return -0.02 * (1 + 0.5 * x[0] - 0.4 * x[0] ** 2)

    @property
    def _along(self) -> list[float]:
        return [1.0] if self.dim == 2 else [np.cos(self.ANGLE), np.sin(self.ANGLE)]

    def displacement(self, x: Value, block: int) -> Value:
        """Return the displacement of a block, 0 being the upper one, as a UFL vector."""
        law, two = self.laws[block], len(self.laws) == 2
        z, across, depth = x[self.dim - 1], range(self.dim - 1), self._depth(x)
        common = 0.01 * ufl.sin(x[0]) if two else 0.0
        foot = [(self.slip(x) if block == 0 else 0.0) * e + common for e in self._along]
        if two and block == 0:
            depth += self.normal_gap(x)
        shear, lame = law.shear, law.bulk - 2 * law.shear / 3
        found = [
            foot[i]
            + z * (self.friction(x) * self._along[i] / shear - depth.dx(i))
            + 0.02 * z**2 * ufl.cos(1.3 * x[0] + 0.5 * i)
            for i in across
        ]
        along = sum(ufl.as_ufl(foot[i]).dx(i) for i in across)
        rise = (-self.pressure(x) - lame * along) / (lame + 2 * shear)
        return ufl.as_vector([*found, depth + z * rise - 0.03 * z**2 * ufl.sin(x[0] + 0.4)])

    def exact(self, domain: Domain) -> Value:
        """Return the displacement on a mesh as a UFL vector. Collective."""
        x = ufl.SpatialCoordinate(domain.mesh)
        if len(self.laws) == 1:
            return self.displacement(x, 0)
        within = self._within(domain)
        return within * self.displacement(x, 0) + (1 - within) * self.displacement(x, 1)

    def _within(self, domain: Domain) -> fem.Function:
        """Return 1 in the upper block, 0 in the lower one."""
        found = fem.Function(fem.functionspace(domain.mesh, ("DG", 0)))
        found.x.array[domain.cells("block0")] = 1.0
        found.x.scatter_forward()
        return found

    def problem(self, n: int, degree: int, cell: str | None = None) -> ContactProblem:
        """Return the problem with n cells along each edge, 3n/4 of a lower block. Collective."""
        domain = self.domain(n, cell or ("triangle" if self.dim == 2 else "tetrahedron"))
        d, up = self.dim, self.dim - 1
        x, u = ufl.SpatialCoordinate(domain.mesh), self.exact(domain)
        sigma = stress(self.laws[0], strain(u))
        if len(self.laws) == 2:
            within = self._within(domain)
            sigma = within * sigma + (1 - within) * stress(self.laws[1], strain(u))
        name = domain.mesh.topology.cell_name()
        element = basix.ufl.element("Lagrange", name, degree + 2, discontinuous=True)
        axes = range(d)
        given = {None: [-sum(sigma[i, j].dx(j) for j in axes) for i in axes]}
        for side, axis, sign in SIDES[: 2 * up]:
            given[side] = [sign * sigma[i, axis] for i in axes]
        if not all(isinstance(law, Linear) for law in self.laws):
            contact = [-self.friction(x) * e for e in self._along] + [self.pressure(x)]
            for k in range(len(self.laws)):
                sign = 2 * k - 1
                given[f"contact{k}"] = [sign * (sigma[i, up] + contact[i]) for i in axes]
        space = fem.functionspace(domain.mesh, element)
        found = interpolated(space, [one for components in given.values() for one in components])
        loads = [Load(part, found[d * k : d * (k + 1)]) for k, part in enumerate(given)]
        fixed = [Fixed(f"far{k}", u) for k in range(len(self.laws))]
        materials = [Material(law, on=f"block{k}") for k, law in enumerate(self.laws)]
        if len(self.laws) == 1:
            contact = Contact("contact0", self.gap)
        else:
            contact = Contact("contact0", against="contact1")
        friction = Friction(ConstantCoefficient(self.mu))
        body = Body(materials, fixed, loads)
        return ContactProblem(domain, body, contact, friction, degree=degree)

    def domain(self, n: int, cell: str) -> Domain:
        """Return the blocks, whose meshes do not match. Collective."""
        d, kind = self.dim, dmesh.CellType[cell]
        make = dmesh.create_rectangle if d == 2 else dmesh.create_box
        points, cells = [], []
        for k in range(len(self.laws)):
            number = [n, 3 * n // 4][k]
            corners = [[0.0] * (d - 1) + [-float(k)], [1.0] * (d - 1) + [1.0 - k]]
            grid = make(MPI.COMM_SELF, corners, [number] * d, cell_type=kind)
            cells.append(geometry_dofmap(grid) + sum(map(len, points)))
            points.append(grid.geometry.x[:, :d])
        mesh = assembled(MPI.COMM_WORLD, np.concatenate(points), np.concatenate(cells), cell)
        facets, middle, behind, centre = midpoints(mesh)

        def at(axis: int, value: float) -> Any:
            return np.abs(middle[:, axis] - value) < 1e-9

        where = {side: at(axis, max(sign, 0.0)) for side, axis, sign in SIDES[: 2 * (d - 1)]}
        regions = {}
        for k in range(len(self.laws)):
            up = 1 - 2 * k
            where[f"contact{k}"] = (up * behind[:, -1] > 0) & at(d - 1, 0.0)
            where[f"far{k}"] = at(d - 1, up)
            regions[f"block{k}"] = np.flatnonzero(up * centre[:, -1] > 0)
        parts = {name: facets[chosen] for name, chosen in where.items()}
        return from_mesh(mesh, parts, regions=regions)


@dataclass(frozen=True)
class PiezoLayers:
    """A square of two piezoelectric layers that slides on a conductive foundation.

    sigma_yy, sigma_xy and D_y are given functions of y, continuous between the layers; the
    displacement and the potential are their integrals through the law of each layer.
    """

    #: The material.
    law: Linear
    #: Of the lower layer and of the upper one, in the plane, poled along y.
    piezo: tuple[Piezo, Piezo]
    #: Coefficient of friction.
    mu: float = 0.3
    #: Conductivity of the foundation.
    k_e: float = 2.0

    #: Height of the layers, pressure at the bottom over Young's modulus, slip, displacement of the
    #: bottom against the foundation, and potential in the middle.
    MIDDLE, PRESSURE, SLIP, LOW, POTENTIAL = 0.5, 0.02, 0.05, -0.01, 0.03

    def _normal(self, y: Value) -> Value:
        """Return sigma_yy over its value at y = 0, and its integral from the middle."""
        return 1 + ufl.sin(2 * y), self._from(lambda y: y - ufl.cos(2 * y) / 2, y)

    def _charge(self, y: Value) -> Value:
        return 1 - 2 * y + 3 * y**2, self._from(lambda y: y - y**2 + y**3, y)

    def _shear(self, y: Value) -> Value:
        return 1 + y**2, self._from(lambda y: y + y**3 / 3, y)

    def _from(self, integral: Any, y: Value) -> Value:
        return integral(y) - integral(ufl.as_ufl(self.MIDDLE))

    @property
    def _sizes(self) -> tuple[float, float, float]:
        """sigma_yy, D_y and sigma_xy at y = 0."""
        pressure = self.PRESSURE * self.law.young
        return -pressure, 0.3, self.mu * pressure

    def _compliance(self, layer: int) -> np.ndarray:
        """Return the matrix from (sigma_yy, D_y) to (eps_yy, phi_y) of a layer."""
        stiffness = self.law.bulk + 4 * self.law.shear / 3
        e, beta = self.piezo[layer].e[1, 1, 1], np.asarray(self.piezo[layer].beta)[1, 1]
        return np.linalg.inv([[stiffness, e], [e, -beta]])

    def fields(self, x: Value) -> Value:
        """Return (u_x, u_y, phi) as a UFL vector."""
        y = x[1]
        sizes, low = self._sizes, ufl.lt(y, self.MIDDLE)
        integrals = [self._normal(y)[1] * sizes[0], self._charge(y)[1] * sizes[1]]
        one, other = (self._compliance(k) for k in range(2))
        rise, phi = (
            sum(ufl.conditional(low, *map(float, (one[i, j], other[i, j]))) * integrals[j]
                for j in range(2))
            for i in range(2)
        )  # fmt: skip
        bottom = self._at_bottom(one)
        along = sizes[2] / self.law.shear * (self._shear(y)[1] - _number(self._shear(0.0)[1]))
        return ufl.as_vector(
            [self.SLIP + along, self.LOW + rise - float(bottom[0]), self.POTENTIAL + phi]
        )

    @property
    def at_bottom(self) -> float:
        """The potential of the bottom."""
        return self.POTENTIAL + float(self._at_bottom(self._compliance(0))[1])

    def _at_bottom(self, compliance: np.ndarray) -> np.ndarray:
        """Return u_y and phi at y = 0, less those in the middle."""
        integrals = [_number(of(0.0)[1]) for of in (self._normal, self._charge)]
        return np.asarray(compliance @ (np.array(self._sizes[:2]) * integrals))

    def problem(self, n: int, degree: int) -> ContactProblem:
        """Return the problem with n cells along each edge, an even number. Collective."""
        plain = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, 1.0], [n, n])
        regions = {
            "low": lambda x: x[1] < self.MIDDLE + 1e-9,
            "high": lambda x: x[1] > self.MIDDLE - 1e-9,
        }
        domain = from_mesh(plain.mesh, plain.parts, regions=regions)
        x = ufl.SpatialCoordinate(domain.mesh)
        every, y = self.fields(x), x[1]
        sizes = self._sizes
        force = [
            -sizes[2] * self._shear(y)[0].dx(1),
            -sizes[0] * self._normal(y)[0].dx(1),
        ]
        loads = [Load(None, force), Load(None, charge=sizes[1] * self._charge(y)[0].dx(1))]
        fixed = [Fixed(side, [every[0], every[1]], every[2]) for side in ("left", "right", "top")]
        materials = [
            Material(self.law, piezo, on=name)
            for name, piezo in zip(regions, self.piezo, strict=True)
        ]
        # D.nu = -D_y = k_e (phi - phi_f) at the bottom.
        conductor = Conductor(PerfectConductivity(self.k_e), self.at_bottom + sizes[1] / self.k_e)
        contact = Contact("bottom", -self.LOW)
        friction = Friction(ConstantCoefficient(self.mu))
        body = Body(materials, fixed, loads)
        return ContactProblem(domain, body, contact, friction, conductor, degree=degree)


def _number(expression: Value) -> float:
    """Return the value of a UFL expression without coordinates."""
    return float(ufl.as_ufl(expression)(()))
