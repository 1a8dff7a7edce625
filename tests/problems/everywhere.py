"""Nodal values of all ranks, sorted by position: a mesh made twice may be distributed otherwise."""

import numpy as np


def displacements(loop):
    """Return the displacements of all nodes, shape (nodes, d), on every rank. Collective."""
    body = loop.problem.equilibrium
    u = loop.state.x[: body.owned].reshape(-1, body.block_size)[:, : body.dim]
    return _sorted(body.comm, body.layout.points, u)


def pressures(loop):
    """Return the pressures of all contact nodes, shape (nodes,), on every rank. Collective."""
    nodes = loop.problem.nodes
    return _sorted(nodes.comm, nodes.points, loop.state.forces.pressure)


def _sorted(comm, points, values):
    points, values = (np.concatenate(comm.allgather(part)) for part in (points, values))
    return values[np.lexsort(np.round(points, 9).T)]
