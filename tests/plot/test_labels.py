"""Labels of figures and the ends of their colours."""

import numpy as np
import pytest

from contact.plot.style import colour_range, named, unit_of, widened
from contact.results.options import Units


@pytest.mark.parametrize(
    ("quantity", "plane", "space"),
    [
        ("area", "(mm)", "(mm$^2$)"),
        ("force", "(N/mm)", "(N)"),
        ("work", "(N)", "(N mm)"),
        ("force · length", "(N)", "(N mm)"),
    ],
)
def test_units_of_a_unit_of_thickness(quantity: str, plane: str, space: str) -> None:
    units = Units(length="mm", stress="MPa")
    assert unit_of(quantity, units, True) == f" {plane}"
    assert unit_of(quantity, units, False) == f" {space}"
    ours = Units(length="l", stress="s")
    assert unit_of("work", ours, True) == " (s l$^2$)"
    assert unit_of("force", ours, True) == " (s l)"


def test_rounding_has_no_colours() -> None:
    """What is the same everywhere has one colour, and a scale with short numbers."""
    low, high = widened(77.83342606819, 77.83342606821)
    assert high - low > 5
    assert widened(0.0, 1.0) == (0.0, 1.0)
    assert widened(-3.0, 2.0) == (-3.0, 2.0)
    norm, label = colour_range(200 + 1e-13 * np.arange(100.0) ** 4, "stress")
    assert label == "stress, 200 everywhere" and norm.vmin < 195
    norm, label = colour_range(np.zeros(3), "stress")
    assert label == "stress, 0 everywhere" and norm.vmin < norm.vmax
    assert colour_range(np.arange(3.0), "stress")[1] == "stress"


@pytest.mark.parametrize(
    ("field", "label"),
    [
        ("electric_field_y", "electric field y (V/mm)"),
        ("electric_displacement", "electric displacement (C/mm$^2$)"),
        ("principal_stress", "principal stress (MPa)"),
        ("stress_xy", "stress xy (MPa)"),
        ("plastic_strain", "plastic strain"),
        ("potential", r"potential $\varphi$ (V)"),
    ],
)
def test_fields_have_their_units(field: str, label: str) -> None:
    assert named(field, Units(length="mm", stress="MPa", potential="V", charge="C"))[1] == label
    assert named(field, Units())[1] == label.partition(" (")[0]
