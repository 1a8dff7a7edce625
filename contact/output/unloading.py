"""Hencky's law is nonlinear elasticity: what has yielded comes back the way it went.

A metal does not. Where |dev eps| beyond the yield strain decreases, the law says no more than
that, and whoever computes with it has to know.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.history import Evaluated
from contact.output.fields import DerivedFields
from contact.problem.problem import ContactProblem
from forms.elasticity import Anisotropic
from forms.hencky import HistoryLaw

#: Decrease of |dev eps|, over what it was, that counts as unloading; and of the secant modulus,
#: over that of small strains, that counts as yielding.
DECREASE, SOFTENED = 1e-6, 1e-9


class Unloading:
    """Follows |dev eps| from step to step.

    Parameters
    ----------
    problem
        The problem.
    x
        Local unknowns from which on it is followed. Collective.

    Attributes
    ----------
    share
        Largest share of the body (volume) that has unloaded from beyond yield in a step.
    """

    def __init__(self, problem: ContactProblem, state: Evaluated) -> None:
        self.share = 0.0
        body = problem.equilibrium
        self._body = body
        self._fields = None if body.linear else DerivedFields(body, state)
        if self._fields is not None:
            self._strains = self._fields.strains()
            self._volumes = self._fields.volumes_of_materials()
            self._whole = body.comm.allreduce(sum(v.sum() for v in self._volumes), op=MPI.SUM)

    def follow(self, state: Evaluated) -> None:
        """Look at the end of the next step. Collective."""
        if self._fields is None:
            return
        self._fields.move_to(state)
        before, self._strains = self._strains, self._fields.strains()
        back = 0.0
        for material, volumes, old, new in zip(
            self._body.body.materials, self._volumes, before, self._strains, strict=True
        ):
            if isinstance(material.law, Anisotropic | HistoryLaw):
                continue
            modulus = np.asarray(material.law.secant_modulus(old**2), dtype=float)
            yielded = modulus < (1 - SOFTENED) * float(material.law.shear)
            back += float(volumes @ (yielded & (new < (1 - DECREASE) * old)).mean(axis=1))
        share = self._body.comm.allreduce(back, op=MPI.SUM) / self._whole
        self.share = max(self.share, float(share))
