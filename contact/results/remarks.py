"""Remarks on a solution: reasons to trust its numbers less.

Each is one sentence with an identifier, whose entry in docs/troubleshooting.md has the details.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.elements import unlocked
from contact.errors import counted
from contact.interface.mortar.search import nearest
from contact.interface.mortar.surface import surface_of
from contact.mesh.cells import shape_of
from contact.mesh.deviation import ALIKE_NORMALS
from contact.mesh.entities import cells_at, exterior_facets
from contact.mesh.geometry import areas, volumes
from contact.model.obstacle import Heights, Shape
from contact.problem.checks import meeting_supports
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_as_pressures, residual_forces
from contact.problem.state import State
from contact.results import bodies
from contact.results.error_estimate import estimated
from contact.results.fields import DerivedFields, deformation, unloaded
from contact.results.solution import Note, Remark, Results
from contact.tolerances import EPS, NEGLIGIBLE, TOUCHING
from contact.typing import Array
from forms.j2 import J2
from forms.monotonicity import check_monotonicity
from forms.plane_stress import base_of, hencky_of

logger = logging.getLogger("contact.solve")

#: Relative difference of a material's g(0) from mu_1 that is warned of.
MODULUS_OFF = 0.01

#: Relative force imbalance that is warned of: displacements by these loads are about as far off.
IMBALANCE = 1e-6

#: Largest |eps| of linear kinematics: its square is then 1 % of it.
SMALL = 0.1

#: Relative rounding of contact forces that is warned of.
KNOWN = 1e-3

#: Ratio of bulk to shear modulus, of nu = 0.475, from which on elements of degree 1 lock.
LOCKED = 20.0

#: Estimated error below which no mesh locks: there the solution is one that these elements have.
EXACT = 5e-3

#: Largest estimated error without a warning: its square is that of the elastic energy.
COARSE = 0.15

#: Largest deviation of facets from a curved surface, as a share of the gaps that are closed, or of
#: the pressure by it, as a share of the largest.
DEVIATION = 0.1

#: Strain, or pressure, by an overlap that is taken as 0, over the largest one there, that is warned
#: of; and strain where no solution is known.
DROPPED, STRAINED = 0.01, 1e-4

#: Largest turn h/R of a straight edge of degree 2 without a warning.
TURN = 0.05

#: Least number of nodes across a contact zone.
ACROSS = 5

#: Penetration of the boundary beside a contact part, over the largest displacement.
PASSED = 0.01

#: Remedies of straight facets of a curved surface.
FINER = "a finer mesh from the beginning, or space.degree = 2"
CURVED = "a finer mesh, or curved cells (mesh.order = 2)"


def announce(solution: Results) -> None:
    """Review a solution, and log the warnings. Collective."""
    review(solution)
    if solution.problem.comm.rank == 0:
        for warning in solution.warnings:
            logger.warning(warning)


def evaluate_extremes(solution: Results, whole: bool = True) -> list[float]:
    """Give a solution its extremes, if `whole` its error too; return |dev eps| by material."""
    body = solution.problem.body
    fields = DerivedFields(body, solution.state)
    extremes = fields.extremes()
    strains = [largest.strain for largest in extremes]
    solution.max_dev_strain = max(strains)
    solution.max_von_mises = max(largest.von_mises for largest in extremes)
    yielded = [largest.yielded for largest in extremes if largest.yielded is not None]
    if yielded:
        solution.plastic_share = sum(yielded) / sum(largest.volume for largest in extremes)
    plastic = [largest for largest in extremes if largest.plastic is not None]
    if plastic:
        solution.equivalent_plastic_strain = max(largest.plastic or 0.0 for largest in plastic)
        solution.plastic_volume = sum(largest.yielded or 0.0 for largest in plastic)
    if whole:
        solution.deformation = deformation(body, solution.state)
        if not solution.converged:
            solution.error = None  # it estimates the distance of the mesh's solution alone
        elif solution.error is None:
            solution.error = estimated(solution.problem, solution.state, fields)
    return strains


def review(solution: Results) -> None:
    """Add all remarks to the notes and warnings of a solution. Collective."""
    strains, problem = evaluate_extremes(solution), solution.problem
    times = [record.state.time for record in solution.steps] or [problem.time]
    for identifier, remarks in {
        "unloading": unloading(solution),
        "material": monotonicity(solution, strains),
        "small-strain": small_strain(solution),
        "curved-surface": chain(coarse_curves(solution), own_shape(problem)),
        "part-end": beyond_part(solution),
        "locking": locking(solution),
        "discretisation-error": large_error(solution),
        "no-contact": untouched(solution),
        "resolution": chain(resolution(solution), charge_resolution(solution)),
        "rounding": rounding(solution),
        "several-solutions": several_solutions(solution),
        "overlap": bodies.overlapping(problem),
        "two-bodies": chain(bodies.sides(solution), bodies.apart(problem)),
        "supports": meeting_supports(problem, times),
        "unresisted-motion": bodies.unresisted_motions(solution),
        "not-held": bodies.not_held(solution),
        "limit-load": limit_load(solution),
    }.items():
        for text in remarks:
            listed = solution.notes if isinstance(text, Note) else solution.warnings
            listed.append(f"{text} [{identifier}]")


def unloading(solution: Results) -> Iterator[Remark]:
    """Warn of Hencky's materials that have unloaded from the plastic range in a step."""
    share = unloaded(solution.problem, [record.state for record in solution.steps])
    if share > 0:
        yield (
            f"{share:.1%} of the body unload from the plastic range, along the loading path, for "
            'Hencky\'s law is nonlinear elasticity; material.law = "j2" keeps a plastic strain'
        )


def monotonicity(solution: Results, strains: Sequence[float]) -> Iterator[Remark]:
    """Tell of strong monotonicity, (h1), on the strains in Hencky's materials, and of g(0)."""
    domain = solution.problem.domain
    whole = 3 if domain.revolved else domain.dim
    for material, strain in zip(solution.problem.description.materials, strains, strict=True):
        law = hencky_of(material.law)
        if law is None or not np.isfinite(strain):
            continue
        dim = 3 if material.in_plane_stress else whole
        found = check_monotonicity(law, strain, dim=dim)
        constants = (
            f"up to |dev eps| = {strain:.4g} g_0 = {found.g_0:.4g} <= g <= {found.largest:.4g}, "
            f"(d/2) k_0 = {found.ceiling:.4g}, alpha = {found.alpha:.4g}, beta = {found.beta:.4g}"
            + (", times the material's factor" if material.factor is not None else "")
        )
        if found.hardens and found.g_0 > 0:  # where g is above (d/2) k_0 alone it is monotone too
            yield Note(f"strong monotonicity is {'met' if found.holds else 'not met'}: {constants}")
        else:
            yield f"the material softens, there may be several solutions or none: {constants}"
        modulus, shear = np.ravel(law.secant_modulus(np.zeros(1)))[0], float(law.shear)
        if abs(modulus - shear) > MODULUS_OFF * abs(shear):
            yield (
                f"the secant modulus is {modulus:.4g} without strain, and Young's modulus and "
                f"Poisson's ratio say mu_1 = {shear:.4g}"
            )


def small_strain(solution: Results) -> Iterator[Remark]:
    """Warn of strains or rotations that are not small."""
    made = solution.deformation
    if made is None:
        return
    # To turn by an angle a makes the determinant 1 + a^2, strains at most 1 + sqrt(3) |eps|; the
    # last iterate of a body that nothing holds turns by any angle.
    turned = made.largest_volume - 1 - np.sqrt(3) * made.largest_strain
    if made.largest_strain > SMALL or (solution.converged and turned > SMALL):
        yield (
            "strains or rotations are not small, and kinematics is linear: |eps| reaches "
            f"{made.largest_strain:.3g}, and det(I + grad u) lies between "
            f"{made.least_volume:.3g} and {made.largest_volume:.3g}"
        )


def untouched(solution: Results) -> Iterator[Remark]:
    """Warn of a static problem in which no node is in contact; a load step may end like that."""
    problem = solution.problem
    closed = problem.comm.allreduce(bool(np.any(solution.status != "open")), op=MPI.LOR)
    met = closed or any(record.row["contact_nodes"] > 0 for record in solution.steps)
    # A method that fails may have left the body anywhere.
    if solution.converged and not met and problem.since is None:
        yield (
            "nothing touches: the loads open the contact, or the foundation is too far away, or "
            "narrower than the elements there"
        )


def rounding(solution: Results) -> Iterator[Remark]:
    """Warn of forces that are small beside those in the bodies, and hardly known. Collective."""
    problem, state, outcome = solution.problem, solution.state, solution.outcome
    body, asked, larger = problem.body, outcome.allowed.equilibrium, "far larger forces act"
    if solution.equilibrium_rounding > asked:
        known = f"to {solution.equilibrium_rounding:.1e}"
        yield f"rounding decides how well the forces balance, {known}: {larger}"
    if not solution.converged:
        return
    residual, loads = residual_forces(problem, state), body.load_norms(state.time)
    uncertainty = max(
        outcome.residuals.pressure_rounding, residual_as_pressures(problem, state, residual)
    )
    moved = bool(problem.comm.allreduce(bool(np.any(problem.start().x)), op=MPI.LOR))
    if uncertainty > KNOWN and (moved or loads[0].max() > 0):
        yield f"contact forces are known to {uncertainty:.1e} of their size only: {larger}"
    on_contact = np.zeros_like(residual)
    problem.interface.add_forces(on_contact, state.x, state.multipliers)
    acting = (loads + body.norms(on_contact))[0]
    left = body.norms(body.unbalanced(residual))[0]
    borne = body.norms(body.reactions(residual))[0]
    # Where supports bear no more than the loads, the residual is rounding; so are all forces on a
    # body that are rounding of those on others.
    much = (acting > EPS * acting.max()) & (left > max(IMBALANCE, asked) * acting)
    much &= borne > acting
    if not moved and much.any():
        worst = np.max(left[much] / acting[much])
        yield f"{worst:.1e} of loads and contact forces are out of balance: {larger}"


def limit_load(solution: Results) -> Iterator[Remark]:
    """Tell that a body without hardening has a limit load, where a method fails."""
    laws = [base_of(material.law) for material in solution.problem.description.materials]
    flows = [law for law in laws if isinstance(law, J2) and not law.kinematic]
    perfect = any(law.strength(np.ones(1)) == law.yield_stress for law in flows)
    if perfect and not solution.converged:
        yield (
            'a material with law = "j2" has no hardening, and the loads may be more than the limit '
            "load; accepted: smaller loads, or material.hardening"
        )


def several_solutions(solution: Results) -> Iterator[Remark]:
    """Warn where several solutions may exist. Collective."""
    reasons = falling_friction, strong_friction, falling_layer
    words = f"several solutions may exist, and this is one reached from {solution.start}"
    for reason in chain.from_iterable(find(solution) for find in reasons):
        yield f"{words}: {reason}"


def falling_friction(solution: Results) -> Iterator[str]:
    """Find an L_mu above the bound of a sliding block."""
    # Of height H and under the pressure p it slides by s, G (U - s)/H = mu(s) p, which is unique
    # for every U if L_mu < G/(p H). An uneven pressure counts by its own weight, and half of G.
    problem, law = solution.problem, solution.problem.interface.friction.law
    if law is None:
        return
    nodes, pressure = problem.nodes, solution.pressure
    own = (law.maximum, law.lipschitz) if nodes.nodes.size else (0.0, 0.0)
    maximum, lipschitz = (problem.comm.allreduce(value, op=MPI.MAX) for value in own)
    if lipschitz == 0 or not np.isfinite(maximum):  # constant, or Tresca's
        return
    total = nodes.sum(pressure)
    mean = nodes.sum(pressure**2) / total if total > 0 else 0.0
    if mean <= 0:
        return
    bound = 0.5 * problem.scales.shear / (mean * problem.scales.height)
    if lipschitz >= bound:
        yield (
            f"friction falls with the slip by up to L_mu = {lipschitz:.4g}/length, and a sliding "
            f"block under the pressure {mean:.4g} has one solution where L_mu < {bound:.4g}/length"
        )


def strong_friction(solution: Results) -> Iterator[str]:
    """Find friction that suffices for several solutions, see `contact.results.uniqueness`."""
    law, nodes = solution.problem.interface.friction.law, solution.problem.nodes
    if solution.jammed:
        yield (
            "friction alone keeps the bodies in contact, which without any contact force are in "
            "balance where they do not meet"
        )
    elif solution.critical_factor <= 1:
        # mu = s/p at the present slip, of which the factor is.
        pressure = np.maximum(solution.pressure, np.finfo(float).tiny)
        mu = nodes.maximum(np.where(solution.pressure > 0, solution.friction_bound / pressure, 0.0))
        if mu == 0:  # nothing touches
            own = law.maximum if law is not None and nodes.nodes.size else 0.0
            mu = solution.problem.comm.allreduce(own, op=MPI.MAX)
        critical = solution.critical_factor * mu
        yield f"the linearised problem is singular from a friction coefficient of {critical:.4g} on"


def falling_layer(solution: Results) -> Iterator[str]:
    """Find a layer whose p_nu falls: (h~6) of chapter 6 asks for less."""
    problem = solution.problem
    layers = (contact.compliant_layer for contact in problem.contacts)
    if any(layer is not None and layer.falls(problem.domain.size) for layer in layers):
        yield "p_nu falls with the penetration of the layer"


def locks(solution: Results) -> str | None:
    """Return the remedy of elements that may be much too stiff, for volumes hardly change."""
    error, body = solution.error, solution.problem.body
    stiff = error is not None and (error.stiffness_ratio or 0.0) >= LOCKED
    if error is None or not stiff or error.relative <= EXACT:
        return None
    return unlocked(body.element, body.degree, shape_of(body.domain.mesh))


def locking(solution: Results) -> Iterator[Remark]:
    """Warn of volumetric locking, or that of stiff fibres."""
    error, remedy = solution.error, locks(solution)
    if error is not None and remedy is not None:
        yield (
            f"the mesh may lock, displacements may be too small, and the estimated error a lower "
            f"bound: the ratio of bulk and shear modulus is {error.stiffness_ratio:.3g} where the "
            f"energy is; {remedy}"
        )


def large_error(solution: Results) -> Iterator[Remark]:
    """Warn of an estimated error that is large."""
    error = solution.error
    if error is not None and error.relative > COARSE and not locks(solution):
        # Where one cell of degree 1 is the thickness, the estimate is half of the error.
        bending = ", more where slender parts bend" if solution.problem.body.degree == 1 else ""
        yield (
            "the mesh is too coarse: the estimated discretisation error is "
            f"{error.relative:.1%} (energy norm), that of the elastic energy about "
            f"{error.relative**2:.1%}{bending}"
        )


def resolution(solution: Results) -> Iterator[Remark]:
    """Warn of less than `ACROSS` nodes across a contact zone that ends within the contact part."""
    problem, nodes = solution.problem, solution.problem.nodes
    closed = solution.status != "open"
    count = int(nodes.comm.allreduce(int(np.count_nonzero(closed)), op=MPI.SUM))
    if count == 0 or count == nodes.size:
        return
    across, width = float(count), solution.contact_area
    if problem.dim == 3 or problem.domain.revolved:  # of a round zone, not a ring
        width = float(2 * np.sqrt(width / np.pi))
    if problem.dim == 3:
        across = float(np.sqrt(4 * count / np.pi))
    elif problem.domain.revolved:  # both halves
        nearest_axis = float(nodes.points[closed, 0].min(initial=np.inf))
        on_axis = nodes.comm.allreduce(nearest_axis, op=MPI.MIN) < 1e-9 * problem.domain.size
        across = 2 * count - on_axis
    if across < ACROSS:
        yield (
            f"the mesh is too coarse for the pressures: {counted(across, 'node')} across the "
            f"contact zone; accepted: {ACROSS} at least, elements of at most {width / ACROSS:.2g}"
        )


def charge_resolution(solution: Results) -> Iterator[Remark]:
    """Warn of a charge that rises in front of the closed gap within less than two elements."""
    problem, width = solution.problem, solution.conduction_ramp
    conductor, spacing = problem.interface.foundation.conductor, problem.scales.spacing
    if width is None or conductor is None or conductor.psi.k_e == 0 or not problem.piezoelectric:
        return
    if width < 2 * spacing:
        yield (
            "the mesh decides which contact nodes conduct: the charge rises within 1/delta = "
            f"{width:.3g} of the gap, less than two elements ({2 * spacing:.3g})"
        )


def own_shape(problem: ContactProblem) -> Iterator[Remark]:
    """Warn of a part that is not flat, without any gap: its foundation has then its very shape."""
    comm, size = problem.comm, problem.domain.size
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes = geometry.nodes
        sums = np.append(nodes.weight @ nodes.normal, nodes.weight.sum())
        total = comm.allreduce(sums, op=MPI.SUM)
        flat = np.linalg.norm(total[:-1]) > 0.995 * total[-1]
        gap = comm.allreduce(float(np.abs(nodes.gap).max(initial=0.0)), op=MPI.MAX)
        rigid = contact.against is None and not contact.obstacle.is_shape
        if rigid and not flat and gap <= 1e-9 * size:
            yield (
                f"the part {contact.on} is not flat and its gap is 0 everywhere: the foundation "
                "has the body's own shape, unless contact.foundation or a gap is given"
            )


def beyond_part(solution: Results) -> Iterator[Remark]:
    """Warn of contact that goes on where its part, or the map of heights, ends. Collective."""
    problem, d = solution.problem, solution.problem.dim
    if any(isinstance(contact.foundation, Heights) for contact in problem.contacts):
        yield from beyond_heights(problem, solution.status != "open")
    rigid = [contact for contact in problem.contacts if contact.against is None]
    facing = [(c.on, c.foundation) for c in rigid if isinstance(c.foundation, Shape)]
    if not facing or not solution.converged:
        return
    points, nodes = _beside(problem, [contact.on for contact in rigid])
    states = [record.state for record in solution.steps] or [solution.state]
    sizes = [record.row["max_displacement"] for record in solution.steps]
    largest = max(sizes or [solution.max_displacement])
    body, tiny = problem.body, NEGLIGIBLE * problem.domain.size
    for part, shape in facing:
        # Along the body's normal, which is not known there, those to the nearest point.
        seen = shape if shape.direction == "axis" else replace(shape, direction="foundation")
        with np.errstate(all="ignore"):  # not finite where nothing faces
            direction, gap = seen.measure(points, points)
        moves = body.global_unknowns.of_foundation(points, body.block_size, part)
        depth = -np.inf
        for state in states:
            u = body.nodal(state.x)[nodes, :d]
            if moves is not None:
                u = u - (moves @ body.motion(state.x))[:, :d]
            within = np.einsum("nd,nd->n", direction, u) - gap
            # Nodes in the foundation in the reference configuration are left out.
            within = within[(gap >= -tiny) & np.isfinite(within)]
            depth = max(depth, float(within.max(initial=-np.inf)))
        depth = problem.comm.allreduce(depth, op=MPI.MAX)
        if depth > PASSED * largest:
            yield (
                f"beside the contact part {part!r} the body passes into the foundation, by up to "
                f"{depth:.3g}: a larger part has other pressures"
            )


def _beside(problem: ContactProblem, parts: list[str]) -> tuple[Array, NDArray[np.int32]]:
    """Return the owned nodes of the boundary beside some parts, and their points. Collective."""
    domain, space = problem.domain, problem.body.space
    taken = np.concatenate([domain.facets(part) for part in parts])
    rest = np.setdiff1d(exterior_facets(domain.mesh), taken).astype(np.int32)
    found, own = (fem.locate_dofs_topological(space, domain.dim - 1, f) for f in (rest, taken))
    nodes = np.setdiff1d(found, own).astype(np.int32)
    nodes = nodes[nodes < space.dofmap.index_map.size_local]
    return space.tabulate_dof_coordinates()[nodes, : domain.dim], nodes


def beyond_heights(problem: ContactProblem, touched: NDArray[np.bool_]) -> Iterator[Remark]:
    """Warn of nodes in contact, touched (n,), beyond the last of measured heights. Collective."""
    begin = 0
    for contact, geometry in zip(problem.contacts, problem.geometries, strict=True):
        nodes, shape = geometry.nodes, contact.foundation
        seen = touched[begin : begin + len(nodes.weight)]
        begin += len(nodes.weight)
        if isinstance(shape, Heights):
            area = nodes.sum(seen.astype(np.float64))
            beyond = nodes.sum((shape.beyond(nodes.points) & seen).astype(np.float64))
            if beyond > 0:
                yield (
                    f"{beyond / area:.1%} of the area of {contact.on} lie beyond the last place of "
                    "the heights of its foundation, which goes on level there"
                )


def coarse_curves(solution: Results) -> Iterator[Remark]:
    """Warn of straight facets of a curved surface whose deviation decides gaps or pressures."""
    problem, nodes = solution.problem, solution.problem.nodes
    yield from rounded_overlaps(problem, solution.state)
    closed, uncertainty = solution.status != "open", nodes.maximum(nodes.deviation)
    if nodes.maximum(closed.astype(float)) == 0:
        least = -nodes.maximum(-problem.interface.gap, -np.inf)
        if uncertainty > max(DEVIATION * least, NEGLIGIBLE * problem.domain.size):
            yield (
                f"nothing touches, but straight facets deviate by up to {uncertainty:.3g} from a "
                f"curved contact surface, and the least gap is {least:.3g}; accepted: {FINER}"
            )
    elif problem.body.degree == 2 and problem.domain.levels == 0:
        yield from _straight_edges(solution, closed)
    else:
        for number, contact in enumerate(problem.contacts):
            own = problem.entry_numbers == number
            size = nodes.maximum(np.where(own & closed, np.abs(problem.interface.gap), 0.0))
            off = nodes.maximum(np.where(own, nodes.deviation, 0.0))
            if size > 1e-9 * problem.domain.size and off > DEVIATION * size:
                yield (
                    f"straight facets deviate by up to {off:.3g} from a curved contact surface, "
                    f"and contact of {contact.on} closes gaps of at most {size:.3g}; "
                    f"accepted: {FINER}"
                )


def rounded_overlaps(problem: ContactProblem, state: State | None = None) -> Iterator[Remark]:
    """Warn of overlaps that are taken as 0, but would strain cells at the contact. Collective.

    Their strain, and the pressure by that and the modulus at the contact, are compared with the
    largest ones there, where a state is known.
    """
    body, domain, comm = problem.body, problem.domain, problem.comm
    factor = 1 if not shape_of(domain.mesh).simplex else domain.dim
    for number, parts in enumerate(problem.sides):
        cut = problem.geometries[number].cut
        if cut <= EPS * domain.size:
            continue
        facets = np.unique(np.concatenate([domain.facets(part) for part in parts]))
        cells = cells_at(domain.mesh, facets)[0]
        heights = factor * volumes(domain)[cells] / areas(domain, facets)
        sides = [surface_of(domain, body.space, part).edges.ravel() for part in parts]
        least = min(x.min(initial=np.inf) for x in (heights, *sides))
        strain = cut / comm.allreduce(float(least), op=MPI.MIN)
        told = strain > (STRAINED if state is None else TOUCHING)
        if told and state is not None:
            own = np.where(problem.entry_numbers == number, state.multipliers.contact, 0.0)
            fields = DerivedFields(body, state)
            eps = np.linalg.norm(fields.cell_means()[cells, fields.columns["strain"]], axis=1)
            strained = comm.allreduce(float(eps.max(initial=0.0)), op=MPI.MAX)
            pressed = problem.nodes.maximum(own) / problem.contact_youngs[number]
            told = strain > DROPPED * min(strained, pressed)
        if told:
            yield (
                f"contact surfaces overlap by up to {cut:.3g} at {parts[0]}, as facets of curves "
                "or rounded positions do, and are taken to touch there; accepted: of curves "
                f'{FINER}, of an interference overlap = "press"'
            )


def _straight_edges(solution: Results, closed: NDArray[np.bool_]) -> Iterator[Remark]:
    """Warn of straight edges of degree 2, whose gaps are those of fitted curves. Collective.

    The pressure that flattens waves of the height u and the length 2 h is pi E' u/(4 h) (Johnson,
    Contact Mechanics, 1985, section 13.2): u is the unknown part of the gaps, h the length of an
    edge, twice the spacing of the nodes. Displacements are those of chords, and leave pressures a
    relative error of about h/R (docs/discretisation.md).
    """
    problem, nodes = solution.problem, solution.problem.nodes
    turn, pressed = _turn(solution, closed), nodes.maximum(solution.multipliers.contact)
    unknown = nodes.maximum(np.where(closed, nodes.deviation, 0.0))
    waves = np.pi * problem.scales.plane_modulus * unknown / (8 * problem.scales.spacing)
    if pressed > 0 and waves > DEVIATION * pressed:
        yield (
            "straight edges tell too little of a curved contact surface: nodal pressures scatter "
            f"by about {waves / pressed:.0%} of the largest; accepted: {CURVED}"
        )
    elif turn > TURN:
        yield (
            f"straight edges of a curved contact surface turn by up to {turn:.2g} where it "
            f"touches: pressures of single nodes may be off by this share; accepted: {CURVED}"
        )


def _turn(solution: Results, closed: NDArray[np.bool_]) -> float:
    """Return h/R of straight edges that touch, or of contact directions at corners. Collective."""
    problem, domain = solution.problem, solution.problem.domain
    nodes, space = problem.nodes, problem.body.space
    numbers, found = nodes.nodes + space.dofmap.index_map.local_range[0], 0.0

    def here(asked: NDArray[np.int64]) -> Array:
        normals = np.full((asked.size, domain.dim), np.nan)
        _, of, at = np.intersect1d(asked, numbers, return_indices=True)
        normals[of] = nodes.normal[at]
        return normals

    for part in dict.fromkeys(p for c in problem.contacts for p in (c.on, c.against) if p):
        side = surface_of(domain, space, part)
        near = nearest(problem.comm, side.centres, nodes.points[closed]) <= side.radii
        if side.follows:
            normals = side.owners.values(side.nodes.ravel(), here)
            normals = normals.reshape(*side.nodes.shape, domain.dim)
            first, second = (normals[near][:, of] for of in np.array(side.shape.edges).T)
            cosine = np.einsum("fed,fed->fe", first, second)
            angle = np.arccos(cosine[cosine < ALIKE_NORMALS])
            found = max(found, side.turns[near].max(initial=0.0), angle.max(initial=0.0))
    return float(problem.comm.allreduce(found, op=MPI.MAX))
