"""Sets, surfaces and elements of Abaqus' input files as people write them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.contents import Contents
from contact.mesh.reader import from_file
from tests.problems import files
from tests.problems.sizes import integral, measures


def cube(n: int = 2) -> Contents:
    """Return the unit cube of n x n x n elements, those of the lowest layer first."""
    points = np.array([*np.ndindex((n + 1,) * 3)], float)[:, ::-1] / n
    number = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    around = [(up, *ji) for up in (0, 1) for ji in [(0, 0), (0, 1), (1, 1), (1, 0)]]
    corners = [number[c : n + c, b : n + b, a : n + a].ravel() for c, b, a in around]
    return Contents(points, [("hexahedron", np.stack(corners, axis=1))])


def block() -> str:
    """Return the cube of eight elements as an input file, all in the set Eall."""
    return files.abaqus(replace(cube(), groups={"Eall": {0: np.arange(8)}}))


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
    assert domain.notes == ()


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
    with pytest.raises(InputError, match=r"\[mesh-file\]"):
        read(tmp_path, block() + text)


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
    return PARTS.format(block=files.abaqus(cube()), sets=sets)


def test_a_part_and_its_assembly_have_names_of_their_own(tmp_path):
    """Set-1 is Abaqus/CAE's first name for the section of a part, and for supports."""
    sets = "*NSET, NSET=Set-1, INSTANCE=Part-1-1, GENERATE\n1, 9\n"
    sets += "*ELSET, ELSET=set-1, INSTANCE=Part-1-1\n1, 2\n"
    domain = read(tmp_path, in_parts(sets))
    assert measures(domain) == pytest.approx({"Set-1": 1.0, "Part-1-1.Set-1": 6.0})
    found = {name: len(cells) for name, cells in domain.regions.items()}
    assert found == {"Part-1-1.Set-1": 8, "Set-1": 2}
