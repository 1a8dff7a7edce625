"""Iterative solver of the piezoelectric operator: MINRES with a block-diagonal preconditioner.

The symmetrised operator [[K, E^T], [E, -L]] is indefinite. With L the permittivity's Laplacian,
diag(K, L) is positive definite and bounds the preconditioned spectrum by
+-[1, sqrt(1 + kappa)], kappa < 1 for PZT-5A (`forms.piezo.coupling_number`), whatever the mesh
and the units. K and L are replaced by one V-cycle each: GAMG with the rigid-body motions for
the displacement, hypre (or GAMG) for the potential.

The preconditioner is assembled from a copy of the operator whose electric rows are negated:
its diagonal blocks are K and L, and PETSc's fieldsplit looks at nothing else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.linear import multigrid
from contact.linear.layout import Layout, set_defaults
from contact.linear.multigrid import rigid_motions

#: Default options of the displacement's block, under ``fieldsplit_u_``. The W-cycle keeps the
#: counts flat; coarse levels have few unknowns.
MECHANICAL = {
    "pc_type": "gamg",
    **multigrid.DEFAULTS,
    "pc_mg_cycle_type": "w",
}

#: The same of the potential's block, under ``fieldsplit_phi_``, without hypre.
ELECTRIC = {
    "pc_type": "gamg",
    "pc_gamg_agg_nsmooths": "1",
    "pc_gamg_aggressive_coarsening": "0",
    "pc_mg_cycle_type": "w",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": "2",
    "mg_levels_pc_type": "sor",
}


class BlockPreconditioner:
    """The block-diagonal preconditioner of one linear operator.

    Parameters
    ----------
    ksp
        The solver, which is set up for fieldsplit. Options under its prefix come first, for
        instance ``-contact_fieldsplit_phi_pc_type gamg``.
    layout
        Unknowns with a potential.
    symmetric
        Whether the operator is symmetric: MINRES, else GMRES.
    """

    def __init__(self, ksp: PETSc.KSP, layout: Layout, symmetric: bool) -> None:
        self._layout, self._ksp = layout, ksp
        self._matrix: PETSc.Mat | None = None
        self._signs: PETSc.Vec | None = None
        multigrid.iterate(ksp, "minres" if symmetric else "gmres")
        pc = ksp.getPC()
        pc.setType("fieldsplit")
        mechanical, electric = _fields(layout)
        mechanical.compose("nearnullspace", rigid_motions(layout))
        pc.setFieldSplitIS(("u", mechanical), ("phi", electric))
        pc.setFieldSplitType(PETSc.PC.CompositeType.ADDITIVE)
        prefix = ksp.getOptionsPrefix() or ""
        set_defaults(f"{prefix}fieldsplit_u_", MECHANICAL)
        hypre = PETSc.Sys.hasExternalPackage("hypre")
        electric_options = {"pc_type": "hypre"} if hypre else ELECTRIC
        set_defaults(f"{prefix}fieldsplit_phi_", electric_options)

    def set_goal(self, rhs: PETSc.Vec | None) -> None:
        """Set the absolute tolerance of MINRES to rtol |b|; to 0 for None. Collective."""
        if self._ksp.getType() != "minres":
            return
        size = 0.0
        if rhs is not None:
            solved = rhs.duplicate()
            self._ksp.getPC().apply(rhs, solved)
            size = np.sqrt(max(rhs.dot(solved), 0.0))
        self._ksp.setTolerances(atol=self._ksp.rtol * size)

    def matrix(self, operator: PETSc.Mat) -> PETSc.Mat:
        """Return the copy of an operator with negated electric rows. Collective."""
        if self._matrix is None:
            self._matrix = operator.copy()
            # The diagonal of fixed unknowns is positive, and stays so.
            sign = np.ones(self._layout.free.shape)
            sign[self._layout.free[:, -1], -1] = -1.0
            self._signs = operator.createVecLeft()
            self._signs.array[:] = sign.ravel()
        else:
            operator.copy(self._matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._matrix.diagonalScale(L=self._signs)
        return self._matrix


def _fields(layout: Layout) -> tuple[PETSc.IS, PETSc.IS]:
    """Return the global numbers of the owned mechanical and electric unknowns."""
    d, bs = layout.dim, layout.block_size
    start, end = layout.index_map.local_range
    numbers: NDArray[np.integer] = np.arange(start * bs, end * bs, dtype=PETSc.IntType)
    nodes = numbers.reshape(-1, bs)
    mechanical = PETSc.IS().createGeneral(nodes[:, :d].ravel(), layout.comm)
    mechanical.setBlockSize(d)
    electric = PETSc.IS().createGeneral(nodes[:, d].copy(), layout.comm)
    return mechanical, electric
