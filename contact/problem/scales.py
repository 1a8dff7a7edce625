"""Sizes of a body and its stiffness, from which solvers choose their parameters."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Scales:
    """Sizes that fit a body in any units.

    Attributes
    ----------
    young, poisson, bulk, shear
        Elastic constants of small strains (stress, none, stress, stress).
    size
        Largest extent (length).
    height
        Volume over the area of Gamma_3 (length).
    area
        Of Gamma_3 (length^(d - 1)); of a body of revolution over the full turn (length^2).
    spacing
        Of the contact nodes (length).
    """

    young: float
    poisson: float
    bulk: float
    shear: float
    size: float
    height: float
    area: float
    spacing: float

    @property
    def plane_modulus(self) -> float:
        """E' = E/(1 - nu^2) (stress)."""
        return self.young / (1 - self.poisson**2)
