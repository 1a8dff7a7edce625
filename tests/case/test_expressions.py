"""Formulas: NumPy and UFL agree with each other, and nothing else than formulas is let in."""

import math
import pickle
from functools import reduce

import basix.ufl
import numpy as np
import pytest
import ufl
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from contact.case.formula import Expression
from contact.errors import InputError


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


def test_constants_have_the_shape_of_the_points():
    expression = Expression("2*pi")
    assert expression.is_constant and expression.value == pytest.approx(2 * np.pi)
    assert expression.numpy(np.zeros((4, 3))).shape == (4,)
    assert expression.numpy(np.zeros((0, 2))).shape == (0,)
    assert expression.ufl(x2).ufl_shape == ()
    with pytest.raises(ValueError, match="depends on the coordinates"):
        _ = Expression("x").value


def test_names_equality_and_pickle():
    expression = Expression("x*sin(z)")
    assert expression.names == {"x", "z"}
    assert pickle.loads(pickle.dumps(expression)) == expression
    assert Expression(1) == Expression(1.0) != Expression("1")
    assert len({Expression("x"), Expression("x")}) == 1


def test_z_is_refused_in_the_plane():
    for evaluate in (lambda e: e.numpy([[0.0, 0.0]]), lambda e: e.ufl(x2)):
        with pytest.raises(InputError, match=r'"x\*z" uses z in a plane problem'):
            evaluate(Expression("x*z"))


def test_values_that_are_not_finite_name_the_point():
    with pytest.raises(InputError, match=r'"1/x" is not finite at \(0, 2\)'):
        Expression("1/x").numpy([[1.0, 2.0], [0.0, 2.0]])


@pytest.mark.parametrize(
    ("source", "fragment"),
    [
        ("9**9**9", "not finite"),
        ("1e999", "not finite"),
        ("1" * 900, "not finite"),
        ("sqrt(-1)", "not finite"),
        ("1/0", "division by zero"),
        ("1/(0*x)", "division by zero"),
        ("(0*x - 8)**0.5", "not finite"),
        ("exp(1000 + 0*x)", "not finite"),
        ("nan", "unknown name nan"),
        ("inf*x", "unknown name inf"),
        ("X", "unknown name X"),
        ("sinh(x)", "unknown function sinh"),
        ("x^2", "written **"),
        ("x.__class__", "x.__class__ is not accepted"),
        ("__import__('os').system('true')", "is not accepted"),
        ("().__class__.__bases__", "is not accepted"),
        ("lambda: 1", "is not accepted"),
        ("[i for i in (1, 2)]", "is not accepted"),
        ("x if y else z", "is not accepted"),
        ("x and y", "is not accepted"),
        ("x // 2", "is not accepted"),
        ("x[0]", "is not accepted"),
        ("sin(x=1)", "is not accepted"),
        ("max(*x)", "is not accepted"),
        ("x in y", "only the comparisons"),
        ("'x'", "is not accepted"),
        ("1j", "is not accepted"),
        ("True", "is not accepted"),
        ("min(x)", "2 arguments or more"),
        ("where(x, y)", "3 arguments"),
        ("sin(x, y)", "1 argument"),
        ("", "not a formula"),
        ("x +", "not a formula"),
        ("x\ny", "not a formula"),
        ("x\0", "not a formula"),
        ("(" * 400 + "x" + ")" * 400, "not a formula"),
        ("-" * 990 + "x", "nested too deeply"),
        ("x+" * 400 + "x", "nested too deeply"),
        ("x" * 2000, "2000 characters"),
        (math.nan, "not finite"),
        (math.inf, "not finite"),
        (True, "neither a number nor a formula"),
        (None, "neither a number nor a formula"),
        ([1.0], "neither a number nor a formula"),
    ],
)
def test_everything_else_is_refused_in_one_short_line(source, fragment):
    with pytest.raises(InputError) as error:
        Expression(source)
    message = str(error.value)
    assert fragment in message
    assert "\n" not in message and len(message) < 300
