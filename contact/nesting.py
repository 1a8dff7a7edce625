"""Nested meshes: the solution of a case on coarser ones, each from the one before."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.spatial import cKDTree

from contact.build import build_problem
from contact.case.file import Case
from contact.case.nesting import coarser_cases, has_coarser
from contact.history import History
from contact.interface.complementarity import project_half_line
from contact.interface.multipliers import Multipliers
from contact.linear import multigrid
from contact.mesh.transfer import carry
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3

#: Unknowns, in the plane and in space, from which a start on coarser meshes saves more time than
#: it takes.
MANY = {2: 100_000, 3: 40_000}


def pays(case: Case, problem: ContactProblem) -> bool:
    """Tell whether a start from coarser meshes saves time: where Newton's steps are many solves.

    In space those of a body that is condensed onto its contact nodes are few in any case. In the
    plane they are where it is linear; else the tangent is factorised near the solution, once.
    """
    body = problem.equilibrium
    if body.layout.dim == 2:
        slow = not body.linear
    else:
        slow = multigrid.is_large(body.layout) and case.solver.linear != "lu"
    enough = body.layout.unknowns >= MANY[body.layout.dim]
    return slow and enough and case.evolution is None and has_coarser(case)


def _levels(case: Case, problem: ContactProblem) -> int | None:
    """Return the number of meshes, the finest one counted; None for all that pay."""
    newton = case.solver if isinstance(case.solver, NewtonOptions) else NewtonOptions()
    # In the plane a second coarser one takes more time than it saves on the first.
    one = newton.nested_levels is None and problem.dim == 2 and not newton.nested
    return 2 if one else newton.nested_levels


def _linear(case: Case, problem: ContactProblem) -> Literal["auto", "lu", "iterative"]:
    """Return how the systems of the coarser meshes are solved: by multigrid where the finest are.

    In space that takes a quarter of the time of a factorisation from 2,000 unknowns on. Where it
    fails a start is lost, and no solution.
    """
    layout, linear = problem.equilibrium.layout, case.solver.linear
    quick = layout.dim == 3 and not layout.coupled and multigrid.is_large(layout)
    return "iterative" if linear == "auto" and quick else linear


def nested_start(case: Case, problem: ContactProblem, **replacements: Any) -> State:
    """Solve on all coarser meshes, each from the one before, and carry that to a problem's.

    Collective.
    """
    options = NewtonOptions(
        tolerance=max(COARSE_TOLERANCE, case.solver.tolerance), linear=_linear(case, problem)
    )
    last: tuple[ContactProblem, State] | None = None
    for level in coarser_cases(case, _levels(case, problem)):
        coarse = build_problem(level, problem.comm, **replacements)
        start = None if last is None else prolong(*last, coarse)
        last = coarse, Newton(coarse, options).solve(start)[0]
    assert last is not None
    return prolong(*last, problem)


def prolong(coarse: ContactProblem, state: State, fine: ContactProblem) -> State:
    """Carry a state of a coarse problem to a finer one. Collective."""
    body, before = fine.equilibrium, coarse.equilibrium
    x = carry(before.function(state.x), body.space).x.array.copy()
    if coarse.piezoelectric:
        x[coarse.dim :: body.block_size] *= before.phi_scale / body.phi_scale
    x = np.concatenate([x, before.motion(state.x)])
    forces = np.column_stack([state.forces.pressure, state.forces.friction])
    points = coarse.nodes.gather(coarse.nodes.points)
    values = _interpolate(points, coarse.nodes.gather(forces), fine.nodes.points)
    multipliers = Multipliers.of(fine.nodes, project_half_line(values[:, 0]), values[:, 1:])
    history = transferred(state.history, coarse, fine)
    return State(body.prescribe(x, fine.time), multipliers, fine.time, history)


def transferred(history: History, coarse: ContactProblem, fine: ContactProblem) -> History:
    """Carry a history to the contact nodes and quadrature points of a finer mesh. Collective."""
    arrays = fine.initial.arrays()
    for place in history.places:
        given, at = history.arrays(place), fine.points(place)
        points = np.concatenate(coarse.comm.allgather(coarse.points(place)))
        for name, array in given.items():
            values = np.concatenate(coarse.comm.allgather(array.reshape(len(array), -1)))
            arrays[name] = _interpolate(points, values, at).reshape(arrays[name].shape)
    return fine.initial.replaced(arrays)


def _interpolate(points: Array, values: Array, at: Array) -> Array:
    """Interpolate between the d nearest points, weighted by the inverse of the distance.

    On nested edges that is linear interpolation.
    """
    if at.shape[0] == 0:
        return np.zeros((0, values.shape[1]))
    distance, near = cKDTree(points).query(at, k=min(at.shape[1], len(points)))
    distance, near = distance.reshape(len(at), -1), near.reshape(len(at), -1)
    weight = 1 / np.maximum(distance, 1e-9 * distance.max(initial=1e-300))
    weight /= weight.sum(axis=1)[:, None]
    return np.asarray(np.einsum("nk,nkc->nc", weight, values[near]))
