"""The work of a body's stresses, divided among the functions of a scalar field."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem

from contact.body.equilibrium import BodyEquilibrium
from contact.body.loads import assembled
from contact.history import Evaluated, InternalVariables
from contact.typing import Array


class FieldWork:
    """Work along given unknowns, one value for each function of a field.

    The functions add up to 1, so that the values add up to the work: if a constant of a material is
    the sum of m_i phi_i, the derivative of value i by the constant is that of the work by m_i.

    Parameters
    ----------
    body
        The body.
    space
        Of the field: DG0 or P1.
    """

    def __init__(self, body: BodyEquilibrium, space: fem.FunctionSpace) -> None:
        self._body, functions = body, ufl.TestFunction(space)
        self._along = fem.Function(body.space)
        self._owned = space.dofmap.index_map.size_local
        self._forms = body.forms.work(self._along, functions)
        self._weighted = body.laws.divided(functions)

    def __call__(
        self, state: Evaluated, along: Array, phi_scale: float, after: InternalVariables | None
    ) -> Array:
        """Return the values of the functions that this rank owns. Collective.

        Parameters
        ----------
        state, along
            The unknowns of the stresses, and the owned ones along which they work.
        phi_scale
            The unit of the potential in both, which may be that of another body.
        after
            Weights of the internal variables at the end of the step, whose sum counts as work;
            None for none.
        """
        body = self._body
        for into, values in ((body.forms.at, state.x), (self._along, body.local(along))):
            nodal = body.nodal(values).copy()
            nodal[:, body.dim :] *= phi_scale / body.phi_scale
            into.x.array[:] = nodal.ravel()
        body.laws.set(state)
        found = sum(assembled(form, self._owned) for form in self._forms)
        if after is not None:
            body.laws.weigh(state, after)
            found = found + assembled(self._weighted, self._owned)
        return np.asarray(found)
