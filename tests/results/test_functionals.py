"""The quantities with derivatives are the columns of steps.csv, value by value."""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from contact import load_case, parse_case, sensitivity, solve
from contact.case.file import number_at, with_number
from contact.results.functionals import Differentiable, Integral
from contact.results.quantities import named_functionals
from tests.problems.clamped import clamped
from tests.problems.taylor import block, charged, evolving, plastic, slipping

SELF = MPI.COMM_SELF


def plate():
    """Return a block under a turning plate that sinks, with a foundation that moves too."""
    return parse_case(clamped(
        [2.0, 1.0], [6, 3], fixed=[],
        rigid=[{"on": "top", "displacement": [0.001, "free"], "force": [0.0, -0.02],
                "rotation": "free", "moment": 0.0007, "centre": [1.1, 1.2]}],
        contact={"on": "bottom",
                 "foundation": {"shape": "sphere", "centre": [1.0, -4.0], "radius": 4.0},
                 "rigid": {"displacement": [0.0, "0.002*t"], "rotation": 0.1,
                           "centre": [0.5, 0.0]}},
        friction={"law": "coulomb", "mu": 0.4},
        evolution={"times": [0.0, 1.0], "steps": [3]},
        solver={"tolerance": 1e-13},
    ))  # fmt: skip


def hencky():
    """Return the evolution of a block by Hencky's law."""
    law = {"law": "log", "young": 1.05, "poisson": 0.21, "yield_strain": 0.01}
    top = {"on": "top", "displacement": [0.0015, -0.0169]}
    return parse_case(evolving(block(material=law, fixed=[top])))


def energy(run):
    """Return the stored energy, of Hencky's law by a finer quadrature than that of the column."""
    here = run.problem.at(run.state.time, run.state.history)
    return named_functionals(run.problem)["energy"](here, run.state)


def bolted():
    """Return a block that a jack, a bolt of negative force, presses on a foundation."""
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [6, 4]}
    return parse_case({
        "mesh": {**mesh, "inside": {"cut": "abs(y - 0.5) < 1e-6"}},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [0.001, 0.0]}],
        "bolt": [{"on": "cut", "force": -0.02}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.2},
        "evolution": {"times": [0.0, 1.0], "steps": [2]},
        "solver": {"tolerance": 1e-13},
    })  # fmt: skip


CASES = {
    "bolt": bolted,
    "plate": plate,
    "slip": lambda: parse_case(slipping()),
    "log": hencky,
    "j2": lambda: parse_case(plastic()),
    "electrode": lambda: parse_case(charged()),
    "ring": lambda: load_case(
        "scripts/cases/ring-on-mandrel.toml", ["mesh.cells=[4,3]", "evolution.steps=[3,3]"]
    ),
}


#: Columns with derivatives, at least: all but times, counts, residuals and work, which asks for
#: two ends. A new column may be without one.
COUNTS = {"bolt": 13, "plate": 18, "slip": 12, "log": 12, "j2": 13, "electrode": 15, "ring": 15}


@pytest.mark.parametrize(("name", "count"), COUNTS.items())
def test_columns(name, count):
    run = solve(CASES[name](), comm=SELF)
    known = named_functionals(run.problem)
    assert len(known) >= count
    for record in run.steps:
        here = run.problem.at(record.state.time, record.state.history)
        for key, quantity in known.items():
            # Of Hencky's law the energy is a quadrature of the way, in one step or in several.
            close = 1e-5 if key == "energy" and name == "log" else 1e-9
            value = quantity(here, record.state)
            assert value == pytest.approx(record.row[key], rel=close, abs=1e-12), key


@pytest.mark.parametrize("name", ["bolt", "plate", "slip", "log", "j2", "electrode"])
def test_derivatives_of_all_columns(name):
    case = CASES[name]()
    key, second = ("rigid.0.centre.0" if name == "plate" else "friction.mu"), "material.young"
    key = "friction.mu.a" if name == "slip" else key
    run, keys = solve(case, comm=SELF), [key, second]
    known = named_functionals(run.problem)
    tangent = sensitivity(run, [*known], keys, "tangent")
    smooth = [name for name, it in known.items() if isinstance(it, Differentiable)]
    adjoint = sensitivity(run, smooth, keys, "adjoint")
    for one in keys:
        at = number_at(case, one)
        step = 1e-5 * at
        ends = [solve(with_number(case, one, at + by), comm=SELF) for by in (step, -step)]
        rows = [{**end.steps[-1].row, "energy": energy(end)} for end in ends]
        for column in known:
            apart = (rows[0][column] - rows[1][column]) / (2 * step)
            size = max(abs(apart), 1e-2 * abs(run.steps[-1].row[column] / at), 1e-9)
            assert tangent[column][one] == pytest.approx(apart, abs=2e-6 * size), (column, one)
            if column in smooth:
                size = max(size, abs(run.steps[-1].row[column] / at))
                assert adjoint[column][one] == pytest.approx(tangent[column][one], abs=1e-9 * size)
    assert np.isfinite([*tangent["energy"].values()]).all()


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("on", [None, "left"])
def test_an_integral_of_ones_own(on):
    """A quadratic density: central differences are exact, and its value is that of NumPy."""
    if on is None:
        run = solve(parse_case(charged()), comm=MPI.COMM_WORLD)
    else:
        run = solve(plate(), comm=MPI.COMM_WORLD)
    problem, state, body = run.problem, run.state, run.problem.body

    def density(u, phi):
        found = ufl.div(u) ** 2 + u[0] * u[1] + u[1]
        return found if phi is None else found + phi * u[1]

    functional = Integral(density, on)
    by_x, by_force = functional.gradient(problem, state)
    assert np.all(by_force == 0) and by_x.size == body.owned + body.global_unknowns.size
    way = np.zeros_like(by_x)
    points = body.space.tabulate_dof_coordinates()[: body.owned // body.block_size, :2]
    body.nodal(way)[:] = np.sin(3 * points @ np.array([[1.0, 2.0, 3.0], [2.0, 1.0, 0.5]]))[
        :, : body.block_size
    ]
    ends = [
        functional(problem, replace(state, x=body.updated(state.x, 1e-3 * sign * way)))
        for sign in (1, -1)
    ]
    assert body.product(by_x, way) == pytest.approx((ends[0] - ends[1]) / 2e-3, rel=1e-8)


def test_the_integral_of_a_linear_displacement():
    """Of u_y = -y/100 over a block of 2 x 1, and along its left side."""
    fixed, material = {"on": "top", "displacement": [0.0, -0.01]}, {"young": 1.0, "poisson": 0.0}
    given = clamped([2.0, 1.0], [4, 2], fixed=[fixed], material=material)
    run = solve(parse_case(given), comm=SELF)
    for on, exact in ((None, -0.01), ("left", -0.005)):
        found = Integral(lambda u, phi: u[1], on)(run.problem, run.state)
        assert found == pytest.approx(exact, rel=1e-9)
