"""The case file: what is accepted, files, overrides.

What objects in Python replace need not stand in the case.
The case file's `[evolution]`: steps, amplitudes, formulas in t, and what is refused.
"""

import pickle
import tomllib

import numpy as np
import pytest
from mpi4py import MPI

from contact import Friction, InputError, Linear, Sphere, load_case, parse_case, solve
from contact.case.checks import check_mesh
from contact.case.file import to_toml
from contact.mesh.grid import rectangle
from contact.model.formula import Expression
from contact.model.friction import SlipLaw
from forms.laws import ConstantCoefficient
from tests.problems.bar import BAR, changed
from tests.problems.messages import message_of

PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


@pytest.mark.core
def test_the_bar(bar):
    case = load_case(bar)
    assert case.source == str(bar)
    assert case.mesh.parts["loaded"].start == 2.0
    assert case.load[0].traction == (Expression(0.0), Expression(-0.005))
    assert case.friction.mu == SlipLaw(law="slip", a=0.5, b=0.2, rho=1e4)
    assert case.contact.gap == Expression(0.0)
    assert pickle.loads(pickle.dumps(case)) == case


@pytest.mark.core
def test_the_rest_of_the_keys():
    case = parse_case(
        changed(
            mesh={"generator": "box", "size": [1, 1, 2], "cells": [1, 2, 2], "rotation": 30},
            mesh__parts__strip=[{"side": "top", "from": [0, 0], "to": [1, 0.5]}, {"side": "left"}],
            material__piezo={**PIEZO, "poling": [0, 0, 1]},
            fixed=[
                {"on": "top", "displacement": [0, "free", "0.1*x"]},
                {"on": "left", "potential": 0},
            ],
            load=[
                {"on": "right", "pressure": "z", "charge": 1},
                {"everywhere": True, "body_force": [0, 0, -1], "body_charge": "x"},
            ],
            contact={
                "on": "bottom",
                "law": "compliance",
                "layer": 0.1,
                "foundation": {"shape": "sphere", "centre": [0, 0, -1], "radius": 1},
                "direction": "body",
            },
            friction={"law": "tresca", "bound": "1 + x"},
            electric={"k_e": 1, "phi_f": 32, "delta": 10, "limit": 100, "lagged": True},
            solver={"method": "uzawa", "r": 25, "stopping": "thesis", "eps": 1e-4},
            output={"fields": "xdmf", "checkpoint": True},
        )
    )
    assert case.mesh.origin == (0.0, 0.0, 0.0)
    assert len(case.mesh.parts["strip"]) == 2
    assert case.fixed[0].displacement == (Expression(0.0), "free", Expression("0.1*x"))
    assert isinstance(case.contact.foundation, Sphere) and case.contact.gap is None
    assert (case.contact.stiffness, case.contact.limit) == (10.0, 0.1)
    assert (case.contact.potential_factor, case.contact.potential_range) == (2.0, 128.0)
    assert case.solver.r == 25.0
    e, beta = case.material.coupling.voigt
    assert e[2].tolist() == [-5.4, -5.4, 15.8, 0, 0, 0] and e[0, 4] == e[1, 3] == 12.3
    assert np.diag(beta).tolist() == [8.13866, 8.13866, 7.37455]
    again = parse_case(tomllib.loads(to_toml(case)))
    assert again == case


def test_generators_take_their_parameters_in_the_mesh_section():
    case = parse_case(changed(mesh={"generator": "quarter_disc", "contact_size": 0.1}))
    assert case.mesh.parameters == {"contact_size": 0.1}
    assert case.mesh.sides == ()
    assert parse_case(tomllib.loads(to_toml(case))) == case


def test_a_mesh_file_belongs_to_the_folder_of_the_case(bar):
    text = BAR.replace('generator = "rectangle"', 'file = "body.msh"')
    lines = [line for line in text.splitlines() if not line.startswith(("origin", "size", "cells"))]
    start, stop = lines.index("[mesh.parts.loaded]"), lines.index("[space]")
    bar.write_text("\n".join(lines[:start] + lines[stop:]))
    with pytest.raises(InputError, match=r"mesh\.file.*\[file-name\]"):
        load_case(bar)
    (bar.parent / "body.msh").touch()
    assert load_case(bar).mesh.file == str(bar.parent / "body.msh")


@pytest.mark.parametrize(
    ("content", "fragment"),
    [
        (b"[mesh\n", "line 1"),
        (b"title = 'a'\nyoung 3\n", "line 2"),
        (b"\xff\xfe", "UTF-8"),
        (b"a = 1\na = 2\n", "not a TOML file"),
        (b"", "material: missing"),
    ],
)
def test_broken_files_name_the_file(tmp_path, content, fragment):
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        load_case(path)
    assert str(error.value).startswith(f"{path}: ") or not content
    assert fragment in str(error.value) or not content


@pytest.mark.core
def test_overrides(bar):
    case = load_case(
        bar,
        [
            "material.young=2",
            "material.law=linear",
            "title=two words",
            "load.0.traction=[0, '-10*x']",
            "load.0.traction.0=y",
            "friction.mu=0.3",
            "output.fields=none",
            "solver.nested = true",
        ],
    )
    assert case.material.young == 2.0 and case.material.kind == "linear"
    assert case.title == "two words"
    assert case.load[0].traction == (Expression("y"), Expression("-10*x"))
    assert case.friction.mu == Expression(0.3)
    assert case.output.fields == "none" and case.solver.nested
    assert load_case(bar, {"material.young": "2"}).material.young == 2.0


BAD_OVERRIDES = [
    "material.young",
    "=3",
    "material.yung=3",
    "load.1.on=top",
    "load.x.on=top",
    "load.-1.on=top",
    "material.young.x=3",
    "load.0.traction=[0, y]",
    "title='open",
    "material.young=nan",
    "material.young=",
]


@pytest.mark.wording
def test_messages_of_bad_overrides(bar, snapshot):
    said = {repr(given): message_of(load_case, bar, [given]) for given in BAD_OVERRIDES}
    assert all(message.startswith(f"{bar}: ") for message in said.values())
    snapshot("refused-overrides", {k: v.replace(str(bar), bar.name) for k, v in said.items()})


def test_what_only_the_mesh_can_tell():
    case = parse_case(changed(mesh={"generator": "quarter_disc"}), source="disc.toml")
    check_mesh(case, 2, ["left", "loaded", "bottom"])
    with pytest.raises(InputError, match=r"\[part-name\]"):
        check_mesh(case, 2, ["left", "loaded", "arc"])


BARE = {
    "fixed": [{"on": "top", "displacement": [0.02, -0.02]}],
    "contact": {"on": "bottom"},
}


def objects() -> dict[str, object]:
    domain = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (2.0, 1.0), (4, 2))
    return {"domain": domain, "law": Linear(10.0, 0.3), "coefficient": ConstantCoefficient(0.3)}


@pytest.mark.parallel
def test_the_same_as_in_the_case() -> None:
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]}
    material = {"young": 10.0, "poisson": 0.3}
    friction = {"law": "coulomb", "mu": 0.3}
    whole = solve(parse_case({**BARE, "mesh": mesh, "material": material, "friction": friction}))
    given = objects()
    for replacements in (given, given | {"coefficient": None, "friction": Friction(mu=0.3)}):
        bare = solve(parse_case(BARE), **replacements)
        assert bare.converged
        assert bare.contact_force == pytest.approx(whole.contact_force, rel=1e-9)


@pytest.mark.parametrize(("key", "name"), [("mesh", "domain"), ("material", "law")])
def test_an_object_that_is_not_there(key: str, name: str) -> None:
    others = {k: v for k, v in objects().items() if k != name}
    with pytest.raises(InputError, match=rf"{key}.*\[missing\]"):
        solve(parse_case(BARE), **others)


STEPS = {"times": [0.0, 1.0, 3.0], "steps": [2, 4]}
PRESS = {"time": [0.0, 3.0], "value": [0.0, 1.0]}


def evolution(**changes):
    return {**STEPS, "amplitudes": {"press": PRESS}, **changes}


@pytest.mark.core
def test_ends_of_the_steps():
    case = parse_case(changed(evolution=STEPS))
    assert case.evolution.ends == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


@pytest.mark.core
def test_an_amplitude_is_linear_between_its_values():
    case = parse_case(changed(evolution=evolution(), load__0__amplitude="press"))
    function = case.evolution.amplitudes["press"]
    assert [function(time) for time in (0.0, 1.5, 3.0)] == [0.0, 0.5, 1.0]


BAD = [
    {"evolution": evolution(), "load__0__amplitude": "pres"},
    {"load__0__amplitude": "press"},
    {"load__0__traction": [0.0, "-t"]},
    {"evolution": evolution(), "contact__gap": "0.1*t"},
    {"evolution": evolution(times=[0.0, 1.0, 1.0])},
    {"evolution": evolution(steps=[2, 0])},
    {"evolution": evolution(steps=[2])},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "value": [1.0]}})},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [0.0, 2.0]}})},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [3.0, 0.0]}})},
    {"evolution": {"times": [0.0, 1.0]}},
    {"evolution": STEPS, "solver__nested": True},
]


@pytest.mark.wording
def test_messages_of_bad_evolutions(snapshot):
    said = {str(k): message_of(parse_case, changed(**changes)) for k, changes in enumerate(BAD)}
    snapshot("refused-evolutions", said)
