"""Parameters c and gamma of the complementarity functions, and r of the Uzawa block relaxation.

All are stiffnesses (stress/length). c and r are those of a block that has the height of the body;
gamma is the option `gamma`, which has no unit, times the larger one of c and a node's stiffness.
"""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI

from contact.interface.complementarity import ComplementarityParameters
from contact.problem.protocols import Problem, Scales
from contact.problem.residuals import residual_forces
from contact.problem.state import State

#: Ratio of c times the penetration of the first step to the loads above which c overestimates the
#: stiffness of the body. It is about sqrt(H/h) for a block, whose stiffness c estimates.
OVERESTIMATE = 1e3


def automatic_r(scales: Scales) -> float:
    """Return r* = 1.39 E'/sqrt(h H), the geometric mean of the Steklov spectrum's ends.

    E' = E/(1 - nu^2); h is the spacing of the contact nodes and H the volume of the body over
    the area of Gamma_3. The best r differs by a factor of a few; acceleration makes up for that.
    """
    return 1.39 * scales.plane_modulus / math.sqrt(scales.spacing * scales.height)


def complementarity_parameters(scales: Scales, gamma: float) -> ComplementarityParameters:
    """Return parameters that fit a body and its mesh, in any units.

    Displacements of Gamma_3 that vary over the height H of the body meet the stiffness E'/H, the
    least one, and those that vary from node to node r*^2 H/E', the largest: r* is their geometric
    mean.
    """
    middle = automatic_r(scales)
    nodal = middle**2 * scales.height / scales.plane_modulus
    return ComplementarityParameters(middle, nodal, gamma * max(middle, nodal))


def overestimates_stiffness(
    problem: Problem, parameters: ComplementarityParameters, state: State
) -> bool:
    """Tell whether c is far above the stiffness of a body, by its first state. Collective.

    It is where c times the penetration is far above all loads, those on global unknowns included.
    Where nothing but a given motion of the foundation acts, there is no load to compare with.
    """
    interface = problem.interface
    penetration = np.maximum(-interface.opening(interface.jump.apply(state.x)), 0.0)
    foreseen = parameters.c * interface.jump.sum(penetration)
    forces = np.abs(residual_forces(problem, problem.start()))
    on_nodes, on_global = np.split(forces, [problem.equilibrium.owned])
    loads = interface.comm.allreduce(float(on_nodes.sum()), op=MPI.SUM) + on_global.sum()
    return bool(foreseen > OVERESTIMATE * loads > 0)
