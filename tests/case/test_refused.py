"""What a case file may not say: one line each."""

import pytest

from contact.case.file import parse_case
from tests.problems.bar import changed
from tests.problems.messages import message_of

PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}

box = {"generator": "box", "size": [1, 1, 1], "cells": [1, 1, 1]}
electrode = [{"on": "left", "displacement": [0, 0], "potential": 0}]
full = {"e": [[0] * 6] * 3, "beta": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}

BAD = {
    "unknown section": {"meterial__young": 1},
    "unknown key": {"material__yung": 1},
    "unknown key deep": {"friction__mu__roh": 1},
    "unknown key in a list": {"load__0__tracton": 1},
    "no mesh": {"mesh": None},
    "no material": {"material": None},
    "no contact": {"contact": None},
    "table for a list": {"load": {"on": "top"}},
    "number for a table": {"solver": 3},
    "missing key": {"material__young": None},
    "negative modulus": {"material__young": -1.0},
    "modulus as text": {"material__young": "1.0"},
    "modulus as switch": {"material__young": True},
    "not a number": {"material__young": float("nan")},
    "infinite": {"solver": {"method": "uzawa", "r": float("inf")}},
    "huge": {"material__young": 10**400},
    "incompressible": {"material__poisson": 0.5},
    "unknown law": {"material__law": "plastic"},
    "log without yield": {"material__yield_strain": None},
    "plastic without yield": {"material": {"law": "j2", "young": 1.0, "poisson": 0.3}},
    "yield stress of another law": {"material__yield_stress": 1.0},
    "softening": {
        "material": {"law": "j2", "young": 1.0, "poisson": 0.3, "hardening": [[0, 2], [1, 1]]}
    },
    "key of a back stress": {
        "material": {
            **{"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 0.1},
            "kinematic": [{"modulos": 1.0}],
        }
    },
    "floor above the modulus": {"material__g_min": 1.0},
    "degree": {"space__degree": 3},
    "generator": {"mesh__generator": "circle"},
    "generator and file": {"mesh__file": "a.msh"},
    "neither": {"mesh__generator": None},
    "flat mesh": {"mesh__size": [4.0, 0.0]},
    "no cells": {"mesh__cells": None},
    "a billion cells": {"mesh__cells": [1_000_000_000, 1_000_000_000]},
    "half cells": {"mesh__cells": [8, 2.5]},
    "3 sizes": {"mesh__size": [1, 1, 1]},
    "axis in the plane": {"mesh__axis": [0, 0, 1]},
    "cell of a file": {"mesh": {"file": "a.msh", "cell": "triangle"}},
    "order of a file": {"mesh": {"file": "a.msh", "order": 2}},
    "order of a grid": {"mesh": {**box, "order": 2}},
    "cell of a box": {"mesh": {**box, "cell": "triangle"}},
    "order of a cell": {"mesh": {"generator": "quarter_disc", "order": 3}},
    "diagonal of a box": {"mesh": {**box, "diagonal": "left"}},
    "side": {"mesh__parts__loaded__side": "front"},
    "backward piece": {"mesh__parts__loaded__to": 1.0},
    "piece in space": {"mesh__parts__loaded__to": [1, 2]},
    "piece off the grid": {"mesh__parts__loaded": [{"side": "top"}, {"side": "left", "to": 0.3}]},
    "part named as a side": {"mesh__parts__top": {"side": "left"}},
    "generator key": {"mesh": {"generator": "quarter_disc", "radios": 1}},
    "generator value": {"mesh": {"generator": "quarter_disc", "radius": -1}},
    "infinite generator": {"mesh": {"generator": "quarter_disc", "size": float("inf")}},
    "parameters of a grid": {"mesh__parameters": {"radius": 1}},
    "unknown part": {"load__0__on": "laoded"},
    "unknown contact part": {"contact__on": "floor"},
    "contact part clamped": {"contact__on": "left"},
    "nothing fixed": {"fixed": [{"on": "left", "displacement": ["free", "free"]}]},
    "components": {"fixed__0__displacement": [0, 0, 0]},
    "components in space": {"mesh": box, "load__0__on": "top"},
    "component": {"fixed__0__displacement": [0, "fre"]},
    "load nowhere": {"load__0__on": None},
    "load of nothing": {"load__0__traction": None},
    "body force on a part": {"load__0__body_force": [0, 1]},
    "traction everywhere": {"load__0": {"everywhere": True, "traction": [0, 1]}},
    "unknown name": {"load__0__traction": ["10*w", 0]},
    "code": {"contact__gap": "__import__('os')"},
    "z in the plane": {"load__0__traction": ["z", 0]},
    "power": {"contact__gap": "9**9**9"},
    "press of nothing": {"contact__overlap": "press"},
    "gap and shape": {"contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 1]}},
    "shape": {"contact__foundation": {"shape": "cube"}},
    "normal": {
        "contact__gap": None,
        "contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 0]},
    },
    "layer": {"contact__layer": 0.1},
    "potential factor": {"contact__law": "compliance", "contact__potential_factor": 0.5},
    "tresca without bound": {"friction": {"law": "tresca"}},
    "coulomb without mu": {"friction": {"law": "coulomb"}},
    "mu without friction": {"friction__law": "none"},
    "negative mu": {"friction__mu": -0.3},
    "slip law": {"friction__mu": {"law": "rate", "rho": 1}},
    "radius": {"friction": {"law": "none", "radius": 1}},
    "potential without piezo": {"fixed": electrode},
    "charge without piezo": {"load__0__charge": 1},
    "electric without piezo": {"electric": {"k_e": 1}},
    "floating potential": {"material__piezo": PIEZO},
    "part of piezo": {"material__piezo": {"e31": 1, "e33": 1}},
    "both piezo": {"material__piezo": {**PIEZO, **full}},
    "piezo matrix": {"material__piezo": {**full, "e": [[0] * 5] * 3}},
    "permittivity asymmetric": {
        "material__piezo": {**full, "beta": [[1, 1, 0], [0, 1, 0], [0, 0, 1]]}
    },
    "permittivity indefinite": {
        "material__piezo": {**full, "beta": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}
    },
    "poling in the plane": {"material__piezo": {**PIEZO, "poling": [0, 0, 1]}, "fixed": electrode},
    "conductivity": {"material__piezo": PIEZO, "fixed": electrode, "electric": {"k_e": -1}},
    "slope of a jump": {
        "material__piezo": PIEZO,
        "fixed": electrode,
        "electric": {"k_e": 1, "law": "perfect", "delta": 9},
    },
    "floor of a constant": {"material__law": "linear", "material__g_min": 0.1},
    "argument of a constant": {"material__law": "linear", "material__argument": "square"},
    "method": {"solver__method": "newtn"},
    "setting of another method": {"solver__r": 25},
    "stopping rule of Newton's method": {"solver__stopping": "thesis"},
    "most inner iterations of Newton's method": {"solver__max_inner": 7},
    "penalty in Newton's method": {"solver__eps_contact": 1e-5},
    "default of another method": {"solver__acceleration": "anderson"},
    "tolerance of another rule": {"solver": {"method": "uzawa", "eps": 1e-4}},
    "over-relaxation of Anderson's steps": {"solver": {"method": "uzawa", "relaxation": 1.7}},
    "augmentation": {"solver": {"method": "uzawa", "r": 0}},
    "augmentation text": {"solver": {"method": "uzawa", "r": "big"}},
    "relaxation": {"solver": {"method": "uzawa", "acceleration": "none", "relaxation": 2.0}},
    "method as a list": {"solver__method": ["newton"]},
    "unknown setting": {"solver__tolerence": 1},
    "a setting of Python's": {"solver__gamma": 1.0},
    "nested meshes of another method": {"solver": {"method": "penalty", "nested": True}},
    "tolerance as a text": {"solver__tolerance": "1e-8"},
    "count as a number": {"solver__max_outer": 3.0},
    "switch as a number": {"solver__nested": 1},
    "tolerance": {"solver__tolerance": 0.0},
    "tolerance below rounding": {"solver__tolerance": 1e-16},
    "loose inner loop": {"solver": {"method": "uzawa", "inner_tolerance": 1e-3}},
    "iterations": {"solver__max_outer": 0},
    "levels": {"solver__nested_levels": 3},
    "output": {"output": {"fields": "vtk"}},
    "unknown output": {"output": {"feilds": "vtx"}},
    "output as a number": {"output": 3},
    "title": {"title": 3},
}


@pytest.mark.wording
def test_messages_of_bad_cases(snapshot):
    said = {
        name: message_of(parse_case, changed(**changes), source="bar.toml")
        for name, changes in BAD.items()
    }
    assert all(message.startswith("bar.toml: ") for message in said.values())
    snapshot("refused-cases", said)
