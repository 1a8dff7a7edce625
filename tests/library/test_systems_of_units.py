"""Materials by name in systems of units: one physical problem has one solution in all of them."""

import tomllib

import numpy as np
import pytest

import contact
from contact.case.file import parse_case, to_toml
from contact.errors import InputError
from contact.model.units import SYSTEMS, System, system_named

STEEL = {"name": "steel"}


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
    """With a closed form: uniaxial plane strain, sides held."""
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
    system = System(1e-3, 10.0, 1e3) if name == "table" else system_named(name, {})
    case = pressed(
        units,
        length / system.length,
        shift / system.length,
        volts / system.potential,
        name="PZT-5A",
    )
    other = contact.solve(case)
    assert np.allclose(other.pressure * system.unit("stress"), si.pressure, rtol=1e-8)
    phi, given = si.potential.x.array, other.potential.x.array * system.potential
    assert np.allclose(given, phi, rtol=0, atol=1e-8 * volts)
    # Of a plane body, a unit of length thick.
    charge = other.charges.electrodes["left"] * system.unit("charge") / system.length
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


MM = {"length": "mm", "stress": "MPa"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"units": None, "labels": MM}, '"SI" has m for length, and case.units.length = "mm"'),
        ({"units": None, "labels": {"stress": "psi"}}, 'has Pa for stress, and .*"psi"'),
        ({"units": None, "labels": {"length": "R"}}, 'has m for length, and .*"R"'),
        ({"units": "GPa", "labels": MM}, '"GPa" has GPa for stress'),
        ({"units": "SI", "labels": MM}, r'accepted: "N-mm-MPa" \[units]$'),
        ({"units": "kN-mm-GPa", "labels": {"stress": "N/mm²"}}, "for stress"),
        ({"units": "SI", "labels": "N-mm-MPa"}, "for length"),
        ({"units": "N-mm", "labels": None}, "accepted: .*N-mm-MPa.*or a table"),
        ({"units": {"length": "inch"}, "labels": None}, r"units\.length: given .inch."),
        ({"units": {"lenght": "mm"}, "labels": None}, "did you mean length"),
        ({"units": None, "labels": "mm-MPa"}, r"case\.units: given .mm-MPa.; accepted: .SI."),
        (
            {"units": "N-mm-MPa", "labels": MM | {"charge": "C"}, "name": "PZT-4"},
            "has mC for charge",
        ),
        (
            {"units": "GPa", "labels": {"length": "mm", "stress": "GPa", "potential": "GV"}}
            | {"name": "PZT-4"},
            r"accepted: labels of one system",
        ),
        (
            {"units": "GPa", "labels": {"length": "mm", "stress": "GPa", "charge": "nC"}}
            | {"name": "PZT-4"},
            "accepted: labels of one system",
        ),
    ],
)
def test_contradictions_are_refused(arguments, words):
    with pytest.raises(InputError, match=words) as caught:
        pressed(size=1.0, shift=1e-3, **arguments)
    assert "\n" not in str(caught.value)


def test_labels_that_fit_are_accepted():
    for units, labels in (
        ("N-mm-MPa", MM),
        ("N-mm-MPa", {"length": "mm", "stress": "N/mm2", "charge": "C"}),  # steel has no charge
        ("GPa", {"length": "mm", "stress": "GPa", "potential": "MV"}),
        ({"length": "cm", "force": "daN"}, {"length": "cm", "stress": "daN/cm^2"}),
    ):
        assert pressed(units, 1.0, 1e-3, labels=labels).case.units.given == labels


def test_materials_of_two_systems_are_refused():
    data = pressed("SI", 1.0, 1e-3).model_dump(by_alias=True, exclude_none=True)
    data["material"] = [
        {"name": "steel", "units": "SI", "on": "a"},
        {"name": "aluminium", "units": "GPa", "on": "b"},
    ]
    with pytest.raises(InputError, match=r'material\.1\.units: "GPa", and material\.0 has "SI"'):
        parse_case(data)


def test_labels_are_printed_with_the_letter_of_si() -> None:
    """The names of systems keep letters of a keyboard."""
    assert system_named("uN-um-MPa", {}).labels["length"] == "µm"
    assert {"µm"} == {system_named(k, {}).labels["length"] for k in SYSTEMS if "um" in k}
    assert system_named("N-mm-MPa", {}).labels == {
        "length": "mm", "stress": "MPa", "potential": "V", "charge": "mC"
    }  # fmt: skip
