"""The style of all figures: settings, colours, titles and the ends of colour bars."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from contact.model.units import force_of
from contact.results.options import Units
from contact.results.quantities import quantities
from contact.results.quantity import BODY
from contact.typing import Array

#: Settings of all figures.
STYLE: dict[str, Any] = {
    "figure.figsize": (6.3, 4.0),
    "font.size": 9,
    "font.family": "serif",
    "mathtext.fontset": "dejavuserif",
    "axes.linewidth": 0.6,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}
#: Figures narrower than this (inches) have small letters and panels below each other.
NARROW = 4.5
#: Characters of a title that fit on a figure.
LONGEST_TITLE = 70
#: Okabe and Ito's palette: told apart by colour-blind readers, and in grey.
BLUE, SKY, ORANGE, GREEN, GREY = "#0072B2", "#56B4E9", "#D55E00", "#009E73", "#555555"
#: Status of a node -> colour of its zone, and its name in legends.
ZONES = {
    "stick": ("#CDE7F0", "sticking"),
    "slip": ("#FBE3C8", "sliding"),
    "open": ("#F2F2F2", "open"),
}
#: Fields of the deformed body that are drawn by default: name of the figure, label.
DEFORMED: dict[str, tuple[str, str]] = {
    "von_mises": ("deformed", "von Mises stress"),
    "equivalent_plastic_strain": ("plastic", "equivalent plastic strain"),
    "potential": ("potential", r"potential $\varphi$"),
}
#: Colours of a bar, from its least to its largest value.
SHADES = 256
#: Quantiles of the values at which colours end where some values lie far beyond.
OUTLIERS = (0.005, 0.995)


@dataclass(frozen=True)
class Look:
    """Choices for all figures of a run."""

    width: float | None = None  #: of the figures (inches); None for that of a page
    #: Direction from a body in 3-D to the eye; None for one that sees the contact.
    view: tuple[float, float, float] | None = None

    @property
    def style(self) -> dict[str, Any]:
        """The settings of the figures."""
        if self.width is None:
            return STYLE
        # Long numbers of an axis would meet: their power of ten stands at its end.
        small = {"font.size": 7, "legend.fontsize": 6, "axes.formatter.limits": (-2, 4)}
        small = small if self.width < NARROW else {}
        return STYLE | {"figure.figsize": (self.width, self.width)} | small


#: Figures as wide as a page, with axes that suit them.
PAGE = Look()


def page_width() -> float:
    """Return the width of figures by the present settings (inches)."""
    return float(matplotlib.rcParams["figure.figsize"][0])


def sheet(aspect: float) -> Figure:
    """Return an empty figure of the present width, and of a height in shares of it."""
    return Figure(figsize=(page_width(), aspect * page_width()))


def image(figure: Figure, ending: str, dpi: int | None = None) -> bytes:
    """Return a figure as the contents of a file."""
    data = io.BytesIO()
    figure.savefig(data, format=ending, dpi=dpi or "figure")
    return data.getvalue()


def heading(title: str) -> str:
    """Return the title of a case as one line, not too long, to be shown as it is."""
    line = " ".join(title.split())
    if len(line) > LONGEST_TITLE:
        line = line[: LONGEST_TITLE - 1] + "…"
    return line.replace("$", r"\$")


def fitted(title: str) -> str:
    """Return a title in lines that fit on a figure of the present width."""
    letter = 0.6 * 1.2 * float(matplotlib.rcParams["font.size"]) / 72
    return "\n".join(textwrap.wrap(title, int(page_width() / letter)))


def name_and_label(field: str, units: Units) -> tuple[str, str]:
    """Return the name of the figure of a field, and the label of its colours."""
    name, words = DEFORMED.get(field, (field, field.replace("_", " ")))
    known = [each for each in quantities(BODY) if f"{field}_".startswith(f"{each.name}_")]
    return name, words + "".join(unit_of(each.unit, units, plane=False) for each in known)


#: Quantities whose unit is a power of that of length, of some times that of force.
POWERS = {"area": (2, False), "volume": (3, False), "force": (0, True), "work": (1, True)}
POWERS["force · length"] = POWERS["work"]


def unit_of(quantity: str, units: Units, plane: bool) -> str:
    """Return " (UNIT)" of "length", of one of `POWERS`, or a quotient; "" where it has no name."""
    if "/" in quantity:
        names = [unit_of(part, units, plane)[2:-1] for part in quantity.split("/")]
        return f" ({'/'.join(names)})" if all(names) else ""
    length, stress = units.length, units.stress
    if quantity not in POWERS:
        name = getattr(units, quantity, None)
        return f" ({name})" if name else ""
    power, forced = POWERS[quantity]
    if not length or (forced and not stress):
        return ""
    force = force_of(stress, length) if forced and stress else ""
    if force is None:  # of no name: stress times area
        force, power = stress, power + 2
    power -= plane
    sides = {-1: f"/{length}", 0: "", 1: f" {length}"}
    return f" ({(force or '') + sides.get(power, f' {length}$^{power}$')})".replace("( ", "(")


def smooth(ax: Axes, mesh: Triangulation, values: Array, norm: Normalize, colours: Any) -> None:
    """Colour triangles by values at their nodes, between which values are linear, not colours."""
    levels = np.linspace(norm.vmin, norm.vmax, SHADES + 1)
    look: dict[str, Any] = {"norm": norm, "cmap": colours, "extend": "both"}
    ax.tricontourf(mesh, values, levels, zorder=-1, **look)
    ax.set_rasterization_zorder(0)  # as they are, contours would stay shapes


def colour_bar(
    figure: Figure, axes: Sequence[Axes], norm: Normalize, colours: Any, label: str
) -> None:
    """Add a bar of colours below axes."""
    bar = {"location": "bottom", "aspect": 40, "shrink": 0.8}
    made = figure.colorbar(ScalarMappable(norm, colours), ax=axes, **bar)
    made.set_label(label, loc="left")  # a power of ten stands below the right end
    made.formatter.set_powerlimits((-2, 4))  # long numbers would meet
    made.locator = MaxNLocator(5, steps=[1, 2, 2.5, 5, 10])


def widened(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a colour bar: of a field that is constant to rounding a wide one."""
    largest = max(abs(low), abs(high))
    more = 0.05 * largest or 1.0
    return (low - more, high + more) if high - low <= 1e-6 * largest else (low, high)


def colour_range(values: Array, label: str) -> tuple[Normalize, str]:
    """Return the range of colours without singular peaks, and a label with the peaks cut off."""
    low, high = (float(end) for end in np.quantile(values, OUTLIERS))
    ends, peaks = [float(values.min()), float(values.max())], []
    if widened(*ends)[0] < ends[0]:
        return Normalize(*widened(*ends)), f"{label}, {ends[1]:.4g} everywhere"
    if low - ends[0] > 0.2 * (high - low) > 0:
        peaks.append(f"least {ends[0]:.3g}")
        ends[0] = low
    if ends[1] - high > 0.2 * (high - low) > 0:
        peaks.append(f"peak {ends[1]:.3g}")
        ends[1] = high
    return Normalize(*widened(*ends)), ", ".join([label, *peaks])
