"""When a solver follows the conductivity's dependence on the gap, and when it freezes it.

Followed, the charge psi(u_nu - rho) phi_L(phi - phi_F) converges fast even where the ramp psi is
steep. But where a node that opens draws less current and thus opens further, the linearised
charge may point back to the foundation, where the node cannot stay: it is pulled there. Such a
step is taken back and forth for ever. With psi frozen from step to step the node opens to the
other end of the ramp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class GapDerivative:
    """Decides from the residuals of the steps; all ranks decide alike.

    Attributes
    ----------
    near
        Residual from which on psi may be followed at all.
    """

    near: float = np.inf
    _limit: float = np.inf
    _included: bool = False

    @property
    def included(self) -> bool:
        """Whether the last step has followed psi."""
        return self._included

    def worsened(self, residual: float) -> bool:
        """Tell whether the last step has followed psi and made things worse: freeze it then.

        Parameters
        ----------
        residual
            The largest residual after that step.
        """
        if not self._included or residual <= self._limit:
            return False
        # A step with psi frozen may well undo what this one has done: ask for more.
        self._limit *= 0.1
        self._included = False
        return True

    def __call__(self, residual: float, allowed: bool = True) -> bool:
        """Tell whether the next step is to follow psi.

        Parameters
        ----------
        residual
            The largest residual before that step.
        allowed
            Whether the solver would follow it.
        """
        self.worsened(residual)
        self._included = allowed and residual <= min(self.near, self._limit)
        if self._included:
            self._limit = residual
        return self._included
