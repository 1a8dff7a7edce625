"""How far loads and prescribed values move a body, about, before anything is solved."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.problem.problem import ContactProblem
from contact.typing import Array


def expected_displacements(
    problem: ContactProblem, loads: Array, prescribed: Array
) -> tuple[float, float]:
    """Return what loads, as a stress on Gamma_3, do to a block of the body's size. Collective.

    Parameters
    ----------
    problem
        The problem.
    loads
        Owned nodal loads, those on global unknowns behind them.
    prescribed
        Local unknowns with what is prescribed, 0 elsewhere.

    Returns
    -------
    That displacement, and the largest one that is prescribed.
    """
    body, scales = problem.equilibrium, problem.scales
    nodal = np.abs(body.nodal(loads)[:, : body.dim]).sum()
    force = body.comm.allreduce(float(nodal), op=MPI.SUM) + np.abs(body.motion(loads)).sum()
    given = np.abs(np.append(body.nodal(prescribed)[:, : body.dim], body.motion(prescribed)))
    largest = body.comm.allreduce(float(given.max(initial=0.0)), op=MPI.MAX)
    return float(force / scales.area / scales.young * scales.size), largest
