"""The augmentation parameter of a body that bends, from the stiffness of its softest mode.

A mode of Gamma_3 with the stiffness sigma contracts by sigma/(sigma + r) where contact holds it
and by r/(sigma + r) where it is free: r has to stand in the middle of the spectrum. Of a block the
ends are known, 1.1 E'/H and 1.92 E'/h. A slender body is softer than that by many orders of
magnitude, and only its operator says by how many. A parameter for each node, from the compliance
of that node alone, does no better: the spectrum of all together is wide. Of a cantilever 300 times
as long as thick the ends are 3e10 apart, and 1e11 with each node in units of its own. One for each
mode would: but then a node's projection depends on all others, and is the contact problem itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.jump import Jump
from contact.linear.operator import Operator
from contact.methods.parameters import automatic_r
from contact.methods.thesis.uzawa import Relaxation, augmentation, split
from contact.problem.kkt import residual_forces
from contact.problem.protocols import Problem
from contact.typing import Array

#: Earlier solves that the acceleration uses. It begins anew when it has so many, as it may have
#: come to the best combination of these alone.
MEMORY = 60

#: Lanczos's steps: the softest mode stands out.
STEPS = 12

#: Regularising stiffness of all modes while the softest is looked for, over r*.
SHIFT = 1e-14

#: Modes softer than this, over the shift, are motions that nothing but contact holds.
FREE = 10.0


@dataclass(frozen=True)
class SpectralFit:
    """Augmentation parameter and start of the relaxation of a soft body, by its spectrum.

    Attributes
    ----------
    r
        The parameter (stress/length).
    sigma
        Stiffness of the softest mode (stress/length).
    z
        Start of the relaxation, shape (n, 1 + d): r u without contact; 0 where contact
        alone holds the body.
    """

    r: float
    sigma: float
    z: Array

    def fit(self, relaxation: Relaxation) -> Relaxation:
        """Return the relaxation with this r, and memory for a wide spectrum."""
        depth = MEMORY if relaxation.depth else 0
        return replace(relaxation, r=self.r, depth=depth, anew=True)


def spectral_fit(problem: Problem, operator: Operator, friction: bool) -> SpectralFit | None:
    """Return r and a start for a body that is softer than a block; else None. Collective.

    Parameters
    ----------
    problem
        The contact problem.
    operator
        Its operator, which is assembled anew.
    friction
        Whether tangential forces act.
    """
    interface, body, state = problem.interface, problem.equilibrium, problem.start()
    jump, star = interface.jump, automatic_r(problem.scales)
    nodal, shift = jump.apply(state.x), SHIFT * star
    current = interface.law.current_block(nodal, interface.pressure(nodal, state.forces))
    blocks = interface.weighted(current + augmentation(jump, shift, False), state.x)

    def solve(traction: Array) -> Array:
        rhs = np.zeros_like(body.owned_part(state.x))
        jump.transpose((jump.weight * traction)[:, None] * jump.normal, rhs)
        return jump.normal_component(jump.apply(operator.solve(rhs)))

    try:
        operator.update("secant", state, blocks, constant=body.linear)
        sigma, held = smallest_eigenvalue(jump, solve, shift)
        loads = -residual_forces(problem, state)
        free = jump.apply(operator.solve(loads)) if held else np.zeros_like(nodal)
    except InputError:  # a rigid-body mode is free, and `shift` is lost in rounding
        return None
    block = 1.1 * problem.scales.plane_modulus / problem.scales.height
    if sigma is None or sigma >= block:
        return None
    r = star * float(np.sqrt(sigma / block))
    return SpectralFit(r, sigma, r * split(interface, nodal + free, friction))


def stall_reason(problem: Problem, given: float | str, fit: SpectralFit | None) -> str:
    """Say why the Uzawa block relaxation may have stalled, given r and its spectral fit."""
    if given != "auto":
        return f'r = {given:.3g} was given, r = "auto" fits it to the body'
    star = automatic_r(problem.scales)
    if fit is None:
        return f"r = {star:.3g} is that of a block, and the body has no softer modes"
    stiffest = 1.92 * problem.scales.plane_modulus / problem.scales.spacing
    return (
        f"contact moves modes of the body with stiffnesses from {fit.sigma:.2g} to "
        f"{stiffest:.2g} (stress/length); neither r = {star:.2g} nor {fit.r:.2g} fits all"
    )


def smallest_eigenvalue(
    jump: Jump, solve: Callable[[Array], Array], shift: float
) -> tuple[float | None, bool]:
    """Return the least stiffness of a mode of the normal displacements. Collective.

    Parameters
    ----------
    jump
        The contact nodes.
    solve
        Maps normal tractions at these nodes to normal displacements, both of shape (n,), with
        the stiffness `shift` added to all of them.
    shift
        Small against all that is looked for (stress/length).

    Returns
    -------
    The Ritz value of a few steps of Lanczos's method in L2(Gamma_3) (stress/length), None if all
    that was found is free; and whether nothing was free.
    """
    basis: list[Array] = []
    images: list[Array] = []

    def inner(a: Array, b: Array) -> float:
        return float(jump.comm.allreduce(np.dot(jump.weight * a, b), op=MPI.SUM))

    # The same on all ranks, and no mode itself: weights differ at the ends of Gamma_3.
    most = jump.comm.allreduce(np.max(jump.weight, initial=0.0), op=MPI.MAX)
    turned = jump.normal @ np.sqrt([2.0, 3.0, 5.0])[: jump.normal.shape[1]]
    vector = jump.weight / most + 0.1 * turned
    while len(basis) < STEPS:
        for _ in range(2):  # twice is enough, in spite of cancellation
            for other in basis:
                vector = vector - inner(other, vector) * other
        length = np.sqrt(inner(vector, vector))
        size = np.sqrt(inner(images[-1], images[-1])) if images else 0.0
        if not length > 1e-12 * size:
            break
        basis.append(vector / length)
        images.append(solve(basis[-1]))
        vector = images[-1]
    if not basis:
        return None, False
    matrix = np.array([[inner(a, b) for b in images] for a in basis])
    if not np.isfinite(matrix).all():
        return None, False
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    stiffness = 1 / values[values > 0] - shift
    held = stiffness[stiffness > FREE * shift]
    return (float(held.min()) if held.size else None), held.size == stiffness.size
