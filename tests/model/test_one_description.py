"""Descriptions are what a case file of the same keys gives, and problems of both are the same."""

from __future__ import annotations

import inspect
from dataclasses import replace

import numpy as np
import pytest

from contact import (
    Body,
    Conductor,
    Contact,
    Electric,
    Fixed,
    Friction,
    InputError,
    Layer,
    Linear,
    Load,
    Material,
    Motion,
    Plane,
    Problem,
    Rigid,
    ShiftedConductivity,
    make_material,
    parse_case,
    solve,
)
from contact.model.evolution import Amplitude, Evolution
from contact.model.messages import keys_of
from forms.laws import Compliance, PotentialFactor, Truncation
from tests.problems.put_together import block

TABLES = {
    "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]},
    "material": {"name": "PZT-4", "units": "GPa", "poling": 30.0},
    "fixed": [{"on": "top", "displacement": [0.0, -0.005], "potential": 0.0}],
    "rigid": [{"on": "left", "displacement": ["free", 0.0], "force": [0.1, 0.0]}],
    "contact": {
        "on": "bottom",
        "law": "compliance",
        "gap": "0.001*x",
        "layer": 0.002,
        "stiffness": 50.0,
        "limit": np.inf,
        "electric": {"k_e": 2.0, "phi_f": 0.1},
    },
    "evolution": {
        "times": [0.0, 1.0],
        "steps": [2],
        "amplitudes": {"press": {"time": [0.0, 1.0], "value": [0.0, 2.0]}},
    },
}


def test_tables_are_the_same_objects() -> None:
    case = parse_case(TABLES)
    assert case.material == Material(name="PZT-4", units="GPa", poling=30.0)
    assert Material(Linear(1.0, 0.3)).law == Linear(1.0, 0.3)
    for part in (
        Rigid("left", Motion(["free", 0.0], force=[0.1, 0.0])),
        Rigid("left", displacement=["free", 0.0], force=[0.1, 0.0]),
    ):
        assert case.rigid[0].model_dump() == part.model_dump()
    electric = Electric(2.0, 0.1)
    assert case.contact == Contact(
        "bottom", gap="0.001*x", layer=0.002, stiffness=50.0, limit=np.inf, electric=electric
    )
    amplitude = Amplitude(time=[0.0, 1.0], value=[0.0, 2.0])
    assert case.evolution == Evolution(times=[0.0, 1.0], steps=[2], amplitudes={"press": amplitude})


def test_objects_stand_for_keys() -> None:
    """A body on a layer that conducts: by keys, and by the laws that they mean."""
    body = Body(Material(name="PZT-4", units="GPa"), Fixed("top", [0.0, -0.005], potential=0.0))
    keys = Contact("bottom", layer=0.002, stiffness=50.0, electric=Electric(2.0, 0.1, delta=20.0))
    laws = Contact(
        "bottom",
        layer=Layer(0.002, Compliance(0.1), PotentialFactor(50.0, 2.0, 128.0)),
        conductor=Conductor(ShiftedConductivity(2.0, 20.0), 0.1, Truncation(np.inf)),
    )
    one, other = (solve(Problem(block(), body, contact)) for contact in (keys, laws))
    assert one.charges is not None and other.charges is not None
    assert one.contact_force == pytest.approx(other.contact_force, rel=1e-10)
    assert one.charges.foundation == pytest.approx(other.charges.foundation, rel=1e-10)
    assert abs(one.charges.foundation) > 0


def test_law_and_coupling_of_a_body_are_those_of_its_materials() -> None:
    """Also of other ones in its place: the softest law, the first tensors."""
    body = Body(Linear(10.0, 0.3), Fixed("top", [0.0, 0.0]))
    assert body.materials == (Material(Linear(10.0, 0.3)),) and body.piezo is None
    crystal = make_material(2, name="PZT-4", units="GPa", on="left")
    other = replace(body, materials=[crystal, Material(Linear(1.0, 0.3), on="right")])
    assert other.law == Linear(1.0, 0.3) and other.piezo == crystal.piezo
    assert replace(other, loads=Load("top", [0.0, -1.0])).materials == other.materials


def test_foundations_move_by_the_contact() -> None:
    """A problem is made of the contacts of another one; a body that moves up is pressed alike."""
    body, motion = Body(Linear(10.0, 0.3), Fixed("top", [0.0, 0.0])), Motion([0.0, 0.004])
    plane = Plane((0.0, 0.0), (0.0, 1.0))
    first = Problem(block(), body, Contact("bottom", plane, rigid=motion), Friction(mu=0.1))
    moved = Body(body.law, Fixed("top", [0.0, -0.004]))
    again = Problem(first.domain, first.description, first.contacts)
    second = Problem(first.domain, moved, Contact("bottom", plane), Friction(mu=0.1))
    forces = [solve(problem).contact_force for problem in (first, again, second)]
    assert forces[0][1] < -0.01
    for force in forces[1:]:
        assert force == pytest.approx(forces[0], rel=1e-10)


def test_the_potential_of_a_foundation_in_time() -> None:
    """From the beginning, unless it has an amplitude; formulas and functions of time."""
    domain, half = block(), lambda t: 0.5 * t
    for electric, values in (
        (Electric(1.0, 32.0), (32.0, 32.0)),
        (Electric(1.0, "32*t"), (8.0, 32.0)),
        (Electric(1.0, 32.0, amplitude=half), (4.0, 16.0)),
        (Electric(1.0, lambda t: 2 * t, amplitude="constant"), (0.5, 2.0)),
    ):
        conductor = electric.conductor(domain, "bottom")
        assert tuple(conductor.at(time).phi_f for time in (0.25, 1.0)) == pytest.approx(values)


def test_the_arguments_of_a_material_are_its_keys() -> None:
    """A key that `__init__` lacks would be one of the case file alone."""
    arguments = {*inspect.signature(Material.__init__).parameters} - {"self", "factor"}
    assert arguments == {*keys_of(Material)}


def test_the_material_of_a_body_may_be_given_by_the_name_law() -> None:
    """As it was before a body had a field `materials`."""
    law, support = Linear(1.0, 0.3), Fixed("left", [0.0, 0.0])
    assert Body(law=law, fixed=support) == Body(law, support)
    assert replace(Body(law=law, fixed=support), fixed=()).law is law
    with pytest.raises(InputError, match=r"Body: given .* accepted: one of materials, law"):
        Body(law, support, law=law)
    with pytest.raises(InputError, match="law: given None; accepted: Linear"):
        Body(fixed=support)
