"""Input that is absurd rather than wrong: one line, exit status 2, at once."""

import logging
import time

import pytest
from mpi4py import MPI

from contact.case import mesh
from contact.case.file import parse_case
from contact.case.messages import LIST, listed, path_of, shown
from contact.cli.main import main
from contact.errors import clipped
from tests.cli.running import check_identifier

TABLES = {
    "mesh": 'generator = "rectangle"\nsize = [4.0, 1.0]\ncells = [8, 2]',
    "mesh.parts.loaded": 'side = "top"\nfrom = 2.0\nto = 4.0',
    "material": 'law = "log"\nyoung = 1.0\npoisson = 0.3\nyield_strain = 0.05',
    "[fixed]": 'on = "left"\ndisplacement = [0.0, 0.0]\npotential = 0.0',
    "material.piezo": "e31 = -5.4\ne33 = 15.8\ne15 = 12.3\nbeta11 = 8.1\nbeta33 = 7.3",
    "[load]": 'on = "loaded"\ntraction = [0.0, -0.005]',
    "contact": 'on = "bottom"',
    "friction": 'law = "coulomb"\nmu = 0.3',
}
D400, D5000, X5000 = "1" + "0" * 400, "9" * 5000, "0x" + "f" * 5000
LONG = "k" * 5000
GEOMETRY = (TABLES["mesh.parts.loaded"], 'side = "top"')

#: Name -> (replacements of text in the tables, words of the message).
FILES = {
    "400 digits as traction": (("-0.005", D400), "load.0.traction.1: 1000"),
    "400 digits as body force": (
        ('on = "loaded"\ntraction', "everywhere = true\nbody_force", "-0.005", D400),
        "load.0.body_force.1: 1000",
    ),
    "400 digits as displacement": (("[0.0, 0.0]", f"[0, {D400}]"), "fixed.0.displacement.1: 1"),
    "5000 digits": (
        ("young = 1.0", f"young = {D5000}"),
        "not a TOML file: Exceeds the limit (4300 digits)",
    ),
    "5000 digits, hexadecimal": (
        ("young = 1.0", f"young = {X5000}"),
        "material.young: given a whole number of thousands of digits; accepted: a number > 0",
    ),
    "5000 digits of a load": (("-0.005", X5000), "load.0.traction.1: a whole number of thousands"),
    "an edge of 1e-20": (("[4.0, 1.0]", "[1e-20, 1e-20]"), "mesh.size.0: given 1e-20; accepted: s"),
    "an edge of 1e-150": (
        ("[4.0, 1.0]", "[4.0, 1e-150]", *GEOMETRY),
        "mesh.size.1: given 1e-150; accepted: sizes above 2.2e-16",
    ),
    "an edge of 5e-324": (("[4.0, 1.0]", "[4.0, 5e-324]", *GEOMETRY), "mesh.size.1: given 5e-324"),
    "an edge lost beside the origin": (
        ("cells", "origin = [1e30, 0.0]\ncells", *GEOMETRY),
        "mesh.size.0: given 4.0; accepted: sizes above 2.2e-16, also beside the origin",
    ),
    "an edge of 1e150": (("[4.0, 1.0]", "[1e150, 1.0]"), "mesh.size.0: given 1e+150; accepted: ce"),
    "a yield strain of 1e-308": (("0.05", "1e-308"), "material.yield_strain: given 1e-308"),
    "a permittivity of 1e308": (("8.1", "1e308"), "material.piezo.beta11: given 1e+308; accepted"),
    "ten refinements": (
        ("cells = [8, 2]", "cells = [800, 200]\nrefine = 10"),
        "mesh.refine: 10 refinements of 3.2e+05 cells, 3.36e+11 cells take more memory",
    ),
    "nine refinements of a generator": (
        (
            *(TABLES["mesh"], 'generator = "half_disc"\ncontact_size = 0.05\nrefine = 9'),
            *(f"[mesh.parts.loaded]\n{TABLES['mesh.parts.loaded']}", ""),
            *('on = "left"', 'on = "top"', 'on = "bottom"', 'on = "contact"'),
            *('on = "loaded"\ntraction', "everywhere = true\nbody_force"),
        ),
        "mesh.refine: 9 refinements",
    ),
    "a line break in a key": (("young", '"a\\nb" = 1\nyoung'), r"material.a\nb: unknown key"),
    "a line break in a part": (
        ("[mesh.parts.loaded]", '[mesh.parts."a\\nb"]\nside = "base"\n[mesh.parts.loaded]'),
        r"mesh.parts.a\nb.side: given",
    ),
    "a long key": (("young", f"{LONG} = 1\nyoung"), "kkk...: unknown key; accepted: on, name"),
    "a long part": (
        ("[mesh.parts.loaded]", f'[mesh.parts.{LONG}]\nside = "base"\n[mesh.parts.loaded]'),
        'side: given "base"',
    ),
    "a long list": (("[0.0, -0.005]", f"[{'0.0, ' * 20000}]"), "load.0.traction: given [0.0, 0.0,"),
    "many parts": (
        (
            "[mesh.parts.loaded]",
            "".join(f'[mesh.parts.p{i}]\nside = "top"\n' for i in range(5000))
            + "[mesh.parts.loaded]",
            'on = "bottom"',
            'on = "bottm"',
        ),
        "more (did you mean bottom?)",
    ),
    "a traction that is not finite": (
        ("-0.005", '"log(x-3)"'),
        "load.0.traction.1: a formula is not finite everywhere on its part",
    ),
    "a charge that is not finite": (
        ("-0.005]", '0.0]\ncharge = "log(x-3)"'),
        "load.0.charge: a formula is not finite",
    ),
    "a part inside that is not finite": (
        ("[mesh.parts.loaded]", '[mesh.inside]\ncut = "sqrt(x-1)"\n[mesh.parts.loaded]'),
        'mesh.inside.cut: "sqrt(x-1)" is not finite at (',
    ),
    "a region that is not finite": (
        ("[mesh.parts.loaded]", '[mesh.regions]\nrest = "log(x-1)"\n[mesh.parts.loaded]'),
        'mesh.regions.rest: "log(x-1)" is not finite at (',
    ),
    "a key of another shape": (
        ('on = "bottom"', 'on = "bottom"\nfoundation = {shape = "sphere", point = [0, 0]}'),
        'point: given [0, 0]; accepted: point with shape = "plane" or "cylinder"',
    ),
    "a wrong key of a shape": (
        ('on = "bottom"', 'on = "bottom"\nfoundation = {shape = "sphere", raduis = 1}'),
        'contact.foundation.raduis: unknown key with shape = "sphere", did you mean radius?',
    ),
    "an unknown shape": (
        ('on = "bottom"', 'on = "bottom"\nfoundation = {shape = "cube", centre = [0, 0]}'),
        'contact.foundation.shape: given "cube"; accepted: "plane", "sphere", "cylinder", "cone"',
    ),
    "no shape": (
        ('on = "bottom"', 'on = "bottom"\nfoundation = {centre = [0, 0]}'),
        'contact.foundation.shape: missing; accepted: "plane", "sphere", "cylinder"',
    ),
    "a coefficient of the contact": (
        ('on = "bottom"', 'on = "bottom"\nmu = 0.3'),
        "contact.mu: unknown key here: it belongs to [friction]; accepted: on,",
    ),
    "friction of the contact as a number": (
        ('on = "bottom"', 'on = "bottom"\nfriction = 0.3'),
        "contact.friction: given 0.3; accepted: a table; [friction] at the top level is for all",
    ),
    "material of the contact": (
        ('on = "bottom"', 'on = "bottom"\nmaterial = {young = 0.3}'),
        "contact.material: unknown key here: [material] is a table of its own, at the top level",
    ),
    "friction of the contact": (
        ('on = "bottom"', 'on = "bottom"\nfriction = {mu = 0.3}'),
        'contact.friction.mu: given 0.3; accepted: mu with law = "coulomb"',
    ),
    "friction twice": (
        ('on = "bottom"', 'on = "bottom"\nfriction = {law = "coulomb", mu = 0.3}'),
        "friction: beside friction of every contact; accepted: one of them",
    ),
}

OVERRIDES = {
    "deep": ("a" + ".a" * 20000 + "=1", "20001 keys deep; accepted: at most 16"),
    "long": (f"{LONG}=1", "kkk...: unknown key"),
    "long index": (f"load.{D5000}.on=1", "load has no entry 999"),
    "no assignment": (LONG, "kkk...: no assignment"),
    "line break": ("a\nb=1", r"a\nb: unknown key"),
    "5000 digits": (f"material.young={D5000}", "is broken (Exceeds the limit (4300 digits)"),
    "hexadecimal": (f"material.young={X5000}", "material.young: given a whole number of thousands"),
    "an edge": ("mesh.size.0=1e150", "mesh.size.0: given 1e+150"),
}


def case(*changes):
    """Return the text of a case in which texts are replaced by others: old, new, old, new."""
    text = "\n".join(f"[{name}]\n{table}" for name, table in TABLES.items())
    for old, new in zip(changes[::2], changes[1::2], strict=True):
        assert old in text
        text = text.replace(old, new, 1)
    return text


def refused(path, capsys, *arguments):
    """Return the message of a refusal."""
    begin = time.process_time()
    assert main(["check", str(path), *arguments]) == 2
    message = capsys.readouterr().err
    assert time.process_time() - begin < 20
    assert message.startswith("contact: ") and message.count("\n") == 1
    check_identifier(message.rstrip("\n"))
    assert len(message) < 300 + LIST
    return message


@pytest.mark.parametrize("name", FILES)
def test_absurd_files(name, tmp_path, capsys):
    changes, words = FILES[name]
    path = tmp_path / "case.toml"
    path.write_text(case(*changes))
    assert words in refused(path, capsys)


@pytest.mark.parametrize("name", OVERRIDES)
def test_absurd_overrides(name, tmp_path, capsys):
    override, words = OVERRIDES[name]
    path = tmp_path / "case.toml"
    path.write_text(case())
    assert words in refused(path, capsys, "--set", override)


def test_a_large_mesh_is_announced(monkeypatch, caplog):
    monkeypatch.setattr(mesh, "MANY", 100)
    section = parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [1, 1], "cells": [4, 4], "refine": 1},
            "material": {"young": 1, "poisson": 0.3},
            "fixed": [{"on": "left", "displacement": [0, 0]}],
            "contact": {"on": "bottom"},
        }
    ).mesh
    with caplog.at_level(logging.WARNING, "contact"):
        section.build(MPI.COMM_SELF)
    assert "mesh.refine: 1 refinements of 32 cells, 128 cells: their mesh alone" in caplog.text


def test_what_is_quoted_is_short_and_of_one_line():
    assert shown(10**5000) == "a whole number of thousands of digits"
    nested = []
    for _ in range(100_000):
        nested = [nested]
    assert shown(nested) == "a deeply nested list"
    assert clipped("ä\n\x1b\u2028") == r"ä\n\x1b\u2028"
    assert path_of(["load", "0", "on"]) == "load.0.on"
    assert len(path_of(["k"] * 500)) <= 100
    assert listed(["a", "b"]) == "a, b"
    assert listed(map(str, range(1000))).endswith(" 76, 77 and 922 more")
