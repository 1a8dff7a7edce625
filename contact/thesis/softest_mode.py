"""The augmentation parameter of a body whose softest mode is softer than a block.

A mode of Gamma_3 with the stiffness sigma contracts by sigma/(sigma + r) in contact and by
r/(sigma + r) without: r = sqrt(sigma_min sigma_max) is the best. A block has about the ends
1.1 E'/H and 1.76 E'/h, whose r is `Scales.r`. A body that bends has a smaller sigma_min; so has one
that a soft layer alone holds, as a rigid motion has the stiffness of the layer.

References
----------
Ghadimi, Teixeira, Shames and Johansson, Optimal parameter selection for the alternating direction
method of multipliers (ADMM): quadratic problems, IEEE Trans. Automat. Control 60 (2015) 644.
"""

from __future__ import annotations

import math

import numpy as np

from contact.errors import SingularError
from contact.linear.operator import Operator
from contact.problem.problem import ContactProblem
from contact.problem.state import Scales, State
from contact.ranks import summed
from contact.thesis.uzawa import augmentation
from contact.typing import Array

#: Steps of the Rayleigh-Ritz method: the softest mode of a body that bends stands apart.
STEPS = 12

#: Stiffness added to all modes, over c. Modes below `FREE` times it are left out: they cannot be
#: told from rigid motions (first modes of cantilevers more than 900 times as long as thick), which
#: rounding gives up to ten times it, by the order in which the solver eliminates.
SHIFT, FREE = 1e-14, 100.0

#: Least stiffness of a mode of a block, over E'/H.
BLOCK = 1.1


def fitted_augmentation(problem: ContactProblem, operator: Operator, state: State) -> float | None:
    """Return r = sqrt(sigma_min sigma_max) (stress/length); None if no softer than a block.

    The operator is for this alone: it is left singular where the body is. Collective.
    """
    scales, block = problem.scales, block_stiffness(problem.scales)
    try:
        sigma = softest_mode(problem, operator, state, SHIFT * scales.c)
    except SingularError:  # contact alone holds a rigid-body mode
        return None
    if not sigma < block:
        return None
    return scales.r * math.sqrt(sigma / block)


def block_stiffness(scales: Scales) -> float:
    """Return the least stiffness of a mode of a block (stress/length)."""
    return BLOCK * scales.plane_modulus / scales.height


def conditioning(scales: Scales, r: float) -> str:
    """Say why the relaxation is slow with a fitted r: the ratio of stiffnesses, and its rate."""
    stiffest = scales.r**2 / block_stiffness(scales)
    ratio = (stiffest / r) ** 2
    # The softest mode contracts by 1/(1 + sqrt(sigma_min/sigma_max)).
    steps = math.log(10) * math.sqrt(ratio)
    return (
        f": the modes of its contact surface differ by a factor of {ratio:.1e} in stiffness, as of "
        f"slender bodies and soft layers: a digit takes {steps:.1e} solves without acceleration"
    )


def softest_mode(problem: ContactProblem, operator: Operator, state: State, shift: float) -> float:
    """Return the least stiffness of normal displacements, but for rigid motions. Collective.

    With that of a layer at its first touch: 1/(largest Ritz value of the compliance in
    L2(Gamma_3)) - shift, without rigid motions that nothing holds; `shift` is added to all
    stiffnesses (stress/length).
    """
    interface, nodes = problem.interface, problem.interface.nodes
    law, jump = interface.foundation, nodes.jump(state.x)
    blocks, graph = augmentation(nodes, shift, False), law.normal_graph(jump)
    if graph is not None:
        # Nodes that face nothing touch no layer.
        layer = graph.layer_slope(np.where(np.isfinite(graph.rho_0), graph.rho_0, 0.0))
        blocks += layer[:, None, None] * augmentation(nodes, 1.0, False)
    blocks += law.charge_block(jump, interface.pressure(jump, state.multipliers))
    weighted = interface.weighted(blocks, state.x)
    operator.update("secant", state, weighted)

    def inner(a: Array, b: Array) -> Array:
        return summed(nodes.comm, a.T @ (nodes.weight[:, None] * b))

    def displacement(traction: Array) -> Array:
        load = np.zeros_like(problem.body.owned_part(state.x))
        nodes.add_jump_transposed((nodes.weight * traction)[:, None] * nodes.normal, load)
        return nodes.normal_component(nodes.jump(operator.solve(load)))

    # Without symmetries, and the same on all ranks.
    uneven = np.sqrt([2.0, 3.0, 5.0])[: nodes.dim]
    vector = nodes.normal @ uneven * (1 + nodes.points @ uneven / problem.scales.size)
    basis = images = np.zeros((vector.size, 0))
    for _ in range(STEPS):
        for _ in range(2):  # twice is enough, in spite of cancellation
            vector = vector - basis @ inner(basis, vector[:, None])[:, 0]
        length = nodes.norm(vector)
        if basis.shape[1] and not length > 1e-12 * nodes.norm(images[:, -1]):
            break
        basis = np.column_stack([basis, vector / length])
        vector = displacement(basis[:, -1])
        images = np.column_stack([images, vector])
    compliance = inner(basis, images)
    values = np.linalg.eigvalsh((compliance + compliance.T) / 2)
    stiffness = 1 / values[values > 0] - shift
    constrained = stiffness[stiffness > FREE * shift]
    return float(constrained.min(initial=np.inf))
