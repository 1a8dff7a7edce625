"""Remarks on mesh and surfaces: locking, discretisation error, chords, resolution, foundations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.elements import MEAN_DILATATION, unlocked
from contact.errors import counted
from contact.interface.mortar.search import nearest
from contact.interface.mortar.surface import Surface, surface_of
from contact.mesh.cells import shape_of
from contact.mesh.deviation import ALIKE_NORMALS
from contact.mesh.entities import cells_at, exterior_facets
from contact.model.obstacle import Heights, Shape
from contact.problem.problem import ContactProblem
from contact.results.fields import DerivedFields
from contact.results.solution import Remark, Solution
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Ratio of bulk to shear modulus, of nu = 0.475, from which on elements of degree 1 lock.
LOCKED = 20.0

#: Estimated error below which no mesh locks: there the solution is one that these elements have.
EXACT = 5e-3

#: Largest estimated error without a warning: its square is that of displacements under loads.
COARSE = 0.15

#: Largest deviation of facets from a curved surface, as a share of the gaps that are closed; and
#: of the directions of its tangents along a straight edge of degree 2.
DEVIATION = 0.1

#: Scatter of pressures by chords, over their mean, without a warning.
SCATTER = 0.05

#: The same by chords, over the plane modulus times their normal strain and their turn.
CHORDS = 0.5

#: Least number of nodes across a contact zone.
ACROSS = 5

#: Penetration of the boundary beside a contact part, over the largest displacement.
PASSED = 0.01

#: Remedies of straight facets of a curved surface.
FINER = "a finer mesh from the beginning, or space.degree = 2"
CURVED = "a finer mesh, or curved cells (mesh.order = 2)"


def locks(solution: Solution) -> bool:
    """Whether elements of degree 1 may be much too stiff, for volumes hardly change."""
    error, body = solution.error, solution.problem.equilibrium
    if error is None or error.stiffness_ratio is None:
        return False
    remedy = unlocked(body.element, body.degree, shape_of(body.domain.mesh))
    return remedy is not None and error.stiffness_ratio >= LOCKED and error.relative > EXACT


def locking(solution: Solution) -> Iterator[Remark]:
    """Warn of volumetric locking, or that of stiff fibres."""
    error, body = solution.error, solution.problem.equilibrium
    if error is not None and locks(solution):
        yield (
            f"the mesh may lock, displacements may be too small, and the estimated error a lower "
            f"bound: the ratio of bulk and shear modulus is {error.stiffness_ratio:.3g} where the "
            f"energy is; {unlocked(body.element, body.degree, shape_of(body.domain.mesh))}"
        )


def large_error(solution: Solution) -> Iterator[Remark]:
    """Warn of an estimated error that is large, as where slender parts bend."""
    error, body = solution.error, solution.problem.equilibrium
    if error is not None and error.relative > COARSE and not locks(solution):
        # The mean dilatation is no bound from below: it may be too soft as well.
        mean = body.element == MEAN_DILATATION
        yield (
            f"the mesh is too coarse: the estimated discretisation error is "
            f"{error.relative:.1%} (energy norm), and "
            f"{'displacements are off' if mean else 'the body is too stiff'} by about "
            f"{error.relative**2:.1%}, more where slender parts bend"
        )


def resolution(solution: Solution) -> Iterator[Remark]:
    """Warn of less than `ACROSS` nodes across a contact zone that ends within the contact part."""
    problem, nodes = solution.problem, solution.problem.nodes
    closed = solution.status != "open"
    count = int(nodes.comm.allreduce(int(np.count_nonzero(closed)), op=MPI.SUM))
    if count == 0 or count == nodes.size:
        return
    if problem.dim == 3:
        # Of a round zone with that many nodes.
        across = float(np.sqrt(4 * count / np.pi))
        width = float(np.sqrt(4 * solution.contact_area / np.pi))
    elif problem.domain.revolved:
        # Both halves; the zone of one is known by its area, but for a ring.
        nearest_axis = float(nodes.points[closed, 0].min(initial=np.inf))
        on_axis = nodes.comm.allreduce(nearest_axis, op=MPI.MIN) < 1e-9 * problem.domain.size
        across = 2 * count - 1 if on_axis else 2 * count
        width = float(2 * np.sqrt(solution.contact_area / np.pi))
    else:
        across, width = count, solution.contact_area
    if across < ACROSS:
        yield (
            f"the mesh is too coarse for the pressures: {counted(across, 'node')} across the "
            f"contact zone; accepted: {ACROSS} at least, elements of at most {width / ACROSS:.2g}"
        )


def own_shape(problem: ContactProblem) -> Iterator[Remark]:
    """Warn of a curved part without a gap anywhere: its foundation has then its very shape."""
    comm, size = problem.comm, problem.domain.size
    found = []
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes = geometry.nodes
        sums = np.append(nodes.weight @ nodes.normal, nodes.weight.sum())
        total = comm.allreduce(sums, op=MPI.SUM)
        flat = np.linalg.norm(total[:-1]) > 0.995 * total[-1]
        gap = comm.allreduce(float(np.abs(nodes.gap).max(initial=0.0)), op=MPI.MAX)
        if contact.against is None and not contact.obstacle.is_shape:
            found += [contact.on] * (not flat and gap <= 1e-9 * size)
    if found:
        yield (
            f"the part {', '.join(found)} is curved and its gap is 0 everywhere: the foundation "
            "has the body's own shape, unless contact.foundation or a gap is given"
        )


def beyond_part(solution: Solution) -> Iterator[Remark]:
    """Warn of contact that goes on where its part, or the map of heights, ends. Collective."""
    problem, d = solution.problem, solution.problem.dim
    if any(isinstance(contact.foundation, Heights) for contact in problem.contacts):
        yield from without_heights(problem, _touched(solution))
    rigid = [contact for contact in problem.contacts if contact.against is None]
    facing = [(c.on, c.foundation) for c in rigid if isinstance(c.foundation, Shape)]
    if not facing or not solution.converged:
        return
    points, nodes = _beside(problem, [contact.on for contact in rigid])
    states = [record.state for record in solution.steps] or [solution.state]
    sizes = [record.row["max_displacement"] for record in solution.steps]
    largest = max(sizes or [solution.max_displacement])
    body, tiny = problem.equilibrium, NEGLIGIBLE * problem.domain.size
    for part, shape in facing:
        direction, gap = _gaps(shape, points)
        moves = body.global_unknowns.of_foundation(points, body.block_size, part)
        depth, place = -np.inf, np.zeros(d)
        for state in states:
            u = body.nodal(state.x)[nodes, :d]
            if moves is not None:
                u = u - (moves @ body.motion(state.x))[:, :d]
            within = np.einsum("nd,nd->n", direction, u) - gap
            # Nodes in the foundation in the reference configuration are left out.
            within[~(gap >= -tiny) | ~np.isfinite(within)] = -np.inf
            if within.max(initial=-np.inf) > depth:
                depth, place = float(within.max()), points[within.argmax()]
        depth, place = max(problem.comm.allgather((depth, tuple(place))))
        if depth > PASSED * largest:
            there = ", ".join(f"{x if abs(x) > tiny else 0.0:.4g}" for x in place)
            yield (
                f"beside the contact part {part!r} the body passes into the foundation, by up to "
                f"{depth:.3g} at ({there}): a larger part has other pressures"
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
    """Return directions and gaps as contact nodes have them: not finite where nothing faces."""
    # Along the body's normal, which is not known there, those to the nearest point.
    seen = shape if shape.direction == "axis" else replace(shape, direction="foundation")
    return seen.measure(points, points)


def without_heights(
    problem: ContactProblem, touched: NDArray[np.bool_] | None = None
) -> Iterator[Remark]:
    """Warn of contact parts without measured heights in front of them. Collective.

    Parameters
    ----------
    problem
        The problem.
    touched
        Nodes that are in contact in some step, shape (n,); before a solve all may be.
    """
    begin = 0
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes, shape = geometry.nodes, contact.foundation
        here = slice(begin, begin + len(nodes.weight))
        begin = here.stop
        if not isinstance(shape, Heights):
            continue
        aside = np.where(shape.direction == "foundation", 0.0, nodes.gap)
        unknown = shape.unknown(nodes.points + aside[:, None] * nodes.normal)
        seen = np.ones_like(unknown) if touched is None else touched[here]
        area = nodes.sum((unknown & seen).astype(np.float64))
        if area > 0:
            which = "" if touched is None else "that touches "
            yield (
                f"{area / nodes.sum(seen.astype(np.float64)):.1%} of the area of {contact.on} "
                f"{which}lie where its foundation has no heights ({_known(shape)}), and it is "
                "taken to go on level, or smoothly across a hole"
            )


def _known(shape: Heights) -> str:
    """Return where there are heights, in words."""
    found = []
    for name, axis, gaps in zip("xy", shape.grid[0], shape.gaps, strict=False):
        holes = [f"{begin:.4g} to {end:.4g}" for begin, end in gaps[1:-1]]
        but = f" but {' and '.join(holes)}" if holes else ""
        found.append(f"{name} from {axis[0]:.4g} to {axis[-1]:.4g}{but}")
    return ", ".join(found)


def _touched(solution: Solution) -> NDArray[np.bool_]:
    """Return which contact nodes touch at the end of any step. Collective."""
    interface, found = solution.problem.interface, solution.status != "open"
    for record in solution.steps:
        nodal = interface.nodes.apply(record.state.x)
        found = found | (interface.pressure(nodal, record.state.forces) > interface.rounding(nodal))
    return found


def coarse_curves(solution: Solution) -> Iterator[Remark]:
    """Warn of straight facets of a curved surface whose deviation decides gaps or pressures."""
    problem, nodes = solution.problem, solution.problem.nodes
    if nodes.cut > 0:
        yield (
            f"straight facets of curved contact surfaces overlap by up to {nodes.cut:.3g}, less "
            f"than they deviate from the curves: the gap there is taken as 0; accepted: {FINER}"
        )
    closed, unknown = solution.status != "open", nodes.maximum(nodes.deviation)
    if nodes.maximum(closed.astype(float)) == 0:
        least = -nodes.maximum(-problem.interface.gap, -np.inf)
        if unknown > max(DEVIATION * least, NEGLIGIBLE * problem.domain.size):
            yield (
                f"nothing touches, but straight facets deviate by up to {unknown:.3g} from a "
                f"curved contact surface, and the least gap is {least:.3g}; accepted: {FINER}"
            )
    elif problem.equilibrium.degree == 2 and problem.domain.levels == 0:
        yield from _straight_edges(solution, closed, unknown)
    else:
        size = nodes.maximum(np.where(closed, np.abs(problem.interface.gap), 0.0))
        if size > 1e-9 * problem.domain.size and unknown > DEVIATION * size:
            yield (
                f"straight facets deviate by up to {unknown:.3g} from a curved contact surface, "
                f"and contact closes gaps of at most {size:.3g}: pressures are off by about that "
                f"share; accepted: {FINER}"
            )


def _straight_edges(
    solution: Solution, closed: NDArray[np.bool_], unknown: float
) -> Iterator[Remark]:
    """Warn of straight edges of degree 2, whose gaps are those of fitted curves. Collective."""
    problem, nodes = solution.problem, solution.problem.nodes
    turn, waves, least = _of_edges(solution, closed)
    pressed, force = nodes.maximum(solution.forces.pressure), nodes.sum(solution.pressure)
    scatter = problem.scales.plane_modulus * np.pi / 4 * waves
    if least < ALIKE_NORMALS:
        yield (
            f"contact directions turn by {np.arccos(least):.2g} along a straight edge that "
            "touches: its ends count as corners, whose pressures may be many times those of a "
            f"curve; accepted: {CURVED}"
        )
    if pressed > 0 and scatter > DEVIATION * pressed:
        yield (
            f"straight edges tell a curved contact surface to about {unknown:.2g}: nodal pressures "
            f"scatter by about {scatter:.2g}, {scatter / pressed:.0%} of the largest; accepted: "
            f"{CURVED}"
        )
    elif force > 0 and turn > NEGLIGIBLE:
        mean, scatter = nodes.sum(solution.pressure**2) / force, _of_chords(solution, closed)
        if scatter > SCATTER * mean:
            yield (
                f"straight edges of a curved contact surface turn by up to {turn:.2g} where it "
                f"touches: nodal pressures scatter by about {scatter:.2g}, {scatter / mean:.0%} "
                f"of the mean; accepted: {CURVED}"
            )


def _of_edges(solution: Solution, closed: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return largest turn, waves, least cosine of directions along straight edges. Collective."""
    # Where the curvature varies the deviation of the curve from an edge of the length h is known to
    # some u: waves of this height and the length 2 h take pressures E' pi u/(4 h).
    domain, space = solution.problem.domain, solution.problem.equilibrium.space
    nodes = solution.problem.nodes
    numbers = nodes.nodes + space.dofmap.index_map.local_range[0]

    def here(asked: NDArray[np.int64]) -> Array:
        found = np.full((asked.size, domain.dim + 1), np.nan)
        _, of, at = np.intersect1d(asked, numbers, return_indices=True)
        found[of] = np.column_stack([nodes.normal, nodes.deviation])[at]
        return found

    found: Array = np.array([0.0, 0.0, -1.0])
    shapes = {c.on for c in solution.problem.contacts if isinstance(c.foundation, Shape)}
    for part, side, near in _touching(solution, closed):
        if side.follows:
            there = side.owners.values(side.nodes.ravel(), here)
            there = there.reshape(*side.nodes.shape, domain.dim + 1)[near]
            first, second = (there[:, of, :-1] for of in np.array(side.shape.edges).T)
            cosine = np.einsum("fed,fed->fe", first, second)
            waves = side.waves[near]
            if part in shapes:
                waves = np.nan_to_num(there[:, side.middles, -1]) / side.edges[near]
            most = (values.max(initial=0.0) for values in (side.turns[near], waves))
            found = np.fmax(found, [*most, np.fmax.reduce(-cosine, axis=None, initial=-1.0)])
    domain.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
    return float(found[0]), float(found[1]), float(-found[2])


def _touching(
    solution: Solution, closed: NDArray[np.bool_]
) -> Iterator[tuple[str, Surface, NDArray[np.bool_]]]:
    """Give the contact parts, and which of their facets on this rank touch. Collective."""
    problem, points = solution.problem, solution.problem.nodes.points[closed]
    for part in dict.fromkeys(p for c in problem.contacts for p in (c.on, c.against) if p):
        side = surface_of(problem.domain, problem.equilibrium.space, part)
        yield part, side, nearest(problem.comm, side.centres, points) <= side.radii


def _of_chords(solution: Solution, closed: NDArray[np.bool_]) -> float:
    """Return by how much pressures scatter by displacements of chords (stress). Collective."""
    # The middle of a straight edge of degree 2, f = h^2/(8 R) within the curve, moves by f eps_nn
    # less or more. Pressures that even this out are E' eps_nn h/R times some number: from .33
    # (rings on a rigid shaft) to .5 (rings in rings, on the finer side) on triangles, a third less
    # on quadrilaterals, whatever the stiffness of the other side. Both sides' add up; where they
    # cancel, since both move alike, edges that do not meet leave half of one.
    domain, body = solution.problem.domain, solution.problem.equilibrium
    fields = DerivedFields(body, solution.state)
    strain, d = fields.columns["strain"], domain.dim
    stresses = np.zeros((domain.mesh.topology.index_map(d).size_local, d, d))
    for material, own in enumerate(body.body.materials):
        modulus = own.law.young / (1 - own.law.poisson**2)
        for cells, values in fields.of_material(material):
            mean = values[..., strain].mean(axis=1).reshape(-1, 3, 3)
            stresses[cells] = modulus * mean[:, :d, :d]
    largest: dict[str, float] = {}
    for part, side, near in _touching(solution, closed):
        cells, _ = cells_at(domain.mesh, domain.facets(part))
        across = np.einsum("fi,fij,fj->f", side.normal, stresses[cells], side.normal)
        bends = 2 * side.deviation / side.edges  # h/R, below 0 where it is hollow
        values = (bends * across[:, None])[near].ravel()
        ends = domain.comm.allgather([values.min(initial=0.0), values.max(initial=0.0)])
        largest[part] = max(np.ravel(ends), key=abs)
    found = [0.0]
    for contact in solution.problem.contacts:
        sides = [largest[part] for part in (contact.on, contact.against) if part]
        found.append(max(abs(sum(sides)), max(map(abs, sides)) / 2))
    return CHORDS * max(found)
