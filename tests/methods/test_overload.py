"""Loads that friction cannot balance: a linear program tells, and methods end."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, parse_case, solve
from contact.problem.rigid_modes import groups, sliding_mode
from contact.results.remarks import untouched

MU, PRESS = 0.3, 1e-3


def wall(dim, part, angle=0.0, **contact):
    """Return a unit block pressed to a wall, and along it by a part of the force friction holds.

    Without Poisson's effect the wall presses by E times the way of the other side.
    """
    free = ["free"] * (dim - 1)
    along = np.array([-1.0] if dim == 2 else [np.sin(angle), -np.cos(angle)]) * part * MU * PRESS
    return parse_case({
        "mesh": {"generator": "rectangle" if dim == 2 else "box", "size": [1.0] * dim,
                 "cells": [4] * dim},
        "material": {"young": 1.0, "poisson": 0.0},
        "fixed": [{"on": "right", "displacement": [-PRESS, *free]}],
        "load": [{"everywhere": True, "body_force": [0.0, *along.tolist()]}],
        "contact": {"on": "left", **contact},
        "friction": {"law": "coulomb", "mu": MU},
    })  # fmt: skip


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "angle"), [(2, 0.0), (3, 0.0), (3, 0.3)])
def test_the_friction_that_holds_a_block(dim, angle):
    """A thousandth more than its load holds it, a thousandth less does not, in any direction."""
    problem = build_problem(wall(dim, 1.0, angle), MPI.COMM_WORLD)
    (group,) = groups(problem)
    friction = problem.nodes.weight * MU * PRESS
    assert sliding_mode(group, 1.0, 1.001 * friction) is None
    # Without any, all modes of the box along which loads act are alike.
    assert sliding_mode(group, 1.0, 0.0 * friction) is not None
    for part in (0.3, 0.999):
        mode = sliding_mode(group, 1.0, part * friction)
        named = {name: abs(size) for name, size in zip(group.names, mode, strict=True)}
        assert max(named, key=named.get) == f"translation along {'xyz'[dim - 1]}"


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_the_friction_that_holds_a_block_on_a_layer(dim):
    """Behind a layer without a rigid part the gap is infinite: its friction was not counted."""
    case = wall(dim, 1.0, law="compliance", layer=np.inf, stiffness=1.0)
    problem = build_problem(case, MPI.COMM_WORLD)
    (group,) = groups(problem)
    friction = problem.nodes.weight * MU * PRESS
    assert sliding_mode(group, 1.0, 1.001 * friction) is None
    assert sliding_mode(group, 1.0, 0.999 * friction) is not None


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_a_block_at_a_wall_is_held_or_not(dim):
    """At a hundredth more than friction can hold; it was lost without a word of friction."""
    held, lost = (solve(wall(dim, part), comm=MPI.COMM_WORLD) for part in (0.99, 1.01))
    assert held.converged and not held.outcome.overloaded
    assert not lost.converged and lost.outcome.overloaded
    assert lost.outcome.reason.startswith("the friction of the pressures that were found does not")
    (said,) = [text for text in lost.warnings if "[not-held]" in text]
    found = "the friction of the pressures that were found"
    assert f"{found} cannot hold the body (translation along {'xyz'[dim - 1]})" in said
    # Where the method stopped no node may touch: a foundation too far away is not the cause then.
    open_nodes = (replace(found, state=found.problem.start()) for found in (lost, held))
    assert [len(list(untouched(found))) for found in open_nodes] == [0, 1]
