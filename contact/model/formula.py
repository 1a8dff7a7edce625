"""Formulas such as ``"-10*x"`` as functions of the coordinates and the time.

Python's parser reads a formula; the nodes of its syntax tree that are listed here are compiled, to
calls of `forms.ops`, which take NumPy arrays and UFL alike. All others are refused.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache, reduce
from types import CodeType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact.arguments import OfTime, Returned
from contact.errors import InputError, clipped, counted, nearest, shown
from forms import ops

if TYPE_CHECKING:
    from dolfinx import fem
    from ufl.core.expr import Expr

#: Contents of a formula, for messages and the reference page.
ACCEPTED = (
    "numbers, x, y, z, t, pi, + - * / **, comparisons, and sin, cos, tan, exp, log, sqrt, abs, "
    "min, max, where(condition, a, b)"
)

#: The coordinates and the time.
VARIABLES = ("x", "y", "z", "t")

ARITHMETIC = ast.Add | ast.Sub | ast.Mult | ast.Div | ast.Pow
COMPARISONS: Mapping[str, Callable[[Any, Any], Any]] = {
    "Lt": ops.less,
    "LtE": ops.less_equal,
    "Gt": lambda a, b: ops.less(b, a),
    "GtE": lambda a, b: ops.less_equal(b, a),
    "Eq": ops.equal,
    "NotEq": ops.not_equal,
}


def _comparison(sign: str, a: Any, b: Any) -> Any:
    """Return 1 where a comparison holds, and 0 elsewhere."""
    holds = COMPARISONS[sign](a, b)
    return float(holds) if isinstance(holds, np.bool_) else ops.where(holds, 1.0, 0.0)


def _chain(signs: str, *sides: Any) -> Any:
    """Return 1 where each link of ``a < b < c`` holds."""
    return math.prod(map(_comparison, signs.split(), sides, sides[1:]))


def _where(condition: Any, a: Any, b: Any) -> Any:
    if isinstance(condition, float):
        return a if condition else b
    return ops.where(ops.not_equal(condition, 0.0), a, b)


#: The functions, with the least and the largest number of their arguments.
FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int, float]] = {
    "sin": (ops.sin, 1, 1),
    "cos": (ops.cos, 1, 1),
    "tan": (ops.tan, 1, 1),
    "exp": (ops.exp, 1, 1),
    "log": (ops.log, 1, 1),
    "sqrt": (ops.sqrt, 1, 1),
    "abs": (ops.absolute, 1, 1),
    "min": (lambda *several: reduce(ops.minimum, several), 2, math.inf),
    "max": (lambda *several: reduce(ops.maximum, several), 2, math.inf),
    "where": (_where, 3, 3),
}
_NAMES = {name: function for name, (function, _, _) in FUNCTIONS.items()} | {
    "__builtins__": {},
    "pi": math.pi,
    "_chain": _chain,
}


class Expression:
    """A scalar function of the coordinates and the time, given as a number or a formula.

    Formulas have NumPy's meaning: ``log`` is natural, angles are in radians, ``min`` and ``max``
    take two arguments or more, and a comparison counts as 1 or 0. The source is a finite number or
    a formula in x, y, z and t; an InputError names any other, and the accepted ones. The time of a
    formula in t is a number, or a constant of a form.
    """

    def __init__(self, source: float | str, time: float | fem.Constant | None = None) -> None:
        if isinstance(source, bool) or not isinstance(source, int | float | str):
            raise InputError(f"{source!r} is neither a number nor a formula", "formula")
        self.source = source if isinstance(source, str) else _finite(source, source)
        self.time = time
        if isinstance(source, str):
            _read(source)

    @property
    def names(self) -> frozenset[str]:
        """Coordinates that the formula uses, and "t" if it uses the time."""
        return _read(self.source)[1] if isinstance(self.source, str) else frozenset()

    @property
    def is_constant(self) -> bool:
        """True if the value is the same everywhere at all times."""
        return not self.names

    @property
    def value(self) -> float:
        """The value of a constant expression; of others a ValueError."""
        if self.names:
            raise ValueError(f"{self} depends on the coordinates or the time")
        return _read(self.source)[2] if isinstance(self.source, str) else self.source

    def number(self, time: float) -> float:
        """Return the value of an expression that depends on the time alone."""
        return float(Expression(self.source, time).numpy(np.zeros((1, 3)))[0])

    def numpy(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the values, finite ones, (n,), at points, shape (n, 2) or (n, 3)."""
        points = np.asarray(points, dtype=np.float64)
        values = self.values(points)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            place = ", ".join(f"{c:g}" for c in points[bad[0]])
            raise Returned(
                f"{self} is not finite at ({place}); accepted: a formula that is", "not-finite"
            )
        return values

    def values(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values at points, as `numpy`, not finite where there are none."""
        # An array: NumPy's numbers divide by 0, Python's do not.
        time = None if self.time is None else np.full(1, self.time, dtype=np.float64)
        result = self._evaluate(points.T, points.shape[1], time)
        return np.array(np.broadcast_to(result, points.shape[:1]), dtype=np.float64)

    def ufl(self, x: Expr) -> Expr:
        """Return the scalar UFL expression at ``x``, a vector of length 2 or 3."""
        (dimension,) = x.ufl_shape
        return ops.symbolic(self._evaluate(x, dimension, self.time))

    def _evaluate(self, x: Any, dimension: int, time: Any) -> Any:
        if not isinstance(self.source, str) or self.is_constant:
            return self.value
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
        return _value(self.source, _read(self.source)[0], variables)

    def __repr__(self) -> str:
        """Return the call that makes this expression."""
        return f"Expression({self.source!r})"

    def __str__(self) -> str:
        """Return the source as in the case file."""
        return shown(self.source)

    def __eq__(self, other: object) -> bool:
        """Compare sources and times."""
        if not isinstance(other, Expression):
            return NotImplemented
        return (self.source, self.time) == (other.source, other.time)

    def __hash__(self) -> int:
        """Hash the source."""
        return hash(self.source)


class InTime(Expression):
    """A formula in t as a function of position and time."""

    def at(self, time: float | fem.Constant) -> Expression:
        """Return the function of position at a time."""
        return Expression(self.source, time)


def is_zero(given: object) -> bool:
    """Tell whether a given value is a formula that is 0 everywhere at all times."""
    return isinstance(given, Expression) and given.is_constant and given.value == 0


def as_number(given: Expression | OfTime) -> float | OfTime:
    """Return a formula without coordinates as a number, or as a function of the time."""
    if isinstance(given, OfTime):
        return given
    return given.value if given.is_constant else OfTime(given.number, str(given))


@lru_cache(maxsize=1000)
def _read(source: str) -> tuple[CodeType, frozenset[str], float]:
    """Return the code of a formula, the names of its variables, and its value at ones."""
    try:
        body = ast.parse(source.strip(), mode="eval").body
        tree = ast.fix_missing_locations(ast.Expression(_translated(body)))
        code = compile(tree, "formula", "eval")
    except InputError as error:
        raise error.within(f"{shown(source)}: ") from None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        # Python reports some malformed or deeply nested texts by the last three.
        raise InputError(
            f"{shown(source)} is not a formula; accepted: {ACCEPTED}", "formula"
        ) from error
    names = {node.id for node in ast.walk(body) if isinstance(node, ast.Name)} & {*VARIABLES}
    # Python's numbers in it raise errors where they have no value.
    value = _value(source, code, dict.fromkeys(VARIABLES, np.ones(1)))
    return code, frozenset(names), np.nan if names else _finite(value, source)


def _value(source: str, code: CodeType, variables: Mapping[str, Any]) -> Any:
    """Return the value of a formula, of NumPy arrays or of UFL."""
    try:
        with np.errstate(all="ignore"):
            return eval(code, _NAMES, {**variables})
    except (ArithmeticError, ValueError):
        return _finite(math.nan, source)


def _finite(value: Any, source: object) -> float:
    """Return a finite number, or raise an InputError."""
    try:
        number = float(value)
    except (OverflowError, TypeError):  # a whole number of many digits, a complex one
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{shown(source)} is not finite; accepted: finite numbers", "not-finite")
    return number


def _unknown(kind: str, name: str, known: Iterable[str]) -> InputError:
    """Return the error for an unknown name or function, with the nearest one."""
    hint = nearest(name, known, ", did you mean {}?")
    return InputError(f"unknown {kind} {clipped(name)}{hint}; accepted: {ACCEPTED}", "formula")


def _translated(node: ast.expr) -> ast.expr:
    """Return an accepted node with floats for numbers, and calls for comparisons."""
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return ast.Constant(_finite(value, value))
        case ast.Name(id=name):
            if name in (*VARIABLES, "pi"):
                return node
            raise _unknown("name", name, (*VARIABLES, "pi"))
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            return ast.UnaryOp(sign, _translated(operand))
        case ast.BinOp(op=ast.BitXor()):
            raise InputError("^ is not accepted; a power is written **", "formula")
        case ast.BinOp(left=left, op=op, right=right) if isinstance(op, ARITHMETIC):
            return ast.BinOp(_translated(left), op, _translated(right))
        case ast.Compare(left=left, ops=signs, comparators=others):
            links = [type(sign).__name__ for sign in signs]
            if {*links} <= {*COMPARISONS}:
                sides = map(_translated, (left, *others))
                return ast.Call(
                    ast.Name("_chain", ast.Load()), [ast.Constant(" ".join(links)), *sides], []
                )
        case ast.Call(func=ast.Name(id=name) as function, args=args, keywords=[]):
            if name not in FUNCTIONS:
                raise _unknown("function", name, FUNCTIONS)
            translated, (_, least, most) = [*map(_translated, args)], FUNCTIONS[name]
            if not least <= len(args) <= most:
                more = "" if least == most else " or more"
                raise InputError(
                    f"{name} is given {counted(len(args), 'argument')}; accepted: {least}{more}",
                    "formula",
                )
            return ast.Call(function, translated, [])
    raise InputError(f"{ast.unparse(node)[:40]} is not accepted; accepted: {ACCEPTED}", "formula")


#: Default of components, forces, gaps and the like.
ZERO = Expression(0.0)
