"""Formulas: NumPy and UFL agree with each other, and nothing else than formulas is let in."""

import math
from functools import reduce

import basix.ufl
import numpy as np
import pytest
import ufl
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from contact.errors import InputError
from contact.model.formula import Expression
from tests.problems.messages import message_of


def coordinates(cell):
    element = basix.ufl.element("Lagrange", cell, 1, shape=(3 if cell == "tetrahedron" else 2,))
    return ufl.SpatialCoordinate(ufl.Mesh(element))


x2 = coordinates("triangle")
x3 = coordinates("tetrahedron")

# With a point: Python's whole numbers would grow to gigabytes in powers of powers.
numbers = st.floats(0.1, 9.9).map(lambda v: f"{v:#.3g}")
conditions = ["<", "<=", ">", ">=", "==", "!="]


def combine(inner):
    unary = st.sampled_from(["sin", "cos", "tan", "exp", "log", "sqrt", "abs", "-", "+"])
    pair = st.tuples(inner, inner)
    return st.one_of(
        st.tuples(unary, inner).map(lambda t: f"{t[0]}({t[1]})"),
        st.tuples(inner, st.sampled_from("+-*/"), inner).map(lambda t: f"({t[0]}{t[1]}{t[2]})"),
        st.tuples(inner, st.sampled_from(["2", "3", "0.5", "-1"])).map(
            lambda t: f"({t[0]})**{t[1]}"
        ),
        pair.map(lambda t: f"min({t[0]}, {t[1]})"),
        pair.map(lambda t: f"max({t[0]}, {t[1]}, 1)"),
        st.tuples(inner, st.sampled_from(conditions), inner, inner, inner).map(
            lambda t: f"where({t[0]} {t[1]} {t[2]}, {t[3]}, {t[4]})"
        ),
    )


formulas = st.recursive(st.one_of(numbers, st.sampled_from(["x", "y", "z", "pi"])), combine)
points = st.tuples(*[st.floats(-3, 3).map(lambda v: round(v, 3))] * 3)


@pytest.mark.core
@pytest.mark.filterwarnings("ignore:Value error in evaluation:UserWarning")
@settings(max_examples=300, deadline=None)
@given(formulas, points)
def test_numpy_and_ufl_agree_with_numpy_itself(formula, point):
    """The reference is NumPy's own evaluation; formulas without a finite value are refused."""
    namespace = {name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "log", "sqrt")}
    namespace |= {"abs": np.abs, "pi": np.pi, "where": np.where}
    # Not Python's own, which drop a value that is not a number.
    namespace |= {"min": lambda *a: reduce(np.minimum, a), "max": lambda *a: reduce(np.maximum, a)}
    namespace |= dict(zip("xyz", map(np.float64, point), strict=True))
    with np.errstate(all="ignore"):
        try:
            reference = float(eval(formula, {}, namespace))  # the test's own text
        except (ZeroDivisionError, OverflowError, TypeError):
            reference = math.nan  # Python's numbers raise where NumPy's are not finite
    assume(math.isfinite(reference) and abs(reference) < 1e8)
    try:
        expression = Expression(formula)
        values = expression.numpy([point, point])
    except InputError:
        # An unused branch of where, or a factor of 0, may hide the bad value from NumPy.
        assume(False)
    assert values.shape == (2,)
    assert values[0] == pytest.approx(reference, rel=1e-12, abs=1e-12)
    try:
        symbolic = float(expression.ufl(x3)(tuple(float(v) for v in point)))
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        assume(False)  # UFL evaluates with Python's numbers, which raise in unused branches
    assert symbolic == pytest.approx(reference, rel=1e-9, abs=1e-9)


@pytest.mark.core
@pytest.mark.parametrize(
    ("formula", "value"),
    [
        (3, 3.0),
        ("-10*x", -20.0),
        ("log(exp(2))", 2.0),
        ("2**-1", 0.5),
        ("-x**2", -4.0),
        ("2**3**2", 512.0),
        ("min(x, y, -1)", -1.0),
        ("where(x > 1, y, 0)", 3.0),
        ("where(x, 5, 6)", 5.0),
        ("(x > 1) + (y > 1)", 2.0),
        ("1 < x < 3", 1.0),
        ("1 < x < 2", 0.0),
        ("where(1 < 2, x, y)", 2.0),
        ("sin(pi/2) + 1e-0", 2.0),
        ("0.0**x", 0.0),
        ("abs(-x)", 2.0),
        ("abs(abs(-x))**2", 4.0),
    ],
)
def test_values(formula, value):
    expression = Expression(formula)
    assert expression.numpy([[2.0, 3.0]]) == pytest.approx([value])
    assert float(expression.ufl(x2)((2.0, 3.0))) == pytest.approx(value)


def test_values_that_are_not_finite_name_the_point():
    with pytest.raises(InputError, match=r"\[not-finite\]"):
        Expression("1/x").numpy([[1.0, 2.0], [0.0, 2.0]])


@pytest.mark.parametrize("formula", ["1/(0*x)", "(0*x - 8)**0.5", "exp(1000 + 0*x)"])
def test_formulas_without_a_value_anywhere_are_refused_where_they_are_asked(formula):
    with pytest.raises(InputError, match="is not finite"):
        Expression(formula).numpy([[1.0, 2.0]])


REFUSED = [
    "9**9**9",
    "1e999",
    "1" * 900,
    "sqrt(-1)",
    "1/0",
    "nan",
    "inf*x",
    "X",
    "sinh(x)",
    "x^2",
    "x.__class__",
    "__import__('os').system('true')",
    "().__class__.__bases__",
    "lambda: 1",
    "[i for i in (1, 2)]",
    "x if y else z",
    "x and y",
    "x // 2",
    "x[0]",
    "sin(x=1)",
    "max(*x)",
    "x in y",
    "'x'",
    "1j",
    "True",
    "min(x)",
    "where(x, y)",
    "sin(x, y)",
    "",
    "x +",
    "x\ny",
    "x\0",
    "(" * 400 + "x" + ")" * 400,
    "-" * 5000 + "x",
    "x" * 2000,
    math.nan,
    math.inf,
    True,
    None,
    [1.0],
]


@pytest.mark.wording
def test_messages_of_what_is_no_formula(snapshot):
    said = {repr(source)[:70]: message_of(Expression, source) for source in REFUSED}
    assert len(said) == len(REFUSED)
    snapshot("refused-formulas", said)
