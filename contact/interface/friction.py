"""Friction on Gamma_3: its bound at the contact nodes, (1.36)-(1.38)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.body.description import Field
from contact.interface.nodes import ContactNodes
from contact.interface.smoothing import Smoothing
from contact.typing import Array
from forms.laws import ConstantCoefficient, FrictionCoefficient


@dataclass(frozen=True)
class Friction:
    """Friction on the contact part.

    Attributes
    ----------
    coefficient
        Coulomb's mu(|u_tau|); None without Coulomb friction.
    tresca
        A fixed bound S (stress), used instead of mu times the pressure.
    radius
        Radius of the smoothing operator R; 0 for R = identity.
    mu
        Coulomb's mu as a function of position, instead of `coefficient`.
    """

    coefficient: FrictionCoefficient | None = None
    tresca: Field | None = None
    radius: float = 0.0
    mu: Field | None = None


@dataclass(frozen=True)
class NodalFriction:
    """Friction at the owned contact nodes.

    Attributes
    ----------
    coefficient
        Coulomb's mu(|u_tau|), for all nodes at once; None without.
    tresca
        A fixed bound, shape (n,); None without.
    smoothing
        The operator R.
    """

    coefficient: FrictionCoefficient | None
    tresca: Array | None
    smoothing: Smoothing

    @staticmethod
    def at(nodes: ContactNodes, friction: Friction) -> NodalFriction:
        """Evaluate friction at contact nodes. Collective."""
        coefficient, tresca = friction.coefficient, None
        if friction.mu is not None:
            coefficient = ConstantCoefficient(np.asarray(friction.mu.numpy(nodes.points)))
        if friction.tresca is not None:
            tresca = np.asarray(friction.tresca.numpy(nodes.points), dtype=float)
        return NodalFriction(coefficient, tresca, Smoothing(nodes, friction.radius))

    @property
    def acts(self) -> bool:
        """Whether a tangential force can act."""
        return self.coefficient is not None or self.tresca is not None

    @property
    def local(self) -> bool:
        """Whether the bound at a node depends on what happens there alone: R = identity."""
        return self.smoothing.radius == 0

    def bound(self, pressure: Array, slip: Array) -> Array:
        """Return s = mu(|u_tau|) |R p|, Tresca's S, or 0, shape (n,). Collective."""
        if self.tresca is not None:
            return np.broadcast_to(self.tresca, slip.shape)
        if self.coefficient is None:
            return np.zeros_like(slip)
        return np.asarray(self.coefficient(slip) * self.smooth(pressure), dtype=float)

    def smooth(self, pressure: Array) -> Array:
        """Return |R p|, shape (n,). Collective."""
        return np.maximum(self.smoothing(pressure), 0.0)
