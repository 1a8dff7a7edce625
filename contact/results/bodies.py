"""Remarks on bodies in contact: sides, components, supports, rigid-body modes.

A rigid-body mode that the supports leave free is constrained by contact alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from contact.body.materials import softest
from contact.errors import counted
from contact.mesh.entities import cells_at, owned_among
from contact.mesh.owners import Owners
from contact.problem.checks import places
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.rigid_modes import (
    Group,
    UnilateralSupport,
    groups,
    middle,
    mode_names,
    null_space,
    sliding_mode,
)
from contact.problem.state import State
from contact.results.solution import Remark, Results
from contact.tolerances import EPS
from contact.typing import Array

#: How many times finer or softer the master side may be without a warning.
FINER, SOFTER = 2.0, 5.0

#: Share of a node's area that should face the master side.
HALF = 0.5

#: Share of the largest pressure from which on a node counts as pressed.
PRESSED = 1e-3

#: Share of the largest displacement by which the residual of the forces may move a body.
MOVED = 1e-3

#: Relative stiffness above which contact constrains a rigid-body mode: normals of a mesh are off by
#: more than the root of it.
CONSTRAINED = 1e-8


def sides(solution: Results) -> Iterator[Remark]:
    """Warn of slave sides that are coarser or stiffer, uncovered in part, or have slid too far."""
    # Multipliers live on the slave side: a coarser one penetrates the finer side, a stiffer one
    # carries pressures that the softer side cannot follow.
    problem = solution.problem
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        if contact.against is None or geometry.jumps is None or geometry.covered is None:
            continue
        sides = f"contact on {contact.on!r} against {contact.against!r}"
        (size, young), (other_size, other_young) = (
            _side(problem, part) for part in (contact.on, contact.against)
        )
        better = "accuracy is better with on and against exchanged"
        if size > FINER * other_size:
            yield f"{sides}: the other side is {size / other_size:.3g} times finer, {better}"
        elif young > SOFTER * other_young and size >= other_size:
            yield f"{sides}: the other side is {young / other_young:.3g} times softer, {better}"
        # Beyond the rim of the other side pressures end, far from where they act.
        nodes, covered = geometry.jumps.nodes, geometry.covered
        partly = _pressed(problem, solution.state, nodes[covered < HALF])
        count = problem.comm.allreduce(int(partly.sum()), op=MPI.SUM)
        if count:
            yield (
                f"{sides}: {counted(count, 'node')} in contact, of whose area less than half faces "
                "the other side: the pressure there is a mean over the rest"
            )
        states = [record.state for record in solution.steps] or [solution.state]
        largest = max(_slip(problem, state, nodes) for state in states)
        facet = max(size, other_size)
        if largest > facet:
            yield (
                f"{sides}: points in contact slide by up to {largest:.3g} along the surface, and "
                f"facets are {facet:.3g} long: in linear kinematics each stays opposite the point "
                "it faced in the beginning"
            )


def _pressed(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of the owned contact nodes are among `nodes` and carry pressure. Collective."""
    contact = problem.nodes
    _, local = owned_among(problem.body.layout.index_map, nodes)
    pressure = problem.interface.pressure(problem.nodal(state), state.multipliers)
    # Residuals at open nodes are no pressure, and a thousandth of the rest decides nothing.
    pressed = pressure > PRESSED * contact.maximum(pressure)
    return np.asarray(pressed & np.isin(contact.nodes, local))


def _slip(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> float:
    """Return the largest tangential jump of nodes in contact (length). Collective."""
    along = np.linalg.norm(problem.nodes.tangential_component(problem.nodal(state)), axis=1)
    return problem.nodes.maximum(np.where(_pressed(problem, state, nodes), along, 0.0))


def _side(problem: ContactProblem, part: str) -> tuple[float, float]:
    """Return the mean size of a part's facets, and the least of Young's moduli behind them."""
    domain, body = problem.domain, problem.body
    d, facets = domain.dim, domain.facets(part)
    sizes = domain.mesh.h(d - 1, facets) if facets.size else np.zeros(0)
    total = problem.comm.allreduce(np.array([sizes.sum(), sizes.size]), op=MPI.SUM)
    cells, _ = cells_at(domain.mesh, facets)
    at_part = [np.intersect1d(cells, own) for own in body.cells]
    return float(total[0] / total[1]), softest(domain, body.description.materials, at_part).young


def apart(problem: ContactProblem) -> Iterator[Remark]:
    """Warn of connected components of the mesh that no contact keeps apart. Collective."""
    component, count = problem.body.connected_components
    if count == 1:
        return
    met = np.zeros(count, dtype=np.intc)
    owners = Owners.of(problem.body.layout.index_map, problem.comm)
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        if contact.against is not None and geometry.jumps is not None:
            both = np.concatenate([geometry.jumps.slaves, geometry.jumps.masters])
            met[component[owners.requested(both) - owners.begin]] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, met, op=MPI.MAX)
    alone = count - int(np.count_nonzero(met))
    if alone:
        yield (
            f"the mesh has {count} connected components, and {alone} of them can pass through the "
            "others; accepted: [[contact]] with `on` one and `against` the other"
        )


def overlapping(problem: ContactProblem) -> Iterator[Remark]:
    """Warn of bodies that overlap in the reference configuration without contact. Collective."""
    found = problem.unpaired
    if not found:
        return
    component, points = problem.body.connected_components[0], problem.body.layout.points

    def names_of(two: tuple[int, int]) -> list[str]:
        names = [", ".join(_regions(problem, component, [one])) for one in two]
        if names[0] == names[1]:
            centres = [middle(problem, points[component == one])[0] for one in two]
            names = [f"the body about {places(centre[None])}" for centre in centres]
        return sorted(names)

    # Numbers of components depend on the ranks.
    deepest = max(found.values())
    names = min(names_of(two) for two, depth in found.items() if depth > (1 - EPS) * deepest)
    more = f"; so do {counted(len(found) - 1, 'pair')} more" if len(found) > 1 else ""
    yield (
        f"{' and '.join(names)} overlap by up to {deepest:.3g} in the reference configuration, "
        f"and no contact is between them{more}; accepted: meshes that are apart or touch, or "
        "[[contact]] with `on` one and `against` the other"
    )


def unresisted_motions(solution: Results) -> Iterator[Remark]:
    """Warn of rigid-body modes that are free, and that contact hardly resists. Collective."""
    # Contact is taken to resist with c = E/length times areas: along the normal where something
    # presses, along the surface where it sticks, and across the friction where it slips.
    problem, body = solution.problem, solution.problem.body
    if not solution.converged:
        return
    modes = [(group, null_space(group.supports)) for group in groups(problem)]
    modes = [(group, free) for group, free in modes if free.shape[1] > 0]
    if not modes:
        return
    residual = body.unbalanced(residual_forces(problem, solution.state))
    left = float(np.linalg.norm(body.norms(residual)[0]))
    whole = problem.interface.c_b * problem.nodes.sum(np.ones_like(problem.nodes.weight))
    largest = solution.max_displacement
    accepted = f"{'more ' if problem.frictional else ''}friction, or supports"
    for group, free in modes:
        shares, motions = _least_constrained(solution, group, free, solution.status != "open")
        share, motion = shares[0], motions[:, 0]
        # All that cost nothing, or the one that costs least.
        motions = linalg.orth(motions[:, : max(1, np.count_nonzero(shares < EPS))])
        words, name = mode_names(motions, group.names), _named(group, motions)
        if share < EPS:
            yield (
                f"nothing holds {name} against rigid motions ({words}): of all places the one with "
                f"the least displacements is given; accepted: {accepted}"
            )
            return
        moved = left * _reach(group, motion) / (whole * share)
        if share < CONSTRAINED or moved > MOVED * largest:
            yield (
                f"contact resists a rigid motion of {name} ({words}) by next to nothing: residual "
                f"forces may move it by up to {moved:.2g}; accepted: {accepted}"
            )
            return


def _named(group: Group, motions: Array) -> str:
    """Return the regions of the components that motions of a group move most. Collective."""
    problem, names = group.problem, group.problem.domain.regions
    if group.count == 1 or len(names) == 1:
        return "the body"
    amounts = np.linalg.norm(group.by_connected_component(motions), axis=(1, 2))
    moved = np.array(group.connected_components)[amounts >= amounts.max() / 2]
    return ", ".join(_regions(problem, group.connected_component, moved))


def _regions(problem: ContactProblem, component: NDArray[np.int32], among: ArrayLike) -> list[str]:
    """Return the regions of some of the components of the owned nodes. Collective."""
    dofs, found = problem.body.space.dofmap.list, []
    for name, cells in problem.domain.regions.items():
        nodes = dofs[cells].ravel()
        inside = np.isin(component[nodes[nodes < component.size]], among).any()
        if problem.comm.allreduce(bool(inside), op=MPI.LOR):
            found.append(name)
    return found


def not_held(solution: Results) -> Iterator[Remark]:
    """Warn of loads that by limit analysis are more than contact bears, where a method fails."""
    problem, time = solution.problem, solution.state.time
    if solution.converged:
        return
    for group in groups(problem):
        motion, by = None, "contact and friction"
        if solution.outcome.overloaded:
            by = "the friction of the pressures that were found"
            bound = problem.nodes.weight * solution.friction_bound
            motion = sliding_mode(group, problem.body.external(time), bound)
        elif (support := UnilateralSupport.of(group)) is not None:
            found = support.release(time)
            motion = None if found is None else found.motion
        if motion is None:
            continue
        large = np.abs(motion) > 0.1 * np.abs(motion).max()
        words = ", ".join(dict.fromkeys(np.array(group.names)[large].tolist()))
        yield (
            f"{by} cannot hold {_named(group, motion[:, None])} ({words}), by "
            "limit analysis; accepted: supports, more friction, or a load that presses it"
        )


def _least_constrained(
    solution: Results, group: Group, free: Array, touches: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return ascending relative stiffnesses along free motions, and these, (m, k). Collective."""
    # Shares of their squares that are where they are resisted; the mean square of each is 1.
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
    resisted_sum, moved = nodes.comm.allreduce(sums, op=MPI.SUM)
    area = nodes.sum(np.ones_like(nodes.weight))
    values, motions = linalg.eigh(resisted_sum / area, moved / area)
    return np.maximum(values, 0.0), free @ motions


def _reach(group: Group, motion: Array) -> float:
    """Return the largest displacement of a node by a motion. Collective."""
    body = group.problem.body
    moved = body.nodal(group.moved @ motion)[:, : body.dim]
    here = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
    return float(group.problem.comm.allreduce(here, op=MPI.MAX))
