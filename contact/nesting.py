"""Nested iteration: solutions of a case on coarser meshes, each the initial guess of the next."""

from __future__ import annotations

import logging
from typing import Unpack

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact.case.build import Replacements, build_problem
from contact.case.file import Case
from contact.case.mesh import Mesh
from contact.errors import InputError
from contact.interface.complementarity import project_half_line
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import ContactNodes
from contact.linear import multigrid
from contact.mesh import grid
from contact.mesh.transfer import carry
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.condensed import condensation_pays
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import neighbours
from contact.typing import Array

logger = logging.getLogger("contact.solver")

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3

#: Unknowns from which a start on coarser meshes saves more time than it takes: where each step
#: solves with the whole body, and where a nonlinear one is condensed onto its contact nodes in 2-D.
MANY = {"whole": 40_000, "condensed": 100_000}

#: Meshes with fewer cells along the shortest edge do not tell much of the solution.
COARSEST = 4

#: Meshes with fewer nodes than this take longer to be set up than they save.
SMALL = 500


def pays(case: Case, problem: ContactProblem) -> bool:
    """Tell whether a start from coarser meshes saves time: where Newton's steps are many solves.

    On whole bodies, as slender ones in the plane, each step has a matrix of its own. Of a body that
    is condensed onto its contact nodes the steps are few where it is linear, and in 3-D; in the
    plane the tangent of a nonlinear one is then factorised near the solution, once.
    """
    body, kind = problem.equilibrium, case.solver.linear
    if body.layout.dim == 3:
        slow, many = multigrid.is_large(body.layout) and kind != "lu", MANY["whole"]
    else:
        condensed = condensation_pays(problem, kind)
        slow, many = not (body.linear and condensed), MANY["condensed" if condensed else "whole"]
    enough = body.layout.unknowns >= many
    return slow and enough and case.evolution is None and has_coarser(case)


def default_start(
    case: Case, problem: ContactProblem, **replacements: Unpack[Replacements]
) -> State | None:
    """Return a start from coarser meshes where the case asks for it, or it pays. Collective."""
    nested = case.solver.nested if isinstance(case.solver, NewtonOptions) else False
    if nested:
        return nested_start(case, problem, **replacements)
    if nested is not None or replacements or not pays(case, problem):
        return None
    try:
        return nested_start(case, problem)
    except InputError as error:  # the user does not know of the coarser mesh
        logger.info("no start from a coarser mesh: %s", error)
        return None


def nested_start(
    case: Case, problem: ContactProblem, **replacements: Unpack[Replacements]
) -> State:
    """Solve on all coarser meshes, each from the one before, and carry that to a problem's.

    Collective.
    """
    layout, solver = problem.equilibrium.layout, case.solver
    newton = solver if isinstance(solver, NewtonOptions) else NewtonOptions()
    levels, linear = newton.nested_levels, solver.linear
    if levels is None and layout.dim == 2 and not newton.nested:
        levels = 2  # a second coarser one takes more time than it saves on the first
    if linear == "auto" and layout.dim == 3 and not layout.coupled and multigrid.is_large(layout):
        # A quarter of the time of a factorisation from 2,000 unknowns on. Where it fails a start
        # is lost, and no solution.
        linear = "iterative"
    options = NewtonOptions(tolerance=max(COARSE_TOLERANCE, solver.tolerance), linear=linear)
    last: tuple[ContactProblem, State] | None = None
    for level in coarser_cases(case, levels):
        coarse = build_problem(level, problem.comm, **replacements)
        start = None if last is None else prolong(*last, coarse)
        last = coarse, Newton(coarse, options).solve(start)[0]
    assert last is not None
    return prolong(*last, problem)


def prolong(coarse: ContactProblem, state: State, fine: ContactProblem) -> State:
    """Carry a state of a coarse problem, in a static step, to a finer one. Collective."""
    body, before = fine.equilibrium, coarse.equilibrium
    x = carry(before.function(state.x), body.space).x.array.copy()
    if coarse.piezoelectric:
        x[coarse.dim :: body.block_size] *= before.phi_scale / body.phi_scale
    x = np.concatenate([x, before.motion(state.x)])
    forces = np.column_stack([state.forces.pressure, state.forces.friction])
    values = _interpolate(coarse.nodes, forces, fine.nodes.points)
    multipliers = Multipliers.of(fine.nodes, project_half_line(values[:, 0]), values[:, 1:])
    return State(body.prescribe(x, fine.time), multipliers, fine.time, fine.history)


def _interpolate(nodes: ContactNodes, values: Array, at: Array) -> Array:
    """Interpolate between the d nearest nodes, weighted by the inverse of the distance. Collective.

    On nested edges that is linear interpolation.
    """
    rows, d = np.column_stack([nodes.points, values]), nodes.dim
    nearest = np.arange(1, min(d, nodes.size) + 1)
    # No multiple of the spacing, at which rounding would choose the ranks that send a row of nodes.
    reach = 0.75 * float(nodes.maximum(nodes.weight)) ** (1 / (d - 1))
    # The nearest of all ranks are known where they are within reach.
    known = False
    while not known:
        reach *= 2
        near = neighbours(nodes.comm, nodes.points, rows, reach, asked=at)
        distance, place = cKDTree(near[:, :d]).query(at, k=nearest)
        known = nodes.comm.allreduce(bool(distance.max(initial=0.0) <= reach), op=MPI.LAND)
    weight = 1 / np.maximum(distance, 1e-9 * distance.max(initial=1e-300))
    weight /= weight.sum(axis=1)[:, None]
    return np.asarray(np.einsum("nk,nkc->nc", weight, near[place, d:]))


def coarser_cases(case: Case, levels: int | None = None) -> list[Case]:
    """Return the case on coarser and coarser meshes, the coarsest first, without itself.

    A generated mesh has its cells halved as often as they are enough, and its parts end at
    positions of the grid; a mesh that is refined has one refinement less. ``levels`` is the number
    of meshes, with the finest, which are refused where there are fewer; None for all that pay.
    """
    found: list[Case] = []
    mesh = _coarser(case.mesh)
    while mesh is not None and (levels is None or len(found) < levels - 1):
        # Of a mesh from a file or another generator the number of nodes is not known.
        nodes = np.inf if mesh.cells is None else np.prod(np.add(mesh.cells, 1))
        if levels is None and found and nodes < SMALL:
            break
        found.insert(0, case.model_copy(update={"mesh": mesh}))
        mesh = _coarser(mesh)
    if not found or (levels is not None and len(found) < levels - 1):
        raise InputError(
            f"{case.source}: solver.nested: there are {len(found) + 1} nested levels only; "
            f"accepted: at least {2 * COARSEST} cells along each edge and parts that end at "
            "positions of the grid of half as many, or mesh.refine > 0",
            "nested",
        )
    return found


def has_coarser(case: Case) -> bool:
    """Tell whether there is a coarser mesh."""
    return _coarser(case.mesh) is not None


def _coarser(mesh: Mesh) -> Mesh | None:
    """Return the next coarser mesh, if there is one."""
    if mesh.refine > 0:
        return mesh.model_copy(update={"refine": mesh.refine - 1})
    if mesh.cells is None or min(mesh.cells) < 2 * COARSEST or mesh.inside or mesh.regions:
        return None
    coarser = mesh.model_copy(update={"cells": tuple((n + 1) // 2 for n in mesh.cells)})
    try:
        coarser.check_grid()
    except grid.GridError:  # a part ends between positions of its grid
        return None
    return coarser
