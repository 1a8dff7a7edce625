"""The contact laws of the penalised problem (PV_eps), node by node.

Pressure and friction are functions of the displacement here: [u_nu - rho]^+/eps_contact, and
s u_tau/(|u_tau| + eps_slip), (4.1)-(4.3). `Lagged` keeps the friction modulus of (4.33) from
an earlier iterate, `Implicit` takes everything at the present one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from contact.interface.interface import Interface
from contact.interface.jump import Multipliers
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


def penalised_forces(interface: Interface, nodal: Array, eps: Regularisation) -> Multipliers:
    """Return the contact forces of (4.3) at nodal unknowns of shape (n, bs). Collective."""
    return Implicit(interface, eps).forces(nodal)


class NodalLaw(Protocol):
    """Contact forces as a function of the nodal unknowns, with their derivative."""

    def forces(self, nodal: Array) -> Multipliers:
        """Return the forces. Collective."""

    def block(self, nodal: Array) -> Array:
        """Return their derivative, shape (n, d, d). Collective."""


def _pressure(interface: Interface, nodal: Array, eps: Regularisation) -> tuple[Array, Array]:
    """Return the penalty pressure and its derivative in u_nu: 1/eps also at first touch."""
    jump = interface.jump
    normal = jump.normal_component(nodal)
    pressure = penalty_pressure(normal, jump.gap, eps.contact)
    return pressure, (normal >= jump.gap) / eps.contact


def outer(a: Array, b: Array) -> Array:
    """Return a b^T node by node, shape (n, d, d)."""
    return a[:, :, None] * b[:, None, :]


class Lagged:
    """The laws of (4.32)-(4.33), with the friction modulus s/(|u_tau| + eps) of an iterate.

    Parameters
    ----------
    interface
        The contact nodes with their laws.
    eps
        Parameters of the laws.
    iterate
        Nodal unknowns at which the modulus is taken, shape (n, block size).
    """

    def __init__(self, interface: Interface, eps: Regularisation, iterate: Array) -> None:
        self._interface, self._eps = interface, eps
        pressure, _ = _pressure(interface, iterate, eps)
        forces = Multipliers(pressure, np.zeros((iterate.shape[0], interface.dim)))
        bound = interface.bound(iterate, forces)
        slip = interface.slip_length(iterate)
        self._modulus = penalty_friction_modulus(bound, slip, eps.slip)

    def acts(self) -> bool:
        """Tell whether there is friction anywhere at that iterate. Collective."""
        return self._interface.jump.maximum(self._modulus) > 0

    def stick(self) -> None:
        """Hold all nodes as stiffly along the foundation as across it."""
        self._modulus = np.full_like(self._modulus, 1 / self._eps.contact)

    def forces(self, nodal: Array) -> Multipliers:
        """Return the forces."""
        pressure, _ = _pressure(self._interface, nodal, self._eps)
        tangential = self._interface.slip(nodal)
        return Multipliers(pressure, self._modulus[:, None] * tangential)

    def block(self, nodal: Array) -> Array:
        """Return the derivative: only the active set of the normal part depends on `nodal`."""
        jump = self._interface.jump
        _, slope = _pressure(self._interface, nodal, self._eps)
        normal = slope[:, None, None] * outer(jump.normal, jump.normal)
        return normal + self._modulus[:, None, None] * jump.tangent


class Implicit:
    """The laws of (4.3) themselves.

    With a smoothing radius > 0 the derivative leaves out the terms of the smoothed pressure: they
    would couple the nodes.
    """

    def __init__(self, interface: Interface, eps: Regularisation) -> None:
        self._interface, self._eps = interface, eps

    def forces(self, nodal: Array) -> Multipliers:
        """Return the forces. Collective."""
        interface = self._interface
        pressure, _ = _pressure(interface, nodal, self._eps)
        tangential = interface.slip(nodal)
        forces = Multipliers(pressure, np.zeros_like(tangential))
        slip = interface.slip_length(nodal)
        modulus = penalty_friction_modulus(interface.bound(nodal, forces), slip, self._eps.slip)
        return Multipliers(pressure, modulus[:, None] * tangential)

    def block(self, nodal: Array) -> Array:
        """Return the derivative. Collective."""
        interface, eps = self._interface, self._eps.slip
        jump = interface.jump
        pressure, slope = _pressure(interface, nodal, self._eps)
        forces = Multipliers(pressure, np.zeros((nodal.shape[0], interface.dim)))
        bound = interface.bound(nodal, forces)
        slip = interface.slip_length(nodal)
        modulus = penalty_friction_modulus(bound, slip, eps)
        # Unit vectors of the slip; zero where there is none, as are the terms with it.
        tangential = interface.slip(nodal)
        unit = tangential / np.where(slip > 0, slip, 1.0)[:, None]
        total, share = interface.pressure(nodal, forces), slip / (slip + eps)
        along = (interface.friction.by_slip(total, slip) - modulus) * share
        across = interface.friction.by_pressure(total, slip) * slope * share
        block = slope[:, None, None] * outer(jump.normal, jump.normal)
        block = block + modulus[:, None, None] * jump.tangent
        block = block + along[:, None, None] * outer(unit, unit)
        return block + across[:, None, None] * outer(unit, jump.normal)
