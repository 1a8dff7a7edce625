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
        Nodal unknowns of the lagged friction modulus s/(|u_tau| + eps), (4.32)-(4.33), shape
        (n, block size). None: the modulus is implicit, (4.3), but for a smoothed pressure in its
        derivative.
    """

    def __init__(
        self, interface: Interface, eps: Regularisation, iterate: Array | None = None
    ) -> None:
        self._interface, self._eps = interface, eps
        self._modulus = None if iterate is None else self._modulus_at(iterate)

    def acts(self) -> bool:
        """Return whether friction acts: a lagged modulus above 0 anywhere. Collective."""
        return self._modulus is None or self._interface.nodes.maximum(self._modulus) > 0

    def stick(self) -> None:
        """Set the friction modulus to 1/eps_contact at all nodes."""
        self._modulus = np.full(self._interface.gap.shape, 1 / self._eps.contact)

    def _pressed(self, nodal: Array) -> tuple[Multipliers, Array]:
        """Return the pressures, and their derivative in u_nu: 1/eps also at first touch."""
        interface, nodes = self._interface, self._interface.nodes
        normal = nodes.normal_component(nodal)
        pressure = np.asarray(penalty_pressure(normal, interface.gap, self._eps.contact))
        multipliers = Multipliers(pressure, np.zeros(nodes.normal.shape))
        return multipliers, (normal >= interface.gap) / self._eps.contact

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
        interface, nodes = self._interface, self._interface.nodes
        multipliers, slope = self._pressed(nodal)
        modulus = self._modulus_at(nodal) if self._modulus is None else self._modulus
        block = slope[:, None, None] * outer(nodes.normal, nodes.normal)
        block = block + modulus[:, None, None] * nodes.tangent
        if self._modulus is not None:
            return block
        slip, unit = interface.slip_length(nodal), unit_vectors(interface.slip(nodal))
        total, share = interface.pressure(nodal, multipliers), slip / (slip + self._eps.slip)
        along = (interface.friction.by_slip(total, slip) - modulus) * share
        across = interface.friction.by_pressure(total, slip) * slope * share
        block = block + along[:, None, None] * outer(unit, unit)
        return block + across[:, None, None] * outer(unit, nodes.normal)
