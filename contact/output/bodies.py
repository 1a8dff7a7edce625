"""What there is to say about bodies that touch each other, or that should."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.mesh.entities import cells_at, owned_among
from contact.output.solution import Solution
from contact.problem.problem import ContactProblem
from contact.problem.state import State

#: How many times finer or softer the other side may be before there is a warning.
FINER, SOFTER = 2.0, 5.0

#: Share of a node's area that should face the other side.
HALF = 0.5

#: Share of the largest pressure from which on a node counts as pressed.
PRESSED = 1e-3


def choices(solution: Solution) -> Iterator[tuple[str, bool]]:
    """Say where the sides of two bodies had better change places, or face each other in part.

    Multipliers live on the side `on`: it should be the finer and the softer one, else it
    penetrates what is finer, or carries pressures that what is softer cannot follow.
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
            sizes = f"facets of {other_size:.3g} against {size:.3g}"
            ratio = size / other_size
            yield f"{sides}: the other side is {ratio:.3g} times finer ({sizes}): {better}", False
        elif young > SOFTER * other_young and size >= other_size:
            ratio = young / other_young
            yield f"{sides}: the other side is {ratio:.3g} times softer: {better}", False
        # The rim of what faces the other side is where pressures end, far from where they act.
        partly = entry.coupling.covered < HALF
        if partly.any():
            yield _partly(solution, entry.coupling.nodes[partly], sides)
        yield _slides(solution, entry.coupling.nodes, max(size, other_size), sides)


def _partly(solution: Solution, nodes: NDArray[np.int64], sides: str) -> tuple[str, bool]:
    """Warn of nodes that carry pressure though less than half of their area faces anything."""
    problem = solution.problem
    count = problem.comm.allreduce(int(_pressed(problem, solution.state, nodes).sum()), op=MPI.SUM)
    if count == 0:
        return "", True
    return (
        f"{sides}: {count} nodes in contact face the other side with less than half of their "
        "area: the pressure there is a mean over the rest; facets that end where the other side "
        "does avoid that"
    ), False


def _pressed(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of the owned contact nodes are among `nodes` and carry pressure. Collective."""
    contact = problem.nodes
    _, local = owned_among(problem.equilibrium.layout.index_map, nodes)
    pressure = problem.interface.pressure(problem.nodal(state), state.forces)
    # What a method leaves at open nodes is none; what is a thousandth of the rest decides nothing.
    pressed = pressure > PRESSED * contact.maximum(pressure)
    return np.asarray(pressed & np.isin(contact.nodes, local))


def _slides(
    solution: Solution, nodes: NDArray[np.int64], size: float, sides: str
) -> tuple[str, bool]:
    """Warn of points in contact that are in some step further along than a facet is long."""
    states = [record.state for record in solution.steps] or [solution.state]
    slips = [_slip(solution.problem, state, nodes) for state in states]
    largest = max(slips)
    if largest <= size:
        return "", True
    when = f" at t = {states[slips.index(largest)].time:g}" if solution.steps else ""
    return (
        f"{sides}: points in contact are {largest:.3g} along the surface from what they faced"
        f"{when}, and facets are {size:.3g} long: in linear kinematics each stays opposite what it "
        "faced at rest; where surfaces are curved, or end, the result is of another contact"
    ), False


def _slip(problem: ContactProblem, state: State, nodes: NDArray[np.int64]) -> float:
    """Return how far points in contact are along the surface from what they faced. Collective."""
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


def regions(solution: Solution) -> tuple[str, bool]:
    """Say where regions of the mesh, which somebody has named, have one material."""
    names, materials = solution.problem.domain.regions, solution.problem.body.materials
    if len(names) == 1 or len(materials) > 1:
        return "", True
    which = ", ".join(names)
    return f"the regions {which} have one material; [[material]] with `on` gives each its own", True


def passing(problem: ContactProblem) -> tuple[str, bool]:
    """Warn where components of the mesh are in no contact, so that nothing keeps them apart."""
    piece, count = problem.equilibrium.components
    if count == 1:
        return "", True
    met = np.zeros(count, dtype=np.intc)
    for entry in problem.entries:
        if entry.coupling is not None:
            both = np.concatenate([entry.coupling.slaves, entry.coupling.masters])
            met[piece[owned_among(problem.equilibrium.layout.index_map, both)[1]]] = 1
    problem.comm.Allreduce(MPI.IN_PLACE, met, op=MPI.MAX)
    alone = count - int(np.count_nonzero(met))
    if alone == 0:
        return "", True
    return (
        f"the mesh has {count} connected components, and {alone} of them can pass through "
        "the others: contact between two is asked for by [[contact]] with `on` one and "
        "`against` the other"
    ), False
