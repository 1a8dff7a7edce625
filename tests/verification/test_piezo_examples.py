"""Examples 8.1 and 8.2: independent values, the series, ranks, the iterative solver."""

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from contact.methods.options import FixedPointOptions
from contact.model.friction import Friction
from contact.results.resultants import charge_balance
from contact.thesis.fixed_point import FixedPoint
from forms.laws import ConstantCoefficient, SlipCoefficient
from tests.problems.everywhere import agree
from tests.problems.mechanics import solve
from tests.problems.piezo import Column, example, first_solve, hencky, potential

COMM = MPI.COMM_WORLD
SLIP = Friction(SlipCoefficient(0.5, 0.2, 1.0))
#: First, middle and last of the series of the thesis.
K_E = (0.0, 1e-2, 1.0)
PHI_F = (0.0, 4.0, 32.0)


def extremes(solver):
    """Return phi on Gamma_3, largest displacement component and pressure, over all ranks."""
    problem, state = solver.problem, solver.state
    nodes, phi = problem.nodes, potential(problem, state)
    u = state.x.reshape(-1, problem.body.block_size)[:, : problem.dim]
    return (
        -nodes.maximum(-phi, -np.inf),
        nodes.maximum(phi, -np.inf),
        problem.comm.allreduce(np.abs(u).max(), MPI.MAX),
        nodes.maximum(state.multipliers.contact),
    )


INDEPENDENT = {
    0.2: (0.0366, 3.396, 3.0004, 150.756),
    0.0: (0.0489, 2.514, 2.9356, 75.377),
    1.0: (0.0367, 3.464, 2.9907, 210.531),
}


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("mu", INDEPENDENT)
def test_independent_values(mu):
    """Another code, 64 x 32 cells, load -10x, insulated: to the digits given."""
    friction = Friction(ConstantCoefficient(mu)) if mu > 0 else Friction()
    problem = example(COMM, (64, 32), -10.0, friction=friction, k_e=0.0)
    found = extremes(solve(problem))
    for value, expected in zip(found, INDEPENDENT[mu], strict=True):
        digits = len(str(expected).split(".")[1])
        assert round(value, digits) == expected


@pytest.mark.parametrize("law", [None, hencky()], ids=["8.1", "8.2"])
@pytest.mark.parametrize(
    "changes", [*({"k_e": k_e} for k_e in K_E), *({"phi_f": phi_f} for phi_f in PHI_F)], ids=str
)
def test_series(changes, law):
    """Those of the conductivity and of the foundation's potential."""
    problem = example(COMM, (64, 32), friction=SLIP, law=law, **changes)
    assert charge_balance(problem, solve(problem).state).imbalance < 1e-8


def test_potential_grows_with_phi_f_and_k_e():
    """As Figures 8.4 and 8.6: over most of Gamma_3, away from the grounded end."""
    for rows in (
        [{"phi_f": p} for p in (0.0, 8.0, 32.0)],
        [{"k_e": k} for k in (0.0, 1e-1, 1.0)],
    ):
        curves = []
        for row in rows:
            problem = example(COMM, (32, 16), friction=SLIP, **row)
            phi = potential(problem, solve(problem).state)
            order = np.argsort(problem.nodes.points[:, 0])
            curves.append(phi[order][4:])
        for low, high in pairwise(curves):
            assert np.all(high > low)


def test_lagged_current_stops_converging():
    """Theorem 5.2 asks for small k_e if the charge is lagged, as in Algorithm 4."""
    lagged = example(COMM, (16, 8), friction=SLIP, k_e=10.0, lagged=True)
    _, outcome = FixedPoint(lagged, FixedPointOptions()).solve()
    assert not outcome.converged
    solve(example(COMM, (16, 8), friction=SLIP, k_e=10.0))


@pytest.mark.core
@pytest.mark.parallel(alone=False)
@pytest.mark.parametrize("law", [None, hencky()], ids=["8.1", "8.2"])
def test_ranks_agree(law):
    """All ranks together find what one finds alone, to 1e-8."""

    def quantities(solver):
        state, problem = solver.state, solver.problem
        return dict(enumerate(extremes(solver))) | {
            "pressure": problem.nodes.norm(state.multipliers.contact),
            "potential": problem.nodes.norm(potential(problem, state)),
            "charge": charge_balance(problem, state).foundation,
        }

    agree(lambda c: solve(example(c, (16, 8), friction=SLIP, law=law), 1e-11), quantities)


# The iterative solver


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("symmetric", [True, False], ids=["MINRES", "GMRES"])
@pytest.mark.parametrize("cells", [(32, 16), (8, 2, 4)], ids=["plane", "space"])
def test_iterative_solver_agrees_with_the_direct_one(cells, symmetric):
    iterations, wrong = first_solve(example(COMM, cells), symmetric)
    assert iterations > 1
    assert wrong < 1e-8


@pytest.mark.parametrize(
    "cells", [(32, 64, 128), pytest.param((32, 64, 128, 256), marks=pytest.mark.slow)]
)
def test_iterations_are_flat_in_the_plane(cells):
    counts = [first_solve(example(COMM, (n, n // 2)), compare=False)[0] for n in cells]
    assert max(counts) <= 1.3 * min(counts), counts


@pytest.mark.slow
def test_iterations_are_flat_in_space():
    column = Column(k_e=1.0, phi_f=32.0)
    counts = [
        first_solve(column.problem(COMM, 3, cells=[n, n, 2 * n], mu=0.2), compare=False)[0]
        for n in (8, 11, 16)
    ]
    assert max(counts) <= 1.3 * min(counts), counts
