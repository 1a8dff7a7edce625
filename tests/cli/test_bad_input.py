"""Input that is absurd rather than wrong: one line, exit status 2, at once."""

import time

import pytest

from contact.cli.main import main
from contact.model.messages import LIST
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

#: Name -> replacements of text in the tables.
FILES = {
    "400 digits as traction": ("-0.005", D400),
    "5000 digits": ("young = 1.0", f"young = {D5000}"),
    "an edge of 1e-20": ("[4.0, 1.0]", "[1e-20, 1e-20]"),
    "ten refinements": ("cells = [8, 2]", "cells = [800, 200]\nrefine = 10"),
    "a line break in a key": ("young", '"a\\nb" = 1\nyoung'),
    "a long key": ("young", f"{LONG} = 1\nyoung"),
    "a long list": ("[0.0, -0.005]", f"[{'0.0, ' * 20000}]"),
    "many parts": (
        "[mesh.parts.loaded]",
        "".join(f'[mesh.parts.p{i}]\nside = "top"\n' for i in range(5000)) + "[mesh.parts.loaded]",
        'on = "bottom"',
        'on = "bottm"',
    ),
    "a region that is not finite": (
        "[mesh.parts.loaded]",
        '[mesh.regions]\nrest = "log(x-1)"\n[mesh.parts.loaded]',
    ),
}

OVERRIDES = {
    "deep": "a" + ".a" * 20000 + "=1",
    "long index": f"load.{D5000}.on=1",
    "line break": "a\nb=1",
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
    return message.rstrip("\n").replace(str(path.parent), "")


@pytest.mark.wording
def test_messages_of_absurd_input(snapshot, tmp_path, capsys):
    path, said = tmp_path / "case.toml", {}
    for name, changes in FILES.items():
        path.write_text(case(*changes))
        said[name] = refused(path, capsys)
    path.write_text(case())
    for name, override in OVERRIDES.items():
        said[f"override: {name}"] = refused(path, capsys, "--set", override)
    snapshot("absurd-input", said)
