"""Small contact problems that several tests solve, and fields and rotations to state them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from mpi4py import MPI
from pydantic import BaseModel

from contact.case.build import build_problem
from contact.case.file import Case
from contact.history import History
from contact.mesh.domain import Domain
from contact.mesh.grid import box, rectangle
from contact.methods.method import METHODS, Method
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions, Options
from contact.methods.report import Outcome
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.friction import Friction
from contact.model.obstacle import GapFunction, Plane
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.fields import DerivedFields
from contact.solution import Solution
from contact.thesis.fixed_point import FixedPoint
from contact.typing import Array
from forms.hencky import Hencky, Linear, Log
from forms.laws import FrictionCoefficient, SlipCoefficient
from scripts import cases


def close(one: State, two: State, rtol: float = 0.0, atol: float = 0.0) -> bool:
    """Tell whether two states have the same values on this rank."""
    pairs = (
        (one.x, two.x),
        (one.multipliers.contact, two.multipliers.contact),
        (one.multipliers.friction, two.multipliers.friction),
    )
    return (
        same_history(one.history, two.history, rtol, atol)
        and one.time == two.time
        and all(np.allclose(a, b, rtol=rtol, atol=atol) for a, b in pairs)
    )


def same_history(one: History, two: History, rtol: float = 0.0, atol: float = 0.0) -> bool:
    """Tell whether two histories have the same parts and values on this rank."""
    ours, theirs = one.arrays(), two.arrays()
    return ours.keys() == theirs.keys() and all(
        np.allclose(array, theirs[name], rtol=rtol, atol=atol) for name, array in ours.items()
    )


@dataclass(frozen=True)
class Affine:
    """The scalar field slope . x + value."""

    slope: Sequence[float]
    value: float = 0.0

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""
        return points @ np.asarray(self.slope) + self.value

    def ufl(self, x: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        """Return the field as a UFL expression."""
        return sum(float(a) * x[i] for i, a in enumerate(self.slope)) + self.value


def constant(value: float, dim: int) -> Affine:
    return Affine((0.0,) * dim, value)


def affine_vector(gradient: Array, offset: Array) -> list[Affine]:
    """Return the components of the field gradient @ x + offset."""
    return [Affine(tuple(row), float(b)) for row, b in zip(gradient, offset, strict=True)]


def turn(dim: int, degrees: float, axis: Sequence[float] = (0.0, 1.0, 0.0)) -> Array:
    """Return the rotation matrix that `rectangle` and `box` apply to their meshes."""
    angle = np.deg2rad(degrees)
    if dim == 2:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    a, b, c = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def flat(value: float = 0.0) -> GapFunction:
    """Return a constant gap along the body's normal."""
    return GapFunction(lambda points: np.full(len(points), value))


def bar(
    comm: MPI.Comm,
    n: int = 16,
    f2: float = -0.005,
    rho: float = 1e5,
    degree: int = 1,
    *,
    law: Hencky | None = None,
    friction: Friction | None = None,
) -> ContactProblem:
    """Return Example 7.2 with n cells per unit length."""
    case = cases.bar(n, f2, rho, f"space.degree={degree}")
    built = build_problem(case, comm, law=law)
    if friction is None:
        return built
    contact = built.contacts[0].model_copy(update={"friction": friction})
    return ContactProblem(built.domain, built.description, contact, degree=degree)


def leaning_block(comm: MPI.Comm, n: int = 3, degree: int = 1, mu: float = 0.3) -> ContactProblem:
    """Return a block of 2 x 1 x 1, constrained at the left, pressed and pushed aside on top."""
    domain = box(comm, [0.0, 0.0, 0.0], [2.0, 1.0, 1.0], [2 * n, n, n])
    zero = constant(0.0, 3)
    body = Body(
        Log(1.0, 0.3, yield_strain=0.01),
        [Fixed("left", [zero] * 3)],
        [Load("top", [constant(0.004, 3), constant(0.002, 3), constant(-0.01, 3)])],
    )
    plane = Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    friction = Friction(SlipCoefficient(mu, 0.2, 10.0))
    return ContactProblem(domain, body, Contact("bottom", plane), friction, degree=degree)


@dataclass(frozen=True)
class SlidingBlock:
    """Closed form 1 of the specification: u = (s + gamma y, -a y) on a block of height 1."""

    law: Hencky
    mu: FrictionCoefficient
    squeeze: float
    push: float
    slip: float

    @property
    def shear(self) -> float:
        """The shear strain gamma."""
        return self.push - self.slip

    @property
    def modulus(self) -> float:
        """The secant modulus g at the strain of the block."""
        return float(self.law.secant_modulus(2 * self.squeeze**2 / 3 + self.shear**2 / 2))

    @property
    def pressure(self) -> float:
        """The contact pressure."""
        return (self.law.bulk + 4 * self.modulus / 3) * self.squeeze

    @property
    def stress(self) -> float:
        """The tangential stress that the foundation exerts against the push."""
        return self.modulus * self.shear

    def domain(self, comm: MPI.Comm, dim: int, degrees: float, axis: Sequence[float]) -> Domain:
        """Return the block's mesh, turned."""
        if dim == 2:
            return rectangle(comm, [0.0, 0.0], [1.0, 1.0], [4, 3], rotation=degrees)
        return box(comm, [0.0] * 3, [1.0] * 3, [2, 3, 2], rotation=degrees, axis=axis)

    def problem(
        self,
        comm: MPI.Comm,
        dim: int = 2,
        degree: int = 1,
        degrees: float = 0.0,
        axis: Sequence[float] = (0.0, 1.0, 0.0),
    ) -> ContactProblem:
        """Return the problem, turned with its foundation; in 3-D front and back are fixed."""
        q = turn(dim, degrees, axis)
        gradient = np.zeros((dim, dim))
        gradient[0, -1], gradient[-1, -1] = self.shear, -self.squeeze
        imposed = affine_vector(q @ gradient @ q.T, q @ (self.slip * np.eye(dim)[0]))
        fixed = [Fixed(side, imposed) for side in ("left", "right", "top")]
        if dim == 3:
            across = [None, constant(0.0, 3), None] if axis == (0.0, 1.0, 0.0) else imposed
            fixed += [Fixed(side, across) for side in ("front", "back")]
        normal = tuple(q @ np.eye(dim)[-1])
        return ContactProblem(
            self.domain(comm, dim, degrees, axis),
            Body(self.law, fixed),
            Contact("bottom", Plane((0.0,) * dim, normal)),
            Friction(self.mu),
            degree=degree,
        )


def pressed_block(comm: MPI.Comm, dim: int, degree: int = 1, *, gap: float = 0.0) -> ContactProblem:
    """Return a block of height 1 under uniform pressure, on smooth walls x = 0 and y = 0."""
    zero = constant(0.0, dim)
    if dim == 2:
        domain = rectangle(comm, [0.0, 0.0], [1.0, 1.0], [3, 4])
        fixed = [Fixed("left", [zero, None])]
    else:
        domain = box(comm, [0.0] * 3, [1.0] * 3, [2, 3, 2])
        fixed = [Fixed("left", [zero, None, None]), Fixed("front", [None, zero, None])]
    plane = Plane((0.0,) * (dim - 1) + (-gap,), (0.0,) * (dim - 1) + (1.0,))
    body = Body(Linear(1.0, 0.3), fixed, [Load("top", pressure=constant(0.02, dim))])
    return ContactProblem(domain, body, Contact("bottom", plane), degree=degree)


def solve(problem: ContactProblem, tolerance: float = 1e-10, **options) -> FixedPoint:
    """Solve by the fixed point and insist on convergence."""
    loop, outcome = attempt(problem, tolerance=tolerance, **options)
    assert outcome.converged, outcome
    return loop


def unchecked(options: Options, **changes) -> Options:
    """Return options with values that no user may give."""
    return BaseModel.model_copy(options, update=changes)


def attempt(problem: ContactProblem, **options) -> tuple[FixedPoint, Outcome]:
    loop = FixedPoint(problem, unchecked(FixedPointOptions(), **options))
    return loop, loop.solve()[1]


def solved_by(problem: ContactProblem, options: Options) -> Method:
    """Solve by the method of some options and insist on convergence."""
    method = METHODS[options.method](problem, options, None)
    _, outcome = method.solve()
    assert outcome.converged, outcome
    return method


def newton(problem: ContactProblem, **options) -> Newton:
    """Solve by Newton's method and insist on convergence."""
    return solved_by(problem, NewtonOptions(**{"tolerance": 1e-10, **options}))


def hooke(law: Hencky, strain: Array) -> Array:
    """Return the stress of a linear law, shape (d, d)."""
    mean = (law.bulk - 2 * law.shear / 3) * np.trace(strain)
    return mean * np.eye(len(strain)) + 2 * law.shear * strain


def bar_case(n: int, *changes: str) -> Case:
    """Return Example 7.2 with ten times its load and a constant mu."""
    exact = "friction.mu=0.5", "solver.tolerance=1e-10"
    return cases.bar(n, -0.05, 1.0, *exact, *changes)


def state_of(problem: ContactProblem, tolerance: float = 1e-13, condense: bool = True) -> State:
    """Return the state that Newton's method finds."""
    return newton(problem, tolerance=tolerance, condense=condense).state


def at_points(solution: Solution, name: str) -> Array:
    """Return stresses or strains at points of the owned cells, shape (n, 3, 3)."""
    fields = DerivedFields(solution.problem.body, solution.state)
    chunks = [values[..., fields.columns[name]].reshape(-1, 3, 3) for _, values in fields.chunks()]
    return np.concatenate([np.zeros((0, 3, 3)), *chunks])


def contact_data(loop: FixedPoint) -> dict[str, Array]:
    """Return what there is at all contact nodes, sorted by position."""
    problem, nodes, multipliers = loop.problem, loop.problem.nodes, loop.state.multipliers
    nodal = problem.nodal(loop.state)
    slip = nodes.tangential_component(nodal)
    bound = problem.interface.friction.bound(np.linalg.norm(slip, axis=1), multipliers.contact)
    size = np.linalg.norm(multipliers.friction, axis=1)
    local = {
        "points": nodes.points,
        "u_n": nodes.normal_component(nodal),
        "u_t": slip,
        "pressure": multipliers.contact,
        "friction": multipliers.friction,
        "bound": np.asarray(bound, dtype=float),
        "open": multipliers.contact <= 1e-6 * nodes.maximum(multipliers.contact),
        "sticks": size < 0.9999 * bound,
    }
    data = {name: nodes.gather(values) for name, values in local.items()}
    order = np.lexsort(np.round(data["points"], 9).T)
    return {name: values[order] for name, values in data.items()}
