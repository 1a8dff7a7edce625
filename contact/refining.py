"""From a mesh to a finer one: nested iteration, and adaptive refinement.

Nested iteration solves a case on coarser meshes, each solution the initial guess of the next.
Adaptive refinement solves, estimates, marks and refines, from the solution on the mesh before.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Unpack

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact.case.build import Replacements, build_problem
from contact.case.file import Case
from contact.case.mesh import Adapt, Mesh
from contact.errors import InputError
from contact.interface.complementarity import project_half_line
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import ContactNodes
from contact.linear import multigrid
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices
from contact.mesh.transfer import carry, with_parents
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.methods.report import tell
from contact.problem.checks import check_presses
from contact.problem.condensed import condensation_pays
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import neighbours
from contact.results.error_estimate import estimated, intervals
from contact.results.quantities import values_of
from contact.results.quantity import ADAPT
from contact.results.solution import Remark
from contact.solution import Solution
from contact.tolerances import ROUNDING
from contact.typing import Array

logger = logging.getLogger("contact.adapt")

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3

#: Unknowns from which a start on coarser meshes saves more time than it takes: where each step
#: solves with the whole body, and where a nonlinear one is condensed onto its contact nodes in 2-D.
MANY = {"whole": 40_000, "condensed": 100_000}

#: Meshes with fewer cells along the shortest edge do not tell much of the solution.
COARSEST = 4

#: Meshes with fewer nodes than this take longer to be set up than they save.
SMALL = 500

#: Solves a problem from an initial guess, `start`; the solution is not reviewed.
Solve = Callable[..., Solution]

#: Cells whose indicator is within that of the last one marked are marked too: rounding, which
#: differs by the number of ranks, decides nothing.
TIE = 1e-6

#: A mesh has so many times the cells of the one before, half as many at least and twice as many at
#: most where that reaches the goal: all solves together take about one and a half times the last.
GROWTH = 4

#: Least factor of the cells, where the room for unknowns ends: a last mesh with hardly more would
#: cost as much again.
LEAST = 1.5


def pays(case: Case, problem: ContactProblem) -> bool:
    """Tell whether a start from coarser meshes saves time: where Newton's steps are many solves.

    On whole bodies, as slender ones in the plane, each step has a matrix of its own. Of a body that
    is condensed onto its contact nodes the steps are few where it is linear, and in 3-D; in the
    plane the tangent of a nonlinear one is then factorised near the solution, once.
    """
    body, solver = problem.body, case.solver.linear
    if body.layout.dim == 3:
        slow, many = multigrid.is_large(body.layout) and solver != "lu", MANY["whole"]
    else:
        condensed = condensation_pays(problem, solver)
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
        logging.getLogger("contact.solver").info("no start from a coarser mesh: %s", error)
        return None


def nested_start(
    case: Case, problem: ContactProblem, **replacements: Unpack[Replacements]
) -> State:
    """Solve on coarser meshes, each from the one before, and transfer to a problem. Collective."""
    layout, solver = problem.body.layout, case.solver
    newton = solver if isinstance(solver, NewtonOptions) else NewtonOptions()
    levels, linear = newton.nested_levels, solver.linear
    if levels is None and layout.dim == 2 and not newton.nested:
        levels = 2  # a second coarser one takes more time than it saves on the first
    if (
        linear == "auto"
        and layout.dim == 3
        and not layout.piezoelectric
        and multigrid.is_large(layout)
    ):
        # A quarter of the time of a factorisation from 2,000 unknowns on. Where it fails a start
        # is lost, and no solution.
        linear = "iterative"
    options = NewtonOptions(tolerance=max(COARSE_TOLERANCE, solver.tolerance), linear=linear)
    last: tuple[ContactProblem, State] | None = None
    for level in coarser_cases(case, levels):
        coarse = build_problem(level, problem.comm, refined=True, **replacements)
        start = None if last is None else prolong(*last, coarse)
        last = coarse, Newton(coarse, options).solve(start)[0]
    assert last is not None
    return prolong(*last, problem)


def prolong(coarse: ContactProblem, state: State, fine: ContactProblem) -> State:
    """Carry a state of a coarse problem, in a static step, to a finer one. Collective."""
    body, before = fine.body, coarse.body
    x = carry(before.function(state.x), body.space).x.array.copy()
    if coarse.piezoelectric:
        x[coarse.dim :: body.block_size] *= before.phi_scale / body.phi_scale
    x = np.concatenate([x, before.motion(state.x)])
    stresses = np.column_stack([state.multipliers.contact, state.multipliers.friction])
    values = _interpolate(coarse.nodes, stresses, fine.nodes.points)
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


def _coarser(mesh: Mesh | None) -> Mesh | None:
    """Return the next coarser mesh, if there is one."""
    if mesh is None:
        return None
    if mesh.refine > 0:
        return mesh.model_copy(update={"refine": mesh.refine - 1})
    if mesh.cells is None or min(mesh.cells) < 2 * COARSEST or mesh.inside or mesh.regions:
        return None
    try:
        return mesh.model_copy(update={"cells": tuple((n + 1) // 2 for n in mesh.cells)})
    except InputError:  # a part ends between positions of its grid
        return None


def adapted(case: Case, comm: MPI.Intracomm, solve: Solve) -> Solution:
    """Solve a case on finer and finer meshes, until its `[mesh.adapt]` is met. Collective.

    Of an evolution all steps are solved on each mesh, and the largest indicator of each cell
    counts.
    """
    asked = case.adapt
    assert case.mesh is not None and asked is not None
    domain: Domain | None = case.mesh.build(comm)
    solution: Solution | None = None
    rows: list[dict[str, float]] = []
    refused: InputError | None = None
    while domain is not None:
        try:
            problem = build_problem(case, comm, domain=domain)
            if solution is not None and problem.body.layout.unknowns > asked.max_unknowns:
                break
            solution = _solved_after(solution, problem, solve)
        except InputError as error:
            if solution is None:
                raise
            refused = error
            break
        if solution.outcome.signal:
            break
        rows.append(values_of(ADAPT, solution))
        domain = _next_mesh(asked, domain, solution, len(rows)) if solution.converged else None
    assert solution is not None
    if not solution.outcome.signal:
        check_presses(solution.problem)
    solution.adaptation = rows
    reached = rows if solution.converged else ()
    for identifier, remarks in {"adapt": missed(asked, reached, refused)}.items():
        solution.warnings += [f"{text} [{identifier}]" for text in remarks]
    if asked.fraction == 1 and solution.converged:
        solution.intervals = intervals(rows)
    return solution


def _solved_after(before: Solution | None, problem: ContactProblem, solve: Solve) -> Solution:
    """Solve on the next mesh, from the solution on the mesh before, and estimate. Collective."""
    start = None
    if before is not None and not before.steps:
        start = prolong(before.problem, before.state, problem)
    solution = solve(problem, start=start)
    if solution.outcome.signal:
        return solution
    if solution.converged:
        solution.error = estimated(solution.problem, solution.state)
    for phase, seconds in before.seconds.items() if before is not None else ():
        solution.seconds[phase] += seconds
    return solution


def _next_mesh(asked: Adapt, domain: Domain, solution: Solution, count: int) -> Domain | None:
    """Return the mesh after the last of `count`; None where the goal is met. Collective."""
    squares, error = indicators(solution)
    layout = solution.problem.body.layout
    tell(logger, 0.0, "%d unknowns, estimated error %.2g %%", layout.unknowns, 100 * error)
    # A first mesh may have seen nothing of a narrow load, or of contact between its nodes.
    seen = error > ROUNDING or count > 1
    if asked.error is not None and error <= asked.error and seen:
        return None
    goal = (asked.error / error) ** 2 if asked.error is not None and seen else 0.0
    room, degree = asked.max_unknowns / layout.unknowns, solution.problem.body.degree
    finer = grown(domain, squares, asked.fraction, goal, room, degree)
    return finer if _cells(finer) >= LEAST * _cells(domain) else None


def missed(
    asked: Adapt, rows: Sequence[Mapping[str, float]], refused: InputError | None
) -> Iterator[Remark]:
    """Say that the error that was asked for has not been reached, or that a mesh was refused."""
    error = rows[-1]["error"] if rows else 0.0
    short = asked.error is not None and not error <= asked.error  # a load may be NaN there
    if short or refused is not None:
        goal = f", and mesh.adapt.error = {asked.error:g}" if short else ""
        ended = "would have more unknowns than mesh.adapt.max_unknowns"
        if refused is not None:
            ended = f"is refused, {refused}"
        yield f"the estimated discretisation error is {error:.2g}{goal}: the next mesh {ended}"


def _cells(domain: Domain) -> int:
    return int(domain.mesh.topology.index_map(domain.dim).size_global)


def grown(
    domain: Domain, squares: Array, fraction: float, goal: float, room: float, degree: int
) -> Domain:
    """Refine until the cells are several times as many, by predicted indicators. Collective.

    A last mesh with few more cells than the one before would cost as much again.

    Those of cut cells fall with the mesh size as they do where solutions are smooth (Melenk and
    Wohlmuth, Adv. Comput. Math. 15, 2001); singular corners are seen by the next estimate. Squares
    are eta_K^2 of the owned cells, goal and room the shares of their sum that is asked for, and of
    the cells that there may be.
    """
    comm, d = domain.comm, domain.dim
    first, asked = (comm.allreduce(value, op=MPI.SUM) for value in (squares.size, squares.sum()))
    enough: Domain | None = None
    while True:
        every = np.arange(squares.size, dtype=np.int32)
        cells = every if fraction == 1 else marked(comm, squares, fraction)
        finer, parents = with_parents(domain, cells)
        count = comm.allreduce(parents.size, op=MPI.SUM)
        before = comm.allreduce(squares.size, op=MPI.SUM)
        if before > first and (count > room * first or count > 2 * GROWTH * first):
            return enough or domain
        pieces = np.bincount(parents, minlength=squares.size)
        # Of 2^d pieces each edge is half as long.
        shares = pieces[parents] ** (-1 - 2 * degree / d)
        domain, squares = finer, squares[parents] * shares
        left = comm.allreduce(squares.sum(), op=MPI.SUM)
        if left <= goal * asked and count >= GROWTH / 2 * first:
            return domain
        if count >= 2 * GROWTH * first:
            return enough or domain
        if count >= GROWTH * first:
            enough = enough or domain


def indicators(solution: Solution) -> tuple[Array, float]:
    """Return eta_K^2 of owned cells and relative error, the largest of all steps. Collective."""
    assert solution.error is not None
    squares, error = solution.error.squares, solution.error.relative
    for record in solution.steps[:-1]:
        step = estimated(solution.problem.at(record.state.time, record.state.history), record.state)
        squares, error = np.maximum(squares, step.squares), max(error, step.relative)
    return squares, error


def marked(comm: MPI.Intracomm, squares: Array, fraction: float) -> Indices:
    """Return the fewest owned cells that have a share of the sum (Doerfler, 1996). Collective."""
    share = (1 - ROUNDING) * fraction * comm.allreduce(float(squares.sum()), op=MPI.SUM)
    most = comm.allreduce(float(squares.max(initial=0.0)), op=MPI.MAX)
    # Bisection for the least of them: numbers >= 0 are in the order of their bits.
    low, high = 0, int(np.float64(most).view(np.int64))
    while low < high:
        middle = (low + high + 1) // 2
        above = float(squares[squares >= np.int64(middle).view(np.float64)].sum())
        if comm.allreduce(above, op=MPI.SUM) >= share:
            low = middle
        else:
            high = middle - 1
    last = np.int64(low).view(np.float64)
    return np.flatnonzero(squares >= (1 - TIE) * last).astype(np.int32)
