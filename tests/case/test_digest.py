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
    with pytest.raises(InputError, match=f"{said} has changed since then; accepted"):
        check_files("here", "then", first, digest(load_case(written)))


def test_the_case_has_changed(written):
    first, other = (
        to_toml(load_case(written, changes)) for changes in ([], ["fixed.0.displacement=[0, 0, 1]"])
    )
    with pytest.raises(InputError, match=r"there fixed\.0\.displacement\.2 is 0\.0, here 1\.0"):
        check_same("here", "results", first, other, "")


def test_a_file_is_not_there(written):
    case = load_case(written)
    (written.parent / "tool.stl").unlink()
    with pytest.raises(InputError, match=r"contact\.foundation\.file: .*tool\.stl: No such file"):
        digest(case)


def test_the_library_of_the_package_counts(written):
    text = CASE.replace('library = "own.toml"\n', "")
    written.write_text(text)
    assert "material.library" in digest(load_case(written))


@pytest.mark.parametrize("suffix", ["xdmf", "inp"])
def test_the_other_files_of_a_mesh_count(written, suffix):
    """An .h5 file was exchanged beside its .xdmf file, and rows of two meshes were in a table."""
    texts = {
        "xdmf": '<Xdmf><DataItem Format="HDF">a b.h5:/x</DataItem><DataItem Format="HDF">'
        'a b.h5:/y</DataItem><DataItem Format="Binary">0.bin</DataItem></Xdmf>',
        "inp": "*NODE\n*INCLUDE, INPUT=a b.h5\n*NODE, INPUT=0.bin\n",
    }
    folder = written.parent
    (folder / f"body.{suffix}").write_text(texts[suffix])
    for name in ("a b.h5", "0.bin"):
        (folder / name).write_text("1, 0, 0\n")
    written.write_text(CASE.replace("body.msh", f"body.{suffix}"))
    first = digest(load_case(written))
    others = {"mesh.file/a%20b.h5", "mesh.file/0.bin"}
    assert set(first) == {"mesh.file", "material.library", "contact.foundation.file"} | others
    (folder / "a b.h5").write_text("1, 0, 1\n")
    with pytest.raises(InputError, match=r"the file mesh\.file/a%20b\.h5 has changed since then"):
        check_files("here", "then", first, digest(load_case(written)))
    (folder / "0.bin").unlink()
    with pytest.raises(InputError, match=r"mesh\.file: .*0\.bin"):
        digest(load_case(written))
