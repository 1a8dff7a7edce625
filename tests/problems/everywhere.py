"""Values of all ranks, sorted by position, and their comparison with those of one rank.

A mesh that is made twice may be distributed otherwise.
"""

import numpy as np
from mpi4py import MPI


def agree(make, quantities, rtol=1e-8, atol=0.0):
    """Compare quantities of `make(comm)` on all ranks with one rank's; return the former.

    Numbers may differ by `atol` and `rtol` times the largest of the same name; others are equal.
    """
    together, alone = (make(comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    found, expected = quantities(together), quantities(alone)
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        if np.asarray(value).dtype.kind == "f":
            bound = atol + rtol * np.abs(value).max()
            np.testing.assert_allclose(found[name], value, rtol=0, atol=bound, err_msg=name)
        else:
            assert np.array_equal(found[name], value), name
    return together


def displacements(loop):
    """Return the displacements of all nodes, shape (nodes, d), on every rank. Collective."""
    body = loop.problem.body
    u = loop.state.x[: body.owned].reshape(-1, body.block_size)[:, : body.dim]
    return at_all(body.comm, body.layout.points, u)


def pressures(loop):
    """Return the pressures of all contact nodes, shape (nodes,), on every rank. Collective."""
    nodes = loop.problem.nodes
    return at_all(nodes.comm, nodes.points, loop.state.multipliers.contact)


def at_all(comm, points, values):
    """Return the values at the points of all ranks, sorted by these. Collective."""
    points, values = (np.concatenate(comm.allgather(part)) for part in (points, values))
    return values[np.lexsort(np.round(points, 9).T)]
