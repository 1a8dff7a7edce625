"""What a user's own function raises, or returns and may not, names the argument that it is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    InputError,
    Level,
    Linear,
    Load,
    Motion,
    Problem,
    Response,
    solve,
)
from contact.mesh.grid import rectangle
from contact.typing import Array
from forms.hencky import Isotropic

pytestmark = pytest.mark.parallel(2)

LAW = Linear(10.0, 0.3)
TOP = Fixed("top", [0.0, -0.005])

Own = Callable[..., Any]


def solved(
    fixed: Fixed = TOP,
    load: Any = (),
    contact: Any = None,
    mu: Any = None,
    law: Any = LAW,
) -> object:
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (8, 4))
    body = Body(law, fixed, load)
    return solve(Problem(domain, body, contact or Contact("bottom"), Friction(mu=mu)))


class Coefficient:
    """Of friction, with functions given."""

    maximum, lipschitz = 0.5, 0.0

    def __init__(self, value: Own, derivative: Own = np.zeros_like) -> None:
        self._value, self.derivative = value, derivative

    def __call__(self, slip: Any) -> Any:
        return self._value(slip)


class Given:
    """An object with the methods of a field."""

    def __init__(self, function: Own) -> None:
        self.ufl, self.numpy = function, lambda points: function(points.T)


@dataclass(frozen=True)
class Updated(Isotropic):
    """A stress update whose components are those of a function at the points."""

    function: Own

    def variables(self, size: int) -> dict[str, float]:
        return {}

    def respond(self, strain: Array, variables: object, kind: str = "") -> Response:
        found = self.function(strain.T)
        return Response(found[:, None] + 0 * strain if np.ndim(found) == 1 else found, {})


def moved(function: Own) -> object:
    motion = Motion([0.0, function], [0.0], [0.0, 0.0], [0.0], [0.0, 0.0])
    return solved(contact=Contact("bottom", rigid=motion))


PLACES: dict[str, tuple[Callable[[Own], object], str]] = {
    "support": (lambda f: solved(Fixed("top", [0.0, f])), r"fixed\.0\.displacement\.1"),
    "object": (lambda f: solved(Fixed("top", [0.0, Given(f)])), r"fixed\.0\.displacement\.1"),
    "traction": (lambda f: solved(load=Load("right", [f, 0.0])), r"load\.0\.traction\.0"),
    "pressure": (lambda f: solved(load=Load("right", pressure=f)), r"load\.0\.pressure"),
    "force": (lambda f: solved(load=Load(body_force=[0.0, f])), r"load\.0\.body_force\.1"),
    "gap": (lambda f: solved(contact=Contact("bottom", f)), "contact"),
    "shape": (lambda f: solved(contact=Contact("bottom", Level(f))), "contact"),
    "mu": (lambda f: solved(mu=f), r"friction\.mu"),
    "coefficient": (lambda f: solved(mu=Coefficient(f)), "Friction: "),
    "slope": (lambda f: solved(mu=Coefficient(np.ones_like, f)), "Friction: mu: derivative"),
    "amplitude": (
        lambda f: solved(Fixed("top", [0.0, -0.005], amplitude=f)),
        "Fixed on 'top': amplitude",
    ),
    "load in time": (
        lambda f: solved(load=Load("right", [0.1, 0.0], amplitude=f)),
        "Load on 'right': amplitude",
    ),
    "stress": (lambda f: solved(law=Updated(10.0, 0.3, f)), "Updated: respond(: stress)?"),
    "motion": (moved, r"Motion: displacement\.1"),
}


def fails(*_: Any) -> Any:
    raise KeyError("no such table")


def text(*_: Any) -> Any:
    return "much"


def nothing(*_: Any) -> Any:
    return None


def no_number(x: Any) -> Any:
    return np.nan * x if np.ndim(x) <= 1 else np.full_like(x[0], np.nan)


def table(*_: Any) -> Any:
    return np.zeros((2, 3))


WRONG = {
    fails: "raises KeyError: 'no such table'",
    text: "returns 'much'",
    nothing: "returns None",
    no_number: r"nan|no number|not finite|of shape \(2,\)",
    table: r"of shape \(2, 3\)",
}


@pytest.mark.parametrize(
    ("place", "function"),
    [*((place, fails) for place in PLACES), *(("mu", function) for function in WRONG)],
)
def test_a_message_names_the_argument(place: str, function: Own) -> None:
    give, name = PLACES[place]
    with pytest.raises(InputError, match=f"^({name}).*({WRONG[function]})") as error:
        give(function)
    assert "\n" not in str(error.value)
    if function is fails:
        assert isinstance(error.value.__cause__, KeyError)


@pytest.mark.parametrize(
    "place", ["support", "traction", "gap", "mu", "coefficient", "shape", "stress"]
)
def test_what_one_rank_alone_meets_is_refused_by_all(place: str) -> None:
    last = MPI.COMM_WORLD.rank == MPI.COMM_WORLD.size - 1
    give, name = PLACES[place]
    with pytest.raises(InputError, match=f"^({name}).*no such table"):
        give(
            lambda x: (
                fails() if last else 0.01 * np.ones(np.shape(x)[0 if place == "shape" else -1])
            )
        )
