"""Laws that differ between groups of nodes: each acts on its own.

All that acts on Gamma_3 acts node by node. Where several obstacles touch a body, their nodes are
one array, in which those of one obstacle follow each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from contact.calling import naming, real
from contact.interface.smoothing import Smoothing
from contact.typing import Array


@dataclass(frozen=True)
class Pieces:
    """Several laws in place of one.

    Attributes
    ----------
    laws
        The law of each group.
    bounds
        Where the groups begin on this rank, and the number of all nodes.
    what
        What messages call a law that may be the user's own, and fail or return no numbers.
    """

    laws: tuple[Any, ...]
    bounds: tuple[int, ...]
    what: str = ""

    @staticmethod
    def bounds_of(sizes: Iterable[int]) -> tuple[int, ...]:
        """Return the bounds of groups of given sizes."""
        return tuple(int(bound) for bound in np.cumsum([0, *sizes]))

    def _each(self, name: str, *arguments: Array) -> Array:
        """Return a method of each law at its own nodes."""
        parts, what = [], self.what
        if what and name != "__call__":
            what = f"{what}: {name}"
        for law, (begin, end) in zip(self.laws, pairwise(self.bounds), strict=True):
            here = [argument[begin:end] for argument in arguments]
            with naming(what) if what else nullcontext():
                values = getattr(law, name)(*here)
                parts.append(real(values, (end - begin,), "one number for each node"))
        return np.concatenate(parts) if len(parts) > 1 else parts[0]


@dataclass(frozen=True)
class PointwisePieces(Pieces):
    """p_nu, h_nu or phi_L."""

    def __call__(self, s: Array) -> Array:
        """Return the law at all nodes."""
        return self._each("__call__", s)

    def derivative(self, s: Array) -> Array:
        """Return the derivative at all nodes."""
        return self._each("derivative", s)


@dataclass(frozen=True)
class FrictionPieces(Pieces):
    """Friction bounds, see `forms.laws.FrictionLaw`."""

    @property
    def maximum(self) -> float:
        """Upper bound of s/p."""
        return max(law.maximum for law in self.laws)

    @property
    def lipschitz(self) -> float:
        """Lipschitz constant of s/p in the slip (1/length)."""
        return max(law.lipschitz for law in self.laws)

    def __call__(self, slip: Array, pressure: Array) -> Array:
        """Return the bound at all nodes."""
        return self._each("__call__", slip, pressure)

    def by_slip(self, slip: Array, pressure: Array) -> Array:
        """Return ds/d|u_tau|."""
        return self._each("by_slip", slip, pressure)

    def by_pressure(self, slip: Array, pressure: Array) -> Array:
        """Return ds/dp."""
        return self._each("by_pressure", slip, pressure)


@dataclass(frozen=True)
class ConductivityPieces(Pieces):
    """Conductivities, see `forms.laws.Conductivity`."""

    @property
    def k_e(self) -> float:
        """The largest conductivity."""
        return max(law.k_e for law in self.laws)

    @property
    def delta(self) -> float:
        """The largest slope of psi over k_e (1/length)."""
        return max(law.delta for law in self.laws)

    @property
    def follows_gap(self) -> bool:
        """Whether one of them does."""
        return any(law.follows_gap for law in self.laws)

    def at(self, s: Array, pressed: Array, loaded: Array) -> Array:
        """Return the conductivity at all nodes."""
        return self._each("at", s, pressed, loaded)

    def gap_slope(self, s: Array, pressed: Array) -> Array:
        """Return the derivative by s."""
        return self._each("gap_slope", s, pressed)


@dataclass(frozen=True)
class SmoothingPieces(Pieces):
    """R within each group: the pressure on one obstacle does not bound friction on another."""

    laws: tuple[Smoothing, ...]

    @property
    def radius(self) -> float:
        """The largest radius."""
        return max(law.radius for law in self.laws)

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        return self._each("__call__", values)
