"""The nodal forces of the stresses in a body: assembled, or by the matrix of a linear one.

The matrix costs as much as a dozen assemblies of forces, which load steps need and static problems
mostly do not. Only who is told of many takes it: the forces of one problem are the same numbers,
however often they are asked for.
"""

from __future__ import annotations

import numpy as np
from dolfinx.fem.petsc import assemble_matrix, create_matrix
from mpi4py import MPI
from petsc4py import PETSc

from contact.body.known import LastAnswers
from contact.body.loads import assembled
from contact.body.weak_forms import WeakForms
from contact.history import InternalVariables
from contact.typing import Array


class InternalForces:
    """The forces of the stresses at given unknowns, supports and contact apart.

    Parameters
    ----------
    comm
        Ranks that ask together.
    forms
        The weak forms of the body.
    owned
        Number of unknowns of the nodes that this rank owns.
    """

    def __init__(self, comm: MPI.Intracomm, forms: WeakForms, owned: int) -> None:
        self._forms, self._owned = forms, owned
        # At a state, of its potential alone, and moved to see what rounding does.
        self._last = LastAnswers(comm, 3)
        self._matrix: PETSc.Mat | None = None

    def __call__(
        self, at: Array, secant_at: Array | None, variables: InternalVariables | None
    ) -> Array:
        """Return the owned forces at local unknowns of the nodes, shape (owned,). Collective.

        Parameters
        ----------
        at
            The unknowns.
        secant_at
            Where the secant modulus is taken; None for there too: the material law itself.
        variables
            The internal variables at the beginning of the step.
        """
        asked = (at,) if secant_at is None else (at, secant_at)
        history = () if variables is None else tuple(variables.arrays.values())
        return self._last((*asked, *history), lambda: self._found(variables, *asked))

    def assemble(self) -> None:
        """Keep the matrix of a linear body, by which forces are found from now on. Collective."""
        if self._matrix is None:
            self._matrix = create_matrix(self._forms.secant)
            assemble_matrix(self._matrix, self._forms.secant)
            self._matrix.assemble()

    def _found(
        self, variables: InternalVariables | None, at: Array, about: Array | None = None
    ) -> Array:
        if self._matrix is not None:
            return self._product(self._matrix, at)
        self._forms.variables.set(variables)
        self._forms.at.x.array[:] = at
        if about is not None:
            self._forms.secant_at.x.array[:] = about
        form = self._forms.law_forces if about is None else self._forms.secant_forces
        return assembled(form, self._owned)

    def _product(self, matrix: PETSc.Mat, at: Array) -> Array:
        vector, image = matrix.createVecs()
        vector.array[:] = at[: self._owned]
        matrix.mult(vector, image)
        return np.asarray(image.array)
