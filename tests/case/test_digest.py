"""A case, or a file that it reads, that has changed is told."""

import shutil

import pytest

from contact.case.digest import check_files, check_same, digest
from contact.case.file import load_case, to_toml
from contact.errors import InputError
from contact.library.materials import PACKAGED

CASE = """
title = "Punch"
[mesh]
file = "body.msh"
[material]
name = "steel"
library = "own.toml"
[[fixed]]
on = "left"
displacement = [0, 0, 0]
[contact]
on = "bottom"
foundation = { shape = "surface", file = "tool.stl" }
"""


@pytest.fixture
def written(tmp_path):
    """Return a case file with the files that it reads."""
    for name in ("body.msh", "tool.stl"):
        (tmp_path / name).write_text(name)
    shutil.copy(PACKAGED, tmp_path / "own.toml")
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


def test_nothing_has_changed(written, tmp_path, monkeypatch):
    first = digest(load_case(written))
    before = to_toml(load_case(written), anchored=True)
    assert set(first) == {"mesh.file", "material.library", "contact.foundation.file"}
    monkeypatch.chdir(tmp_path)
    again = load_case("case.toml", ["title=Other", "solver.tolerance=1e-9", "output.fields=vtx"])
    assert digest(again) == first
    check_same("here", "results", before, to_toml(again, anchored=True), "")
    (tmp_path / "stored").mkdir()
    stored = tmp_path / "stored" / "case.toml"
    stored.write_text(to_toml(again, anchored=True))
    assert digest(load_case(stored)) == first
    check_same("here", "results", before, to_toml(load_case(stored), anchored=True), "")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("body.msh", "the file mesh.file"),
        ("tool.stl", "the file contact.foundation.file"),
        ("own.toml", "the file material.library"),
    ],
)
def test_a_file_has_changed(written, name, said):
    first = digest(load_case(written))
    with (written.parent / name).open("a") as file:
        file.write("\n")
    with pytest.raises(InputError, match=rf"{said} .*\[changed-input\]"):
        check_files("here", "then", first, digest(load_case(written)))
