"""The contact laws of the penalised problem (PV_eps), node by node.

Pressure and friction are functions of the displacement here: [u_nu - rho]^+/eps_contact, and
s u_tau/(|u_tau| + eps_slip), (4.1)-(4.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import unit_vectors
from contact.typing import Array
from forms.foundation import penalty_friction_modulus, penalty_pressure


@dataclass(frozen=True)
class Regularisation:
    """Parameters of the penalised laws.

    Attributes
    ----------
    contact
        eps of [u_nu - rho]^+/eps (length^3/force).
    slip
        eps of u_tau/(|u_tau| + eps) (length).
    """

    contact: float
    slip: float


def outer(a: Array, b: Array) -> Array:
    """Return a b^T node by node, shape (n, d, d)."""
    return a[:, :, None] * b[:, None, :]


class PenalisedLaw:
    """Contact forces as a function of the nodal unknowns, with their derivative.

    Parameters
    ----------
    interface, eps
        The contact nodes with their laws, and the parameters of these.
    iterate
        Nodal unknowns at which the friction modulus s/(|u_tau| + eps) is kept, (4.32)-(4.33), shape
        (n, block size). None: it is that of the present ones, (4.3); with a smoothing radius the
        derivative then leaves out the terms of the smoothed pressure, which would couple the nodes.
    """

    def __init__(
        self, interface: Interface, eps: Regularisation, iterate: Array | None = None
    ) -> None:
        self._interface, self._eps = interface, eps
        self._modulus = None if iterate is None else self._modulus_at(iterate)

    def acts(self) -> bool:
        """Tell whether a kept modulus is above 0 anywhere. Collective."""
        return self._modulus is None or self._interface.jump.maximum(self._modulus) > 0

    def stick(self) -> None:
        """Hold all nodes as stiffly along the foundation as across it."""
        self._modulus = np.full(self._interface.jump.gap.shape, 1 / self._eps.contact)

    def _pressed(self, nodal: Array) -> tuple[Multipliers, Array]:
        """Return the pressures, and their derivative in u_nu: 1/eps also at first touch."""
        jump = self._interface.jump
        normal = jump.normal_component(nodal)
        pressure = np.asarray(penalty_pressure(normal, jump.gap, self._eps.contact))
        forces = Multipliers(pressure, np.zeros(jump.normal.shape))
        return forces, (normal >= jump.gap) / self._eps.contact

    def _modulus_at(self, nodal: Array) -> Array:
        """Return the friction modulus, shape (n,). Collective."""
        interface = self._interface
        bound = interface.bound(nodal, self._pressed(nodal)[0])
        return np.asarray(
            penalty_friction_modulus(bound, interface.slip_length(nodal), self._eps.slip)
        )

    def forces(self, nodal: Array) -> Multipliers:
        """Return the forces. Collective."""
        modulus = self._modulus_at(nodal) if self._modulus is None else self._modulus
        tangential = self._interface.slip(nodal)
        return Multipliers(self._pressed(nodal)[0].pressure, modulus[:, None] * tangential)

    def block(self, nodal: Array) -> Array:
        """Return their derivative, shape (n, d, d). Collective."""
        interface, jump = self._interface, self._interface.jump
        forces, slope = self._pressed(nodal)
        modulus = self._modulus_at(nodal) if self._modulus is None else self._modulus
        block = slope[:, None, None] * outer(jump.normal, jump.normal)
        block = block + modulus[:, None, None] * jump.tangent
        if self._modulus is not None:
            return block
        slip, unit = interface.slip_length(nodal), unit_vectors(interface.slip(nodal))
        total, share = interface.pressure(nodal, forces), slip / (slip + self._eps.slip)
        along = (interface.friction.by_slip(total, slip) - modulus) * share
        across = interface.friction.by_pressure(total, slip) * slope * share
        block = block + along[:, None, None] * outer(unit, unit)
        return block + across[:, None, None] * outer(unit, jump.normal)
