"""Copies with other values are checked like new descriptions; all else remains."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest

from contact import (
    Contact,
    FixedPointOptions,
    GapFunction,
    InputError,
    Linear,
    Load,
    Material,
    Motion,
    NewtonOptions,
    Plane,
    Rigid,
    make_material,
    parse_case,
)
from contact.case.file import to_toml
from contact.model.section import Section
from tests.problems.bar import changed

LOAD, CONTACT = Load("top", [0.0, -1.0], amplitude=lambda t: 2 * t), Contact("bottom", "0.1*x")
PLANE = Plane((0.0, 0.0), (0.0, 1.0))


@pytest.mark.parametrize(
    ("one", "update", "words"),
    [
        (LOAD, {"tracton": [0.0, 1.0]}, r"Load on 'top': tracton: unknown.*mean traction\?"),
        (LOAD, {"traction": [0.0, "x+"]}, r"Load on 'top': traction\.1: .*\[formula\]"),
        (LOAD, {"traction": None}, r"\[load-values\]"),
        (CONTACT, {"gap": "a"}, r"Contact on 'bottom': gap: .*unknown name a"),
        (CONTACT, {"foundation": PLANE}, r"both gap and foundation; .*\[exclusive-keys\]"),
        (CONTACT, {"layer": 0.1}, r'layer with law = "compliance"'),
        (CONTACT, {"resultant": 1.0}, r"resultant: unknown key"),
        (Material(young=1.0, poisson=0.3), {"poisson": 0.5}, r"Material: poisson: given 0\.5"),
        (NewtonOptions(), {"tolerence": 1e-6}, r"tolerence: unknown.*mean tolerance\?"),
        (NewtonOptions(), {"max_outer": 0}, "NewtonOptions: max_outer: given 0"),
        (FixedPointOptions(), {"eps": 1e-6}, 'eps with stopping = "thesis"'),
        (parse_case(changed()), {"solver": 3}, "case: solver: .*accepted: a table with method"),
        (parse_case(changed()), {"title": None, "loads": ()}, "case: loads: .*mean load?"),
    ],
)
def test_other_values_are_checked(one: Section, update: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        one.model_copy(update=update)


def test_arguments_of_no_key_are_named() -> None:
    with pytest.raises(InputError, match=r"Options: tolerence: unknown key, did you mean tol.*"):
        NewtonOptions(tolerence=1e-6)  # type: ignore[call-arg]
    with pytest.raises(InputError, match=r"name: given .*; accepted: a printable text"):
        Contact("bottom", name="a\nb")


@pytest.mark.parametrize("name", ["a\tb", "a\rb", "a\x00b", "a\x1b[0m", "a\x7fb", "a\u2028b"])
def test_control_characters_are_refused_in_names(name: str) -> None:
    with pytest.raises(InputError, match=r"name: given .*; accepted: a printable text"):
        Contact("bottom", name=name)


def test_all_else_remains() -> None:
    pushed = LOAD.model_copy(update={"traction": [0.0, "-2*x"]})
    assert pushed == Load("top", [0.0, "-2*x"], amplitude=LOAD.amplitude)
    assert CONTACT.model_copy(update={"gap": None, "foundation": PLANE}) == Contact("bottom", PLANE)
    assert CONTACT.model_copy() == CONTACT
    own = Material(young=1.0, poisson=0.3).model_copy(update={"young": 2.0})
    assert own.law == Linear(2.0, 0.3)
    options = NewtonOptions(condense=False).model_copy(update={"tolerance": 1e-6})
    assert options == NewtonOptions(condense=False, tolerance=1e-6)
    turned = Motion(rotation=0.3, centre=[0.0, 0.0])
    assert turned.model_copy(update={"displacement": [1.0, 0.0]}).rotation == turned.rotation


def test_a_copy_of_a_case_has_its_name_and_those_of_amplitudes() -> None:
    growing = {"time": [0.0, 1.0], "value": [0.0, 2.0]}
    evolution = {"times": [0.0, 1.0], "steps": [2], "amplitudes": {"press": growing}}
    case = parse_case(changed(evolution=evolution), source="block.toml")
    load = case.load[0].model_copy(update={"amplitude": "press"})
    moved = case.model_copy(update={"load": (load,)})
    assert moved.source == "block.toml" and moved.load[0].amplitude == "press"
    assert moved.model_copy(update={"load": case.load}) == case
    unknown = load.model_copy(update={"amplitude": "pres"})
    with pytest.raises(InputError, match=r"block\.toml: load\.0\.amplitude: .*pres"):
        case.model_copy(update={"load": (unknown,)})
    with pytest.raises(InputError, match=r"amplitude: given 'press'"):
        _ = LOAD.model_copy(update={"amplitude": "press"}).factor


def test_copies_of_materials_have_the_rules_of_new_ones() -> None:
    """A factor of a coupled material was taken, and multiplied its stiffness alone."""
    coupled = make_material(2, name="PZT-4", units="GPa", poling=90)
    plastic = make_material(2, law="j2", young=10.0, poisson=0.3, yield_stress=1e-3)
    for material in (coupled, plastic):
        with pytest.raises(InputError, match=r"factor: .*a material without coupling"):
            material.model_copy(update={"factor": 2.0})
        with pytest.raises(InputError, match=r"factor: .*a material without coupling"):
            Material(material.law, material.piezo, factor=2.0)


def test_tables_are_no_values_of_a_copy() -> None:
    """Their rotations, in degrees in a case file, were taken in radians."""
    table = {"on": "right", "rotation": 10.0, "centre": [0.0, 0.0]}
    case = parse_case(changed())
    with pytest.raises(InputError, match=r"rigid\.0: given a table; accepted: Rigid\(\.\.\.\)"):
        case.model_copy(update={"rigid": [table]})
    motion = {"displacement": [0.0, 0.1]}
    with pytest.raises(InputError, match=r"rigid: given a table; accepted: Motion\(\.\.\.\)"):
        Contact("bottom").model_copy(update={"rigid": motion})
    assert Contact("bottom").model_copy(update={"rigid": Motion([0.0, 0.1])}).rigid is not None


def test_a_foundation_moves_by_a_motion_not_as_a_rigid_part() -> None:
    """The nodes of the contact part were tied to it."""
    with pytest.raises(InputError, match=r"rigid: .*accepted: Motion"):
        Contact("bottom", 0.01, rigid=Rigid("left", Motion([0.0, 0.1])))


def test_names_that_are_no_texts_are_refused() -> None:
    with pytest.raises(InputError, match="1"):
        Contact("bottom").model_copy(update={1: 1})


def test_a_copy_of_a_case_holds_what_a_file_says() -> None:
    """Others were solved, and could not be written with the results."""
    case = parse_case(changed(evolution={"times": [0.0, 1.0], "steps": [2]}))
    always = case.load[0].model_copy(update={"amplitude": "constant"})
    written = to_toml(case.model_copy(update={"load": (always,)}))
    assert parse_case(tomllib.loads(written)).load[0].amplitude == "constant"
    for update, place in (
        ({"load": (Load("top", [0.0, lambda x: x[0]]),)}, r"load\.0\.traction\.1"),
        ({"load": (Load("top", [0.0, 1.0], amplitude=lambda t: t),)}, r"load\.0\.amplitude"),
        ({"contact": Contact("bottom", GapFunction(lambda x: x[1]))}, r"contact\.foundation"),
        ({"material": Material(Linear(1.0, 0.3))}, r"material\.law"),
    ):
        with pytest.raises(InputError, match=rf"{place}: given an object of Python; accepted: "):
            case.model_copy(update=update)
