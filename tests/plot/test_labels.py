"""Labels of figures and the ends of their colours."""

import pytest

from contact.plot.style import unit_of
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


def test_a_stress_per_area_names_the_force() -> None:
    assert unit_of("force", Units(length="mm", stress="daN/mm²"), False) == " (daN)"
    assert unit_of("force", Units(length="m", stress="N/mm2"), False) == " (N/mm2 m$^2$)"
