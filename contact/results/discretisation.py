"""Remarks on the discretisation error: elements that lock, meshes that are too coarse, chords."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.elements import MEAN_DILATATION, unlocked
from contact.interface.mortar.search import nearest
from contact.interface.mortar.surface import Surface, surface_of
from contact.interface.obstacle import Shape
from contact.mesh.cells import shape_of
from contact.mesh.deviation import ALIKE_NORMALS
from contact.mesh.entities import cells_at
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


def locks(solution: Solution) -> bool:
    """Whether elements of degree 1 may be much too stiff, for volumes hardly change."""
    error = solution.error
    if error is None or error.stiffness_ratio is None or _remedy(solution) is None:
        return False
    return error.stiffness_ratio >= LOCKED and error.relative > EXACT


def _remedy(solution: Solution) -> str | None:
    body = solution.problem.equilibrium
    return unlocked(body.element, body.degree, shape_of(body.domain.mesh))


def locking(solution: Solution) -> Iterator[Remark]:
    """Say where the mesh may lock."""
    error = solution.error
    if error is not None and locks(solution):
        yield (
            f"the mesh may lock: the ratio of bulk and shear modulus, of crystals and fibres of "
            f"the stiffest strain and the others, is {error.stiffness_ratio:.3g} where the energy "
            f"is, and from {LOCKED:g} on elements of degree 1 can be much too stiff: displacements "
            "may be too small, and the estimated error a lower bound; "
            f"{_remedy(solution)}"
        )


def large_error(solution: Solution) -> Iterator[Remark]:
    """Say where the estimated error is large, as where slender parts bend."""
    error = solution.error
    if error is not None and error.relative > COARSE and not locks(solution):
        # The mean dilatation is no bound from below: it may be too soft as well.
        body = solution.problem.equilibrium
        mean = body.element == MEAN_DILATATION
        yield (
            f"the mesh is too coarse: the estimated discretisation error is "
            f"{error.relative:.1%} (energy norm), and "
            f"{'displacements are off' if mean else 'the body is too stiff'} by about "
            f"{error.relative**2:.1%}, more where slender parts bend; "
            f"a finer mesh{'' if body.degree == 2 else ', or space.degree = 2,'} has less of it"
        )


def coarse_curves(solution: Solution) -> Iterator[Remark]:
    """Say where straight facets of a curved surface lie in the foundation, or decide the gap."""
    problem, nodes = solution.problem, solution.problem.nodes
    if nodes.cut > 0:
        yield (
            f"straight facets of curved contact surfaces overlap by up to {nodes.cut:.3g}, less than "
            "they deviate from the curves: the gap there is taken as 0; make the mesh finer from the "
            "beginning, or take curved cells (mesh.order = 2)"
        )
    closed, unknown = solution.status != "open", nodes.maximum(nodes.deviation)
    if nodes.maximum(closed.astype(float)) == 0:
        least = -nodes.maximum(-nodes.gap, -np.inf)
        rounding = NEGLIGIBLE * problem.domain.size
        if unknown > max(DEVIATION * least, rounding):
            yield (
                f"nothing touches, but straight facets deviate by up to {unknown:.3g} from "
                f"a curved contact surface, and the least gap is {least:.3g}; make the mesh finer "
                "from the beginning, or take space.degree = 2"
            )
        return
    size = nodes.maximum(np.where(closed, np.abs(nodes.gap), 0.0))
    if problem.equilibrium.degree == 2 and problem.domain.levels == 0:
        turn, waves, least = _of_edges(solution, closed)
        pressed = nodes.maximum(solution.forces.pressure)
        scatter = problem.scales.plane_modulus * np.pi / 4 * waves
        if least < ALIKE_NORMALS:
            yield (
                f"contact directions turn by {np.arccos(least):.2g} along a straight edge that "
                "touches: its ends count as corners, and pressures may be many times those of a "
                "curve; take more edges, or curved cells (mesh.order = 2)"
            )
        if pressed > 0 and scatter > DEVIATION * pressed:
            yield (
                f"straight edges tell a curved contact surface to about {unknown:.2g}, and "
                f"nodal pressures scatter by about {scatter:.2g}, {scatter / pressed:.0%} of the "
                "largest; take curved cells (mesh.order = 2), or a finer mesh"
            )
            return
        force = nodes.sum(solution.pressure)
        if force <= 0 or turn <= NEGLIGIBLE:
            return
        mean, scatter = nodes.sum(solution.pressure**2) / force, _of_chords(solution, closed)
        if scatter > SCATTER * mean:
            yield (
                f"straight edges of a curved contact surface turn by up to {turn:.2g} where it "
                "touches, and displacements are those of their chords: nodal pressures scatter by "
                f"about {scatter:.2g}, {scatter / mean:.0%} of the mean; take curved cells "
                "(mesh.order = 2), or a finer mesh"
            )
    elif size > 1e-9 * problem.domain.size and unknown > DEVIATION * size:
        yield (
            f"straight facets deviate by up to {unknown:.3g} from a curved contact "
            f"surface, and contact closes gaps of at most {size:.3g}: pressures are off by about "
            "that share; make the mesh finer from the beginning, or take space.degree = 2"
        )


def _of_edges(solution: Solution, closed: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Return the largest turn and waves of straight edges of degree 2 that touch. Collective.

    Beside them, the least cosine between contact directions at the ends of an edge.

    Where the curvature varies the deviation of the curve from an edge of the length h is known to
    some u: waves of this height and the length 2 h take pressures E' pi u/(4 h).

    Parameters
    ----------
    solution, closed
        The solution, and which contact nodes of this rank touch, shape (n,).
    """
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
    """Return by how much pressures scatter by displacements of chords (stress). Collective.

    The middle of a straight edge of degree 2, f = h^2/(8 R) within the curve, moves by f eps_nn
    less or more. Pressures that even this out are E' eps_nn h/R times some number: from .33 (rings
    on a rigid shaft) to .5 (rings in rings, on the finer side) on triangles, a third less on
    quadrilaterals, whatever the stiffness of the other side. Both sides' add up; where they cancel,
    since both move alike, edges that do not meet leave half of one.

    Parameters
    ----------
    solution, closed
        The solution, and which contact nodes of this rank touch, shape (n,).
    """
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
