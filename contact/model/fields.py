"""Given functions of position and time: numbers, formulas, callables, UFL, amplitudes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, TypeAlias, cast, runtime_checkable

import numpy as np
import ufl
from dolfinx import fem, geometry
from dolfinx import mesh as dmesh
from dolfinx.mesh import Mesh
from mpi4py import MPI
from ufl.core.expr import Expr

from contact import _compat
from contact.arguments import check_finite, expect, naming, real
from contact.errors import InputError
from contact.model.formula import Expression, InTime
from contact.ranks import on_all_ranks
from contact.typing import Array

#: A factor as a function of time.
Factor: TypeAlias = Callable[[float], float]

#: An amplitude as it is given: "constant" for values that always act.
GivenAmplitude: TypeAlias = Factor | Literal["constant"]


@dataclass(frozen=True)
class Ramp:
    """The factor of values without an amplitude: 0 to 1 over the first stage, then 1."""

    begin: float = 0.0
    end: float = 1.0

    def __call__(self, time: float) -> float:
        """Return the factor at a time."""
        return min(max((time - self.begin) / (self.end - self.begin), 0.0), 1.0)


def steady(time: float) -> float:
    """Return 1: given values always act."""
    return 1.0


class Field(Protocol):
    """A given function of position, for instance `contact.model.formula.Expression`."""

    def ufl(self, x: Expr) -> Expr | float:
        """Return the function as a UFL expression of the coordinates, or a number."""

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d), shape (n,)."""


@runtime_checkable
class Moving(Protocol):
    """A given function of position and time."""

    def at(self, time: float | fem.Constant) -> Field:
        """Return the function of position at a time: a number, or a constant of a form."""


#: A given function of position: a number, a formula, a function of x of shape (3, n) that returns
#: n values, a scalar UFL expression (`dolfinx.fem.Function` is one), or an object.
Static: TypeAlias = float | str | Callable[[Array], Array | float] | Expr | Field

#: The same, perhaps with a time: all that `field` takes.
Scalar: TypeAlias = Static | Moving

#: A number, a formula in t, or a function of time.
GivenTimed: TypeAlias = float | str | Factor

#: A given vector, as `vector` takes it: its components, or one UFL expression of vectors.
Vector: TypeAlias = Sequence[Scalar] | Array | Expr

#: A given vector some of whose components may be free.
FreeVector: TypeAlias = Sequence[Scalar | Literal["free"] | None] | Array | Expr


def at_time(field: Field | Moving, time: float | fem.Constant) -> Field:
    """Return a given function of position at a time, whether it depends on that or not."""
    return field.at(time) if isinstance(field, Moving) else field


#: The amplitude of values that always act, by its name.
CONSTANT = "constant"


def amplitude_of(given: Factor | str | None, known: bool) -> Factor:
    """Return the given amplitude, else `steady` for `known` functions of time, else a `Ramp`."""
    if given is None or isinstance(given, Ramp):
        return steady if known else (given or Ramp())
    if callable(given):
        return given
    # Names of a case are exchanged by `build_problem`.
    expect("amplitude", given, f'a function of time, or "{CONSTANT}"', given == CONSTANT)
    return steady


def knows_time(fields: Sequence[Field | Moving | None]) -> bool:
    """Tell whether any of some fields is a function of time."""
    return any(isinstance(field, Moving) for field in fields)


def values_at(
    field: Field | Moving, points: Array, time: float, name: str, comm: MPI.Intracomm
) -> Array:
    """Return a field's values (n,) at points (n, d) and a time, finite ones. Collective."""
    with on_all_ranks(comm), naming(name):
        values = at_time(field, time).numpy(points)
        found = real(values, points.shape[:1], "one number for each of the points")
        check_finite(found, lambda i: f"at ({', '.join(f'{x:g}' for x in points[i] + 0.0)})")
    return found


def constant(mesh: Mesh, value: float) -> fem.Constant:
    """Return a number as a form constant."""
    return fem.Constant(mesh, np.float64(value))


ACCEPTED = (
    "a number, a formula, a function of x as dolfinx interpolates it (x[0], x[1], ... are arrays), "
    "a scalar UFL expression or dolfinx Function, or an object with the methods ufl(x) and "
    "numpy(points)"
)


def field(value: Scalar) -> Field | Moving:
    """Return a given function of position as a `Field` or `Moving`; InputError if it is none."""
    if isinstance(value, Moving):
        return value
    if isinstance(value, np.ndarray) and value.shape == ():
        value = value[()]
    if isinstance(value, np.number):
        value = float(value)
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        value = Expression(value)
    if isinstance(value, Expression):
        return InTime(value.source) if "t" in value.names else value
    if isinstance(value, Expr):
        if value.ufl_shape != ():
            raise InputError(f"given UFL of shape {value.ufl_shape}; accepted: {ACCEPTED}", "field")
        # UFL makes numbers of 0 * x[0] and of components of vectors.
        everywhere = not ufl.domain.extract_domains(value)
        return Expression(float(value)) if everywhere else Ufl(value)
    if hasattr(value, "ufl") and hasattr(value, "numpy"):
        return cast(Field, value)
    if callable(value):
        return Callback(value)
    raise InputError(f"given {value!r} for a function of position; accepted: {ACCEPTED}", "field")


def static(given: Field | Moving) -> Field:
    """Return a field, if it is the same at all times; else raise an InputError."""
    if isinstance(given, Moving):
        raise InputError(
            f"{given} depends on the time; accepted: a number or a function of position, the same "
            "at all times",
            "formula-variable",
        )
    return given


def placeless(given: Field | Moving) -> Field | Moving:
    """Return a field, if it is the same everywhere; else raise an InputError."""
    if not (given.names <= {"t"} if isinstance(given, Expression) else isinstance(given, Moving)):
        raise InputError(
            f"{given} depends on the place; accepted: a number or a formula in t",
            "formula-variable",
        )
    return given


@dataclass(frozen=True)
class Callback:
    """A function of x, an array of shape (3, n), that returns n values.

    In forms it is taken as it is where it can be called with UFL's coordinates (arithmetic and
    `forms.ops`), else interpolated by quadratics.
    """

    function: Callable[[Array], Array | float]

    def ufl(self, x: Expr) -> Expr | float:
        """Return the function as UFL of the coordinates. Collective."""
        try:
            found = self.function(x)
        except Exception:  # NumPy's functions take no UFL, and say so in many ways
            found = None
        if isinstance(found, int | float):
            return float(found)
        if isinstance(found, Expr) and not isinstance(found, ufl.classes.Condition):
            return found
        made = fem.Function(fem.functionspace(mesh_of(x), ("Lagrange", 2)))
        made.interpolate(self._values)
        return made

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""
        x = np.zeros((3, len(points)))
        x[: points.shape[1]] = points.T
        return self._values(x)

    def _values(self, x: Array) -> Array:
        return real(self.function(x), x.shape[1:], "a number for each x[0], x[1], ...")


@dataclass(frozen=True, eq=False)
class Ufl:
    """A scalar UFL expression; dolfinx's Functions are expressions too."""

    expression: Expr

    def ufl(self, x: Expr) -> Expr:
        """Return the expression."""
        return self.expression

    @cached_property
    def _function(self) -> fem.Function:
        if isinstance(self.expression, fem.Function):
            return self.expression
        # Higher degrees than 2 are beyond the elements of the solution.
        space = fem.functionspace(mesh_of(self.expression), ("Lagrange", 2))
        made = fem.Function(space)
        made.interpolate(fem.Expression(self.expression, _compat.interpolation_points(space)))
        return made

    def numpy(self, points: Array) -> Array:
        """Return the values at points (n, d), by local cells, shape (n,). Collective.

        InputError if a point is in no cell that its rank knows.
        """
        function = self._function
        mesh = function.function_space.mesh
        x = np.zeros((len(points), 3))
        x[:, : points.shape[1]] = points
        tree = geometry.bb_tree(mesh, mesh.topology.dim, padding=1e-10)
        found = geometry.compute_collisions_points(tree, x)
        cells = geometry.compute_colliding_cells(mesh, found, x)
        first, count = cells.offsets[:-1], np.diff(cells.offsets)
        if _compat.lasting(mesh.comm).allreduce(bool(np.any(count == 0)), op=MPI.LOR):
            raise InputError("a given Function is not defined everywhere on its part", "field")
        if not len(x):
            return np.zeros(0)
        return np.asarray(function.eval(x, cells.array[first]), dtype=float).reshape(-1)


def mesh_of(expression: Expr) -> dmesh.Mesh:
    """Return the mesh that a UFL expression lives on; InputError if none, or several."""
    for coefficient in ufl.algorithms.extract_coefficients(expression):
        if isinstance(coefficient, fem.Function):
            return coefficient.function_space.mesh
    try:
        domain = ufl.domain.extract_unique_domain(expression)
    except ValueError as error:
        raise InputError(f"a UFL expression: {error}", "field") from None
    if domain is None:
        raise InputError("a UFL expression without a mesh; accepted: a number instead", "field")
    return dmesh.Mesh(domain.ufl_cargo(), domain)
