"""Elementary functions that accept UFL expressions, NumPy arrays and numbers alike.

Each constitutive law is written once, with these functions, and is then used inside
variational forms and on arrays of nodal values.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import ufl
from numpy.typing import NDArray
from ufl.algebra import Abs
from ufl.core.expr import Expr

#: A number, a NumPy array or a UFL expression.
Value: TypeAlias = float | NDArray[np.float64] | Expr

#: A condition on one, true or false at each of its places.
Condition: TypeAlias = bool | NDArray[np.bool_] | Expr


def is_symbolic(*values: Value | Condition) -> bool:
    """Return true if any of the values is a UFL expression."""
    return any(isinstance(value, Expr) for value in values)


def symbolic(a: Value) -> Expr:
    """Return the value as a UFL expression."""
    return ufl.as_ufl(a)


def is_unlimited(limit: Value) -> bool:
    """Return true for an infinite limit, which compiled forms cannot have."""
    return isinstance(limit, float) and limit == np.inf


def maximum(a: Value, b: Value) -> Value:
    """Return the larger of two values, pointwise."""
    return ufl.max_value(a, b) if is_symbolic(a, b) else np.maximum(a, b)


def minimum(a: Value, b: Value) -> Value:
    """Return the smaller of two values, pointwise."""
    return ufl.min_value(a, b) if is_symbolic(a, b) else np.minimum(a, b)


def clip(a: Value, low: Value, high: Value) -> Value:
    """Limit a value to the interval [low, high], pointwise."""
    return minimum(maximum(a, low), high)


def positive_part(a: Value) -> Value:
    """Return [a]^+ = max(a, 0), pointwise."""
    return maximum(a, 0.0)


def where(condition: Condition, a: Value, b: Value) -> Value:
    """Choose ``a`` where the condition holds and ``b`` elsewhere, pointwise."""
    if is_symbolic(condition, a, b) or isinstance(condition, ufl.classes.Condition):
        return ufl.conditional(condition, a, b)
    return np.where(condition, a, b)


def less_equal(a: Value, b: Value) -> Condition:
    """Return the condition a <= b."""
    return ufl.le(a, b) if is_symbolic(a, b) else np.less_equal(a, b)


def less(a: Value, b: Value) -> Condition:
    """Return the condition a < b."""
    return ufl.lt(a, b) if is_symbolic(a, b) else np.less(a, b)


def equal(a: Value, b: Value) -> Condition:
    """Return the condition a == b."""
    return ufl.eq(a, b) if is_symbolic(a, b) else np.equal(a, b)


def not_equal(a: Value, b: Value) -> Condition:
    """Return the condition a != b."""
    return ufl.ne(a, b) if is_symbolic(a, b) else np.not_equal(a, b)


def both(a: Condition, b: Condition) -> Condition:
    """Return the condition that two conditions hold together."""
    return ufl.And(a, b) if is_symbolic(a, b) else np.logical_and(a, b)


def sqrt(a: Value) -> Value:
    """Return the square root."""
    return ufl.sqrt(a) if is_symbolic(a) else np.sqrt(a)


def log(a: Value) -> Value:
    """Return the natural logarithm."""
    return ufl.ln(a) if is_symbolic(a) else np.log(a)


def exp(a: Value) -> Value:
    """Return the exponential."""
    return ufl.exp(a) if is_symbolic(a) else np.exp(a)


def sin(a: Value) -> Value:
    """Return the sine of an angle in radians."""
    return ufl.sin(a) if is_symbolic(a) else np.sin(a)


def cos(a: Value) -> Value:
    """Return the cosine of an angle in radians."""
    return ufl.cos(a) if is_symbolic(a) else np.cos(a)


def tan(a: Value) -> Value:
    """Return the tangent of an angle in radians."""
    return ufl.tan(a) if is_symbolic(a) else np.tan(a)


def absolute(a: Value) -> Value:
    """Return the absolute value."""
    # UFL would nest it in itself without end.
    if isinstance(a, Abs):
        return a
    return abs(a) if is_symbolic(a) else np.abs(a)
