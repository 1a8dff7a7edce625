"""The jump: what the laws of Gamma_3 see of a body's unknowns."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.typing import Array


class Jump(Protocol):
    """Nodal values T x at the contact nodes, with their weights, directions and gaps.

    All that happens on Gamma_3 is written in them. In front of a rigid foundation T selects the
    nodes of the body (`contact.interface.nodes.ContactNodes`), and takes off how the foundation
    moves there.
    """

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""

    @property
    def nodes(self) -> NDArray[np.int32]:
        """Local numbers of the nodes that carry the blocks, shape (n,)."""

    @property
    def weight(self) -> Array:
        """Lumped areas, shape (n,)."""

    @property
    def normal(self) -> Array:
        """Contact directions, unit vectors out of the body, shape (n, d)."""

    @property
    def tangent(self) -> Array:
        """Projectors onto the free tangential directions, shape (n, d, d)."""

    @property
    def gap(self) -> Array:
        """Distances to the obstacle along the contact direction, shape (n,)."""

    @property
    def block_size(self) -> int:
        """Unknowns a node."""

    def apply(self, x: Array) -> Array:
        """Return T x of local or owned unknowns, shape (n, block size)."""

    def transpose(self, nodal: Array, into: Array) -> None:
        """Add T^T t of nodal vectors, shape (n, d) or (n, block size), to owned unknowns.

        Collective.
        """

    def normal_component(self, u: Array) -> Array:
        """Return u . nu, shape (n,), of vectors of shape (n, >= d)."""

    def tangential_component(self, u: Array) -> Array:
        """Return u_tau in the free tangential directions, shape (n, d)."""
