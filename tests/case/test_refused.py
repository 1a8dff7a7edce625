"""What a case file may not say: one line each.

Foundations in the case file that are none.
"""

from __future__ import annotations

import pytest
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from tests.problems.bar import changed
from tests.problems.messages import message_of

PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}

box = {"generator": "box", "size": [1, 1, 1], "cells": [1, 1, 1]}
electrode = [{"on": "left", "displacement": [0, 0], "potential": 0}]
full = {"e": [[0] * 6] * 3, "beta": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}

BAD = {
    "unknown section": {"meterial__young": 1},
    "unknown key": {"material__yung": 1},
    "missing key": {"material__young": None},
    "negative modulus": {"material__young": -1.0},
    "modulus as switch": {"material__young": True},
    "incompressible": {"material__poisson": 0.5},
    "unknown law": {"material__law": "plastic"},
    "log without yield": {"material__yield_strain": None},
    "softening": {
        "material": {"law": "j2", "young": 1.0, "poisson": 0.3, "hardening": [[0, 2], [1, 1]]}
    },
    "degree": {"space__degree": 3},
    "generator": {"mesh__generator": "circle"},
    "generator and file": {"mesh__file": "a.msh"},
    "a billion cells": {"mesh__cells": [1_000_000_000, 1_000_000_000]},
    "axis in the plane": {"mesh__axis": [0, 0, 1]},
    "order of a grid": {"mesh": {**box, "order": 2}},
    "backward piece": {"mesh__parts__loaded__to": 1.0},
    "part named as a side": {"mesh__parts__top": {"side": "left"}},
    "generator value": {"mesh": {"generator": "quarter_disc", "radius": -1}},
    "unknown part": {"load__0__on": "laoded"},
    "contact part clamped": {"contact__on": "left"},
    "nothing fixed": {"fixed": [{"on": "left", "displacement": ["free", "free"]}]},
    "components": {"fixed__0__displacement": [0, 0, 0]},
    "load nowhere": {"load__0__on": None},
    "traction everywhere": {"load__0": {"everywhere": True, "traction": [0, 1]}},
    "code": {"contact__gap": "__import__('os')"},
    "z in the plane": {"load__0__traction": ["z", 0]},
    "press of nothing": {"contact__overlap": "press"},
    "gap and shape": {"contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 1]}},
    "normal": {
        "contact__gap": None,
        "contact__foundation": {"shape": "plane", "point": [0, 0], "normal": [0, 0]},
    },
    "potential factor": {"contact__law": "compliance", "contact__potential_factor": 0.5},
    "coulomb without mu": {"friction": {"law": "coulomb"}},
    "negative mu": {"friction__mu": -0.3},
    "potential without piezo": {"fixed": electrode},
    "floating potential": {"material__piezo": PIEZO},
    "both piezo": {"material__piezo": {**PIEZO, **full}},
    "permittivity indefinite": {
        "material__piezo": {**full, "beta": [[1, 0, 0], [0, -1, 0], [0, 0, 1]]}
    },
    "poling in the plane": {"material__piezo": {**PIEZO, "poling": [0, 0, 1]}, "fixed": electrode},
    "method": {"solver__method": "newtn"},
    "setting of another method": {"solver__r": 25},
    "over-relaxation of Anderson's steps": {"solver": {"method": "uzawa", "relaxation": 1.7}},
    "relaxation": {"solver": {"method": "uzawa", "acceleration": "none", "relaxation": 2.0}},
    "nested meshes of another method": {"solver": {"method": "penalty", "nested": True}},
    "tolerance": {"solver__tolerance": 0.0},
    "iterations": {"solver__max_outer": 0},
    "output": {"output": {"fields": "vtk"}},
    "no mesh file": {"mesh": {"file": ""}},
    "coefficient without law": {"friction__mu": {"a": 0.5}},
}
#: Texts of a list of accepted ones, nearly: changes, and the hint.
NEARLY = [
    ({"material__law": "J2"}, "j2"),
    ({"material": {"name": "PVDF", "units": "gpa"}}, "GPa"),
    ({"friction__law": "coulom"}, "coulomb"),
    ({"friction__mu": {"law": "slipp", "rho": 1.0}}, "slip"),
    ({"mesh": {"generator": "boxx"}}, "box"),
    ({"mesh__generator": "Rectangel"}, "rectangle"),
    ({"mesh__parts__loaded__side": "tops"}, "top"),
    ({"space__kinematics": "axisymetric"}, "axisymmetric"),
    ({"contact__direction": "Axis"}, "axis"),
    ({"solver": {"method": "uzawa", "r": "atuo"}}, "auto"),
    ({"solver__method": "Penalty"}, "penalty"),
    ({"case": {"units": "N-mm-Mpa"}}, "N-mm-MPa"),
    ({"fixed": [{"on": "left", "displacement": ["Free", 0.0]}]}, "free"),
    ({"rigid": [{"on": "top", "displacement": [0.0, "fre"]}]}, "free"),
    ({"rigid": [{"on": "top", "rotation": "FREE"}]}, "free"),
]


def built(data, source="case"):
    return build_problem(parse_case(data, source=source), MPI.COMM_SELF)


@pytest.mark.wording
def test_messages_of_bad_cases(snapshot):
    said = {
        name: message_of(built, changed(**changes), source="bar.toml")
        for name, changes in BAD.items()
    }
    assert all(message.startswith("bar.toml: ") for message in said.values())
    snapshot("refused-cases", said)


@pytest.mark.parametrize(("changes", "near"), NEARLY)
def test_the_nearest_accepted_text_is_named(changes, near) -> None:
    assert f', did you mean "{near}"?; accepted: ' in message_of(parse_case, changed(**changes))


def test_a_text_is_no_case() -> None:
    assert message_of(parse_case, "text") == 'case: given "text"; accepted: a table [value]'


CASE = {
    "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]},
    "material": {"young": 1.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0.0, 0.0, 0.0]}],
}
PLANE = {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}
CONE = {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 70.0}
PUNCH = {"shape": "punch", "centre": [0, 0, 0], "axis": [0, 0, 1], "radius": 1.0}
BAD_SHAPES = {
    "key of another shape": ({**CONE, "inside": True}, {}),
    "edge": ({**PUNCH, "edge_radius": 2.0}, {}),
    "no axis": ({**PUNCH, "axis": [0, 0, 0]}, {}),
    "two and three": ({**CONE, "axis": [0, 1]}, {}),
    "angle": ({**CONE, "half_angle": 90.0}, {}),
    "axis missing": (PLANE, {"direction": "axis"}),
    "axis alone": (PLANE, {"axis": [0, 0, 1]}),
    "no file": ({"shape": "surface"}, {}),
    "shape": ({"shape": "ball"}, {}),
    "shape nearly": ({"shape": "Shpere"}, {}),
    "no shape": ({"centre": [0, 0, 0], "radius": 1.0}, {}),
}


def shaped(foundation, more):
    floats = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in foundation.items()}
    return built({**CASE, "contact": {"on": "bottom", "foundation": floats, **more}})


@pytest.mark.wording
def test_messages_of_bad_shapes(snapshot):
    said = {name: message_of(shaped, *given) for name, given in BAD_SHAPES.items()}
    snapshot("refused-shapes", said)


def test_a_surface_is_no_foundation_in_the_plane():
    mesh = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]}
    foundation = {"shape": "surface", "file": "a.stl"}
    fixed = [{"on": "top", "displacement": [0.0, 0.0]}]
    with pytest.raises(InputError, match=r"\[value\]"):
        built(
            {
                **CASE,
                "mesh": mesh,
                "fixed": fixed,
                "contact": {"on": "bottom", "foundation": foundation},
            }
        )
