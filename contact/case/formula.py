"""Formulas of the case file, such as ``"-10*x"``, as functions of the coordinates and the time.

A formula is read with Python's own parser and checked, node by node, against a short list of
accepted ones. Nothing is handed to ``eval``.
"""

from __future__ import annotations

import ast
import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import TYPE_CHECKING, Any, TypeAlias

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

#: A formula as read: a number, or a function of the values of the variables by their names.
Read: TypeAlias = float | Callable[[Mapping[str, Any]], Any]

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
    ast.UAdd: lambda a: a,
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

    __slots__ = ("_read", "names", "source")

    source: float | str
    #: Coordinates that the formula uses, and "t" if it uses the time.
    names: frozenset[str]

    def __init__(self, source: float | str) -> None:
        if isinstance(source, bool) or not isinstance(source, int | float | str):
            raise InputError(f"{source!r} is neither a number nor a formula")
        if isinstance(source, str):
            self.source, (self._read, names) = source, _parse(source)
            self.names = frozenset() if isinstance(self._read, float) else names
            return
        try:
            self.source, self.names = float(source), frozenset()
            self._read = _finite(self.source)
        except (OverflowError, InputError):
            # A whole number may be as long as it likes.
            raise InputError(f"{shown(source)} is not finite; accepted: finite numbers") from None

    @property
    def is_constant(self) -> bool:
        """True if the value is the same everywhere at all times."""
        return isinstance(self._read, float)

    @property
    def value(self) -> float:
        """Value of a constant expression.

        Raises
        ------
        ValueError
            If the expression depends on the coordinates or the time.
        """
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
        with np.errstate(all="ignore"):
            result = self._evaluate(points.T, points.shape[1], time)
        values = np.array(np.broadcast_to(result, points.shape[:1]), dtype=np.float64)
        bad = points[~np.isfinite(values)][:1].tolist()
        # The lowest rank that has a bad point speaks for all.
        found = bad if comm is None else list(itertools.chain(*comm.allgather(bad)))
        if found:
            place = ", ".join(f"{c:g}" for c in found[0])
            raise InputError(f"{self} is not finite at ({place}); accepted: a formula that is")
        return values

    def ufl(self, x: Expr, time: Any = None) -> Expr:
        """Return the scalar UFL expression at ``x``, a vector of length 2 or 3, and a time.

        Raises
        ------
        InputError
            If z is used in 2-D.
        """
        (dimension,) = x.ufl_shape
        return ops.symbolic(self._evaluate(x, dimension, time))

    def _evaluate(self, x: Any, dimension: int, time: Any) -> Any:
        if dimension < 3 and "z" in self.names:
            raise InputError(f"{self} uses z in a plane problem; accepted there: x and y")
        if time is None and "t" in self.names:
            raise InputError(f"{self} uses t; accepted in a static problem: formulas without")
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

    def __reduce__(self) -> tuple[type[Expression], tuple[float | str]]:
        """Pickle the source alone."""
        # The functions that were read would not pass between ranks.
        return Expression, (self.source,)


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
    time: Any = None

    def ufl(self, x: Expr) -> Expr:
        """Return the formula as a UFL expression of the coordinates."""
        return self.expression.ufl(x, self.time)

    def numpy(self, points: Array) -> Array:
        """Return the values at points of shape (n, d). Collective."""
        try:
            values = self.expression.numpy(points, self.comm, self.time)
        except InputError as error:
            raise InputError(f"{self.key}: {error}") from None
        largest = float(np.abs(values).max(initial=0.0))
        check_range(self.key, self.comm.allreduce(largest, op=MPI.MAX), least=0.0)
        least = self.comm.allreduce(float(values.min(initial=np.inf)), op=MPI.MIN)
        if least < self.minimum:
            raise InputError(
                f"{self.key}: {self.expression} is {least:g} at a node; accepted: values >= 0"
            )
        return values


@dataclass(frozen=True)
class TimeField:
    """A formula of the case file that depends on the time."""

    key: str
    expression: Expression
    comm: MPI.Intracomm

    def at(self, time: Any) -> NodalField:
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


def _parse(source: str) -> tuple[Read, frozenset[str]]:
    """Read a formula and the names of its variables, or raise an InputError that shows it."""
    if len(source) > MAX_LENGTH:
        raise InputError(
            f"{shown(source)} has {len(source)} characters; accepted: at most {MAX_LENGTH}"
        )
    try:
        body = ast.parse(source.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        # Python reports some malformed or deeply nested texts by the last three.
        raise InputError(f"{shown(source)} is not a formula; accepted: {ACCEPTED}") from error
    if _depth(body) > MAX_DEPTH:
        raise InputError(f"{shown(source)} is nested too deeply; accepted: {MAX_DEPTH} levels")
    try:
        read = _read(body)
    except InputError as error:
        raise InputError(f"{shown(source)}: {error}") from None
    names = {node.id for node in ast.walk(body) if isinstance(node, ast.Name)}
    return read, frozenset(names & {*VARIABLES})


def _depth(root: ast.AST) -> int:
    """Depth of a syntax tree, without recursion: the depth is in doubt."""
    level, depth = [root], 0
    while level:
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        depth += 1
    return depth


def _read(node: ast.AST) -> Read:
    """Read a node of the syntax tree; constant parts are evaluated at once."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _finite(value)
        case ast.Name(id="pi"):
            return math.pi
        case ast.Name(id=name) if name in VARIABLES:
            return operator.itemgetter(name)
        case ast.Name(id=name):
            raise InputError(f"unknown name {name}; accepted: {ACCEPTED}")
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _ARITHMETIC:
            return _apply(_ARITHMETIC[type(op)], _read(operand))
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _ARITHMETIC:
            return _arithmetic(op, _read(left), _read(right))
        case ast.BinOp(op=ast.BitXor()):
            raise InputError("^ is not accepted; a power is written **")
        case ast.Compare(left=left, ops=signs, comparators=others):
            return _comparison(signs, [_read(side) for side in (left, *others)])
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _function(name, [_read(arg) for arg in args])
    raise InputError(f"{ast.unparse(node)[:40]} is not accepted; accepted: {ACCEPTED}")


def _arithmetic(op: ast.operator, left: Read, right: Read) -> Read:
    """Read an operation of two; 0*a, 0/a and a**0 are constants.

    UFL would simplify these and go on to compute in Python's numbers, which raise or go complex
    where NumPy's do not; here they are caught as any constant is.
    """
    if isinstance(op, ast.Div) and right == 0.0:
        raise InputError("division by zero is not accepted")
    if isinstance(op, ast.Pow) and right == 0.0:
        return 1.0
    if (isinstance(op, ast.Mult) and 0.0 in (left, right)) or (
        isinstance(op, ast.Div) and left == 0.0
    ):
        return 0.0
    return _apply(_ARITHMETIC[type(op)], left, right)


def _comparison(signs: Sequence[ast.cmpop], sides: Sequence[Read]) -> Read:
    """Read ``a < b``, or the chain ``a < b < c``, which holds if each link does."""
    if not all(type(sign) in _COMPARISONS for sign in signs):
        raise InputError("only the comparisons < <= > >= == != are accepted")
    pairs = zip(signs, itertools.pairwise(sides), strict=True)
    links = [_apply(_COMPARISONS[type(sign)], *pair) for sign, pair in pairs]
    if 0.0 in links:
        return 0.0
    conditions: list[Callable[..., Any]] = [link for link in links if callable(link)]

    def both(one: Callable[..., Any], other: Callable[..., Any]) -> Callable[..., Any]:
        return lambda variables: ops.both(one(variables), other(variables))

    return reduce(both, conditions) if conditions else 1.0


def _function(name: str, arguments: Sequence[Read]) -> Read:
    def check(right: bool, accepted: str) -> None:
        if not right:
            given = f"{name} is given {len(arguments)} argument(s)"
            raise InputError(f"{given}; accepted: {accepted}")

    if name in _FUNCTIONS:
        check(len(arguments) == 1, "1 argument")
        return _apply(_FUNCTIONS[name], *arguments)
    if name in _EXTREMES:
        check(len(arguments) >= 2, "2 arguments or more")
        return reduce(partial(_apply, _EXTREMES[name]), arguments)
    if name == "where":
        check(len(arguments) == 3, "3 arguments: condition, a, b")
        return _where(*arguments)
    raise InputError(f"unknown function {name}; accepted: {ACCEPTED}")


def _where(condition: Read, a: Read, b: Read) -> Read:
    if isinstance(condition, float):
        return a if condition else b

    def chosen(variables: Mapping[str, Any]) -> Any:
        holds = condition(variables)
        if not _is_condition(holds):
            holds = ops.not_equal(holds, 0.0)
        return ops.where(holds, *(_as_number(_value(part, variables)) for part in (a, b)))

    return chosen


def _apply(function: Callable[..., Any], *arguments: Read) -> Read:
    """Apply a function; at once if all is known, so that neither NumPy nor UFL has to."""
    numbers = [argument for argument in arguments if isinstance(argument, float)]
    if len(numbers) == len(arguments):
        with np.errstate(all="ignore"):
            # NumPy's floats: Python's own raise for 9.0**999 and go complex for (-8.0)**0.3.
            return _finite(function(*map(np.float64, numbers)))
    return lambda variables: function(
        *(_as_number(_value(argument, variables)) for argument in arguments)
    )


def _value(read: Read, variables: Mapping[str, Any]) -> Any:
    return read if isinstance(read, float) else read(variables)


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
        raise InputError("a constant in it is not finite; accepted: finite numbers")
    return number
