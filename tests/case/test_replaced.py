"""What objects in Python replace need not stand in the case."""

import pytest
from mpi4py import MPI

from contact import InputError, Linear, parse_case, solve
from contact.mesh.grid import rectangle
from forms.laws import ConstantCoefficient

BARE = {
    "fixed": [{"on": "top", "displacement": [0.02, -0.02]}],
    "contact": {"on": "bottom"},
}


def objects() -> dict[str, object]:
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    return {"domain": domain, "law": Linear(10.0, 0.3), "coefficient": ConstantCoefficient(0.3)}


@pytest.mark.parallel
def test_the_same_as_in_the_case() -> None:
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]}
    material = {"young": 10.0, "poisson": 0.3}
    friction = {"law": "coulomb", "mu": 0.3}
    whole = solve(parse_case({**BARE, "mesh": mesh, "material": material, "friction": friction}))
    bare = solve(parse_case(BARE), **objects())
    assert bare.converged
    assert bare.contact_force == pytest.approx(whole.contact_force, rel=1e-9)


@pytest.mark.parametrize(("key", "name"), [("mesh", "domain"), ("material", "law")])
def test_an_object_that_is_not_there(key: str, name: str) -> None:
    others = {k: v for k, v in objects().items() if k != name}
    with pytest.raises(InputError, match=rf"{key}.*\[missing\]"):
        solve(parse_case(BARE), **others)
