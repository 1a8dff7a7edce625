"""Contact nodes in algebraic multigrid: nodal blocks that are far stiffer than the body."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.typing import Array

#: Part of the contact blocks that is there when the interpolation is made: it alters nothing, but
#: where contact alone holds the body the coarsest operator would be singular without it.
TOUCH = 1e-8


class StiffNodes:
    """The contact nodes of a system that GAMG preconditions.

    Left to itself, GAMG takes a sliding node for one that is cut off, because its gamma outweighs
    all couplings, and leaves its motion along the foundation out of the coarse spaces; and a
    coarse function that moves one node against gamma is lost whole. Either way nothing but the
    smoother acts in a layer at the sliding zone, and the counts grow with its area in elements.

    So the interpolation is made for the body alone, once. At a contact node, where K is the
    body's nodal block and B the contact's, it is then multiplied by (K + |B|)^-1 K: the motion
    that is in equilibrium with the same neighbours. |B|, the root of B^T B, takes friction that
    falls with the slip for a stiffness too, and what it is multiplied by stays bounded.

    Parameters
    ----------
    pc
        GAMG, set up with the body's operator.
    nodes
        Owned nodes that may have contact blocks, local numbers, shape (n,).
    """

    def __init__(self, pc: PETSc.PC, nodes: NDArray[np.int32]) -> None:
        self._nodes = nodes
        self._interpolation: PETSc.Mat | None = None
        if pc.getMGLevels() == 1:
            return
        finest = self._interpolation = pc.getMGInterpolation(pc.getMGLevels() - 1)
        first, bs = finest.getOwnershipRange()[0], finest.getBlockSizes()[0]
        self._rows = (first + bs * nodes[:, None] + np.arange(bs)).astype(PETSc.IntType).ravel()
        chosen = PETSc.IS().createGeneral(self._rows, finest.comm)
        of_body = finest.createSubMatrix(chosen, None)
        self._starts, self._columns, self._values = of_body.getValuesCSR()

    def follow(self, own: Array, blocks: Array) -> None:
        """Adapt the interpolation to contact blocks. Collective.

        Parameters
        ----------
        own, blocks
            What the body and contact have at the nodes, zero where an unknown is fixed, shape
            (n, block size, block size).
        """
        # Of K its diagonal will do.
        root = np.sqrt(np.abs(np.einsum("nii->ni", own)))
        scaled = blocks / root[:, :, None] / root[:, None, :]
        # Where numbers overflow the solver itself will say so.
        left, size, right = np.linalg.svd(np.where(np.isfinite(scaled), scaled, 0.0))
        yielding = np.einsum("nki,nk,nkj->nij", right, 1 / (1 + size), right)
        self._inverse = np.einsum("nki,nk,njk->nij", right, size / (1 + size**2), left)
        self._inverse /= root[:, :, None] * root[:, None, :]
        if self._interpolation is not None:
            values = self._mixed(yielding * root[:, None, :] / root[:, :, None])
            self._interpolation.setValuesIJV(self._starts, self._columns, values, rowmap=self._rows)
            self._interpolation.assemble()

    def _mixed(self, factor: Array) -> Array:
        """Return the values of the rows, those of each node multiplied by a matrix."""
        bs = factor.shape[1]
        row = np.repeat(np.arange(self._rows.size), np.diff(self._starts))
        within = np.arange(row.size) - self._starts[row]
        values = np.zeros_like(self._values)
        for k in range(bs):
            # The rows of a node have the same columns.
            same = self._starts[row // bs * bs + k] + within
            values += factor[row // bs, row % bs, k] * self._values[same]
        return values

    def jump(self, rhs: PETSc.Vec) -> PETSc.Vec:
        """Return a vector that balances what the stiff blocks alone can carry of a right-hand side.

        With friction they carry forces in other directions than those in which they are stiff.
        These would pass to the coarse levels, where nothing resists them, and the first
        correction would be so large that a residual relative to it said nothing.
        """
        vector = rhs.duplicate()
        values = vector.array.reshape(-1, self._inverse.shape[1])
        values[self._nodes] = np.einsum(
            "nij,nj->ni", self._inverse, rhs.array.reshape(values.shape)[self._nodes]
        )
        return vector
