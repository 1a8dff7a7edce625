"""Formulas of the case file, such as ``"-10*x"``, as functions of the coordinates and the time.

A formula is read with Python's own parser and evaluated node by node: a node that is not among the
accepted ones is refused. Nothing is handed to ``eval``.
"""

from __future__ import annotations

import ast
import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray

from contact.arguments import check_range
from contact.case.messages import shown
from contact.errors import InputError
from contact.typing import Array
from forms import ops

if TYPE_CHECKING:
    from dolfinx import fem
    from ufl.core.expr import Expr

#: Contents of a formula, for messages and the reference page.
ACCEPTED = (
    "numbers, x, y, z, t, pi, + - * / **, comparisons, and sin, cos, tan, exp, log, sqrt, abs, "
    "min, max, where(condition, a, b)"
)

#: Longest formula (characters) and deepest nesting: far beyond any load, and small enough for
#: every recursion over the tree, here and in UFL.
MAX_LENGTH = 1000
MAX_DEPTH = 100

#: The coordinates and the time.
VARIABLES = ("x", "y", "z", "t")

_FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "sin": ops.sin,
    "cos": ops.cos,
    "tan": ops.tan,
    "exp": ops.exp,
    "log": ops.log,
    "sqrt": ops.sqrt,
    "abs": ops.absolute,
}
_EXTREMES: Mapping[str, Callable[[Any, Any], Any]] = {"min": ops.minimum, "max": ops.maximum}
_ARITHMETIC: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: ops.less,
    ast.LtE: ops.less_equal,
    ast.Gt: lambda a, b: ops.less(b, a),
    ast.GtE: lambda a, b: ops.less_equal(b, a),
    ast.Eq: ops.equal,
    ast.NotEq: ops.not_equal,
}


class Expression:
    """A scalar function of the coordinates and the time, given as a number or a formula.

    Formulas have NumPy's meaning: ``log`` is natural, angles are in radians, ``min`` and
    ``max`` take two arguments or more, and a comparison counts as 1 or 0.

    Parameters
    ----------
    source
        A finite number or a formula in x, y, z and t.

    Raises
    ------
    InputError
        If the source is anything else; the message names the source and the accepted ones.
    """

    def __init__(self, source: float | str) -> None:
        if isinstance(source, bool) or not isinstance(source, int | float | str):
            raise InputError(f"{source!r} is neither a number nor a formula", "formula")
        self.source: float | str
        #: The value of a constant, else the syntax tree.
        self._read: float | ast.expr
        #: Coordinates that the formula uses, and "t" if it uses the time.
        self.names: frozenset[str] = frozenset()
        if isinstance(source, str):
            self.source, (self._read, self.names) = source, _parse(source)
            return
        try:
            self.source = self._read = _finite(source)
        except InputError:
            raise InputError(
                f"{shown(source)} is not finite; accepted: finite numbers", "not-finite"
            ) from None

    @property
    def is_constant(self) -> bool:
        """True if the value is the same everywhere at all times."""
        return isinstance(self._read, float)

    @property
    def value(self) -> float:
        """The value of a constant expression; of others a ValueError."""
        if not isinstance(self._read, float):
            raise ValueError(f"{self} depends on the coordinates or the time")
        return self._read

    def number(self, time: float) -> float:
        """Return the value of an expression that depends on the time alone."""
        return float(self.numpy(np.zeros((1, 3)), time=time)[0])

    def numpy(
        self, points: ArrayLike, comm: MPI.Comm | None = None, time: float | None = None
    ) -> NDArray[np.float64]:
        """Evaluate at points.

        Parameters
        ----------
        points
            Coordinates, shape (n, 2) or (n, 3).
        comm
            If given, the call is collective, and a bad value on one rank raises on all.
        time
            The time, for a formula in t.

        Returns
        -------
        Values, shape (n,).

        Raises
        ------
        InputError
            If a value is not finite, or z is used in 2-D.
        """
        points = np.asarray(points, dtype=np.float64)
        # An array, since numbers are taken for constants of the formula.
        moment = None if time is None else np.full(1, time, dtype=np.float64)
        with np.errstate(all="ignore"):
            result = self._evaluate(points.T, points.shape[1], moment)
        values = np.array(np.broadcast_to(result, points.shape[:1]), dtype=np.float64)
        bad = points[~np.isfinite(values)][:1].tolist()
        # The lowest rank that has a bad point speaks for all.
        found = bad if comm is None else list(itertools.chain(*comm.allgather(bad)))
        if found:
            place = ", ".join(f"{c:g}" for c in found[0])
            raise InputError(
                f"{self} is not finite at ({place}); accepted: a formula that is", "not-finite"
            )
        return values

    def ufl(self, x: Expr, time: float | fem.Constant | None = None) -> Expr:
        """Return the scalar UFL expression at ``x``, a vector of length 2 or 3, and a time."""
        (dimension,) = x.ufl_shape
        return ops.symbolic(self._evaluate(x, dimension, time))

    def _evaluate(self, x: Any, dimension: int, time: Any) -> Any:
        if isinstance(self._read, float):
            return self._read
        if dimension < 3 and "z" in self.names:
            raise InputError(
                f"{self} uses z in a plane problem; accepted there: x and y", "formula-variable"
            )
        if time is None and "t" in self.names:
            raise InputError(
                f"{self} uses t; accepted in a static problem: formulas without", "formula-variable"
            )
        coordinates = (x[i] for i in range(dimension))
        variables = dict(zip(VARIABLES, coordinates, strict=False)) | {"t": time}
        return _as_number(_value(self._read, variables))

    def __repr__(self) -> str:
        """Return the call that makes this expression."""
        return f"Expression({self.source!r})"

    def __str__(self) -> str:
        """Return the source as in the case file."""
        return shown(self.source)

    def __eq__(self, other: object) -> bool:
        """Compare the sources."""
        return isinstance(other, Expression) and self.source == other.source

    def __hash__(self) -> int:
        """Hash the source."""
        return hash(self.source)


@dataclass(frozen=True)
class NodalField:
    """A formula of the case file as a function of position; messages name its key.

    Attributes
    ----------
    key, expression
        Key of the case file, and its formula.
    comm
        The ranks that evaluate it together.
    minimum
        Least value that is accepted at a node.
    time
        A number, or a constant of a form; None for a formula without t.
    """

    key: str
    expression: Expression
    comm: MPI.Intracomm
    minimum: float = -np.inf
    time: float | fem.Constant | None = None

    @property
    def is_zero(self) -> bool:
        """Whether it is nothing."""
        return self.expression.is_constant and self.expression.value == 0

    def ufl(self, x: Expr) -> Expr:
        """Return the formula as a UFL expression of the coordinates."""
        return self.expression.ufl(x, self.time)

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d). Collective."""
        try:
            values = self.expression.numpy(points, self.comm, self.time)
        except InputError as error:
            raise error.within(f"{self.key}: ") from None
        largest = float(np.abs(values).max(initial=0.0))
        check_range(self.key, self.comm.allreduce(largest, op=MPI.MAX), least=0.0)
        least = self.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
        if least < self.minimum:
            raise InputError(
                f"{self.key}: {self.expression} is {least:g} at a node; accepted: values >= 0",
                "negative",
            )
        return values


@dataclass(frozen=True)
class TimeField:
    """A formula of the case file that depends on the time."""

    key: str
    expression: Expression
    comm: MPI.Intracomm

    def at(self, time: float | fem.Constant) -> NodalField:
        """Return the field at a time: a number, or a constant of a form."""
        return NodalField(self.key, self.expression, self.comm, time=time)


def as_field(
    key: str, given: Any, comm: MPI.Intracomm, minimum: float = -np.inf
) -> NodalField | TimeField | None:
    """Return a formula of the case file as a function of position; None for anything else."""
    if not isinstance(given, Expression):
        return None
    if "t" in given.names:
        return TimeField(key, given, comm)
    return NodalField(key, given, comm, minimum)


def as_number(given: Expression, unit: float = 1.0) -> float | Callable[[float], float]:
    """Return a formula without coordinates as a number, or as a function of the time."""
    if given.is_constant:
        return unit * given.value
    return lambda time: unit * given.number(time)


def _parse(source: str) -> tuple[float | ast.expr, frozenset[str]]:
    """Read a formula and the names of its variables, or raise an InputError that shows it."""
    if len(source) > MAX_LENGTH:
        raise InputError(
            f"{shown(source)} has {len(source)} characters; accepted: at most {MAX_LENGTH}",
            "long-formula",
        )
    try:
        body = ast.parse(source.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        # Python reports some malformed or deeply nested texts by the last three.
        raise InputError(
            f"{shown(source)} is not a formula; accepted: {ACCEPTED}", "formula"
        ) from error
    level: list[ast.AST] = [body]
    for _ in range(MAX_DEPTH):
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    if level:
        raise InputError(
            f"{shown(source)} is nested too deeply; accepted: {MAX_DEPTH} levels", "long-formula"
        )
    try:
        # Anything that is not accepted is found by an evaluation anywhere.
        with np.errstate(all="ignore"):
            value = _value(body, dict.fromkeys(VARIABLES, np.zeros(1)))
    except InputError as error:
        raise error.within(f"{shown(source)}: ") from None
    if isinstance(value, float):
        return value, frozenset()
    names = {node.id for node in ast.walk(body) if isinstance(node, ast.Name)}
    return body, frozenset(names & {*VARIABLES})


def _value(node: ast.AST, variables: Mapping[str, Any]) -> Any:
    """Evaluate a node of the syntax tree at arrays, or UFL, of the variables.

    Constant parts are floats, so that neither NumPy nor UFL has to simplify them.
    """

    def read(inner: ast.AST) -> Any:
        return _value(inner, variables)

    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _finite(value)
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name) if name in VARIABLES:
            return variables[name]
        case ast.Name(id=name):
            raise InputError(f"unknown name {name}; accepted: {ACCEPTED}", "formula")
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _ARITHMETIC:
            return _apply(_ARITHMETIC[type(op)], read(operand))
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _ARITHMETIC:
            return _arithmetic(op, read(left), read(right))
        case ast.BinOp(op=ast.BitXor()):
            raise InputError("^ is not accepted; a power is written **", "formula")
        case ast.Compare(left=left, ops=signs, comparators=others):
            return _comparison(signs, [read(side) for side in (left, *others)])
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _function(name, [read(arg) for arg in args])
    raise InputError(f"{ast.unparse(node)[:40]} is not accepted; accepted: {ACCEPTED}", "formula")


def _arithmetic(op: ast.operator, left: Any, right: Any) -> Any:
    """Evaluate an operation of two; 0*a, 0/a and a**0 are constants.

    UFL would simplify these and go on to compute in Python's numbers, which raise or go complex
    where NumPy's do not; here they are caught as any constant is.
    """
    left_is_zero, right_is_zero = (isinstance(a, float) and a == 0.0 for a in (left, right))
    if isinstance(op, ast.Div) and right_is_zero:
        raise InputError("division by zero is not accepted", "not-finite")
    if isinstance(op, ast.Pow) and right_is_zero:
        return 1.0
    if isinstance(op, ast.Mult | ast.Div) and (left_is_zero or right_is_zero):
        return 0.0
    return _apply(_ARITHMETIC[type(op)], left, right)


def _comparison(signs: Sequence[ast.cmpop], sides: Sequence[Any]) -> Any:
    """Evaluate ``a < b``, or the chain ``a < b < c``, which holds if each link does."""
    if not all(type(sign) in _COMPARISONS for sign in signs):
        raise InputError("only the comparisons < <= > >= == != are accepted", "formula")
    pairs = zip(signs, itertools.pairwise(sides), strict=True)
    links = [_apply(_COMPARISONS[type(sign)], *pair) for sign, pair in pairs]
    known = [link for link in links if isinstance(link, float)]
    if 0.0 in known:
        return 0.0
    conditions = [link for link in links if not isinstance(link, float)]
    return reduce(ops.both, conditions) if conditions else 1.0


def _function(name: str, arguments: Sequence[Any]) -> Any:
    def check(right: bool, accepted: str) -> None:
        if not right:
            given = f"{name} is given {len(arguments)} argument(s)"
            raise InputError(f"{given}; accepted: {accepted}", "formula")

    if name in _FUNCTIONS:
        check(len(arguments) == 1, "1 argument")
        return _apply(_FUNCTIONS[name], *arguments)
    if name in _EXTREMES:
        check(len(arguments) >= 2, "2 arguments or more")
        return reduce(partial(_apply, _EXTREMES[name]), arguments)
    if name != "where":
        raise InputError(f"unknown function {name}; accepted: {ACCEPTED}", "formula")
    check(len(arguments) == 3, "3 arguments: condition, a, b")
    condition, a, b = arguments
    if isinstance(condition, float):
        return a if condition else b
    if not _is_condition(condition):
        condition = ops.not_equal(condition, 0.0)
    return ops.where(condition, _as_number(a), _as_number(b))


def _apply(function: Callable[..., Any], *arguments: Any) -> Any:
    """Apply a function; to constants in NumPy's floats, and the value has to be finite.

    Python's own raise for 9.0**999 and go complex for (-8.0)**0.3.
    """
    if all(isinstance(argument, float) for argument in arguments):
        with np.errstate(all="ignore"):
            return _finite(function(*map(np.float64, arguments)))
    return function(*map(_as_number, arguments))


def _as_number(value: Any) -> Any:
    """Turn a condition that is used as a number into 1 or 0."""
    return ops.where(value, 1.0, 0.0) if _is_condition(value) else value


def _is_condition(value: Any) -> bool:
    return isinstance(value, ufl.classes.Condition) or getattr(value, "dtype", None) == np.bool_


def _finite(value: Any) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError("a constant in it is not finite; accepted: finite numbers", "not-finite")
    return number
