"""What a solution is worth: assumptions on its material and layer, and Theorem 3.1's condition."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.output.fields import DerivedFields
from contact.output.solution import Solution
from forms.hencky import check_monotonicity


def review(solution: Solution) -> None:
    """Add what there is to say to the notes and warnings of a solution. Collective."""
    solution.max_dev_strain = DerivedFields(
        solution.problem.equilibrium, solution.state.x
    ).largest_strain()
    for text, good in (
        _monotonicity(solution),
        _uniqueness(solution),
        _chords(solution),
        _preload(solution),
        _falling(solution),
    ):
        if text:
            (solution.notes if good else solution.warnings).append(text)


def _monotonicity(solution: Solution) -> tuple[str, bool]:
    """Check (h1) on the strains of the solution."""
    problem, strain = solution.problem, solution.max_dev_strain
    if not np.isfinite(strain):
        return "", True
    report = check_monotonicity(problem.body.law, strain)
    verdict = "holds" if report.holds else "does not hold: the material softens"
    text = (
        f"assumption (h1) {verdict} on the strains of this solution, |dev eps| <= {strain:.4g}: "
        f"g <= g_0 = {report.g_0:.4g}, alpha = {report.alpha:.4g}, beta = {report.beta:.4g}"
    )
    return text, report.holds


def _uniqueness(solution: Solution) -> tuple[str, bool]:
    """Set mu* + L_mu beside the bound that a sliding block gives.

    The constants of Theorem 3.1 cannot be computed. A block of height H under the pressure p
    slides by s where G (U - s)/H = mu(s) p; the left-hand side falls faster than the right for
    all s if L_mu < G/(p H), and only then is s unique for every U.
    """
    problem, coefficient = solution.problem, solution.problem.interface.friction.coefficient
    if coefficient is None:
        return "", True
    comm, nodes = problem.comm, problem.nodes
    own = (coefficient.maximum, coefficient.lipschitz) if nodes.nodes.size else (0.0, 0.0)
    maximum, lipschitz = (comm.allreduce(value, op=MPI.MAX) for value in own)
    pressure = solution.pressure
    # Pressures of rounding size are none, as in `Solution.status`.
    area = nodes.sum((pressure > 1e-9 * nodes.maximum(pressure)).astype(float))
    mean = nodes.sum(pressure) / area if area > 0 else 0.0
    text = f"Theorem 3.1: unique if mu* + L_mu = {maximum:.4g} + {lipschitz:.4g} is small enough"
    if lipschitz == 0 or mean <= 0:
        return text, True
    bound = problem.scales.shear / (mean * problem.scales.height)
    text += f"; a sliding block under the mean pressure {mean:.4g} asks for L_mu < {bound:.4g}"
    if lipschitz < bound:
        return text, True
    several = f"several solutions may exist, and this is one reached from {solution.start}"
    return f"{text}: {several}", False


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
    if problem.contact.layer is None:
        return "", True
    least = -problem.nodes.maximum(-problem.interface.response.touch, -np.inf)
    if least >= -1e-9 * problem.domain.size:
        return "", True
    return (
        f"the layer is thicker than the gap, by up to {-least:.4g}: it presses on the body at rest",
        False,
    )


def _falling(solution: Solution) -> tuple[str, bool]:
    """Say where p_nu falls: (h6) asks for less, uniqueness for a law that does not."""
    layer, size = solution.problem.contact.layer, solution.problem.domain.size
    if layer is None or not layer.falls(size):
        return "", True
    text = "p_nu falls with the penetration: several solutions may exist, and this is one of them"
    return text, False
