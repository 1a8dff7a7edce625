"""Materials by name in systems of units: one physical problem has one solution in all of them."""

import tomllib

import numpy as np
import pytest

import contact
from contact.case.file import parse_case, to_toml
from contact.errors import InputError
from contact.model.units import SYSTEMS, UnitSystem, unit_system


def pressed(units, size, shift, volts=None, labels=None, name="steel", **more):
    """Return the case of a square pressed by a plate: its size, the shift and volts in units."""
    material = {"name": name, **more} if units is None else {"name": name, "units": units, **more}
    top = {"on": "top", "displacement": [0.0, -shift]}
    return parse_case(
        {
            "case": {} if labels is None else {"units": labels},
            "mesh": {"generator": "rectangle", "size": [size, size], "cells": [4, 4]},
            "material": material,
            "fixed": [
                top if volts is None else top | {"potential": volts},
                *([] if volts is None else [{"on": "left", "potential": 0.0}]),
            ],
            "contact": {"on": "bottom"},
        }
    )


def test_steel_in_millimetres_is_as_stiff_as_in_metres():
    """With a closed form: uniaxial plane strain, sides constrained."""
    entry = contact.library.materials.find("steel")
    young, poisson = entry.isotropic
    modulus = young * (1 - poisson) / (1 + poisson) / (1 - 2 * poisson)
    for units, length, stress in (
        ("N-mm-MPa", 1e-3, 1e6),
        ("SI", 1.0, 1.0),
        ("uN-um-MPa", 1e-6, 1e6),
        ({"length": "mm", "force": "kN"}, 1e-3, 1e9),
    ):
        case = pressed(units, 1e-3 / length, 1e-6 / length)
        case = parse_case(
            {
                **case.model_dump(by_alias=True, exclude_none=True),
                "fixed": [
                    {"on": "top", "displacement": [0.0, -1e-6 / length]},
                    *({"on": s, "displacement": [0.0, "free"]} for s in ("left", "right")),
                ],
            }
        )
        pressure = contact.solve(case).pressure * stress
        assert np.allclose(pressure, modulus * 1e-3, rtol=1e-8)


@pytest.mark.core("table")
@pytest.mark.parametrize("name", [*SYSTEMS, "table"])
def test_a_piezoelectric_problem_is_the_same_in_all_systems(name):
    """Displacements, pressures, potentials and charges in SI, whatever the system."""
    length, shift, volts = 1e-3, 1e-7, 50.0
    si = contact.solve(pressed("SI", length, shift, volts, name="PZT-5A"))
    table = {"length": "mm", "force": "daN", "potential": "kV"}
    units = table if name == "table" else name
    system = UnitSystem.model_validate(table) if name == "table" else unit_system(name)
    case = pressed(
        units,
        length / system.unit("length"),
        shift / system.unit("length"),
        volts / system.unit("potential"),
        name="PZT-5A",
    )
    other = contact.solve(case)
    assert np.allclose(other.pressure * system.unit("stress"), si.pressure, rtol=1e-8)
    phi, given = si.potential.x.array, other.potential.x.array * system.unit("potential")
    assert np.allclose(given, phi, rtol=0, atol=1e-8 * volts)
    # Of a plane body, a unit of length thick.
    charge = other.charges.electrodes["left"] * system.unit("charge") / system.unit("length")
    assert charge == pytest.approx(si.charges.electrodes["left"], rel=1e-7)
    assert np.abs(phi).max() > 1 and si.charges.electrodes["left"] != 0


def test_the_system_of_the_case_is_that_of_its_materials():
    case = pressed(None, 1.0, 1e-3, labels="N-mm-MPa")
    assert case.case.units.given == {
        "length": "mm",
        "stress": "MPa",
        "potential": "V",
        "charge": "mC",
    }
    assert case.material.units == "N-mm-MPa"
    assert case.material.in_body(2).law.young == pytest.approx(
        contact.library.materials.find("steel").isotropic[0] / 1e6
    )
    again = parse_case(tomllib.loads(to_toml(case)))
    assert again.material == case.material and again.case == case.case
    assert pressed("uN-um-MPa", 1.0, 1e-3, labels="uN-um-MPa").case.units.charge == "pC"


def test_materials_of_two_systems_are_refused():
    data = pressed("SI", 1.0, 1e-3).model_dump(by_alias=True, exclude_none=True)
    data["material"] = [
        {"name": "steel", "units": "SI", "on": "a"},
        {"name": "aluminium", "units": "GPa", "on": "b"},
    ]
    with pytest.raises(InputError, match=r"material\.1\.units.*\[units\]"):
        parse_case(data)
