"""Remarks on bodies in contact: sides, components, and rigid motions that hardly are resisted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import linalg

from contact.errors import counted
from contact.mesh.entities import cells_at, owned_among
from contact.mesh.owners import Owners
from contact.results.solution import Note, Remark, Solution
from contact.problem.limit_analysis import Overload, UnilateralSupport
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.rigid_modes import (
    Group,
    constrained_by_supports,
    described,
    groups,
    null_space,
)
from contact.problem.state import State
from contact.tolerances import EPS
from contact.typing import Array

#: How many times finer or softer the other side may be before there is a warning.
FINER, SOFTER = 2.0, 5.0

#: Share of a node's area that should face the other side.
HALF = 0.5

#: Share of the largest pressure from which on a node counts as pressed.
PRESSED = 1e-3

#: Share of the largest displacement by which the residual of the forces may move a body.
MOVED = 1e-3

#: Share of a motion's square from which on contact holds it: normals of a mesh are off by more than
#: the root of it, and resist motions that the true surface does not.
HELD = 1e-8

#: Largest pressure at the end of a step, over that of all steps, that is rounding of none.
NOTHING = 1e-12


def choices(solution: Solution) -> Iterator[Remark]:
    """Say where the sides of two bodies had better change places, or face each other in part.

    Multipliers live on the side `on`: it should be the finer and the softer one, else it
    penetrates the finer side, or carries pressures that the softer side cannot follow.
    """
    problem = solution.problem
    for contact, entry in zip(problem.contacts, problem.entries, strict=True):
        if contact.against is None or entry.coupling is None:
            continue
        sides = f"contact on {contact.on!r} against {contact.against!r}"
        (size, young), (other_size, other_young) = (
            _side(problem, part) for part in (contact.on, contact.against)
        )
        better = "accuracy is better with on and against exchanged"
        if size > FINER * other_size:
            facets = f"facets of {other_size:.3g} against {size:.3g}"
            finer = f"{size / other_size:.3g} times finer ({facets})"
            yield f"{sides}: the other side is {finer}: {better}"
        elif young > SOFTER * other_young and size >= other_size:
            yield f"{sides}: the other side is {young / other_young:.3g} times softer: {better}"
        # Beyond the rim of the other side pressures end, far from where they act.
        nodes, covered = entry.coupling.nodes, entry.coupling.covered
        partly = _pressed(problem, solution.state, nodes[covered < HALF])
        count = problem.comm.allreduce(int(partly.sum()), op=MPI.SUM)
        if count:
            yield (
                f"{sides}: {counted(count, 'node')} in contact, of whose area less than half faces "
                "the other side: the pressure there is a mean over the rest; facets that end where "
                "the other side does avoid that"
            )
        states = [record.state for record in solution.steps] or [solution.state]
        slips = [_slip(problem, state, nodes) for state in states]
        largest, facet = max(slips), max(size, other_size)
        if largest > facet:
            when = f" at t = {states[slips.index(largest)].time:g}" if solution.steps else ""
            yield (
                f"{sides}: points in contact are {largest:.3g} along the surface from the points "
                f"they faced{when}, and facets are {facet:.3g} long: in linear kinematics each "
                "stays opposite the point it faced in the beginning; where surfaces are curved, or "
                "end, the result is of another contact"
            )


def _pressed(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of the owned contact nodes are among `nodes` and carry pressure. Collective."""
    contact = problem.nodes
    _, local = owned_among(problem.equilibrium.layout.index_map, nodes)
    pressure = problem.interface.pressure(problem.nodal(state), state.forces)
    # Residuals at open nodes are no pressure, and a thousandth of the rest decides nothing.
    pressed = pressure > PRESSED * contact.maximum(pressure)
    return np.asarray(pressed & np.isin(contact.nodes, local))


def _slip(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> float:
    """Return how far points in contact have slid from the points they faced. Collective."""
    along = np.linalg.norm(problem.nodes.tangential_component(problem.nodal(state)), axis=1)
    return problem.nodes.maximum(np.where(_pressed(problem, state, nodes), along, 0.0))


def _side(problem: ContactProblem, part: str) -> tuple[float, float]:
    """Return the mean size of a part's facets, and the least of Young's moduli behind them."""
    domain, body = problem.domain, problem.equilibrium
    d, facets = domain.dim, domain.facets(part)
    sizes = domain.mesh.h(d - 1, facets) if facets.size else np.zeros(0)
    total = problem.comm.allreduce(np.array([sizes.sum(), sizes.size]), op=MPI.SUM)
    cells, _ = cells_at(domain.mesh, facets)
    youngs = [
        float(material.law.young)
        for material, own in zip(body.body.materials, body.cells, strict=True)
        if np.isin(cells, own).any()
    ]
    least = problem.comm.allreduce(min(youngs, default=np.inf), op=MPI.MIN)
    return float(total[0] / total[1]), float(least)


def regions(solution: Solution) -> Iterator[Remark]:
    """Say where regions of the mesh, which somebody has named, have one material."""
    names, materials = solution.problem.domain.regions, solution.problem.body.materials
    if len(names) > 1 and len(materials) == 1:
        words = f"the regions {', '.join(names)} have one material"
        yield Note(f"{words}; [[material]] with `on` gives each its own")


def passing(problem: ContactProblem) -> Iterator[Remark]:
    """Warn where components of the mesh are in no contact, so that nothing keeps them apart."""
    piece, count = problem.equilibrium.components
    if count == 1:
        return
    met = np.zeros(count, dtype=np.intc)
    owners = Owners.of(problem.equilibrium.layout.index_map, problem.comm)
    for entry in problem.entries:
        if entry.coupling is not None:
            both = np.concatenate([entry.coupling.slaves, entry.coupling.masters])
            met[piece[owners.named(both) - owners.begin]] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, met, op=MPI.MAX)
    alone = count - int(np.count_nonzero(met))
    if alone:
        yield (
            f"the mesh has {count} connected components, and {alone} of them can pass through the "
            "others: contact between two is asked for by [[contact]] with `on` one and `against` "
            "the other"
        )


def unresisted_motions(solution: Solution) -> Iterator[Remark]:
    """Warn of rigid motions that supports leave free and contact hardly resists. Collective.

    A cylinder without friction rolls in its place against next to nothing, and wherever it has
    rolled to, its forces are in balance. Contact is taken to resist with c = E/length times areas:
    along the normal where something presses, along the surface where it sticks, and across the
    friction where it slips.
    """
    problem, body = solution.problem, solution.problem.equilibrium
    if not solution.converged:
        return
    motions_left = [(group, null_space(group.supports)) for group in groups(problem)]
    unheld = [(group, free) for group, free in motions_left if free.shape[1] > 0]
    if not unheld:
        return
    residual = body.unbalanced(residual_forces(problem, solution.state))
    left = float(np.linalg.norm(body.norms(residual)[0]))
    whole = problem.interface.stiffness * problem.nodes.sum(np.ones_like(problem.nodes.weight))
    largest, kkt = solution.max_displacement, solution.outcome.kkt
    for group, free in unheld:
        shares, motions = _least_held(solution, group, free, solution.status != "open")
        share, motion = shares[0], motions[:, 0]
        # All that cost nothing, or the one that costs least.
        motions = linalg.orth(motions[:, : max(1, np.count_nonzero(shares < EPS))])
        words, name = described(motions, group.names), _named(group, motions)
        if share < EPS:
            several = motions.shape[1] > 1
            yield (
                f"nothing holds {name} against "
                f"{f'rigid motions ({words})' if several else f'a rigid motion ({words})'}, which "
                f"{'cost' if several else 'costs'} nothing: "
                "of all places the one with the least displacements is given; "
                f"friction, or supports against {'those motions' if several else 'that motion'}, "
                "hold it"
            )
            return
        moved = left * _reach(group, motion) / (whole * share)
        if share < HELD or moved > MOVED * largest:
            yield (
                f"contact resists a rigid motion of {name} ({words}) by next to nothing: the "
                f"mesh decides how far it goes, and the residual forces, {kkt.equilibrium:.1e} of "
                f"all, may move that body by up to {moved:.2g}, where displacements reach "
                f"{largest:.2g}; friction, or a support against that motion, hold it"
            )
            return


def _named(group: Group, motions: Array) -> str:
    """Return the regions of the components that motions of a group move most. Collective."""
    problem, names = group.problem, group.problem.domain.regions
    if group.count == 1 or len(names) == 1:
        return "the body"
    component, dofs = group.component, problem.equilibrium.space.dofmap.list
    amounts = np.linalg.norm(group.of_components(motions), axis=(1, 2))
    moved = np.array(group.components)[amounts >= amounts.max() / 2]
    found = []
    for name, cells in names.items():
        nodes = dofs[cells].ravel()
        inside = np.isin(component[nodes[nodes < component.size]], moved).any()
        if problem.comm.allreduce(bool(inside), op=MPI.LOR):
            found.append(name)
    return ", ".join(found)


def not_held(solution: Solution) -> Iterator[Remark]:
    """Say which bodies contact has not held where a method fails. Collective.

    A block between two jaws that touch it aslant gets out of their way and falls: no solution.
    """
    if solution.converged:
        return
    contact = "friction" if solution.problem.frictional else "contact"
    for group in groups(solution.problem):
        lost = _lost(solution, group)
        if lost is None:
            continue
        motion, why = lost
        large = np.abs(motion) > 0.1 * np.abs(motion).max()
        words = ", ".join(dict.fromkeys(np.array(group.names)[large].tolist()))
        yield (
            f"{contact} cannot hold {_named(group, motion[:, None])} ({words}) where the method "
            f"has left it: {why}; supports, more friction, or a load that presses it where it "
            "touches hold it"
        )


def _lost(solution: Solution, group: Group) -> tuple[Array, str] | None:
    """Return the rigid motion on which contact has not held bodies, and how. Collective."""
    problem, time = solution.problem, solution.state.time
    if solution.outcome.overloaded:
        friction = problem.nodes.weight * solution.friction_bound
        overload = Overload.of(group, time, friction)
        words = "friction bounded by the pressures there does not balance its loads"
        return None if overload is None else (overload.motion, words)
    support = UnilateralSupport.of(group, solution.status != "open")
    if support is None:
        return None
    if (motion := support.lost(time)) is not None:
        words = "the nodes that touch at last, pressed by whatever force, do not balance its loads"
        return motion, words
    motion = _drift(group, support.free, solution.state)
    if _reach(group, motion) <= problem.domain.size:
        return None
    return motion, "it has moved by more than the size of the bodies"


def _drift(group: Group, free: Array, state: State) -> Array:
    """Return the free motion nearest to the displacements of a state, shape (m,). Collective."""
    body, comm = group.problem.equilibrium, group.problem.comm
    rows = group.moved[: body.owned] @ free
    x = state.x[: body.owned]
    gram, side = (comm.allreduce(rows.T @ of, op=MPI.SUM) for of in (rows, x))
    return np.asarray(free @ np.linalg.lstsq(gram, side, rcond=EPS)[0])


def adrift(solution: Solution) -> Iterator[Remark]:
    """Say that nothing held a body any more before the last step. Collective."""
    pressures = np.array([record.row["max_pressure"] for record in solution.steps])
    pressed = pressures > NOTHING * pressures.max(initial=0.0)
    # Before it has been pressed it has not moved.
    free = np.flatnonzero(~pressed[:-1] & np.logical_or.accumulate(pressed)[:-1])
    if free.size == 0 or constrained_by_supports(solution.problem):
        return
    yield (
        f"at t = {solution.steps[free[0]].row['t']:g} nothing presses any more, and no support "
        "holds the body: it is then in one of many places, and so it is later; a "
        "load that goes on pressing it, or a support, holds it"
    )


def _least_held(
    solution: Solution, group: Group, free: Array, touches: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return how far contact holds free motions, ascending, and the motions. Collective.

    That is the share of their squares at all contact nodes that is where they are held; the
    motions, shape (m, k), have mean squares of 1 there.
    """
    nodes = group.problem.nodes
    normal, tangential = group.normal @ free, group.tangential @ free
    resisted = tangential.copy()
    slips = touches & (solution.status == "slip")
    size = np.linalg.norm(solution.friction, axis=1)
    unit = solution.friction / np.where(size > 0, size, 1.0)[:, None]
    resisted[slips] -= np.einsum("ni,nj,njk->nik", unit, unit, tangential)[slips]
    resisted[~touches | (solution.friction_bound <= 0)] = 0.0
    whole = np.concatenate([normal[:, None, :], tangential], axis=1)
    resisting = np.concatenate([(normal * touches[:, None])[:, None, :], resisted], axis=1)
    product = "n,nik,nil->kl"
    sums = np.array([np.einsum(product, nodes.weight, part, part) for part in (resisting, whole)])
    held, moved = nodes.comm.allreduce(sums, op=MPI.SUM)
    area = nodes.sum(np.ones_like(nodes.weight))
    values, motions = linalg.eigh(held / area, moved / area)
    return np.maximum(values, 0.0), free @ motions


def _reach(group: Group, motion: Array) -> float:
    """Return how far a motion moves a node at most. Collective."""
    body = group.problem.equilibrium
    moved = body.nodal(group.moved @ motion)[:, : body.dim]
    here = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
    return float(group.problem.comm.allreduce(here, op=MPI.MAX))
