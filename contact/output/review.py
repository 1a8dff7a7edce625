"""What a solution is worth: assumptions on its material and layer, and Theorem 3.1's condition."""

from __future__ import annotations

import logging

import numpy as np
from mpi4py import MPI

from contact.body.description import Material
from contact.output.fields import DerivedFields
from contact.output.solution import Solution
from forms.hencky import check_monotonicity

logger = logging.getLogger("contact.solve")


def announce(solution: Solution) -> None:
    """Review a solution, and log what there is to say about it. Collective."""
    review(solution)
    if solution.problem.comm.rank == 0:
        for note in solution.notes:
            logger.info(note)
        for warning in solution.warnings:
            logger.warning(warning)


def review(solution: Solution) -> None:
    """Add what there is to say to the notes and warnings of a solution. Collective."""
    fields = DerivedFields(solution.problem.equilibrium, solution.state.x)
    extremes = fields.extremes()
    solution.max_dev_strain = max(largest.strain for largest in extremes)
    solution.max_von_mises = max(largest.von_mises for largest in extremes)
    if any(largest.yields for largest in extremes):
        solution.share_beyond_yield = sum(largest.yielded for largest in extremes) / sum(
            largest.volume for largest in extremes
        )
    for text, good in (
        *(
            _monotonicity(material, largest.strain)
            for material, largest in zip(solution.problem.body.materials, extremes, strict=True)
        ),
        _uniqueness(solution),
        _electric_uniqueness(solution),
        _chords(solution),
        _preload(solution),
        _falling(solution),
    ):
        if text:
            (solution.notes if good else solution.warnings).append(text)


def _monotonicity(material: Material, strain: float) -> tuple[str, bool]:
    """Check (h1) on the strains that the solution has in a material."""
    if not np.isfinite(strain):
        return "", True
    report = check_monotonicity(material.law, strain)
    verdict = "holds" if report.holds else "does not hold: the material softens"
    place = f" in {', '.join(material.on)}" if material.on else ""
    where = f"{place} on the strains of this solution, |dev eps| <= {strain:.4g}"
    text = (
        f"assumption (h1) {verdict}{where}: "
        f"g <= g_0 = {report.g_0:.4g}, alpha = {report.alpha:.4g}, beta = {report.beta:.4g}"
    )
    return text, report.holds


def _uniqueness(solution: Solution) -> tuple[str, bool]:
    """Set mu* + L_mu beside the bound that a sliding block gives.

    The constants of Theorem 3.1 cannot be computed. A block of height H under the pressure p
    slides by s where G (U - s)/H = mu(s) p; the left-hand side falls faster than the right for
    all s if L_mu < G/(p H), and only then is s unique for every U. A pressure that is uneven is
    larger where most of it acts: there it counts with its own weight, and half of G.
    """
    problem, law = solution.problem, solution.problem.interface.friction.law
    if law is None:
        return "", True
    comm, nodes = problem.comm, problem.nodes
    own = (law.maximum, law.lipschitz) if nodes.nodes.size else (0.0, 0.0)
    maximum, lipschitz = (comm.allreduce(value, op=MPI.MAX) for value in own)
    if not np.isfinite(maximum):
        return "", True
    pressure = solution.pressure
    total = nodes.sum(pressure)
    mean = nodes.sum(pressure**2) / total if total > 0 else 0.0
    text = f"Theorem 3.1: unique if mu* + L_mu = {maximum:.4g} + {lipschitz:.4g} is small enough"
    if lipschitz == 0 or mean <= 0:
        return text, True
    bound = 0.5 * problem.scales.shear / (mean * problem.scales.height)
    text += f"; a sliding block under the pressure {mean:.4g} asks for L_mu < {bound:.4g}"
    if lipschitz < bound:
        return text, True
    several = f"several solutions may exist, and this is one reached from {solution.start}"
    return f"{text}: {several}", False


def _electric_uniqueness(solution: Solution) -> tuple[str, bool]:
    """Set what the current does to the gap beside the stiffness that closes it.

    Of a column of height H with the stiffness C, coupling e and permittivity beta, the potential
    follows a change of the current by the share Bi/(1 + Bi) of phi - phi_F, Bi = k_e H/beta, and
    presses with e/H. A gap that opens by less than 1/delta thus opens itself further where
    delta |phi - phi_F| (e/C) Bi/(1 + Bi) exceeds 1: several solutions may then exist.
    """
    problem = solution.problem
    conductor, piezo = problem.interface.response.conductor, problem.body.piezo
    if conductor is None or piezo is None or not conductor.psi.follows_gap:
        return "", True
    scales = problem.scales
    potential = problem.equilibrium.phi_scale * solution.nodal[:, -1]
    difference = np.abs(conductor.phi_l(potential - conductor.phi_f))
    largest = problem.nodes.maximum(difference)
    permittivity = float(np.trace(np.asarray(piezo.beta))) / 3
    biot = conductor.psi.k_e * scales.height / permittivity
    coupling = float(np.abs(np.asarray(piezo.e)).max()) / (scales.bulk + 4 / 3 * scales.shear)
    number = conductor.psi.delta * largest * coupling * biot / (1 + biot)
    if number < 1:
        return "", True
    return (
        f"the current changes within 1/delta = {1 / conductor.psi.delta:.3g} of the gap by so much "
        f"that it opens or closes gaps by itself (a column asks for a number below 1, and it is "
        f"{number:.3g}): several solutions may exist, and this is one reached from "
        f"{solution.start}; a smaller delta has fewer of them",
        False,
    )


def _chords(solution: Solution) -> tuple[str, bool]:
    """Say where nodes on straight facets were found in the foundation, and put on it."""
    cut = solution.problem.nodes.cut
    if cut == 0:
        return "", True
    return (
        f"straight facets of the curved contact part reach {cut:.3g} into the foundation at rest: "
        "the gap there is taken as 0; a mesh that is finer from the beginning has less of it",
        False,
    )


def _preload(solution: Solution) -> tuple[str, bool]:
    """Say where a layer is thicker than the gap, and presses on the body at rest."""
    problem = solution.problem
    response = problem.interface.response
    if response.layer is None:
        return "", True
    least = -problem.nodes.maximum(-response.touch, -np.inf)
    if least >= -1e-9 * problem.domain.size:
        return "", True
    return (
        f"the layer is thicker than the gap, by up to {-least:.4g}: it presses on the body at rest",
        False,
    )


def _falling(solution: Solution) -> tuple[str, bool]:
    """Say where p_nu falls: (h6) asks for less, uniqueness for a law that does not."""
    layers, size = [c.layer for c in solution.problem.contacts], solution.problem.domain.size
    if not any(layer is not None and layer.falls(size) for layer in layers):
        return "", True
    text = "p_nu falls with the penetration: several solutions may exist, and this is one of them"
    return text, False
