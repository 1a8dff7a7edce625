"""Distances to a limit, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from contact.typing import Array
from scripts.reporting import TWO_COLUMNS, subplots

#: How names of parameters and curves are drawn.
SYMBOLS = {
    "mu = k_e": r"$\mu = k_e$",
    "1/c": r"$1/c$ (m/GPa)",
    "p = c [r]^+": r"$p = c\,[r]^+$",
}


@dataclass(frozen=True)
class Errors:
    """Distances to a limit over a parameter."""

    #: The varied parameter.
    name: str
    #: Its values, shape (k,).
    parameter: Array
    #: Distances in V (and W), shape (k, 1 or 2).
    norms: Array

    @property
    def total(self) -> Array:
        """Distances in X, shape (k,)."""
        return np.linalg.norm(self.norms, axis=1)

    def order(self, low: float, high: float) -> float:
        """Return the least-squares order over a range of the parameter."""
        inside = (self.parameter >= low) & (self.parameter <= high)
        x, y = np.log(self.parameter[inside]), np.log(self.total[inside])
        return float(np.polyfit(x, y, 1)[0])


def draw_errors(curves: Mapping[str, Errors]) -> tuple[Figure, dict[str, Array]]:
    """Draw distances in V and W over the parameter, with a line of slope 1."""
    figure, axes = subplots(size=(TWO_COLUMNS, 3.8))
    data: dict[str, Array] = {}
    for (label, errors), fill in zip(curves.items(), ("none", "full"), strict=False):
        data[f"{errors.name}, {label}"] = errors.parameter
        words = SYMBOLS.get(label, label)
        for norms, space, line in zip(errors.norms.T, "VW", ("o-", "s-"), strict=True):
            size = 7 if fill == "none" else 3
            axes.loglog(
                errors.parameter, norms, line, label=f"{words}, in {space}", ms=size, fillstyle=fill
            )
            data[f"in {space}, {label}"] = norms
    slope = 2 * errors.total[-1] / errors.parameter[-1]
    axes.loglog(errors.parameter, slope * errors.parameter, "k:", label="slope 1")
    axes.set(xlabel=SYMBOLS[errors.name], ylabel="distance to the limit (V: m, W: GV)")
    axes.legend()
    return figure, data


def draw_iterations(curves: Mapping[str, Array]) -> Figure:
    """Draw errors over the iterations of the fixed point."""
    figure, axes = subplots(size=(TWO_COLUMNS, 3.8))
    for label, errors in curves.items():
        axes.semilogy(
            np.arange(1, errors.size + 1),
            errors,
            "o-",
            label=label.replace("mu = k_e = 0.02", r"$\mu = k_e = 0.02$"),
            ms=4,
        )
    axes.set(xlabel=r"iteration $n$", ylabel=r"$|x_n - x|$ in $X$")
    axes.legend()
    return figure
