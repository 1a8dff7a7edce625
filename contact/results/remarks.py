"""Remarks on a solution: assumptions of the theory, and reasons to trust numbers less."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence

import numpy as np
from mpi4py import MPI

from contact.model.rigid import Rigid
from contact.errors import counted
from contact.interface.law import Conductor
from contact.results import bodies, discretisation, foundations
from contact.results.error_estimate import estimated
from contact.results.fields import DerivedFields, deformation, unloaded
from contact.results.solution import Note, Remark, Solution
from contact.results.uniqueness import MOST
from contact.problem.checks import meeting_supports
from contact.problem.residuals import left_as_pressures, residual_forces
from contact.problem.rigid_modes import constrained_by_supports
from contact.tolerances import EPS, LARGEST_VIOLATION
from forms.elasticity import Anisotropic
from forms.hencky import Hencky
from forms.history import HistoryLaw
from forms.laws import PerfectConductivity, RampConductivity
from forms.monotonicity import check_monotonicity

logger = logging.getLogger("contact.solve")

#: Nodes across a contact zone from which on it is one.
ACROSS = 5

#: By how much of mu_1 a material of one's own may be off it without strain.
OFF = 0.01

#: Most of loads and contact forces that may be left out of balance: displacements that only they
#: cause are about as far off.
LEFT = 1e-6

#: Largest |eps| of which eps is a good measure: the square of the strain is then 1 % of it.
SMALL = 0.1

#: Share of contact forces that may be rounding without a warning.
KNOWN = 1e-3

#: Share of its bound below which friction lets nothing slip: the penalised one nears it slowly.
BELOW = 0.9


def announce(solution: Solution) -> None:
    """Review a solution, and log the warnings. Collective."""
    review(solution)
    if solution.problem.comm.rank == 0:
        for warning in solution.warnings:
            logger.warning(warning)


def measure(solution: Solution, whole: bool = True) -> list[float]:
    """Give a solution its extremes of stress and strain, and return |dev eps| by material.

    Collective.

    Parameters
    ----------
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
    strains = measure(solution)
    times = [record.state.time for record in solution.steps] or [solution.problem.time]
    for identifier, remarks in {
        "halved-steps": halved(solution),
        "unloading": unloading(solution),
        "material": monotonicity(solution, strains),
        "small-strain": small_strain(solution),
        "curved-surface": discretisation.coarse_curves(solution),
        "held-along": foundations.held_along(solution),
        "part-end": foundations.passed_beside(solution),
        "own-shape": foundations.fitting(solution.problem),
        "no-heights": foundations.without_heights(solution.problem, solution),
        "layer": layers(solution),
        "locking": discretisation.locking(solution),
        "discretisation-error": discretisation.large_error(solution),
        "no-contact": untouched(solution),
        "pressure-resolution": resolution(solution),
        "rounding": rounding(solution),
        "sliding": sliding(solution),
        "strong-friction": strong_friction(solution),
        "conductivity": conductivity(solution),
        "conductivity-ramp": ramp(solution),
        "two-bodies": bodies.choices(solution),
        "meeting-supports": meeting_supports(solution.problem, times),
        "passing-bodies": bodies.passing(solution.problem),
        "one-material": bodies.regions(solution),
        "unresisted-motion": bodies.unresisted_motions(solution),
        "not-held": bodies.not_held(solution),
        "free-motion": bodies.adrift(solution),
        "penalty": giving_way(solution),
    }.items():
        for text in remarks:
            listed = solution.notes if isinstance(text, Note) else solution.warnings
            listed.append(f"{text} [{identifier}]")


def halved(solution: Solution) -> Iterator[Remark]:
    """Say that steps have failed and were halved."""
    if solution.extra_steps > 0:
        yield Note(
            f"{len(solution.steps)} steps, {solution.extra_steps} more than asked for: some that "
            "did not converge were halved"
        )


def unloading(solution: Solution) -> Iterator[Remark]:
    """Say how much of a body of Hencky's materials has unloaded from the plastic range."""
    share = unloaded(solution.problem, [record.state for record in solution.steps])
    if share > 0:
        yield (
            f"{share:.1%} of the body unload from the plastic range in a step: Hencky's law is "
            "nonlinear elasticity, and they come back the way they went; a metal would keep a part "
            'of its strain, as material.law = "j2" does'
        )


def monotonicity(solution: Solution, strains: Sequence[float]) -> Iterator[Remark]:
    """Check strong monotonicity on the strains that the solution has in each material."""
    dim = 3 if solution.problem.domain.revolved else solution.problem.dim
    for material, strain in zip(solution.problem.body.materials, strains, strict=True):
        # That is asked of Hencky's laws; a crystal's stiffness is positive definite, or refused.
        law, place = material.law, f" in {', '.join(material.on)}" if material.on else ""
        if not np.isfinite(strain) or isinstance(law, Anisotropic | HistoryLaw):
            continue
        yield _monotonicity(law, place, strain, dim)
        # g(0) and mu_1, which stands for it wherever a size is asked for.
        found = np.asarray(law.secant_modulus(np.zeros(1)))
        modulus, shear = float(found[0]), float(law.shear)
        if abs(modulus - shear) > OFF * abs(shear):
            yield (
                f"the secant modulus{place} is {modulus:.4g} without strain, and Young's modulus "
                f"and Poisson's ratio say mu_1 = {shear:.4g}: the deviator follows the first, and "
                "changes of volume those two"
            )


def _monotonicity(law: Hencky, place: str, strain: float, dim: int) -> Remark:
    """Say whether it is met: where g exceeds (d/2) k_0 alone the operator is still monotone."""
    report = check_monotonicity(law, strain, dim=dim)
    said = [] if report.holds else [f"the theory does not cover the material{place}"]
    if not report.hardens:
        said = [f"the material softens{place}, alpha <= 0: there may be several solutions or none"]
    if report.g_0 <= 0:
        said.append(f"the material has no stiffness in shear{place}, g_0 <= 0")
    if report.largest > report.ceiling:
        least = (6 - 2 * dim) / (12 + 2 * dim)
        said.append(
            "g exceeds (d/2) k_0, as for any linear material with a Poisson's ratio below "
            f"{least:.3g}"
        )
    said.append(
        f"strong monotonicity is {'met' if report.holds else 'not met'} on the strains of this "
        f"solution, |dev eps| <= {strain:.4g}: g_0 = {report.g_0:.4g} <= g <= "
        f"{report.largest:.4g}, (d/2) k_0 = {report.ceiling:.4g}, alpha = {report.alpha:.4g}, "
        f"beta = {report.beta:.4g}"
    )
    return Note("; ".join(said)) if report.holds else "; ".join(said)


def small_strain(solution: Solution) -> Iterator[Remark]:
    """Say where strains or rotations are no small ones, or the deformed body turns inside out.

    To turn by an angle a makes the determinant 1 + a^2, and strains at most 1 + sqrt(3) |eps|.
    """
    made = solution.deformation
    if made is None:
        return
    turned = made.largest_volume - 1 - np.sqrt(3) * made.largest_strain
    if max(made.largest_strain, turned) > SMALL:
        strained = made.largest_strain > SMALL
        text = "strains are not small" if strained else "rotations are not small"
        text += (
            f": |eps| reaches {made.largest_strain:.3g}, and det(I + grad u) lies "
            f"between {made.least_volume:.3g} and {made.largest_volume:.3g}"
        )
        if made.least_volume <= 0:
            text += ": where it is not positive the deformed body would pass through itself"
        yield f"{text}; linear kinematics is a formal model there"


def layers(solution: Solution) -> Iterator[Remark]:
    """Say where a layer presses on the undeformed body, or p_nu falls.

    (h6) asks for less, uniqueness for a law that does not fall.
    """
    problem = solution.problem
    law, size = problem.interface.law, problem.domain.size
    if law.layer is None:
        return
    least = -problem.nodes.maximum(-law.touch, -np.inf)
    if least < -1e-9 * size:
        yield (
            f"the layer is thicker than the gap, by up to {-least:.4g}: it presses on the "
            "undeformed body"
        )
    if any(contact.layer is not None and contact.layer.falls(size) for contact in problem.contacts):
        yield (
            "the layer presses less the deeper it is pressed, p_nu falls with the penetration: "
            "several solutions may exist, and this is one of them"
        )


def resolution(solution: Solution) -> Iterator[Remark]:
    """Say where the mesh is too coarse for pressures and zones of contact.

    A zone that ends within the contact part is looked at; one that covers it has the size that it
    was given.
    """
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
        nearest = float(nodes.points[closed, 0].min(initial=np.inf))
        on_axis = nodes.comm.allreduce(nearest, op=MPI.MIN) < 1e-9 * problem.domain.size
        across = 2 * count - 1 if on_axis else 2 * count
        width = float(2 * np.sqrt(solution.contact_area / np.pi))
    else:
        across, width = count, solution.contact_area
    if across < ACROSS:
        yield (
            f"the mesh is too coarse for the pressures: {counted(across, 'node')} across the "
            f"contact zone; accepted: {ACROSS} at least, for instance elements of at most "
            f"{width / ACROSS:.2g} there"
        )


def untouched(solution: Solution) -> Iterator[Remark]:
    """Say that no node is in contact: a load step may end like that, a static problem is not one.

    A shape with a tip may also reach into the body between the nodes.
    """
    problem = solution.problem
    closed = bool(np.any(solution.status != "open"))
    if any(record.row["contact_nodes"] > 0 for record in solution.steps):
        return
    # The method has then left the body where its friction did not hold it.
    if solution.outcome.overloaded:
        return
    if problem.since is not None or problem.comm.allreduce(closed, op=MPI.LOR):
        return
    members = problem.equilibrium.global_unknowns.members
    free = any(isinstance(m.description, Rigid) and m.free.any() for m in members)
    yield (
        "nothing touches: no contact node has met the foundation; it is too far away, or narrower "
        "than the elements there"
        + ("; a rigid part that is free may be anywhere that it touches nothing" if free else "")
    )


def rounding(solution: Solution) -> Iterator[Remark]:
    """Say where forces are small beside those that balance in the bodies, and hardly known.

    Long bodies, or stretched ones, bear forces of many times the loads or the contact forces, and
    residuals are relative to all of them. Where supports move the body, their reactions are among
    its loads. Collective.
    """
    problem, state, outcome = solution.problem, solution.state, solution.outcome
    body, known, asked = problem.equilibrium, list[str](), outcome.allowed.equilibrium
    if solution.rounding > asked:
        known.append(
            f"rounding decides how well the forces balance, to {solution.rounding:.1e} of them for "
            f"a tolerance of {asked:g}"
        )
    residual = residual_forces(problem, state)
    unknown = max(outcome.kkt.unknown, left_as_pressures(problem, state, residual))
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
    much = (acting > EPS * acting.max()) & (left > max(LEFT, asked) * acting) & (borne > acting)
    if solution.converged and not moved and much.any():
        worst = np.max(left[much] / acting[much])
        known.append(
            f"{worst:.1e} of loads and contact forces are out of balance, and displacements about "
            "as far off"
        )
    if known:
        yield (
            f"{'; '.join(known)}: far larger forces act in the bodies; fewer cells along a slender "
            'body, linear elements, linear = "lu", a smaller solver.tolerance, smaller '
            "displacements elsewhere, or less of electric.k_e, make them known better"
        )


def sliding(solution: Solution) -> Iterator[Remark]:
    """Set L_mu beside the bound that a sliding block gives.

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
    text = (
        f"friction falls with the slip by up to L_mu = {lipschitz:.4g}/length of the pressure; a "
        f"sliding block under the pressure {mean:.4g} has one solution where "
        f"L_mu < {bound:.4g}/length"
    )
    if lipschitz < bound:
        yield Note(text)
    else:
        yield (
            f"several solutions may exist, and this is one reached from {solution.start}: {text}; "
            "a mu that falls more slowly with the slip has fewer of them"
        )


def strong_friction(solution: Solution) -> Iterator[Remark]:
    """Say where friction suffices for several solutions, see `contact.results.uniqueness`."""
    factor = solution.critical_factor
    if np.isnan(factor):
        yield Note(f"with more than {MOST} contact nodes, a critical friction is not looked for")
    if solution.jammed:
        several = f"there are several solutions, and this is one reached from {solution.start}"
        balance = "without any contact force are in balance where they do not meet; load steps"
        if constrained_by_supports(solution.problem):
            yield (
                f"{several}: friction alone keeps the bodies in contact, which on their supports "
                f"{balance} choose one by the way of loading, less friction, or none, leaves one"
            )
        else:
            yield (
                f"{several}: friction alone jams the bodies, which {balance} choose one by the way "
                "of loading, a support against the motion away, or no friction, leaves one"
            )
    elif factor <= 1:
        law, nodes = solution.problem.interface.friction.law, solution.problem.nodes
        own = law.maximum if law is not None and nodes.nodes.size else 0.0
        largest = solution.problem.comm.allreduce(own, op=MPI.MAX)
        yield (
            f"several solutions may exist, and this is one reached from {solution.start}: where "
            f"nodes slide together the linearised problem is singular from {factor:.3g} of this "
            f"friction on, mu up to {factor * largest:.4g}; load steps choose one by the way of "
            "loading"
        )


def _conductor(solution: Solution) -> Conductor | None:
    """Return the foundation's electric contact; None where nothing is conducted."""
    conductor = solution.problem.interface.law.conductor
    if conductor is None or not solution.problem.piezoelectric or conductor.psi.k_e == 0:
        return None
    return conductor


def conductivity(solution: Solution) -> Iterator[Remark]:
    """Say which assumptions of the existence theory each conductivity gives up."""
    if _conductor(solution) is None:
        return
    conductors = (contact.conductor for contact in solution.problem.contacts)
    laws = {type(conductor.psi) for conductor in conductors if conductor is not None}
    if RampConductivity in laws:
        yield (
            'the foundation never conducts, k_e has no effect: electric.law = "ramp" conducts only '
            'where u_nu > rho, and u_nu <= rho; "shifted" moves the ramp in front of the closing '
            "gap"
        )
    if PerfectConductivity in laws:
        yield (
            'the charge jumps as the gap closes, electric.law = "perfect": no theorem gives '
            "existence or uniqueness of a solution; where contact ends inside a part, the edge is "
            'not determined; "shifted" with a large delta determines it'
        )


def ramp(solution: Solution) -> Iterator[Remark]:
    """Set the ramp of psi beside the mesh, the effect of the charge beside the stiffness.

    Of a column of height H with the stiffness C, coupling e and permittivity beta, the potential
    follows a change of the charge by the share Bi/(1 + Bi) of phi - phi_F, Bi = k_e H/beta, and
    presses with e/H. A gap that opens by less than 1/delta thus opens itself further where
    delta |phi - phi_F| (e/C) Bi/(1 + Bi) exceeds 1: several solutions may then exist.
    """
    problem = solution.problem
    conductor, piezo = _conductor(solution), problem.body.piezo
    if conductor is None or piezo is None or not conductor.psi.follows_gap:
        return
    scales, psi = problem.scales, conductor.psi
    width = 1 / psi.delta
    if width < 2 * scales.spacing:
        yield (
            f"the mesh decides which contact nodes conduct: psi rises within 1/delta = "
            f"{width:.3g} of the gap, less than two of their spacings "
            f"(2 h = {2 * scales.spacing:.3g}); take a finer mesh, or electric.delta below "
            f"{0.5 / scales.spacing:.3g}"
        )
    potential = problem.equilibrium.phi_scale * solution.nodal[:, -1]
    largest = problem.nodes.maximum(np.abs(conductor.phi_l(potential - conductor.phi_f)))
    permittivity = float(np.trace(np.asarray(piezo.beta))) / 3
    biot = psi.k_e * scales.height / permittivity
    coupling = float(np.abs(np.asarray(piezo.e)).max()) / (scales.bulk + 4 / 3 * scales.shear)
    number = psi.delta * largest * coupling * biot / (1 + biot)
    if number >= 1:
        yield (
            f"several solutions may exist, and this is one reached from {solution.start}: the "
            f"charge changes within 1/delta = {width:.3g} of the gap by so much that it opens or "
            f"closes gaps by itself (a column asks for a number below 1, and it is {number:.3g}); "
            "a smaller delta has fewer of them"
        )


def giving_way(solution: Solution) -> Iterator[Remark]:
    """Say where penalties move contact nodes by much of the largest displacement. Collective.

    The residuals weigh penetrations and slips by E/length, or more. A flat body is stiffer by far:
    its displacements are those of the penalties where these are as small as the residuals ask for.
    Later steps are not looked at: earlier slips stay.
    """
    problem = solution.problem
    if solution.method != "penalty" or problem.since is not None:
        return
    size = np.linalg.norm(solution.friction, axis=1)
    held = size < BELOW * solution.friction_bound
    slip = np.linalg.norm(solution.slip[held], axis=1)
    depth = (solution.normal_displacement - problem.nodes.gap)[solution.pressure > 0]
    if problem.interface.law.layer is not None:
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
            f"displacements reach {largest:.2g}; a smaller solver.eps_{key}, or another method, "
            "brings these nearer to their limit"
        )
