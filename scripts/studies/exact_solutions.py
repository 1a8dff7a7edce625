"""Problems whose exact solution is known: manufactured ones, and Signorini's with r^(3/2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, GapFunction, Load, Material
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array
from forms.hencky import Hencky, Linear, Log, stress
from forms.history import to_tensor, to_vector
from forms.kinematics import strain
from forms.ops import cos, sin
from forms.piezo import Piezo, coupling_stress, electric_displacement
from forms.plane_stress import ACROSS, HenckyAtPoints, PlaneStressHistory
from scripts.studies.error_norms import Errors, errors
from scripts.studies.hertz_exact import components


@dataclass(frozen=True)
class Given:
    """A function of the coordinates, for UFL and NumPy alike."""

    function: Callable[[Any], Any]

    def ufl(self, x: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        """Return the function as a UFL expression of the coordinates."""
        return self.function(x)

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""
        return np.asarray(self.function(points.T))


#: Law of the manufactured problem: some of the body is beyond its yield strain, some not.
HENCKY = Log(1.0, 0.3, yield_strain=0.13)


def smooth(dim: int) -> list[Callable[[Any], Any]]:
    """Return the components of a smooth displacement in 2-D or 3-D."""
    up = dim - 1
    parts: list[Callable[[Any], Any]] = [
        lambda x: 0.12 * sin(1.7 * x[0]) * cos(1.2 * x[up]),
        lambda x: 0.12 * cos(0.9 * x[0]) * sin(1.9 * x[up] + 0.3),
    ]
    if dim == 3:
        parts.insert(1, lambda x: 0.1 * sin(1.1 * x[1] + 0.2) * cos(0.8 * x[0]))
    return parts


def nearly_isochoric(law: Linear) -> list[Callable[[Any], Any]]:
    """Return the components of a displacement in 2-D whose pressure is smooth and of order one."""
    low = 0.05 / float(law.bulk)
    return [
        lambda x: 0.1 * sin(x[0]) * cos(x[1]) + low * sin(2 * x[0] + x[1]),
        lambda x: -0.1 * cos(x[0]) * sin(x[1]) + low * cos(x[0] - 2 * x[1]),
    ]


def electric(x: Any) -> Any:
    """Return a smooth potential."""
    return 0.3 * sin(1.2 * x[0] + 0.5) * cos(0.9 * x[1]) + 0.1 * x[0] * x[1]


def manufactured(
    dim: int,
    degree: int,
    n: int,
    law: Hencky = HENCKY,
    cell: str | None = None,
    piezo: Piezo | None = None,
    element: str = "standard",
    parts: Sequence[Callable[[Any], Any]] | None = None,
    plane_stress: bool = False,
) -> ContactProblem:
    """Return a Hencky body with a given displacement, loaded at the bottom. Collective."""
    make, usual = (rectangle, "triangle") if dim == 2 else (box, "tetrahedron")
    domain = make(MPI.COMM_WORLD, [0.0] * dim, [1.0] * dim, [n] * dim, cell=cell or usual)
    x = ufl.SpatialCoordinate(domain.mesh)
    parts = parts or smooth(dim)
    eps = strain(ufl.as_vector([f(x) for f in parts]))
    # Derivatives of an interpolated stress jump from cell to cell.
    name = domain.mesh.topology.cell_name()
    finer = basix.ufl.element("Lagrange", name, degree + 2, discontinuous=True)
    space = fem.functionspace(domain.mesh, finer)
    sigma = _without_stress_across(law, eps, space) if plane_stress else stress(law, eps)
    if piezo is not None:
        sigma += coupling_stress(piezo, electric(x))

    # The outward normal of the bottom is minus the last axis.
    axes, up = range(dim), dim - 1
    expressions = [-sum(sigma[i, j].dx(j) for j in axes) for i in axes]
    expressions += [-sigma[i, up] for i in axes]
    if piezo is not None:
        d = electric_displacement(piezo, eps, electric(x))
        expressions += [sum(d[j].dx(j) for j in axes), -d[up]]
    # Interpolated: UFL would ask for a quadrature of a very high degree.
    found = interpolated(space, expressions)
    loads = [Load(None, found[:dim]), Load("bottom", found[dim : 2 * dim])]
    if piezo is not None:
        loads += [Load(None, charge=found[-2]), Load("bottom", charge=found[-1])]
    given = [Given(f) for f in parts]
    sides = ["left", "right", "top"] + ["front", "back"] * (dim == 3)
    fixed = [Fixed(side, given, None if piezo is None else Given(electric)) for side in sides]
    far = GapFunction(lambda points: np.full(len(points), 10.0))
    material = Material(law, piezo)
    body = Body(material.plane_stress() if plane_stress else material, fixed, loads)
    contact = Contact("bottom", far)
    return ContactProblem(domain, body, contact, degree=degree, element=element)


def _without_stress_across(
    law: Hencky, eps: ufl.core.expr.Expr, space: fem.FunctionSpace
) -> ufl.core.expr.Expr:
    """Return the plane stress of a strain, interpolated."""
    element = basix.ufl.element(
        "Lagrange", space.mesh.topology.cell_name(), space.ufl_element().degree, shape=(4,)
    )
    found = fem.Function(fem.functionspace(space.mesh, element))
    points = space.ufl_element().basix_element.points
    found.interpolate(fem.Expression(to_vector(eps, 4), points))
    strains = found.x.array.reshape(-1, 4)
    across = {ACROSS: np.zeros(len(strains))}
    response = PlaneStressHistory(HenckyAtPoints(law)).respond(strains, across)
    found.x.array[:] = response.stress.ravel()
    return to_tensor(found)


def interpolated(
    space: fem.FunctionSpace, expressions: Sequence[ufl.core.expr.Expr]
) -> list[fem.Function]:
    """Return the interpolants of expressions, compiled together. Collective."""
    points, mesh = space.element.basix_element.points, space.mesh
    index_map = mesh.topology.index_map(mesh.topology.dim)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    found = fem.Expression(ufl.as_vector(expressions), points).eval(mesh, cells)
    values, dofs = np.reshape(found, (cells.size, len(points), -1)), space.dofmap.list
    made = [fem.Function(space) for _ in expressions]
    for i, function in enumerate(made):
        function.x.array[dofs] = values[..., i]
    return made


def exact(dim: int, charged: bool = False) -> Callable[[Any], ufl.core.expr.Expr]:
    """Return `smooth` as a UFL vector, with `electric` of a piezoelectric body."""
    return lambda x: ufl.as_vector([f(x) for f in [*smooth(dim), *[electric] * charged]])


@dataclass(frozen=True)
class Singular:
    """Frictionless contact of a half plane y > 0 for x > x0."""

    #: Elastic constants, plane strain.
    law: Linear = field(default_factory=lambda: Linear(1.0, 0.3))
    #: -A > 0: the pressure is |A| sqrt(x - x0).
    amplitude: float = 0.1
    #: Where the contact ends.
    x0: float = 0.53

    def component(self, i: int, x: Any, polar: tuple[Any, Any], ops: Any) -> Any:
        """Return u_x or u_y at r, theta about (x0, 0); `ops` is the module of cos and sin."""
        r, theta = polar
        a, kappa = -self.amplitude, 3 - 4 * self.law.poisson
        root = a * r**0.5
        cube = 2 * a / 3 * r**1.5
        if i == 0:
            value = (kappa - 1) / 2 * cube * ops.cos(1.5 * theta)
            value = value - x[1] * root * ops.sin(theta / 2)
        else:
            value = (kappa + 1) / 2 * cube * ops.sin(1.5 * theta)
            value = value - x[1] * root * ops.cos(theta / 2)
        return value / (2 * self.law.shear)

    def displacement(self, x: Array) -> Array:
        """Return (u_x, u_y) at points (x, y), shape (2, n)."""
        # Rounding must not take nodes of y = 0 across the branch cut.
        y = np.maximum(x[1], 0.0)
        polar = np.hypot(x[0] - self.x0, y), np.arctan2(y, x[0] - self.x0)
        return np.stack([self.component(i, x, polar, np) for i in range(2)])

    def ufl(self, x: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        """Return the displacement as a UFL vector."""
        r = ufl.sqrt((x[0] - self.x0) ** 2 + x[1] ** 2)
        polar = r, ufl.atan2(x[1], x[0] - self.x0)
        return ufl.as_vector([self.component(i, x, polar, ufl) for i in range(2)])

    def pressure(self, points: Array) -> Array:
        """Return the contact pressure at points of y = 0, shape (n,)."""
        return self.amplitude * np.sqrt(np.maximum(points[:, 0] - self.x0, 0.0))

    def problem(self, n: int, degree: int = 1) -> ContactProblem:
        """Return the problem on the unit square with n x n cells. Collective."""
        return self.on(rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, 1.0], [n, n]), degree)

    def on(self, domain: Domain, degree: int) -> ContactProblem:
        """Return the problem on another mesh of the square, with the same sides. Collective."""
        given = components(self.displacement, 2)
        fixed = [Fixed(side, given) for side in ("left", "right", "top")]
        flat = GapFunction(lambda points: np.zeros(len(points)))
        return ContactProblem(domain, Body(self.law, fixed), Contact("bottom", flat), degree=degree)

    def errors(self, problem: ContactProblem, state: State) -> tuple[Errors, float]:
        """Return the norms of a state's error, and the largest one at the nodes. Collective."""
        body = problem.body
        given = self.displacement(body.space.tabulate_dof_coordinates().T).T
        largest = np.abs(state.x.reshape(-1, 2) - given).max(initial=0.0)
        norms = errors(body, state.x, self.ufl)
        return norms, float(problem.comm.allreduce(largest, op=MPI.MAX))
