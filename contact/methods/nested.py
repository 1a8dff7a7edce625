"""Nested meshes: each level starts from the solution of the coarser one."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact.body.transfer import carry
from contact.build import build_problem
from contact.case.file import Case
from contact.case.mesh import Mesh
from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.interface.projections import project_half_line
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3

#: Meshes with fewer cells along the shortest edge do not tell much of the solution.
COARSEST = 4

#: Meshes with fewer nodes than this take longer to be set up than they save.
SMALL = 1000


def coarser_cases(case: Case, levels: int | None = None) -> list[Case]:
    """Return the case on coarser and coarser meshes, the coarsest first, without itself.

    A generated mesh has its cells halved as often as all numbers of cells are even, a mesh
    that is refined has one refinement less.

    Parameters
    ----------
    case
        The case on the finest mesh.
    levels
        Number of meshes, with the finest; None for all that pay.

    Raises
    ------
    InputError
        If there is no coarser mesh, or there are not as many as asked for.
    """
    found: list[Case] = []
    mesh = case.mesh
    while levels is None or len(found) < levels - 1:
        cells = mesh.cells
        if mesh.refine > 0:
            update: dict[str, object] = {"refine": mesh.refine - 1}
        elif cells is not None and all(n % 2 == 0 for n in cells) and min(cells) >= 2 * COARSEST:
            update = {"cells": tuple(n // 2 for n in cells)}
        else:
            break
        mesh = mesh.model_copy(update=update)
        if levels is None and found and _nodes(mesh) < SMALL:
            break
        found.insert(0, case.model_copy(update={"mesh": mesh}))
    if not found or (levels is not None and len(found) < levels - 1):
        raise InputError(
            f"{case.source}: solver.nested: there are {len(found) + 1} nested meshes only; "
            "accepted: numbers of cells that can be halved, or mesh.refine > 0"
        )
    return found


def _nodes(mesh: Mesh) -> float:
    """Return the number of vertices of a generated mesh; infinity if it is not known."""
    return np.inf if mesh.cells is None else float(np.prod([n + 1 for n in mesh.cells]))


def coarse_solution(
    case: Case, comm: MPI.Intracomm, **replacements: Any
) -> tuple[ContactProblem, State]:
    """Solve on all meshes but the finest, each from the one before. Collective."""
    options = NewtonOptions(
        tolerance=max(COARSE_TOLERANCE, case.solver.tolerance), linear=case.solver.linear
    )
    last: tuple[ContactProblem, State] | None = None
    levels = case.solver.nested_levels if isinstance(case.solver, NewtonOptions) else None
    for level in coarser_cases(case, levels):
        problem = build_problem(level, comm, **replacements)
        method = Newton(problem, options)
        state, _ = method.solve(None if last is None else prolong(*last, problem))
        last = problem, state
    assert last is not None
    return last


def prolong(coarse: ContactProblem, state: State, fine: ContactProblem) -> State:
    """Carry a state of a coarse problem to a finer one. Collective."""
    body = fine.equilibrium
    x = carry(coarse.equilibrium.function(state.x), body.space).x.array.copy()
    if coarse.piezoelectric:
        x[coarse.dim :: body.block_size] *= coarse.equilibrium.phi_scale / body.phi_scale
    forces = np.column_stack([state.forces.pressure, state.forces.friction])
    points = coarse.nodes.gather(coarse.nodes.points)
    values = _interpolate(points, coarse.nodes.gather(forces), fine.nodes.points)
    friction = np.einsum("nij,nj->ni", fine.nodes.tangent, values[:, 1:])
    multipliers = Multipliers(project_half_line(values[:, 0]), friction)
    return State(body.prescribe(x), multipliers)


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
