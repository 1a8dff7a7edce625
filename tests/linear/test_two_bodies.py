"""Multigrid for two bodies that touch each other."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Load, build_problem, parse_case, solve
from contact.linear import multigrid
from contact.linear.operator import SparseOperator
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.blocks import Blocks
from tests.problems.mechanics import constant, flat

SELF = MPI.COMM_SELF


def blocks(constrained: bool, n: int = 6) -> ContactProblem:
    """Return two blocks in space; a side of both is a plane of symmetry.

    The upper one is moved at its top, or loaded there and constrained by friction alone.
    """
    bottom = Fixed("bottom", [constant(0.0, 3)] * 3)
    sides = Fixed("left", [constant(0.0, 3), None, None])
    top = [constant(value, 3) for value in (0.0, 0.01, -0.01)]
    fixed, loads = [bottom, sides], []
    if constrained:
        fixed.append(Fixed("top", top))
    else:
        loads.append(Load("top", [constant(value, 3) for value in (0.0, 0.001, -0.01)]))
    friction = Friction(ConstantCoefficient(0.2))
    contact = Contact("under", flat(), friction=friction, against="over")
    domain = Blocks(3, n, n + 1, jitter=0.1).domain(SELF)
    return ContactProblem(domain, Body(Linear(1.0, 0.3), fixed, tuple(loads)), contact)


def balls(linear, mu, push):
    """Return half a ball that is pressed on another, and pushed aside."""
    return parse_case({
        "mesh": {"generator": "two_spheres", "quarters": 2, "size": 25.0, "contact_size": 2.5,
                 "contact_width": 5.0},
        "material": {"young": 20e3, "poisson": 0.3},
        "fixed": [
            {"on": "symmetry_y", "displacement": ["free", 0.0, "free"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0, 0.0]},
        ],
        "load": [{"on": "upper_cut", "traction": [push, 0.0, -8.0]}],
        "contact": {"on": "upper_round", "against": "lower_round"},
        "friction": {"law": "coulomb", "mu": mu} if mu else {"law": "none"},
        "solver": {"linear": linear, "tolerance": 1e-8},
    })  # fmt: skip


@pytest.mark.parametrize(("mu", "push"), [(0.0, 0.0), (0.3, 0.5)])
def test_a_ball_that_only_another_ball_holds(mu, push, monkeypatch):
    """It touches it at one node at first; the preconditioner's norm saw nothing but its rolling."""
    options = {**multigrid.DEFAULTS, "pc_gamg_coarse_eq_limit": "200"}
    monkeypatch.setattr(multigrid, "DEFAULTS", options)
    left = []

    def measured(self, rhs, rtol=None, guess=None, solve=SparseOperator.solve):
        x = solve(self, rhs, rtol, guess)
        if self.iterative:
            size = np.linalg.norm(self.layout.mask(rhs))
            rest = self.layout.mask(rhs - self.multiply(x))
            left.append(np.linalg.norm(rest) / size / np.sqrt(rtol or multigrid.TOLERANCE))
        return x

    monkeypatch.setattr(SparseOperator, "solve", measured)
    found = {}
    for linear in ("iterative", "lu"):
        case = balls(linear, mu, push)
        problem = build_problem(case, SELF)
        found[linear] = solve(problem, case.solver)
        assert found[linear].converged
    assert max(left) <= 1
    direct = found["lu"].state.multipliers.contact
    assert np.abs(found["iterative"].state.multipliers.contact - direct).max() < 1e-5 * direct.max()
