"""Safeguards of Newton's step on active sets that cycle: no part of the laws.

- `guarded_active_set`: friction of nodes that go on slipping is raised to its bound; nodes whose
  slip reverses stick in one step.
- `bound_by_slip`: the derivative of the friction bound by the slip, limited where the bound falls;
  `NewtonStep` takes it once the active set is unchanged.
- `regularisation`: the Levenberg-Marquardt term of bodies that nothing constrains at first.
- `ConductivityDerivative`: psi of the charge linearised or frozen.

References
----------
Nocedal and Wright, Numerical Optimization, Springer (2006): Levenberg-Marquardt regularisation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.interface import Interface
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.typing import Array

#: Levenberg-Marquardt parameter over the stiffness of a node times the residual.
REGULARISATION = 1e-2


def guarded_active_set(
    interface: Interface,
    jump: Array,
    multipliers: Multipliers,
    bound: Array,
    c: float,
    before: ActiveSet | None,
) -> tuple[ActiveSet, Multipliers]:
    """Return the active set (18) of a step, and the multipliers about which it linearises.

    `before` is the active set of the last step; None in the first one, where closed nodes stick.
    """
    if before is None:
        closed = interface.normal_gap(jump) <= 1e-12 * interface.size
        return ActiveSet.without_slip(closed, interface.friction.acts), multipliers
    slip = interface.slip(jump)
    friction = at_bound(before, multipliers.friction, slip, bound)
    multipliers = replace(multipliers, friction=friction)
    active = interface.active_set(jump, multipliers, bound, c)
    reverses = before.slips & active.slips & (_power(friction, slip) < 0)
    sticks, slips = active.sticks | reverses, active.slips & ~reverses
    return replace(active, sticks=sticks, slips=slips), multipliers


def at_bound(before: ActiveSet, friction: Array, slip: Array, bound: Array) -> Array:
    """Return friction, raised to its bound at nodes that go on slipping, shape (n, d).

    The linearised bound of a coefficient that falls with the slip may be far below that of the new
    slip: active sets would cycle between stick and slip.
    """
    norm = np.linalg.norm(friction, axis=1)
    slides: NDArray[np.bool_] = (
        before.slips & (_power(friction, slip) > 0) & (norm < bound) & (norm > 0)
    )
    scale = np.where(slides, bound / np.where(slides, norm, 1.0), 1.0)
    return friction * scale[:, None]


def _power(friction: Array, slip: Array) -> Array:
    """Return lambda_f . u_tau, shape (n,)."""
    return np.einsum("ni,ni->n", friction, slip)


def bound_by_slip(interface: Interface, length: Array, pressure: Array, limit: float) -> Array:
    """Return max(ds/d|u_tau|, -limit) at |u_tau| and pressures, shapes (n,).

    The limit is the part of a node's stiffness that a falling bound may take away (stress/length):
    with one that falls faster than the stiffness, slip snaps. Collective.
    """
    return np.maximum(interface.friction.by_slip(length, pressure), -limit)


def regularisation(interface: Interface, residual: float, nodal_stiffness: float) -> Array:
    """Return the Levenberg-Marquardt term of the nodal blocks, shape (n, d, d).

    It bounds the steps while the active set changes, and decreases with the residual.
    """
    nodes = interface.nodes
    along = nodes.normal[:, :, None] * nodes.normal[:, None, :]
    return (
        REGULARISATION * min(residual, 1.0) * nodal_stiffness * (along + nodes.tangential_projector)
    )


@dataclass
class ConductivityDerivative:
    """Choice between psi'(u_nu - rho) in the tangent and psi frozen.

    With it, the charge psi(u_nu - rho) phi_L(phi - phi_F) is linearised consistently, and steep
    ramps psi converge fast. But a node that opens draws less charge, and may open further: the
    linearised charge leads back to contact, the node is then under tension, and the active set
    cycles. With psi frozen it opens to the other end of the ramp. `near` is the largest residual
    with the derivative, `included` tells whether the last step had it.
    """

    near: float = np.inf
    included: bool = False
    _limit: float = np.inf

    def worsened(self, residual: float) -> bool:
        """Tell whether a step with the derivative has raised the residual: it is to be rejected.

        The derivative is taken again below a tenth of the residual before that step.
        """
        if not self.included or residual <= self._limit:
            return False
        # A step with psi frozen may only undo this one.
        self._limit *= 0.1
        self.included = False
        return True

    def __call__(self, residual: float, allowed: bool = True) -> bool:
        """Tell whether the next step is to have the derivative, by the residual before it."""
        self.worsened(residual)
        self.included = allowed and residual <= min(self.near, self._limit)
        if self.included:
            self._limit = residual
        return self.included
