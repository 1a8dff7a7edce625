"""The unknowns of a linear system: nodes with a block of unknowns each, some of them fixed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray

from contact.typing import Array


@dataclass(frozen=True)
class Layout:
    """Nodes and their unknowns: d displacement components, then a potential or none.

    Attributes
    ----------
    comm
        Communicator.
    index_map
        Of the nodes.
    points
        Coordinates of the owned nodes, shape (nodes, d) (length).
    free
        Which unknowns of the owned nodes are not fixed, shape (nodes, block size).
    size
        Largest extent of the body (length).
    stiffness
        Young's modulus, the unit of the operator (stress).
    revolved
        Whether the nodes are those of the half plane of a body of revolution, x its radius: it
        then moves along y alone.
    """

    comm: MPI.Intracomm
    index_map: IndexMap
    points: Array
    free: NDArray[np.bool_]
    size: float
    stiffness: float
    revolved: bool = False

    @property
    def dim(self) -> int:
        """Number d of displacement components of a node."""
        return self.points.shape[1]

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""
        return self.free.shape[1]

    @property
    def coupled(self) -> bool:
        """Whether there is a potential."""
        return self.block_size > self.dim

    @property
    def unknowns(self) -> int:
        """Number of unknowns over all ranks."""
        return int(self.index_map.size_global) * self.block_size

    def mask(self, values: Array) -> Array:
        """Return owned values, 0 where the unknown is fixed."""
        return np.where(self.free.ravel(), values, 0.0)
