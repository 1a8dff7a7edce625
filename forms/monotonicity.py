"""Assumption (h1) on Hencky's law, strong monotonicity of the stress, by samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forms.hencky import Hencky


@dataclass(frozen=True)
class MonotonicityReport:
    """Constants of assumption (h1) on strains up to some |dev eps|.

    Attributes
    ----------
    g_0, largest
        Bounds of g from below and above.
    ceiling
        (d/2) k_0, which (h1)(a) allows g.
    alpha
        Lower bound of d(g t)/dt, (h1)(b): the material hardens where it is positive.
    beta
        Upper bound of d(g t)/dt.
    """

    g_0: float
    largest: float
    ceiling: float
    alpha: float
    beta: float

    @property
    def bounded(self) -> bool:
        """True if 0 < g_0 <= g <= (d/2) k_0: (h1)(a)."""
        return self.g_0 > 0 and self.largest <= self.ceiling

    @property
    def hardens(self) -> bool:
        """True if alpha > 0: (h1)(b)."""
        return self.alpha > 0

    @property
    def holds(self) -> bool:
        """True if (h1) holds."""
        return self.bounded and self.hardens


def check_monotonicity(
    law: Hencky, t_max: float, samples: int = 2000, dim: int = 3
) -> MonotonicityReport:
    """Sample (h1): 0 < g_0 <= g <= (d/2) k_0 and 0 < alpha <= d(g t)/dt <= beta, 0 < t <= t_max.

    Parameters
    ----------
    law
        The material.
    t_max
        The largest |dev eps| of interest, for instance that of a computed solution.
    samples
        Number of intervals; the slopes are those of the chords of g(t) t.
    dim
        The dimension d.
    """
    t = np.linspace(0.0, max(t_max, 1e-12), samples + 1)
    g = np.asarray(law.secant_modulus(t**2)) * np.ones_like(t)
    slopes = np.diff(g * t) / np.diff(t)
    return MonotonicityReport(
        float(g.min()),
        float(g.max()),
        dim / 2 * float(law.bulk),
        float(slopes.min()),
        float(slopes.max()),
    )
