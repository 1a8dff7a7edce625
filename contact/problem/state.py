"""The state of a contact problem, a frozen value, and the scales of a problem."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from contact.history import History
from contact.interface.complementarity import ComplementarityParameters
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.typing import Array


@dataclass(frozen=True)
class State:
    """Unknowns and multipliers at a time; their arrays are read-only.

    Attributes
    ----------
    x
        Local unknowns, ghosts behind the owned ones: displacement and scaled potential by node.
    multipliers
        Multipliers lambda_c and lambda_f at the contact nodes (stress).
    time
        Time of loads and prescribed values; 1 of a static problem.
    history
        History at the beginning of the step; empty for the reference configuration.
    active_set
        Active set of the last Newton step; None without one.
    layer_pressure
        Pressure of the linearised layer after that step, shape (n,); None for the law's.
    secant_at
        Of an initial guess: unknowns x* of the first secant modulus g(eps(x*)). None for x, where
        prescribed values that have changed strain the cells at the support alone: too soft.
    """

    x: Array
    multipliers: Multipliers
    time: float = 1.0
    history: History = field(default_factory=History)
    active_set: ActiveSet | None = None
    layer_pressure: Array | None = None
    secant_at: Array | None = None

    def __post_init__(self) -> None:
        """Mark unknowns and multipliers as read-only."""
        for array in (self.x, self.multipliers.contact, self.multipliers.friction):
            array.flags.writeable = False

    @property
    def starts_with_tangent(self) -> bool:
        """Whether the first linearisation is the tangent: the solution is taken to be near."""
        return self.active_set is not None and self.secant_at is None


@dataclass(frozen=True)
class Scales:
    """Lengths and stiffnesses of a body and its mesh, in any units.

    Attributes
    ----------
    young, poisson, bulk, shear
        Elastic constants of small strains, of the softest material (stress, none, stress, stress).
    contact_young
        E_3, Young's modulus at the contacts (stress).
    size
        Largest extent (length).
    height
        H, volume over the area of Gamma_3 (length).
    area
        Area of Gamma_3 (length^(d - 1)); of a body of revolution of the full turn (length^2).
    spacing
        h, spacing of the contact nodes (length).
    """

    young: float
    contact_young: float
    poisson: float
    bulk: float
    shear: float
    size: float
    height: float
    area: float
    spacing: float

    @property
    def plane_modulus(self) -> float:
        """E' = E/(1 - nu^2) of the softest material (stress)."""
        return self.young / (1 - self.poisson**2)

    @property
    def c(self) -> float:
        """Complementarity parameter c = 1.39 E'/sqrt(h H), (20) (stress/length).

        It is the geometric mean of the least and the largest stiffness of a mode of Gamma_3, about
        1.1 E'/H and 1.76 E'/h. On rectangles with the far side fixed, 16 and 32 cells of P1 over H,
        these are 1.0 to 1.2 E'/H and 1.3 to 1.8 E'/h (Poisson's ratios 0.3 and 0.45).
        """
        return 1.39 * self.plane_modulus / math.sqrt(self.spacing * self.height)

    @property
    def r(self) -> float:
        """Augmentation parameter r = c sqrt(E_3/E), by default (stress/length).

        Of a body of several materials the least stiffness may be that of the softest one, with E,
        and the largest is that of the material at the contact, with E_3.
        """
        return self.c * math.sqrt(self.contact_young / self.young)

    def complementarity_parameters(self, ratio: float) -> ComplementarityParameters:
        """Return c, kappa = c^2 H/E' = 1.93 E'/h, and gamma = `ratio` max(c, kappa) E_3/E, (20)."""
        c = self.c
        kappa = c**2 * self.height / self.plane_modulus
        gamma = ratio * max(c, kappa) * (self.contact_young / self.young)
        return ComplementarityParameters(c, kappa, gamma)
