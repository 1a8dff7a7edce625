"""What a case file may not say: one line each."""

import json

import pytest

from contact.case.file import parse_case
from contact.errors import InputError
from tests.problems.bar import changed

PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}

box = {"generator": "box", "size": [1, 1, 1], "cells": [1, 1, 1]}
electrode = [{"on": "left", "displacement": [0, 0], "potential": 0}]
full = {"e": [[0] * 6] * 3, "beta": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}

BAD = {
    "unknown section": ({"meterial__young": 1}, "meterial: unknown key, did you mean material?"),
    "unknown key": ({"material__yung": 1}, "material.yung: unknown key, did you mean young?"),
    "unknown key deep": (
        {"friction__mu__roh": 1},
        'friction.mu.roh: unknown key with law = "slip", did you mean rho?',
    ),
    "unknown key in a list": ({"load__0__tracton": 1}, "load.0.tracton: unknown key"),
    "no mesh": ({"mesh": None}, "mesh: missing; accepted: a table"),
    "no material": ({"material": None}, "material: missing"),
    "no contact": ({"contact": None}, "contact: missing"),
    "table for a list": ({"load": {"on": "top"}}, "load: given a table; accepted: tables [[load]]"),
    "number for a table": ({"solver": 3}, "solver: given 3; accepted: a table"),
    "missing key": ({"material__young": None}, "material.young: missing; accepted: a number > 0"),
    "negative modulus": ({"material__young": -1.0}, "material.young: given -1.0"),
    "modulus as text": ({"material__young": "1.0"}, 'material.young: given "1.0"; accepted'),
    "modulus as switch": ({"material__young": True}, "material.young: given true"),
    "not a number": ({"material__young": float("nan")}, "material.young: given nan"),
    "infinite": ({"solver": {"method": "uzawa", "r": float("inf")}}, "solver.r: given inf"),
    "huge": ({"material__young": 10**400}, "material.young: given 1000"),
    "incompressible": ({"material__poisson": 0.5}, "a number between -1 and 0.5, both excluded"),
    "unknown law": ({"material__law": "plastic"}, 'given "plastic"; accepted: "linear", "log"'),
    "log without yield": ({"material__yield_strain": None}, "material.yield_strain: missing"),
    "plastic without yield": (
        {"material": {"law": "j2", "young": 1.0, "poisson": 0.3}},
        'material.yield_stress: missing; accepted: a number > 0 with law = "j2"',
    ),
    "yield stress of another law": (
        {"material__yield_stress": 1.0},
        'material.yield_stress: given 1.0; accepted: yield_stress with law = "j2"',
    ),
    "softening": (
        {"material": {"law": "j2", "young": 1.0, "poisson": 0.3, "hardening": [[0, 2], [1, 1]]}},
        "material.hardening: [[0.0, 2.0], [1.0, 1.0]]; accepted: stresses > 0 that do not decrease",
    ),
    "key of a back stress": (
        {
            "material": {
                **{"law": "j2", "young": 1.0, "poisson": 0.3, "yield_stress": 0.1},
                "kinematic": [{"modulos": 1.0}],
            }
        },
        "material.kinematic.0.modulos: unknown key, did you mean modulus?",
    ),
    "floor above the modulus": ({"material__g_min": 1.0}, "at most the shear modulus 0.384615"),
    "degree": ({"space__degree": 3}, "space.degree: given 3; accepted: 1 or 2"),
    "generator": ({"mesh__generator": "circle"}, "mesh.generator: given"),
    "generator and file": ({"mesh__file": "a.msh"}, "mesh.generator: generator and file"),
    "neither": ({"mesh__generator": None}, "mesh.generator: neither generator nor file"),
    "flat mesh": ({"mesh__size": [4.0, 0.0]}, "mesh.size.1: given 0.0"),
    "no cells": ({"mesh__cells": None}, "mesh.cells: missing; accepted: a list of 2 numbers"),
    "a billion cells": (
        {"mesh__cells": [1_000_000_000, 1_000_000_000]},
        "mesh.cells.0: given 1000000000; accepted: a list of 2 whole numbers from 1 to 10000000",
    ),
    "half cells": ({"mesh__cells": [8, 2.5]}, "mesh.cells.1: given 2.5"),
    "3 sizes": ({"mesh__size": [1, 1, 1]}, "mesh.size: given [1.0, 1.0, 1.0]; accepted: a list"),
    "axis in the plane": ({"mesh__axis": [0, 0, 1]}, "mesh.axis"),
    "cell of a file": ({"mesh": {"file": "a.msh", "cell": "triangle"}}, "cell of generators"),
    "order of a file": ({"mesh": {"file": "a.msh", "order": 2}}, "other generators than rectangle"),
    "order of a grid": (
        {"mesh": {**box, "order": 2}},
        "order 2 of other generators than rectangle",
    ),
    "cell of a box": ({"mesh": {**box, "cell": "triangle"}}, '"tetrahedron" or "hexahedron"'),
    "order of a cell": (
        {"mesh": {"generator": "quarter_disc", "order": 3}},
        "mesh.order: given 3; accepted: 1 or 2",
    ),
    "diagonal of a box": ({"mesh": {**box, "diagonal": "left"}}, "for a rectangle only"),
    "side": ({"mesh__parts__loaded__side": "front"}, "left, right, bottom, top"),
    "backward piece": ({"mesh__parts__loaded__to": 1.0}, "mesh.parts.loaded.to: given 1.0"),
    "piece in space": ({"mesh__parts__loaded__to": [1, 2]}, "mesh.parts.loaded.to: given [1.0"),
    "piece off the grid": (
        {"mesh__parts__loaded": [{"side": "top"}, {"side": "left", "to": 0.3}]},
        "mesh.parts.loaded.1.to: given 0.3; accepted: positions of the grid on its side (nearest",
    ),
    "part named as a side": ({"mesh__parts__top": {"side": "left"}}, "a name that no side has"),
    "generator key": (
        {"mesh": {"generator": "quarter_disc", "radios": 1}},
        "mesh.radios: unknown key, did you mean radius?",
    ),
    "generator value": ({"mesh": {"generator": "quarter_disc", "radius": -1}}, "mesh.radius"),
    "infinite generator": (
        {"mesh": {"generator": "quarter_disc", "size": float("inf")}},
        "mesh.size: given inf; accepted: a number > 0",
    ),
    "parameters of a grid": ({"mesh__parameters": {"radius": 1}}, "mesh.parameters.radius"),
    "unknown part": ({"load__0__on": "laoded"}, "(did you mean loaded?)"),
    "unknown contact part": ({"contact__on": "floor"}, "contact.on: given"),
    "contact part clamped": ({"contact__on": "left"}, "a part that fixed.0 does not fix wholly"),
    "nothing fixed": (
        {"fixed": [{"on": "left", "displacement": ["free", "free"]}]},
        "a component that is fixed, normal, symmetry or a potential [supports]",
    ),
    "components": ({"fixed__0__displacement": [0, 0, 0]}, "2 components in 2-D"),
    "components in space": ({"mesh": box, "load__0__on": "top"}, "3 components in 3-D"),
    "component": ({"fixed__0__displacement": [0, "fre"]}, "fixed.0.displacement.1: "),
    "load nowhere": ({"load__0__on": None}, "load.0.on: neither; accepted: one of on and"),
    "load of nothing": ({"load__0__traction": None}, "load.0.traction: missing; accepted: at"),
    "body force on a part": ({"load__0__body_force": [0, 1]}, "load.0.body_force"),
    "traction everywhere": ({"load__0": {"everywhere": True, "traction": [0, 1]}}, "body_force"),
    "unknown name": ({"load__0__traction": ["10*w", 0]}, 'load.0.traction.0: "10*w": unknown name'),
    "code": ({"contact__gap": "__import__('os')"}, "contact.gap: "),
    "z in the plane": (
        {"load__0__traction": ["z", 0]},
        "formulas in x and y in 2-D [formula-variable]",
    ),
    "power": ({"contact__gap": "9**9**9"}, "not finite"),
    "negative gap": ({"contact__gap": -0.1}, "contact.gap: -0.1 is negative"),
    "gap and shape": (
        {"contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 1]}},
        "both gap and foundation",
    ),
    "shape": (
        {"contact__foundation": {"shape": "cube"}},
        'accepted: "plane", "sphere", "cylinder"',
    ),
    "normal": (
        {
            "contact__gap": None,
            "contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 0]},
        },
        "contact.foundation.normal: given [0, 0]; accepted: a vector that is not zero",
    ),
    "layer": ({"contact__layer": 0.1}, 'contact.layer: given 0.1; accepted: layer with law = "com'),
    "potential factor": (
        {"contact__law": "compliance", "contact__potential_factor": 0.5},
        "a number >= 1",
    ),
    "tresca without bound": ({"friction": {"law": "tresca"}}, "friction.bound: missing"),
    "coulomb without mu": (
        {"friction": {"law": "coulomb"}},
        'friction.mu: missing; accepted: a number >= 0 or a formula, or a table with law = "slip"',
    ),
    "mu without friction": (
        {"friction__law": "none"},
        'friction.mu: given a table; accepted: mu with law = "coulomb"',
    ),
    "negative mu": ({"friction__mu": -0.3}, "friction.mu: -0.3 is negative"),
    "slip law": ({"friction__mu": {"law": "rate", "rho": 1}}, 'accepted: "slip"'),
    "radius": ({"friction": {"law": "none", "radius": 1}}, "friction.radius: given 1.0"),
    "potential without piezo": ({"fixed": electrode}, "with [material.piezo] only"),
    "charge without piezo": ({"load__0__charge": 1}, "load.0.charge: given 1.0"),
    "electric without piezo": ({"electric": {"k_e": 1}}, "electric: given a table"),
    "floating potential": ({"material__piezo": PIEZO}, "fixed: no potential fixed"),
    "part of piezo": ({"material__piezo": {"e31": 1, "e33": 1}}, "material.piezo.e15: only e31"),
    "both piezo": ({"material__piezo": {**PIEZO, **full}}, "both ways"),
    "piezo matrix": ({"material__piezo": {**full, "e": [[0] * 5] * 3}}, "3 rows of 6 numbers"),
    "permittivity asymmetric": (
        {"material__piezo": {**full, "beta": [[1, 1, 0], [0, 1, 0], [0, 0, 1]]}},
        "material.piezo.beta: the permittivity beta must be symmetric; accepted: a symmetric",
    ),
    "permittivity indefinite": (
        {"material__piezo": {**full, "beta": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}},
        "the permittivity beta must be positive definite; accepted",
    ),
    "poling in the plane": (
        {"material__piezo": {**PIEZO, "poling": [0, 0, 1]}, "fixed": electrode},
        "an angle in 2-D",
    ),
    "conductivity": (
        {"material__piezo": PIEZO, "fixed": electrode, "electric": {"k_e": -1}},
        "electric.k_e: given -1; accepted: a number >= 0",
    ),
    "slope of a jump": (
        {
            "material__piezo": PIEZO,
            "fixed": electrode,
            "electric": {"k_e": 1, "law": "perfect", "delta": 9},
        },
        'electric.delta: given 9.0; accepted: delta with law = "shifted" or "ramp"',
    ),
    "floor of a constant": (
        {"material__law": "linear", "material__g_min": 0.1},
        'material.g_min: given 0.1; accepted: g_min with law = "log"',
    ),
    "argument of a constant": (
        {"material__law": "linear", "material__argument": "square"},
        'argument with law = "log"',
    ),
    "method": ({"solver__method": "newtn"}, 'solver.method: given "newtn"; accepted: "uzawa", '),
    "setting of another method": (
        {"solver__r": 25},
        'solver.r: given 25; accepted: r with method = "uzawa"',
    ),
    "stopping rule of Newton's method": (
        {"solver__stopping": "thesis"},
        'solver.stopping: given "thesis"; accepted: stopping with method = "uzawa" or "penalty"',
    ),
    "most inner iterations of Newton's method": (
        {"solver__max_inner": 7},
        'accepted: max_inner with method = "uzawa" or "penalty"',
    ),
    "penalty in Newton's method": (
        {"solver__eps_contact": 1e-5},
        'accepted: eps_contact with method = "penalty"',
    ),
    "default of another method": (
        {"solver__acceleration": "anderson"},
        'accepted: acceleration with method = "uzawa"',
    ),
    "tolerance of another rule": (
        {"solver": {"method": "uzawa", "eps": 1e-4}},
        'solver.eps: given 0.0001; accepted: eps with stopping = "thesis"',
    ),
    "over-relaxation of Anderson's steps": (
        {"solver": {"method": "uzawa", "relaxation": 1.7}},
        'relaxation with acceleration = "none"',
    ),
    "augmentation": (
        {"solver": {"method": "uzawa", "r": 0}},
        'solver.r: given 0; accepted: "auto" or a number > 0',
    ),
    "augmentation text": (
        {"solver": {"method": "uzawa", "r": "big"}},
        'accepted: "auto" or a number > 0',
    ),
    "relaxation": (
        {"solver": {"method": "uzawa", "acceleration": "none", "relaxation": 2.0}},
        "between 0 and 2, both excluded",
    ),
    "method as a list": ({"solver__method": ["newton"]}, 'solver.method: given ["newton"]'),
    "unknown setting": (
        {"solver__tolerence": 1},
        'solver.tolerence: unknown key with method = "newton", did you mean tolerance?',
    ),
    "a setting of Python's": ({"solver__gamma": 1.0}, "solver.gamma: unknown key with method"),
    "nested meshes of another method": (
        {"solver": {"method": "penalty", "nested": True}},
        'solver.nested: given true; accepted: nested with method = "newton"',
    ),
    "tolerance as a text": ({"solver__tolerance": "1e-8"}, 'solver.tolerance: given "1e-8"'),
    "count as a number": ({"solver__max_outer": 3.0}, "solver.max_outer: given 3.0"),
    "switch as a number": ({"solver__nested": 1}, "solver.nested: given 1; accepted: true or"),
    "tolerance": ({"solver__tolerance": 0.0}, "solver.tolerance: given 0.0"),
    "tolerance below rounding": ({"solver__tolerance": 1e-16}, "a number from 1e-15"),
    "loose inner loop": (
        {"solver": {"method": "uzawa", "inner_tolerance": 1e-3}},
        "at most tolerance = 1e-08",
    ),
    "iterations": ({"solver__max_outer": 0}, "solver.max_outer: given 0"),
    "levels": ({"solver__nested_levels": 3}, "nested_levels with nested = true"),
    "output": ({"output": {"fields": "vtk"}}, '"vtu", "vtx", "xdmf" or "none"'),
    "unknown output": ({"output": {"feilds": "vtx"}}, "output.feilds: unknown key, did you mean f"),
    "output as a number": ({"output": 3}, "output: given 3; accepted: a table"),
    "title": ({"title": 3}, "title: given 3; accepted: a text"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_cases_get_one_line_each(name):
    changes, fragment = BAD[name]
    with pytest.raises(InputError) as error:
        parse_case(changed(**changes), source="bar.toml")
    message = str(error.value)
    assert message.startswith("bar.toml: ")
    assert fragment in message
    assert "\n" not in message and len(message) < 400


def test_messages_show_values_as_in_the_file():
    with pytest.raises(InputError) as error:
        parse_case(changed(title=["long"] * 50))
    given = str(error.value).split("given ")[1].split("; accepted")[0]
    assert len(given) == 60 and given.startswith(json.dumps(["long"])[:-1])
