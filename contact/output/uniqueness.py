"""Whether a solution is the only one: the theorems' conditions, and estimates in their place.

The theorems ask that a sum of constants of the laws be below one of the body that cannot be
computed. What the sums are made of is said; a block that slides and a column that conducts stand
in for the body.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from contact.interface.current import Conductor
from contact.output.assumptions import Remark
from contact.output.solution import Solution
from forms.laws import PerfectConductivity, RampConductivity, ShiftedConductivity


def theorem(solution: Solution) -> Remark:
    """Name the theorem on uniqueness that is for such a problem, and what its condition adds up."""
    problem = solution.problem
    friction, layered = _friction(solution), problem.interface.law.layer is not None
    conductor = _conductor(solution)
    terms = [*_layer_terms(solution)]
    if friction is not None:
        maximum, lipschitz = friction
        terms.append(("mu*", f"{maximum:.4g} (a number)"))
        if not layered:
            terms.append(("L_mu", f"{lipschitz:.4g} (1/length)"))
    if conductor is not None:
        terms += _electric_terms(solution, conductor)
    if not terms:
        return "", True
    name = "3.1"
    if layered:
        name = "6.1" if friction is None and conductor is None else "6.2"
    elif problem.piezoelectric:
        name = "5.1"
    total, values = " + ".join(t[0] for t in terms), ", ".join(" = ".join(t) for t in terms)
    given = {
        "friction": friction is not None,
        "the layer": layered,
        "the current": conductor is not None,
    }
    weak = [name for name, there in given.items() if there]
    text = (
        f"one solution is sure where {' and '.join(weak)} {'is' if len(weak) == 1 else 'are'} weak "
        f"enough: Theorem {name} asks that {total} be "
        f"small; here {values}"
    )
    if layered and friction is not None and friction[1] > 0:
        text += f"; it has no mu that depends on the slip, and here L_mu = {friction[1]:.4g}/length"
    if conductor is not None and not np.isfinite(_limit(conductor)):
        text += (
            "; it needs a limit L of phi_L, and electric.limit is not given: the largest "
            f"|phi - phi_F| here, {_largest_difference(solution, conductor):.4g}, stands for L "
            "above, and any limit from there on leaves this solution as it is"
        )
    return text, True


def _conductor(solution: Solution) -> Conductor | None:
    """Return the foundation's electric contact; None where nothing is conducted."""
    conductor = solution.problem.interface.law.conductor
    if conductor is None or not solution.problem.piezoelectric or conductor.psi.k_e == 0:
        return None
    return conductor


def _friction(solution: Solution) -> tuple[float, float] | None:
    """Return mu* and L_mu; None without friction, or with Tresca's. Collective."""
    problem, law = solution.problem, solution.problem.interface.friction.law
    if law is None:
        return None
    own = (law.maximum, law.lipschitz) if problem.nodes.nodes.size else (0.0, 0.0)
    maximum, lipschitz = (problem.comm.allreduce(value, op=MPI.MAX) for value in own)
    return (maximum, lipschitz) if np.isfinite(maximum) else None


def _layer_terms(solution: Solution) -> Iterator[tuple[str, str]]:
    """Yield M_h L_p + L_h M_p, (h6) and (h7), for the potentials and depths that can occur."""
    problem, largest = solution.problem, 0.0
    conductor = problem.interface.law.conductor
    difference = 0.0
    if problem.piezoelectric:
        difference = _largest_difference(solution, conductor)
    s = np.linspace(-difference, difference, 513)
    layers = [contact.layer for contact in problem.contacts if contact.layer is not None]
    for layer in layers:
        depths = layer.depths(problem.domain.size)
        constants = [
            float(np.max(np.abs(np.broadcast_to(values, at.shape))))
            for values, at in (
                (layer.h_nu(s), s),
                (layer.p_nu.derivative(depths), depths),
                (layer.h_nu.derivative(s), s),
                (layer.p_nu(depths), depths),
            )
        ]
        largest = max(largest, constants[0] * constants[1] + constants[2] * constants[3])
    if layers:
        unit = "stress/length, with a term in stress/potential"
        yield "(M_h L_p + L_h M_p)", f"{largest:.4g} ({unit})"


def _limit(conductor: Conductor) -> float:
    return float(getattr(conductor.phi_l, "limit", np.inf))


def _largest_difference(solution: Solution, conductor: Conductor | None) -> float:
    """Return the largest |phi - phi_F| at the contact nodes. Collective."""
    problem = solution.problem
    potential = problem.equilibrium.phi_scale * solution.nodal[:, -1]
    foundation = 0.0 if conductor is None else conductor.phi_f
    return problem.nodes.maximum(np.abs(potential - foundation))


def _electric_terms(solution: Solution, conductor: Conductor) -> list[tuple[str, str]]:
    psi, limit = conductor.psi, _limit(conductor)
    if not np.isfinite(limit):
        limit = _largest_difference(solution, conductor)
    steepness = psi.k_e * psi.delta * limit if psi.k_e > 0 and limit > 0 else 0.0
    return [
        ("L_psi L", f"k_e delta L = {steepness:.4g} (charge/length^3)"),
        ("M_psi", f"k_e = {psi.k_e:.4g} (charge/(length^2 potential))"),
    ]


def sliding(solution: Solution) -> Remark:
    """Set L_mu beside the bound that a sliding block gives.

    A block of height H under the pressure p slides by s where G (U - s)/H = mu(s) p; the
    left-hand side falls faster than the right for all s if L_mu < G/(p H), and only then is s
    unique for every U. A pressure that is uneven is larger where most of it acts: there it counts
    with its own weight, and half of G.
    """
    problem, friction = solution.problem, _friction(solution)
    if friction is None or friction[1] == 0:
        return "", True
    nodes, pressure = problem.nodes, solution.pressure
    total = nodes.sum(pressure)
    mean = nodes.sum(pressure**2) / total if total > 0 else 0.0
    if mean <= 0:
        return "", True
    bound = 0.5 * problem.scales.shear / (mean * problem.scales.height)
    text = (
        f"friction falls with the slip by up to L_mu = {friction[1]:.4g}/length of the pressure; a "
        f"sliding block under the pressure {mean:.4g} has one solution where "
        f"L_mu < {bound:.4g}/length"
    )
    if friction[1] < bound:
        return text, True
    return (
        f"several solutions may exist, and this is one reached from {solution.start}: {text}; a "
        "mu that falls more slowly (a smaller rho) has fewer of them",
        False,
    )


def conductivity(solution: Solution) -> Iterator[Remark]:
    """Say what of (h~5) each conductivity gives up."""
    laws = {
        type(contact.conductor.psi)
        for contact in solution.problem.contacts
        if contact.conductor is not None and _conductor(solution) is not None
    }
    if ShiftedConductivity in laws:
        yield (
            'the foundation conducts from just before it is touched, electric.law = "shifted": it '
            'gives up (h~5)(d), psi = 0 for u_nu <= rho, with which, as "ramp" has it, it never '
            "conducts, for u_nu <= rho everywhere",
            True,
        )
    if RampConductivity in laws:
        yield (
            'the foundation never conducts, k_e has no effect: electric.law = "ramp" conducts only '
            'where u_nu > rho, and u_nu <= rho; "shifted" moves the ramp in front of the closing '
            "gap",
            False,
        )
    if PerfectConductivity in laws:
        yield (
            'the current jumps as the gap closes, electric.law = "perfect": (h~5)(e) fails, and no '
            "theorem says that there is a solution or only one. Where contact ends within the "
            "part, the place of its edge is not determined: a potential that lifts the body to the "
            "foundation leaves an interval for it, with a pressure that is singular there, one "
            'that pushes it off no place; "shifted" with a large delta is continuous and decides',
            False,
        )


def ramp(solution: Solution) -> Remark:
    """Set the ramp of psi beside the mesh, and what the current does beside the body's stiffness.

    Of a column of height H with the stiffness C, coupling e and permittivity beta, the potential
    follows a change of the current by the share Bi/(1 + Bi) of phi - phi_F, Bi = k_e H/beta, and
    presses with e/H. A gap that opens by less than 1/delta thus opens itself further where
    delta |phi - phi_F| (e/C) Bi/(1 + Bi) exceeds 1: several solutions may then exist.
    """
    problem = solution.problem
    conductor, piezo = _conductor(solution), problem.body.piezo
    if conductor is None or piezo is None or not conductor.psi.follows_gap:
        return "", True
    scales, psi = problem.scales, conductor.psi
    width, text = 1 / psi.delta, ""
    if width < 2 * scales.spacing:
        text = (
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
        text += (text and "; ") + (
            f"several solutions may exist, and this is one reached from {solution.start}: the "
            f"current changes within 1/delta = {width:.3g} of the gap by so much that it opens or "
            f"closes gaps by itself (a column asks for a number below 1, and it is {number:.3g}); "
            "a smaller delta has fewer of them"
        )
    return text, False
