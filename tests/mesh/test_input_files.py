"""Sets, surfaces and elements of Abaqus' input files as people write them."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact.cli.main import CONVERGED, main
from contact.errors import InputError
from contact.mesh.reader import from_file
from tests.problems.sizes import integral, measures


def block(n: int = 2) -> str:
    """Return the unit cube of n x n x n elements C3D8, those of the lowest layer first."""
    grid = [np.arange(n + 1)] * 3
    z, y, x = (axis.ravel() / n for axis in np.meshgrid(*grid, indexing="ij"))
    number = np.arange(1, (n + 1) ** 3 + 1).reshape((n + 1,) * 3)
    lines = [
        "*NODE",
        *(f"{k}, {a}, {b}, {c}" for k, a, b, c in zip(number.ravel(), x, y, z, strict=True)),
    ]
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=Eall")
    for k, (c, b, a) in enumerate(np.ndindex(n, n, n), 1):
        face = [(0, 0), (0, 1), (1, 1), (1, 0)]
        nodes = [number[c + up, b + j, a + i] for up in (0, 1) for j, i in face]
        lines.append(", ".join(map(str, [k, *nodes])))
    return "\n".join(lines) + "\n"


#: The faces of the cube's lower side, as shells.
SHELLS = "*ELEMENT, TYPE=S4R, ELSET=shell\n101,1,2,5,4\n102,2,3,6,5\n103,4,5,8,7\n104,5,6,9,8\n"


def read(tmp_path, text: str):
    (tmp_path / "block.inp").write_text(text)
    return from_file(MPI.COMM_SELF, tmp_path / "block.inp")


@pytest.mark.parametrize("order", ["1, 2, 5, 4, 10, 11, 14, 13", "10, 11, 14, 13, 1, 2, 5, 4"])
def test_a_cell_that_stands_twice_counts_once(order, tmp_path):
    """Facets of the boundary stay there, and the volume is that of the body."""
    again = f"*ELEMENT, TYPE=C3D8R, ELSET=again\n11, {order}\n*ELEMENT, TYPE=C3D8, ELSET=more\n"
    again += f"12, {order}\n*NSET, NSET=low, GENERATE\n1, 9\n*ELSET, ELSET=all\nEall, again, more\n"
    again += "*SURFACE, NAME=skin\nall,\n"
    domain = read(tmp_path, block() + again)
    assert measures(domain) == pytest.approx({"low": 1.0, "skin": 6.0})
    assert integral(domain) == pytest.approx(1.0)
    assert {name: len(cells) for name, cells in domain.regions.items()} == {
        **{"Eall": 8, "again": 1, "more": 1, "all": 8}
    }
    assert domain.notes == ("2 cell(s) that stand twice in it count once",)


@pytest.mark.parametrize("label", ["S1", "S2", "SPOS", "SNEG", ""])
def test_either_side_of_a_shell_is_the_facet(label, tmp_path):
    text = f"*SURFACE, NAME=low\nshell, {label}\n*NSET, NSET=high, GENERATE\n19, 27\n"
    domain = read(tmp_path, block() + SHELLS + text)
    assert measures(domain) == pytest.approx({"low": 1.0, "shell": 1.0, "high": 1.0})


def test_edges_of_shells_are_no_facets_of_solids(tmp_path):
    edges = "*SURFACE, NAME=rim\nshell, S3\nshell, E2\n*SURFACE, NAME=both\nshell, S4\n5, S2\n"
    domain = read(tmp_path, block() + SHELLS + edges)
    assert measures(domain) == pytest.approx({"both": 0.25, "shell": 1.0})
    assert "'rim' has no facets" in domain.unusable["rim"]


def test_surfaces_made_of_others_are_refused_by_name(tmp_path):
    text = "*SURFACE, NAME=low\n1, S1\n*SURFACE, NAME=high\n8, S2\n"
    text += "*SURFACE, NAME=both, COMBINE=UNION\nlow, high\n"
    with pytest.raises(InputError, match=r"\*SURFACE, COMBINE=UNION: no surfaces are made of"):
        read(tmp_path, block() + text)


def test_free_sides_of_plane_elements(tmp_path):
    text = "*NODE\n1,0,0\n2,1,0\n3,2,0\n4,0,1\n5,1,1\n6,2,1\n*ELEMENT, TYPE=CPS4, ELSET=plate\n"
    text += "1,1,2,5,4\n2,2,3,6,5\n*SURFACE, NAME=rim\nplate,\n"
    assert measures(read(tmp_path, text)) == pytest.approx({"rim": 6.0})


def test_nodes_of_a_set_of_elements(tmp_path):
    """Before or behind its elements, and with other nodes."""
    sets = "*NSET, NSET=layer, ELSET=lowest\n*ELSET, ELSET=lowest, GENERATE\n1, 4\n"
    sets += "*NSET, NSET=high, GENERATE\n19, 27\n*NSET, NSET=both\nlayer, high\n"
    domain = read(tmp_path, block() + sets)
    assert measures(domain) == pytest.approx({"layer": 1 + 4 / 2, "high": 1.0, "both": 6.0})


def test_sets_and_surfaces_of_one_name(tmp_path):
    """Parts of the same facets are one; else the surface stays, and it is said."""
    sets = "*NSET, NSET=low, GENERATE\n1, 9\n*SURFACE, NAME=LOW\n1, S1\n2, S1\n3, S1\n4, S1\n"
    sets += "*NSET, NSET=End, GENERATE\n19, 27\n*SURFACE, NAME=end\n5, S2\n"
    sets += "*NSET, NSET=nodal, GENERATE\n1, 9\n*SURFACE, NAME=NODAL, TYPE=NODE\nEND\n"
    domain = read(tmp_path, block() + sets)
    assert measures(domain) == pytest.approx({"low": 1.0, "End": 0.25, "nodal": 1.0})
    said = "sets left out, as a surface of other facets has their name: "
    assert domain.notes == (said + "nodal", said + "End")


def test_what_is_left_out_is_shown(tmp_path, capsys):
    text = block() + "*NSET, NSET=End, GENERATE\n19, 27\n*SURFACE, NAME=end\n5, S2\n"
    text += "*SURFACE, NAME=low\nEall, S1\n*ELEMENT, TYPE=C3D8\n11, 1,2,5,4,10,11,14,13\n"
    (tmp_path / "block.inp").write_text(text.replace("Eall, S1", "1, S1\n2, S1\n3, S1\n4, S1"))
    assert main(["new", str(tmp_path / "block.inp")]) == CONVERGED
    assert main(["check", str(tmp_path / "block.toml")]) == CONVERGED
    shown = capsys.readouterr().out
    assert "# note: 1 cell(s) that stand twice in it count once" in shown
    assert "# note: sets left out, as a surface of other facets has their name: End" in shown


PARTS = """*PART, NAME=Part-1
{block}*NSET, NSET=Set-1, GENERATE
1, 27
*ELSET, ELSET=Set-1, GENERATE
1, 8
*END PART
*ASSEMBLY, NAME=Assembly
*INSTANCE, NAME=Part-1-1, PART=Part-1
*END INSTANCE
{sets}*END ASSEMBLY
"""


def in_parts(sets: str) -> str:
    """Return the unit cube as Abaqus/CAE writes it: a part with sets, and those of an assembly."""
    return PARTS.format(block=block().replace(", ELSET=Eall", ""), sets=sets)


def test_a_part_and_its_assembly_have_names_of_their_own(tmp_path):
    """Set-1 is Abaqus/CAE's first name for the section of a part, and for supports."""
    sets = "*NSET, NSET=Set-1, INSTANCE=Part-1-1, GENERATE\n1, 9\n"
    sets += "*ELSET, ELSET=set-1, INSTANCE=Part-1-1\n1, 2\n"
    domain = read(tmp_path, in_parts(sets))
    assert measures(domain) == pytest.approx({"Set-1": 1.0, "Part-1-1.Set-1": 6.0})
    found = {name: len(cells) for name, cells in domain.regions.items()}
    assert found == {"Part-1-1.Set-1": 8, "Set-1": 2}


def test_names_behind_their_instance(tmp_path):
    sets = "*NSET, NSET=low, INSTANCE=Part-1-1, GENERATE\n1, 9\n*NSET, NSET=all\nPart-1-1.Set-1\n"
    sets += "*NSET, NSET=more, INSTANCE=Part-1-1\nSet-1\n*NSET, NSET=step\nlow"
    sets += ", part-1-1.10, Part-1-1.11, part-1-1.12\n*SURFACE, NAME=top\n"
    sets += "".join(f"Part-1-1.{k}, S2\n" for k in range(5, 9))
    domain = read(tmp_path, in_parts(sets))
    expected = {"low": 1.0, "all": 6.0, "more": 6.0, "Set-1": 6.0, "top": 1.0}
    expected |= {"step": 1.5}
    assert measures(domain) == pytest.approx(expected)


def test_continuum_shells_are_solids(tmp_path):
    text = block() + "*NODE\n28, 0, 0, 2\n29, 1, 0, 2\n30, 1, 1, 2\n31, 0, 1, 2\n"
    text += "*ELEMENT, TYPE=SC8R\n9, 19, 21, 27, 25, 28, 29, 30, 31\n"
    domain = read(tmp_path, text + "*NSET, NSET=low, GENERATE\n1, 9\n")
    assert integral(domain) == pytest.approx(2.0)


def test_elements_between_nodes_are_left_out(tmp_path):
    text = block() + "*ELEMENT, TYPE=MASS, ELSET=point\n9, 27\n*ELEMENT, TYPE=SPRINGA\n10, 1, 27\n"
    domain = read(tmp_path, text + "*NSET, NSET=low, GENERATE\n1, 9\n*NSET, NSET=a, ELSET=point\n")
    assert measures(domain) == pytest.approx({"low": 1.0})
    assert domain.notes[0] == "left out: *ELEMENT, TYPE=MASS, *ELEMENT, TYPE=SPRINGA"


def test_a_surface_that_goes_on(tmp_path):
    text = "*SURFACE, NAME=low\n1, S1\n2, S1\n*SURFACE, NAME=Low\n3, S1\n4, S1\n"
    assert measures(read(tmp_path, block() + text)) == pytest.approx({"low": 1.0})


def test_letters_and_numbers_of_other_programs(tmp_path):
    """A byte order mark, Fortran's exponents, letters in Latin-1, commas in quotation marks."""
    text = block().replace("0.5", "5.0D-1")
    text += '*NSET, NSET="under, façade", GENERATE\n1, 9\n*NSET, NSET=faèade, GENERATE\n19, 27\n'
    expected = {"under, façade": 1.0, "faèade": 1.0}
    for written in (text.encode("latin-1"), text.encode("utf-8-sig")):
        (tmp_path / "block.inp").write_bytes(written)
        domain = from_file(MPI.COMM_SELF, tmp_path / "block.inp")
        assert measures(domain) == pytest.approx(expected)
