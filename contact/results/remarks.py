"""Remarks on a solution: reasons to trust its numbers less.

Each is one sentence with an identifier, whose entry in docs/troubleshooting.md has the details.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np
from mpi4py import MPI

from contact.model.foundation import Conductor
from contact.problem.checks import meeting_supports
from contact.problem.residuals import residual_as_pressures, residual_forces
from contact.problem.rigid_modes import constrained_by_supports
from contact.results import bodies, discretisation
from contact.results.error_estimate import estimated
from contact.results.fields import DerivedFields, deformation, unloaded
from contact.results.solution import Note, Remark, Solution
from contact.tolerances import EPS, LARGEST_VIOLATION
from forms.elasticity import Anisotropic
from forms.history import HistoryLaw
from forms.laws import PerfectConductivity, RampConductivity
from forms.monotonicity import check_monotonicity

logger = logging.getLogger("contact.solve")

#: Relative difference of a material's g(0) from mu_1 that is warned of.
MODULUS_OFF = 0.01

#: Relative force imbalance that is warned of: displacements by these loads are about as far off.
IMBALANCE = 1e-6

#: Largest |eps| of linear kinematics: its square is then 1 % of it.
SMALL = 0.1

#: Relative rounding of contact forces that is warned of.
KNOWN = 1e-3

#: Share of the friction bound up to which a node sticks: the penalised bound is reached slowly.
STICKS = 0.9


def announce(solution: Solution) -> None:
    """Review a solution, and log the warnings. Collective."""
    review(solution)
    if solution.problem.comm.rank == 0:
        for warning in solution.warnings:
            logger.warning(warning)


def evaluate_extremes(solution: Solution, whole: bool = True) -> list[float]:
    """Give a solution its extremes of stress and strain, and return |dev eps| by material.

    Collective.

    Parameters
    ----------
    solution
        The solution.
    whole
        Whether it is given deformation and error estimate too.
    """
    body = solution.problem.equilibrium
    fields = DerivedFields(body, solution.state)
    extremes = fields.extremes()
    strains = [largest.strain for largest in extremes]
    solution.max_dev_strain = max(strains)
    solution.max_von_mises = max(largest.von_mises for largest in extremes)
    yielded = [largest.yielded for largest in extremes if largest.yielded is not None]
    if yielded:
        solution.plastic_share = sum(yielded) / sum(largest.volume for largest in extremes)
    plastic = [largest.plastic for largest in extremes if largest.plastic is not None]
    if plastic:
        solution.equivalent_plastic_strain = max(plastic)
        solution.plastic_volume = sum(
            e.yielded for e in extremes if e.plastic is not None and e.yielded is not None
        )
    if whole:
        solution.deformation = deformation(body, solution.state.x)
        if not solution.converged:
            solution.error = None  # it estimates the distance of the mesh's solution alone
        elif solution.error is None:
            solution.error = estimated(solution.problem, solution.state, fields)
    return strains


def review(solution: Solution) -> None:
    """Add all remarks to the notes and warnings of a solution. Collective."""
    strains, problem = evaluate_extremes(solution), solution.problem
    times = [record.state.time for record in solution.steps] or [problem.time]
    for identifier, remarks in {
        "unloading": unloading(solution),
        "material": monotonicity(solution, strains),
        "small-strain": small_strain(solution),
        "curved-surface": discretisation.coarse_curves(solution),
        "own-shape": discretisation.own_shape(problem),
        "part-end": discretisation.beyond_part(solution),
        "locking": discretisation.locking(solution),
        "discretisation-error": discretisation.large_error(solution),
        "no-contact": untouched(solution),
        "pressure-resolution": discretisation.resolution(solution),
        "rounding": rounding(solution),
        "layer": layers(solution),
        "strong-friction": chain(falling_friction(solution), strong_friction(solution)),
        "conductivity": conductivity(solution),
        "two-bodies": chain(bodies.sides(solution), bodies.apart(problem)),
        "meeting-supports": chain(meeting_supports(problem, times), bodies.held_along(solution)),
        "unresisted-motion": bodies.unresisted_motions(solution),
        "not-held": bodies.not_held(solution),
        "penalty": giving_way(solution),
    }.items():
        for text in remarks:
            listed = solution.notes if isinstance(text, Note) else solution.warnings
            listed.append(f"{text} [{identifier}]")


def unloading(solution: Solution) -> Iterator[Remark]:
    """Warn of Hencky's materials that have unloaded from the plastic range in a step."""
    share = unloaded(solution.problem, [record.state for record in solution.steps])
    if share > 0:
        yield (
            f"{share:.1%} of the body unload from the plastic range, along the loading path, for "
            'Hencky\'s law is nonlinear elasticity; material.law = "j2" keeps a plastic strain'
        )


def monotonicity(solution: Solution, strains: Sequence[float]) -> Iterator[Remark]:
    """Tell of strong monotonicity, (h1), on the strains in Hencky's materials, and of g(0)."""
    dim = 3 if solution.problem.domain.revolved else solution.problem.dim
    for material, strain in zip(solution.problem.body.materials, strains, strict=True):
        law, place = material.law, f" in {', '.join(material.on)}" if material.on else ""
        if not np.isfinite(strain) or isinstance(law, Anisotropic | HistoryLaw):
            continue
        found = check_monotonicity(law, strain, dim=dim)
        text = (
            f"strong monotonicity is {'met' if found.holds else 'not met'} on the strains of this "
            f"solution{place}, |dev eps| <= {strain:.4g}: g_0 = {found.g_0:.4g} <= g <= "
            f"{found.largest:.4g}, (d/2) k_0 = {found.ceiling:.4g}, alpha = {found.alpha:.4g}, "
            f"beta = {found.beta:.4g}"
        )
        if found.hardens and found.g_0 > 0:  # where g is above (d/2) k_0 alone it is monotone too
            yield Note(text)
        else:
            yield f"the material softens, there may be several solutions or none: {text}"
        modulus, shear = np.ravel(law.secant_modulus(np.zeros(1)))[0], float(law.shear)
        if abs(modulus - shear) > MODULUS_OFF * abs(shear):
            yield (
                f"the secant modulus{place} is {modulus:.4g} without strain, and Young's modulus "
                f"and Poisson's ratio say mu_1 = {shear:.4g}: the deviator follows the first"
            )


def small_strain(solution: Solution) -> Iterator[Remark]:
    """Warn of strains or rotations that are not small, or a deformed body that turns inside out.

    To turn by an angle a makes the determinant 1 + a^2, and strains at most 1 + sqrt(3) |eps|.
    """
    made = solution.deformation
    if made is None:
        return
    turned = made.largest_volume - 1 - np.sqrt(3) * made.largest_strain
    if max(made.largest_strain, turned) > SMALL:
        which = "strains" if made.largest_strain > SMALL else "rotations"
        inside_out = made.least_volume <= 0
        yield (
            f"{which} are not small, and kinematics is linear: |eps| reaches "
            f"{made.largest_strain:.3g}, and det(I + grad u) lies between "
            f"{made.least_volume:.3g} and {made.largest_volume:.3g}"
            f"{', where the body would pass through itself' if inside_out else ''}"
        )


def layers(solution: Solution) -> Iterator[Remark]:
    """Warn of layers that press on the undeformed body, or whose p_nu falls: (h6) asks for less."""
    problem = solution.problem
    law, size = problem.interface.layer, problem.domain.size
    if law.compliance is None:
        return
    least = -problem.nodes.maximum(-law.touch, -np.inf)
    if least < -1e-9 * size:
        yield (
            f"the layer is thicker than the gap, by up to {-least:.4g}, and presses on the "
            "undeformed body"
        )
    layers = (contact.compliant_layer for contact in problem.contacts)
    if any(layer is not None and layer.falls(size) for layer in layers):
        yield "several solutions may exist, for p_nu falls with the penetration of the layer"


def untouched(solution: Solution) -> Iterator[Remark]:
    """Warn of a static problem in which no node is in contact; a load step may end like that.

    A shape with a tip may also reach into the body between the nodes.
    """
    problem = solution.problem
    closed = problem.comm.allreduce(bool(np.any(solution.status != "open")), op=MPI.LOR)
    met = closed or any(record.row["contact_nodes"] > 0 for record in solution.steps)
    # An overloaded method has left the body where its friction did not hold it.
    if not (met or solution.outcome.overloaded or problem.since is not None):
        yield (
            "nothing touches: the foundation is too far away, or narrower than the elements there"
        )


def rounding(solution: Solution) -> Iterator[Remark]:
    """Warn of forces that are small beside those in the bodies, and hardly known. Collective.

    Long bodies, or stretched ones, bear forces of many times the loads or the contact forces, and
    residuals are relative to all of them. Where supports move the body, their reactions are among
    its loads.
    """
    problem, state, outcome = solution.problem, solution.state, solution.outcome
    body, known, asked = problem.equilibrium, list[str](), outcome.allowed.equilibrium
    if solution.rounding > asked:
        known.append(f"rounding decides how well the forces balance, to {solution.rounding:.1e}")
    residual = residual_forces(problem, state)
    unknown = max(
        outcome.residuals.pressure_rounding, residual_as_pressures(problem, state, residual)
    )
    moved = bool(problem.comm.allreduce(bool(np.any(problem.start().x)), op=MPI.LOR))
    loads = body.load_norms(state.time)
    if solution.converged and unknown > KNOWN and (moved or loads[0].max() > 0):
        known.append(f"contact forces are known to {unknown:.1e} of their size only")
    on_contact = np.zeros_like(residual)
    problem.interface.add_forces(on_contact, state.x, state.forces)
    acting = (loads + body.norms(on_contact))[0]
    left = body.norms(body.unbalanced(residual))[0]
    borne = body.norms(body.reactions(residual))[0]
    # Where supports bear no more than the loads, the residual is rounding; so are all forces on a
    # body that are rounding of those on others.
    much = (acting > EPS * acting.max()) & (left > max(IMBALANCE, asked) * acting)
    much &= borne > acting
    if solution.converged and not moved and much.any():
        worst = np.max(left[much] / acting[much])
        known.append(
            f"{worst:.1e} of loads and contact forces are out of balance, displacements likewise"
        )
    if known:
        yield f"{'; '.join(known)}: far larger forces act in the bodies"


def falling_friction(solution: Solution) -> Iterator[Remark]:
    """Warn of an L_mu above the bound that a sliding block gives.

    A block of height H under the pressure p slides by s where G (U - s)/H = mu(s) p; the
    left-hand side falls faster than the right for all s if L_mu < G/(p H), and only then is s
    unique for every U. A pressure that is uneven is larger where most of it acts: there it counts
    with its own weight, and half of G.
    """
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
            f"{_several(solution)}: friction falls with the slip by up to L_mu = {lipschitz:.4g}"
            f"/length, and a sliding block under the pressure {mean:.4g} has one solution where "
            f"L_mu < {bound:.4g}/length"
        )


def _several(solution: Solution) -> str:
    return f"several solutions may exist, and this is one reached from {solution.start}"


def strong_friction(solution: Solution) -> Iterator[Remark]:
    """Warn of friction that suffices for several solutions, see `contact.results.uniqueness`."""
    if solution.jammed:
        held = constrained_by_supports(solution.problem)
        which = "keeps the bodies in contact" if held else "jams the bodies"
        yield (
            f"{_several(solution)}: friction alone {which}, which without any contact force are in "
            "balance where they do not meet"
        )
    elif solution.critical_factor <= 1:
        law, nodes = solution.problem.interface.friction.law, solution.problem.nodes
        own = law.maximum if law is not None and nodes.nodes.size else 0.0
        largest = solution.problem.comm.allreduce(own, op=MPI.MAX)
        factor = solution.critical_factor
        yield (
            f"{_several(solution)}: the linearised problem is singular from {factor:.3g} of this "
            f"friction on, mu up to {factor * largest:.4g}"
        )


def _conductor(solution: Solution) -> Conductor | None:
    """Return the foundation's electric contact; None where nothing is conducted."""
    conductor = solution.problem.interface.layer.conductor
    if conductor is None or not solution.problem.piezoelectric or conductor.psi.k_e == 0:
        return None
    return conductor


def conductivity(solution: Solution) -> Iterator[Remark]:
    """Warn of assumptions of the theory that a conductivity gives up, and of a steep ramp.

    Of a column of height H with the stiffness C, coupling e and permittivity beta, the potential
    follows a change of the charge by the share Bi/(1 + Bi) of phi - phi_F, Bi = k_e H/beta, and
    presses with e/H. A gap that opens by less than 1/delta thus opens itself further where
    delta |phi - phi_F| (e/C) Bi/(1 + Bi) exceeds 1: several solutions may then exist.
    """
    problem = solution.problem
    conductor, piezo, scales = _conductor(solution), problem.body.piezo, problem.scales
    if conductor is None or piezo is None:
        return
    laws = {type(c.conductor.psi) for c in problem.contacts if c.conductor is not None}
    if RampConductivity in laws:
        yield 'the foundation never conducts: electric.law = "ramp" does so where u_nu > rho alone'
    if PerfectConductivity in laws:
        yield (
            'the charge jumps as the gap closes, electric.law = "perfect", and where contact ends '
            "is not determined"
        )
    psi = conductor.psi
    if not psi.follows_gap:
        return
    width = 1 / psi.delta
    if width < 2 * scales.spacing:
        yield (
            "the mesh decides which contact nodes conduct: the charge rises within 1/delta = "
            f"{width:.3g} of the gap, less than two elements ({2 * scales.spacing:.3g})"
        )
    potential = problem.equilibrium.phi_scale * solution.nodal[:, -1]
    largest = problem.nodes.maximum(np.abs(conductor.phi_l(potential - conductor.phi_f)))
    permittivity = float(np.trace(np.asarray(piezo.beta))) / 3
    biot = psi.k_e * scales.height / permittivity
    coupling = float(np.abs(np.asarray(piezo.e)).max()) / (scales.bulk + 4 / 3 * scales.shear)
    number = psi.delta * largest * coupling * biot / (1 + biot)
    if number >= 1:
        yield (
            f"{_several(solution)}: the charge opens or closes gaps by itself within 1/delta = "
            f"{width:.3g} (a column asks for a number below 1, and it is {number:.3g})"
        )


def giving_way(solution: Solution) -> Iterator[Remark]:
    """Warn of penalties that move contact nodes by much of the largest displacement. Collective.

    The residuals weigh penetrations and slips by E/length, or more. A flat body is stiffer by far:
    its displacements are those of the penalties where these are as small as the residuals ask for.
    Later steps are not looked at: earlier slips stay.
    """
    problem = solution.problem
    if solution.method != "penalty" or problem.since is not None:
        return
    size = np.linalg.norm(solution.friction, axis=1)
    slip = np.linalg.norm(solution.slip[size < STICKS * solution.friction_bound], axis=1)
    depth = (solution.normal_displacement - problem.interface.gap)[solution.pressure > 0]
    if problem.interface.layer.compliance is not None:
        depth = depth[:0]  # it gives way by itself
    deep, far = (
        problem.comm.allreduce(float(values.max(initial=0.0)), op=MPI.MAX)
        for values in (depth, slip)
    )
    largest = solution.max_displacement
    if max(deep, far) > LARGEST_VIOLATION * largest:
        which, key = ("touch penetrate", "contact") if deep > far else ("should stick slip", "slip")
        yield (
            f"the penalties give way: nodes that {which} by up to {max(deep, far):.2g}, where "
            f"displacements reach {largest:.2g}; accepted: a smaller solver.eps_{key}"
        )
