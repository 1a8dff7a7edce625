"""The grammar of formulas: from a text to a tree, and from a tree to values.

A formula is read with Python's own parser, checked against a short list of what is accepted,
and turned into a small tree of numbers, coordinates and calls. Nothing is handed to ``eval``.
"""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from contact.case.showing import shown
from contact.errors import InputError
from forms import ops

#: What a formula may contain, for messages and the reference page.
ACCEPTED = (
    "numbers, x, y, z, t, pi, + - * / **, comparisons, and sin, cos, tan, exp, log, sqrt, abs, "
    "min, max, where(condition, a, b)"
)

#: Longest formula (characters) and deepest nesting: far beyond any load, and small enough for
#: every recursion over the tree, here and in UFL.
MAX_LENGTH = 1000
MAX_DEPTH = 100

#: What a formula may depend on: the coordinates, and the time.
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
class Number:
    """A number."""

    value: float


@dataclass(frozen=True)
class Variable:
    """A coordinate or the time, by its index in `VARIABLES`."""

    index: int


@dataclass(frozen=True)
class Call:
    """A function of subtrees; ``condition`` marks the ones that are true or false."""

    function: Callable[..., Any]
    arguments: tuple[Tree, ...]
    condition: bool = False


Tree: TypeAlias = Number | Variable | Call


def parse(source: float | str) -> Tree:
    """Read a number or a formula, or raise an InputError that shows it."""
    if isinstance(source, float):
        if not math.isfinite(source):
            raise InputError(f"{shown(source)} is not finite; accepted: finite numbers")
        return Number(source)
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


def _build(node: ast.AST) -> Tree:
    match node:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            return _number(value)
        case ast.Name(id="pi"):
            return Number(math.pi)
        case ast.Name(id=name) if name in VARIABLES:
            return Variable(VARIABLES.index(name))
        case ast.Name(id=name):
            raise InputError(f"unknown name {name}; accepted: {ACCEPTED}")
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _as_number(_build(operand))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _call(lambda a: -a, [_as_number(_build(operand))])
        case ast.BinOp(op=op, left=left, right=right) if type(op) in _ARITHMETIC:
            sides = [_as_number(_build(left)), _as_number(_build(right))]
            if isinstance(op, ast.Div) and sides[1] == Number(0.0):
                raise InputError("division by zero is not accepted")
            return _simplest(op, *sides) or _call(_ARITHMETIC[type(op)], sides)
        case ast.BinOp(op=ast.BitXor()):
            raise InputError("^ is not accepted; a power is written **")
        case ast.Compare(left=left, ops=signs, comparators=others):
            return _comparison(signs, [_as_number(_build(n)) for n in (left, *others)])
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]):
            return _function(name, [_build(arg) for arg in args])
    raise InputError(f"{ast.unparse(node)[:40]} is not accepted; accepted: {ACCEPTED}")


def _simplest(op: ast.operator, left: Tree, right: Tree) -> Tree | None:
    """Return the constant that UFL simplifies 0*a, 0/a and a**0 to, if it is one of these.

    UFL would go on to compute with it in Python's numbers, which raise or go complex where
    NumPy's do not; here it is caught as any constant is.
    """
    zero = Number(0.0)
    if isinstance(op, ast.Pow):
        return Number(1.0) if right == zero else None
    if (isinstance(op, ast.Mult) and zero in (left, right)) or (
        isinstance(op, ast.Div) and left == zero
    ):
        return zero
    return None


def _comparison(signs: Sequence[ast.cmpop], sides: Sequence[Tree]) -> Tree:
    """Build ``a < b``, or the chain ``a < b < c``, which holds if each link does."""
    if not all(type(sign) in _COMPARISONS for sign in signs):
        raise InputError("only the comparisons < <= > >= == != are accepted")
    links = [
        _call(_COMPARISONS[type(sign)], pair, condition=True)
        for sign, pair in zip(signs, itertools.pairwise(sides), strict=True)
    ]
    if Number(0.0) in links:
        return Number(0.0)
    open_links = [link for link in links if not isinstance(link, Number)]
    if not open_links:
        return Number(1.0)
    chain = open_links[0]
    for link in open_links[1:]:
        chain = Call(ops.both, (chain, link), condition=True)
    return chain


def _function(name: str, arguments: list[Tree]) -> Tree:
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


def _check_count(name: str, arguments: Sequence[Tree], right: bool, accepted: str) -> None:
    if not right:
        raise InputError(f"{name} is given {len(arguments)} argument(s); accepted: {accepted}")


def _where(condition: Tree, a: Tree, b: Tree) -> Tree:
    if isinstance(condition, Number):
        return a if condition.value else b
    if not (isinstance(condition, Call) and condition.condition):
        condition = Call(ops.not_equal, (condition, Number(0.0)), condition=True)
    return Call(ops.where, (condition, a, b))


def _as_number(tree: Tree) -> Tree:
    """Turn a condition that is used as a number into 1 or 0."""
    if isinstance(tree, Call) and tree.condition:
        return Call(ops.where, (tree, Number(1.0), Number(0.0)))
    return tree


def _call(function: Callable[..., Any], arguments: Sequence[Tree], condition: bool = False) -> Tree:
    """Apply a function; at once if all is known, so that neither NumPy nor UFL has to."""
    numbers = [argument.value for argument in arguments if isinstance(argument, Number)]
    if len(numbers) < len(arguments):
        return Call(function, tuple(arguments), condition)
    with np.errstate(all="ignore"):
        # NumPy's floats: Python's own raise for 9.0**999 and go complex for (-8.0)**0.3.
        return _number(function(*map(np.float64, numbers)))


def _number(value: Any) -> Number:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InputError("a constant in it is not finite; accepted: finite numbers")
    return Number(number)


def evaluate(tree: Tree, x: Any) -> Any:
    """Evaluate on ``x[0]``, ``x[1]`` ...: values of the variables, arrays or UFL expressions."""
    match tree:
        case Number(value):
            return value
        case Variable(index):
            return x[index]
        case Call(function, arguments):
            return function(*(evaluate(argument, x) for argument in arguments))


def variables(tree: Tree) -> set[int]:
    """Return the indices of the variables that a tree uses."""
    match tree:
        case Variable(index):
            return {index}
        case Call(_, arguments):
            return set().union(*(variables(argument) for argument in arguments))
    return set()
