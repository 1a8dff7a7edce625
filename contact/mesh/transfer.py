"""Functions carried from one mesh of a body to another."""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray


def carry(coarse: fem.Function, space: fem.FunctionSpace) -> fem.Function:
    """Return the interpolant of a function in a space on another mesh. Collective.

    Parameters
    ----------
    coarse
        The function.
    space
        Space on another mesh of the same body.

    Notes
    -----
    Where the meshes are nested the new function is the old one, for its values at the nodes of
    the fine element are then all there is to know; elsewhere it differs by the fine mesh's
    interpolation error. A node of the new mesh that lies slightly outside of the old one, as on
    a curved boundary, gets the value of the closest cell.
    """
    made = fem.Function(space, name=coarse.name)
    cells = _covering(space)
    padding = 1e-3 * float(np.ptp(space.mesh.geometry.x, axis=0).max(initial=0.0))
    padding = space.mesh.comm.allreduce(padding, op=MPI.MAX)
    source = coarse.function_space
    data = fem.create_interpolation_data(space, source, cells, padding=padding)
    made.interpolate_nonmatching(coarse, cells, interpolation_data=data)
    made.x.scatter_forward()
    return made


def _covering(space: fem.FunctionSpace) -> NDArray[np.int32]:
    """Return owned cells that have all nodes among theirs: a fraction of the cells in space."""
    topology = space.mesh.topology
    nodes = space.dofmap.list[: topology.index_map(topology.dim).size_local]
    _, first = np.unique(nodes, return_index=True)
    return np.unique(first // nodes.shape[1]).astype(np.int32)
