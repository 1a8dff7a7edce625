"""The derivative of the conductivity by the gap: whether a linearisation includes it.

With it, the charge psi(u_nu - rho) phi_L(phi - phi_F) is linearised consistently, and Newton's
method converges fast even where the ramp psi is steep. But a node that opens draws less charge,
and may thus open further. The linearised charge then leads back to contact, where the node is under
tension: the active set cycles. Without the derivative (psi frozen, Picard) the node opens to the
other end of the ramp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class ConductivityDerivative:
    """Decides by the residuals whether a step includes the derivative; alike on all ranks.

    Attributes
    ----------
    near
        Largest residual at which the derivative may be included at all.
    included
        Whether the last step has included it.
    """

    near: float = np.inf
    included: bool = False
    _limit: float = np.inf

    def worsened(self, residual: float) -> bool:
        """Tell whether the last step included the derivative and has raised the residual.

        If so, it is included again only below a tenth of the residual before that step.

        Parameters
        ----------
        residual
            The largest residual after that step.
        """
        if not self.included or residual <= self._limit:
            return False
        # The next step, with psi frozen, may only undo this one: ask for a smaller residual.
        self._limit *= 0.1
        self.included = False
        return True

    def __call__(self, residual: float, allowed: bool = True) -> bool:
        """Tell whether the next step is to include the derivative.

        Parameters
        ----------
        residual
            The largest residual before that step.
        allowed
            Whether the solver would include it.
        """
        self.worsened(residual)
        self.included = allowed and residual <= min(self.near, self._limit)
        if self.included:
            self._limit = residual
        return self.included
