"""Charges of a piezoelectric body: D.nu integrated over electrodes, loads and foundation."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.kkt import residual_forces
from contact.problem import ContactProblem
from contact.state import Multipliers, nodal_iterate, total_pressure


def charge_balance(problem: ContactProblem, forces: Multipliers) -> dict[str, float]:
    """Return the charges that bound the body. Collective.

    Returns
    -------
    "electrodes"
        What the parts with a prescribed potential hold: the reactions of the potential.
    "given"
        Surface charges q_2 minus body charges q_0.
    "foundation"
        What has left through the conductive foundation.
    "total"
        Their sum, which Gauss's law makes zero: a check of the solution.
    """
    problem.freeze()
    d, scale = problem.dim, problem.phi_scale
    residual = residual_forces(problem, forces).reshape(-1, problem.block_size)[:, d]
    given = problem.external.reshape(-1, problem.block_size)[:, d]
    nodal, trace = nodal_iterate(problem), problem.trace
    charge = problem.response.charge(nodal, total_pressure(problem, nodal, forces))
    local = [
        residual[~problem.free[:, d]].sum() / scale,
        given.sum() / scale,
        np.dot(trace.weight, charge),
    ]
    electrodes, known, foundation = problem.comm.allreduce(np.array(local), op=MPI.SUM).tolist()
    return {
        "electrodes": electrodes,
        "given": known,
        "foundation": foundation,
        "total": electrodes + known + foundation,
    }
