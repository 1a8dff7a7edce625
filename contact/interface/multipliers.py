"""Contact forces at the contact nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.jump import Jump
from contact.typing import Array


@dataclass(frozen=True)
class Multipliers:
    """Contact forces at the owned contact nodes.

    Attributes
    ----------
    pressure
        lambda_c = -sigma_nu without the layer's part, shape (n,).
    friction
        lambda_f = -sigma_tau, tangential vectors, shape (n, d).
    """

    pressure: Array
    friction: Array

    @staticmethod
    def zero(jump: Jump) -> Multipliers:
        """Return vanishing contact forces."""
        return Multipliers(np.zeros(jump.gap.size), np.zeros(jump.normal.shape))

    @staticmethod
    def of(jump: Jump, pressure: Array, friction: Array) -> Multipliers:
        """Return contact forces with the tangential part of vectors of shape (n, d).

        All methods hand over theirs by this: what their arithmetic leaves along the normal is no
        friction.
        """
        return Multipliers(pressure, jump.tangential_component(friction))

    def vectors(self, jump: Jump) -> Array:
        """Return lambda_c nu + lambda_f, shape (n, d); of lambda_f the tangential part acts."""
        return self.pressure[:, None] * jump.normal + jump.tangential_component(self.friction)
