"""The augmentation parameter of a body that bends, from the stiffness of its softest mode.

A mode of Gamma_3 with the stiffness sigma contracts by sigma/(sigma + r) where contact holds it
and by r/(sigma + r) where it is free: r has to stand in the middle of the spectrum. Of a block the
ends are known, 1.1 E'/H and 1.92 E'/h. A slender body is softer than that by many orders of
magnitude, and only its operator says by how many. A parameter for each node, from the flexibility
of that node alone, does not do: what is wide is the spectrum of all together.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.jump import Jump
from contact.linear.operator import Operator
from contact.methods.augmentation import augmentation, automatic_r
from contact.problem.protocols import Problem
from contact.typing import Array

#: Lanczos's steps: the softest mode stands out.
STEPS = 12

#: Springs in all modes while the softest is looked for, over r*.
SHIFT = 1e-10

#: Modes softer than this, over the shift, are motions that nothing but contact holds.
FREE = 10.0


def softer_r(problem: Problem, operator: Operator) -> float | None:
    """Return r in the middle of the spectrum at rest, where that is below r*. Collective.

    Parameters
    ----------
    problem
        The contact problem.
    operator
        Its operator; what it holds is replaced.

    Returns
    -------
    The parameter (stress/length); None if the body is no softer than a block, or if nothing is
    found.
    """
    interface, body, state = problem.interface, problem.equilibrium, problem.start()
    jump, star = interface.jump, automatic_r(problem.scales)
    nodal, shift = jump.apply(state.x), SHIFT * star
    current = interface.response.current_block(nodal, interface.pressure(nodal, state.forces))
    blocks = interface.weighted(current + augmentation(jump, shift, False), state.x)

    def solve(traction: Array) -> Array:
        rhs = np.zeros_like(body.owned_part(state.x))
        jump.transpose((jump.weight * traction)[:, None] * jump.normal, rhs)
        return jump.normal_component(jump.apply(operator.solve(rhs)))

    try:
        operator.update("secant", state.x, blocks, constant=body.linear)
        sigma = softest(jump, solve, shift)
    except InputError:  # nothing but contact holds it, and the springs are too soft to be seen
        return None
    block = 1.1 * problem.scales.plane_modulus / problem.scales.height
    return None if sigma is None or sigma >= block else star * float(np.sqrt(sigma / block))


def spectrum(given: float | str, r: float) -> str:
    """Say why the block relaxation may have stalled with r, "auto" or given."""
    if given != "auto":
        return f'r = {r:.3g} was given, r = "auto" fits it to the body'
    return f"some modes of the body are too soft for r = {r:.3g}, others too stiff"


def softest(jump: Jump, solve: Callable[[Array], Array], shift: float) -> float | None:
    """Return the least stiffness of a mode of the normal displacements. Collective.

    Parameters
    ----------
    jump
        The contact nodes.
    solve
        Maps normal tractions at these nodes to normal displacements, both of shape (n,), with
        springs of the stiffness `shift` in all of them.
    shift
        Small against all that is looked for (stress/length).

    Returns
    -------
    The Ritz value of a few steps of Lanczos's method in L2(Gamma_3) (stress/length); None if all
    that was found is free.
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
        return None
    matrix = np.array([[inner(a, b) for b in images] for a in basis])
    if not np.isfinite(matrix).all():
        return None
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    stiffness = 1 / values[values > 0] - shift
    held = stiffness[stiffness > FREE * shift]
    return float(held.min()) if held.size else None
