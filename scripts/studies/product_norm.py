"""How far apart two solutions are: the norms of the space of displacements and potentials."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem

from contact.problem.problem import ContactProblem
from contact.typing import Array
from forms.kinematics import strain


class ProductNorm:
    """The norms of X = V x W, (5.15): |eps(u)| and |grad(phi)| in L2(Omega).

    Parameters
    ----------
    problem
        Whose local unknowns are measured.
    """

    def __init__(self, problem: ContactProblem) -> None:
        body = self._body = problem.body
        self._x = fem.Function(body.space)
        u, phi = body.split(self._x)
        parts = [ufl.inner(strain(u), strain(u))]
        if phi is not None:
            parts.append(ufl.inner(ufl.grad(phi), ufl.grad(phi)))
        self._forms = [fem.form(part * problem.domain.dx) for part in parts]
        self._comm = problem.comm

    def __call__(self, x: Array) -> tuple[float, ...]:
        """Return the norms in V and, with a potential, W of local unknowns. Collective."""
        self._x.x.array[:] = self._body.nodal(x).ravel()
        squares = [self._comm.allreduce(fem.assemble_scalar(form)) for form in self._forms]
        return tuple(float(np.sqrt(square)) for square in squares)
