"""Where a moving foundation is to begin with: it is put onto the body."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.body.masters import Masters
from contact.interface.nodes import ContactNodes
from contact.typing import Array


def approached(nodes: ContactNodes, x: Array, masters: Masters, time: float) -> Array:
    """Return unknowns with each free foundation moved by its force to where it first touches.

    Where it touches nothing, nothing resists its force: the first linear system would be singular.
    Collective.

    Parameters
    ----------
    nodes
        The contact nodes.
    x
        Local unknowns, the global ones behind them.
    masters
        The global unknowns.
    time
        When: forces are those of this time.
    """
    forces = masters.forces(time)
    for member in masters.members:
        push = np.zeros(masters.size)
        push[member.columns] = forces[member.columns]
        if nodes.motion is None or not member.foundation or not push.any():
            continue
        opening = nodes.gap - nodes.normal_component(nodes.apply(x))
        closing = -nodes.normal_component(nodes.motion @ push)
        mine = np.abs(nodes.motion[:, :, member.columns]).max(axis=(1, 2), initial=0.0) > 0
        way = np.full(opening.size, np.inf)
        there = mine & (closing > 0)
        way[there] = opening[there] / closing[there]
        least = nodes.comm.allreduce(float(way.min(initial=np.inf)), op=MPI.MIN)
        if 0 < least < np.inf:
            x = x.copy()
            x[x.size - masters.size :] += least * push
    return x
