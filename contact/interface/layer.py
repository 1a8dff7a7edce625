"""The graph of a compliant layer and the rigid part behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.tolerances import EPS
from contact.typing import Array
from forms.laws import PenetrationLaw


@dataclass(frozen=True)
class NormalLaw:
    """-sigma_nu as a graph of u_nu (Figure 1.6): free, compliant layer, rigid part.

    Attributes
    ----------
    p_nu
        Penetration law.
    stiffness
        h_nu, frozen, shape (n,).
    touch, gap
        rho_0 and rho, gaps of the layer and of the rigid part, shape (n,).
    """

    p_nu: PenetrationLaw
    stiffness: Array
    touch: Array
    gap: Array

    def layer(self, u_n: Array) -> Array:
        """Return the pressure of the layer at normal displacements."""
        return self.stiffness * self.p_nu(u_n - self.touch)

    def layer_slope(self, u_n: Array) -> Array:
        """Return the derivative of `layer`."""
        return self.stiffness * self.p_nu.derivative(u_n - self.touch)

    def pressure(self, z: Array, r: float) -> Array:
        """Return P with (phi, P) on the graph and P + r phi = z: (3.43) with a layer.

        It is unique for any r > 0 above the slope of a falling p_nu.
        """
        low, high = self.touch, np.minimum(self.gap, z / r)
        phi, layer, steep = high, self.layer(high), self.layer_slope(high)
        free, rigid = z <= r * low, z - r * self.gap >= layer
        done = free | rigid
        # Newton's method in a bracket; every third sweep halves it, should Newton not.
        for sweep in range(90):
            excess, slope = r * phi + layer - z, r + steep
            # Below this the excess is rounding in phi.
            rounding = 4 * EPS * (np.abs(z) + np.abs(slope) * (np.abs(phi) + np.abs(self.touch)))
            done |= np.abs(excess) <= rounding
            if np.all(done):
                break
            low, high = np.where(excess < 0, phi, low), np.where(excess > 0, phi, high)
            newton = phi - excess / np.where(slope > 0, slope, r)
            inside = (newton > low) & (newton < high) & (sweep % 3 < 2)
            phi = np.where(done, phi, np.where(inside, newton, 0.5 * (low + high)))
            layer, steep = self.layer(phi), self.layer_slope(phi)
        # The layer's pressure is exact where it is small, the remainder where it is stiff.
        pressed = np.where(steep < r, layer, z - r * phi)
        return np.where(free, 0.0, np.where(rigid, z - r * self.gap, pressed))

    def displacement(self, z: Array, r: float) -> Array:
        """Return u_nu = (z - `pressure`)/r."""
        return np.asarray((z - self.pressure(z, r)) / r, dtype=float)

    def pressure_slope(self, z: Array, r: float) -> Array:
        """Return the derivative of `pressure` by z: 0 free, 1 rigid, between them in the layer."""
        high = np.minimum(self.gap, z / r)
        free, rigid = z <= r * self.touch, z - r * self.gap >= self.layer(high)
        slope = self.layer_slope(self.displacement(z, r))
        return np.where(free, 0.0, np.where(rigid, 1.0, slope / (slope + r)))
