"""Formulas of the case file, such as ``"-10*x"``: parsed, never handed to ``eval``.

A formula is read with Python's own parser, checked against a short list of what is accepted,
and turned into a small tree that is evaluated on arrays of points or as a UFL expression.
"""

from __future__ import annotations

import ast
import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact.errors import InputError
from forms import ops

if TYPE_CHECKING:
    from mpi4py import MPI
    from ufl.core.expr import Expr

#: What a formula may contain, for messages and the reference page.
ACCEPTED = (
    "numbers, x, y, z, pi, + - * / **, comparisons, and sin, cos, tan, exp, log, sqrt, abs, "
    "min, max, where(condition, a, b)"
)

#: Longest formula (characters) and deepest nesting: far beyond any load, and small enough for
#: every recursion over the tree, here and in UFL.
MAX_LENGTH = 1000
MAX_DEPTH = 100

COORDINATES = ("x", "y", "z")

_FUNCTIONS: Mapping[str, Callable[[Any], Any]] = {
    "sin": ops.sin,
    "cos": ops.cos,
    "tan": ops.tan,
    "exp": ops.exp,
    "log": ops.log,
    "sqrt": ops.sqrt,
    "abs": ops.absolute,
}
_VARIADIC: Mapping[str, Callable[[Any, Any], Any]] = {"min": ops.minimum, "max": ops.maximum}
_ARITHMETIC: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b,
    ast.Pow: lambda a, b: a**b,
}
_COMPARISONS: Mapping[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: ops.less,
    ast.LtE: ops.less_equal,
    ast.Gt: lambda a, b: ops.less(b, a),
    ast.GtE: lambda a, b: ops.less_equal(b, a),
    ast.Eq: ops.equal,
    ast.NotEq: ops.not_equal,
}


@dataclass(frozen=True)
class _Number:
    value: float


@dataclass(frozen=True)
class _Coordinate:
    index: int


@dataclass(frozen=True)
class _Call:
    """A function of subtrees; ``condition`` marks the ones that are true or false."""

    function: Callable[..., Any]
    arguments: tuple[_Tree, ...]
    condition: bool = False


_Tree: TypeAlias = _Number | _Coordinate | _Call


class Expression:
    """A scalar function of the coordinates, given as a number or a formula.

    Formulas have NumPy's meaning: ``log`` is natural, angles are in radians, ``min`` and
    ``max`` take two arguments or more, and a comparison counts as 1 or 0.

    Parameters
    ----------
    source
        A finite number or a formula in x, y and z.

    Raises
    ------
    InputError
        If the source is anything else; the message names the source and what is accepted.
    """

    __slots__ = ("_tree", "names", "source")

    source: float | str
    #: Coordinates that the formula uses.
    names: frozenset[str]

    def __init__(self, source: float | str) -> None:
        if isinstance(source, bool) or not isinstance(source, int | float | str):
            raise InputError(f"{source!r} is neither a number nor a formula")
        self.source = source if isinstance(source, str) else float(source)
        self._tree = _parse(self.source)
        self.names = frozenset(COORDINATES[i] for i in _coordinates(self._tree))

    @property
    def is_constant(self) -> bool:
        """True if the value is the same everywhere."""
        return isinstance(self._tree, _Number)

    @property
    def value(self) -> float:
        """Value of a constant expression.

        Raises
        ------
        ValueError
            If the expression depends on the coordinates.
        """
        if not isinstance(self._tree, _Number):
            raise ValueError(f"{self} depends on the coordinates")
        return self._tree.value

    def numpy(self, points: ArrayLike, comm: MPI.Comm | None = None) -> NDArray[np.float64]:
        """Evaluate at points.

        Parameters
        ----------
        points
            Coordinates, shape (n, 2) or (n, 3).
        comm
            If given, the call is collective, and a bad value on one rank raises on all.

        Returns
        -------
        Values, shape (n,).

        Raises
        ------
        InputError
            If a value is not finite, or z is used in the plane.
        """
        points = np.asarray(points, dtype=np.float64)
        self.check_dimension(points.shape[1])
        with np.errstate(all="ignore"):
            result = _evaluate(self._tree, points.T)
        values = np.array(np.broadcast_to(result, points.shape[:1]), dtype=np.float64)
        bad = points[~np.isfinite(values)][:1].tolist()
        # The lowest rank that has a bad point speaks for all.
        found = bad if comm is None else list(itertools.chain(*comm.allgather(bad)))
        if found:
            place = ", ".join(f"{c:g}" for c in found[0])
            raise InputError(f"{self} is not finite at ({place}); accepted: a formula that is")
        return values

    def ufl(self, x: Expr) -> Expr:
        """Return the scalar UFL expression at ``x``, a vector of length 2 or 3.

        Raises
        ------
        InputError
            If z is used in the plane.
        """
        (dimension,) = x.ufl_shape
        self.check_dimension(dimension)
        return ops.symbolic(_evaluate(self._tree, x))

    def check_dimension(self, dimension: int) -> None:
        """Raise an InputError if z is used in the plane."""
        if dimension < 3 and "z" in self.names:
            raise InputError(f"{self} uses z in a plane problem; accepted there: x and y")

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
        # The tree's functions would not pass between ranks.
        return Expression, (self.source,)


def shown(given: Any) -> str:
    """Show what the user gave as in the case file, on one line and not too long."""
    text = str(given) if isinstance(given, float) else json.dumps(given, default=str)
    return text if len(text) <= 60 else text[:57] + "..."


def _parse(source: float | str) -> _Tree:
    """Read a number or a formula, or raise an InputError that shows it."""
    if isinstance(source, float):
        if not math.isfinite(source):
            raise InputError(f"{shown(source)} is not finite; accepted: finite numbers")
        return _Number(source)
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
        return _as_number(_build(body))
    except InputError as error:
        raise InputError(f"{shown(source)}: {error}") from None


def _depth(root: ast.AST) -> int:
    """Depth of a syntax tree, without recursion: the depth is what is in doubt."""
    level, depth = [root], 0
    while level:
        level = [child for node in level for child in ast.iter_child_nodes(node)]
        depth += 1
    return depth


def _build(node: ast.AST) -> _Tree:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _number(value)
        case ast.Name(id="pi"):
            return _Number(math.pi)
        case ast.Name(id=name) if name in COORDINATES:
            return _Coordinate(COORDINATES.index(name))
        case ast.Name(id=name):
            raise InputError(f"unknown name {name}; accepted: {ACCEPTED}")
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _as_number(_build(operand))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _call(lambda a: -a, [_as_number(_build(operand))])
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _ARITHMETIC:
            sides = [_as_number(_build(left)), _as_number(_build(right))]
            if isinstance(op, ast.Div) and sides[1] == _Number(0.0):
                raise InputError("division by zero is not accepted")
            return _simplest(op, *sides) or _call(_ARITHMETIC[type(op)], sides)
        case ast.BinOp(op=ast.BitXor()):
            raise InputError("^ is not accepted; a power is written **")
        case ast.Compare(left=left, ops=signs, comparators=others):
            return _comparison(signs, [_as_number(_build(n)) for n in (left, *others)])
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _function(name, [_build(arg) for arg in args])
    raise InputError(f"{ast.unparse(node)[:40]} is not accepted; accepted: {ACCEPTED}")


def _simplest(op: ast.operator, left: _Tree, right: _Tree) -> _Tree | None:
    """Return the constant that UFL simplifies 0*a, 0/a and a**0 to, if it is one of these.

    UFL would go on to compute with it in Python's numbers, which raise or go complex where
    NumPy's do not; here it is caught as any constant is.
    """
    zero = _Number(0.0)
    if isinstance(op, ast.Pow):
        return _Number(1.0) if right == zero else None
    if (isinstance(op, ast.Mult) and zero in (left, right)) or (
        isinstance(op, ast.Div) and left == zero
    ):
        return zero
    return None


def _comparison(signs: Sequence[ast.cmpop], sides: Sequence[_Tree]) -> _Tree:
    """Build ``a < b``, or the chain ``a < b < c``, which holds if each link does."""
    if not all(type(sign) in _COMPARISONS for sign in signs):
        raise InputError("only the comparisons < <= > >= == != are accepted")
    links = [
        _call(_COMPARISONS[type(sign)], pair, condition=True)
        for sign, pair in zip(signs, itertools.pairwise(sides), strict=True)
    ]
    if _Number(0.0) in links:
        return _Number(0.0)
    open_links = [link for link in links if not isinstance(link, _Number)]
    if not open_links:
        return _Number(1.0)
    chain = open_links[0]
    for link in open_links[1:]:
        chain = _Call(ops.both, (chain, link), condition=True)
    return chain


def _function(name: str, arguments: list[_Tree]) -> _Tree:
    if name in _FUNCTIONS:
        _check_count(name, arguments, len(arguments) == 1, "1 argument")
        return _call(_FUNCTIONS[name], [_as_number(arguments[0])])
    if name in _VARIADIC:
        _check_count(name, arguments, len(arguments) >= 2, "2 arguments or more")
        result, *rest = (_as_number(argument) for argument in arguments)
        for argument in rest:
            result = _call(_VARIADIC[name], [result, argument])
        return result
    if name == "where":
        _check_count(name, arguments, len(arguments) == 3, "3 arguments: condition, a, b")
        return _where(arguments[0], _as_number(arguments[1]), _as_number(arguments[2]))
    raise InputError(f"unknown function {name}; accepted: {ACCEPTED}")


def _check_count(name: str, arguments: Sequence[_Tree], right: bool, accepted: str) -> None:
    if not right:
        raise InputError(f"{name} is given {len(arguments)} argument(s); accepted: {accepted}")


def _where(condition: _Tree, a: _Tree, b: _Tree) -> _Tree:
    if isinstance(condition, _Number):
        return a if condition.value else b
    if not (isinstance(condition, _Call) and condition.condition):
        condition = _Call(ops.not_equal, (condition, _Number(0.0)), condition=True)
    return _Call(ops.where, (condition, a, b))


def _as_number(tree: _Tree) -> _Tree:
    """Turn a condition that is used as a number into 1 or 0."""
    if isinstance(tree, _Call) and tree.condition:
        return _Call(ops.where, (tree, _Number(1.0), _Number(0.0)))
    return tree


def _call(
    function: Callable[..., Any], arguments: Sequence[_Tree], condition: bool = False
) -> _Tree:
    """Apply a function; at once if all is known, so that neither NumPy nor UFL has to."""
    numbers = [argument.value for argument in arguments if isinstance(argument, _Number)]
    if len(numbers) < len(arguments):
        return _Call(function, tuple(arguments), condition)
    with np.errstate(all="ignore"):
        # NumPy's floats: Python's own raise for 9.0**999 and go complex for (-8.0)**0.3.
        return _number(function(*map(np.float64, numbers)))


def _number(value: Any) -> _Number:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError("a constant in it is not finite; accepted: finite numbers")
    return _Number(number)


def _evaluate(tree: _Tree, x: Any) -> Any:
    """Evaluate on ``x[0]``, ``x[1]`` ...: rows of an array or components of a UFL vector."""
    match tree:
        case _Number(value):
            return value
        case _Coordinate(index):
            return x[index]
        case _Call(function, arguments):
            return function(*(_evaluate(argument, x) for argument in arguments))


def _coordinates(tree: _Tree) -> set[int]:
    match tree:
        case _Coordinate(index):
            return {index}
        case _Call(_, arguments):
            return set().union(*(_coordinates(argument) for argument in arguments))
    return set()
