"""Remarks on foundations: where contact nodes meet them, and which surface they have there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.interface.obstacle import Heights, Shape
from contact.mesh.entities import exterior_facets
from contact.results.solution import Note, Remark, Solution
from contact.problem.problem import ContactProblem
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Share of the largest displacement from which on a body beside its contact part has passed in.
PASSED = 0.01


def held_along(solution: Solution) -> Iterator[Remark]:
    """Say where supports hold touching nodes along the contact, so that friction does not act.

    Aslant to the contact direction, or moved along another body that is free there.
    """
    problem, nodes, d = solution.problem, solution.problem.nodes, solution.problem.dim
    rubs = solution.friction_bound > 0
    aslant = np.where(rubs, np.linalg.norm(nodes.lift - nodes.normal, axis=1), 0.0)
    jump = problem.nodal(solution.state)[:, :d]
    along = jump - nodes.normal_component(jump)[:, None] * nodes.normal
    held = np.linalg.norm(along - nodes.tangential_component(jump), axis=1)
    moves = np.linalg.norm(problem.equilibrium.nodal(solution.state.x)[nodes.nodes, :d], axis=1)
    moved = nodes.maximum(np.where(rubs, held, 0.0)) > 0.1 * nodes.maximum(moves)
    if nodes.maximum(aslant) > 0.1 or moved:
        yield Note(
            "supports hold contact nodes aslant to the contact direction, or move them along "
            "another body: no friction acts at these nodes along the directions that supports "
            "hold, and the error of forces is that of these nodes alone"
        )


def fitting(problem: ContactProblem) -> Iterator[Remark]:
    """Say where a curved part has no gap anywhere: its foundation has then its very shape."""
    comm, size = problem.comm, problem.domain.size
    found = []
    for contact, entry in zip(problem.contacts, problem.entries, strict=True):
        nodes = entry.nodes
        sums = np.append(nodes.weight @ nodes.normal, nodes.weight.sum())
        total = comm.allreduce(sums, op=MPI.SUM)
        flat = np.linalg.norm(total[:-1]) > 0.995 * total[-1]
        gap = comm.allreduce(float(np.abs(nodes.gap).max(initial=0.0)), op=MPI.MAX)
        if contact.against is None and not contact.foundation.is_shape:
            found += [contact.on] * (not flat and gap <= 1e-9 * size)
    if found:
        yield (
            f"the part {', '.join(found)} is curved and its gap is 0 everywhere: the foundation "
            "has the body's own shape; for a plane, sphere... in front of it give "
            "contact.foundation, and a gap otherwise"
        )


def passed_beside(solution: Solution) -> Iterator[Remark]:
    """Say where the body beside a contact part has passed into its foundation. Collective.

    The zone of contact then ends where the part does, and pressures beyond are missing. Nodes that
    are in the foundation in the reference configuration are left out.
    """
    problem, body, d = solution.problem, solution.problem.equilibrium, solution.problem.dim
    rigid = [contact for contact in problem.contacts if contact.against is None]
    facing = [(c.on, c.foundation) for c in rigid if isinstance(c.foundation, Shape)]
    if not facing or not solution.converged:
        return
    points, nodes = _beside(problem, [contact.on for contact in rigid])
    states = [record.state for record in solution.steps] or [solution.state]
    sizes = [record.row["max_displacement"] for record in solution.steps]
    largest = max(sizes or [solution.max_displacement])
    tiny = NEGLIGIBLE * problem.domain.size
    for part, shape in facing:
        direction, gap = _gaps(shape, points)
        moves = body.global_unknowns.of_foundation(points, body.block_size, part)
        depth, place = -np.inf, np.zeros(d)
        for state in states:
            u = body.nodal(state.x)[nodes, :d]
            if moves is not None:
                u = u - (moves @ body.motion(state.x))[:, :d]
            within = np.einsum("nd,nd->n", direction, u) - gap
            within[~(gap >= -tiny) | ~np.isfinite(within)] = -np.inf
            if within.max(initial=-np.inf) > depth:
                depth, place = float(within.max()), points[within.argmax()]
        depth, place = max(problem.comm.allgather((depth, tuple(place))))
        if depth > PASSED * largest:
            there = ", ".join(f"{x if abs(x) > tiny else 0.0:.4g}" for x in place)
            yield (
                f"beside the contact part {part!r} the body passes into the foundation, by "
                f"up to {depth:.3g} at ({there}), where displacements reach {largest:.3g}: contact "
                "reaches the end of the part, and a larger one has other pressures"
            )


def _beside(problem: ContactProblem, parts: list[str]) -> tuple[Array, NDArray[np.int32]]:
    """Return the owned nodes of the boundary beside some parts, and their points. Collective."""
    domain, space = problem.domain, problem.equilibrium.space
    taken = np.concatenate([domain.facets(part) for part in parts])
    rest = np.setdiff1d(exterior_facets(domain.mesh), taken).astype(np.int32)
    found, own = (fem.locate_dofs_topological(space, domain.dim - 1, f) for f in (rest, taken))
    nodes = np.setdiff1d(found, own).astype(np.int32)
    nodes = nodes[nodes < space.dofmap.index_map.size_local]
    return space.tabulate_dof_coordinates()[nodes, : domain.dim], nodes


@np.errstate(all="ignore")
def _gaps(shape: Shape, points: Array) -> tuple[Array, Array]:
    """Return directions and gaps as contact nodes have them; along the body's normal the nearest.

    They are no numbers, or infinite, where nothing is in front.
    """
    seen = shape if shape.direction == "axis" else replace(shape, direction="foundation")
    return seen.measure(points, points)  # neither asks for normals of the body


def without_heights(problem: ContactProblem, solution: Solution | None = None) -> Iterator[Remark]:
    """Say how much of a contact part has no measured heights in front of it. Collective.

    Parameters
    ----------
    problem
        The problem.
    solution
        Its solution, by which contact there is told; without one it may come to that.
    """
    touched, begin = None if solution is None else _touched(solution), 0
    for contact, entry in zip(problem.contacts, problem.entries, strict=True):
        nodes, shape = entry.nodes, contact.foundation
        here = slice(begin, begin + len(nodes.weight))
        begin = here.stop
        if not isinstance(shape, Heights):
            continue
        aside = np.where(shape.direction == "foundation", 0.0, nodes.gap)
        unknown = shape.unknown(nodes.points + aside[:, None] * nodes.normal)
        part = nodes.sum(unknown.astype(np.float64)) / nodes.sum(np.ones_like(nodes.weight))
        if part == 0:
            continue
        text = (
            f"{part:.1%} of the part {contact.on} lie where its foundation has no heights "
            f"({_known(shape)}), and it is taken to go on level, or smoothly across a hole"
        )
        accepted = "accepted: heights in front of all of the part, or a smaller one"
        if touched is None:
            yield f"{text}; {accepted}"
            continue
        closed = touched[here]
        area = nodes.sum((unknown & closed).astype(np.float64))
        if area == 0:
            yield Note(f"{text}; nothing touches there")
        else:
            share = area / nodes.sum(closed.astype(np.float64))
            yield f"{text}: so does {share:.1%} of the area that touches; {accepted}"


def _known(shape: Heights) -> str:
    """Say where there are heights."""
    found = []
    for name, axis, gaps in zip("xy", shape.places, shape.gaps, strict=False):
        holes = [f"{begin:.4g} to {end:.4g}" for begin, end in gaps[1:-1]]
        but = f" but {' and '.join(holes)}" if holes else ""
        found.append(f"{name} from {axis[0]:.4g} to {axis[-1]:.4g}{but}")
    return ", ".join(found)


def _touched(solution: Solution) -> NDArray[np.bool_]:
    """Tell which contact nodes touch at the end of any step. Collective."""
    interface, found = solution.problem.interface, solution.status != "open"
    for record in solution.steps:
        nodal = interface.jump.apply(record.state.x)
        found = found | (interface.pressure(nodal, record.state.forces) > interface.rounding(nodal))
    return found
