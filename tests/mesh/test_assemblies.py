"""Parts and instances of Abaqus' input files, against files whose nodes stand in their places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact.body.description import Body
from contact.cli.main import BAD_INPUT, main
from contact.mesh.domain import Domain
from contact.mesh.reader import from_file
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.model.body import Fixed
from contact.model.contact import Contact
from contact.model.material import Material
from contact.model.obstacle import GapFunction
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.mesh.test_input_files import block
from tests.problems.mechanics import constant
from tests.problems.sizes import integral


def sets(n: int, first: int = 0, cells: int = 0, before: str = "") -> str:
    """Return sets and surfaces of a block of n x n x n elements, by numbers behind others."""
    layer, every = (n + 1) ** 2, (n + 1) ** 3
    return (
        f"*NSET, NSET={before}low, GENERATE\n{first + 1}, {first + layer}\n"
        f"*NSET, NSET={before}high, GENERATE\n{first + every - layer + 1}, {first + every}\n"
        f"*ELSET, ELSET={before}layer, GENERATE\n{cells + 1}, {cells + n * n}\n"
        f"*ELSET, ELSET={before}all\n{before}layer, "
        + ", ".join(str(cells + k) for k in range(n * n + 1, n**3 + 1))
        + f"\n*ELSET, ELSET={before}row, GENERATE\n{cells + 1}, {cells + n}\n"
        f"*SURFACE, NAME={before}front\n{before}row, S3\n"
        f"*NSET, NSET={before}nodal, ELSET={before}layer\n"
    )


def part(name: str, n: int) -> str:
    """Return a block as a part, its nodes and elements numbered from 1."""
    return f"*PART, NAME={name}\n{block(n).replace(', ELSET=Eall', '')}{sets(n)}*END PART\n"


def instance(name: str, of: str, lines: str = "", content: str = "") -> str:
    return f"*INSTANCE, NAME={name}, PART={of}\n{lines}{content}*END INSTANCE\n"


def assembly(parts: str, instances: str, more: str = "") -> str:
    return f"*HEADING\n{parts}*ASSEMBLY, NAME=A\n{instances}{more}*END ASSEMBLY\n*STEP\n*STATIC\n"


def flat(*blocks) -> str:
    """Return blocks in a file without parts: a name, n and a map of the nodes of each."""
    text, first, cells = "", 0, 0
    for name, n, moved in blocks:
        nodes, elements = block(n).replace(", ELSET=Eall", "").split("*ELEMENT")
        text += "*NODE\n"
        for line in nodes.splitlines()[1:]:
            number, *x = map(float, line.split(","))
            text += ", ".join(map(repr, [int(number) + first, *moved(*x)])) + "\n"
        head, *rows = elements.splitlines()
        text += f"*ELEMENT{head}\n"
        for row in rows:
            element, *corners = map(int, row.split(","))
            text += ", ".join(map(str, [element + cells, *(k + first for k in corners)])) + "\n"
        text += sets(n, first, cells, f"{name}.")
        first, cells = first + (n + 1) ** 3, cells + n**3
    return text


def read(path: Path, text: str) -> Domain:
    path.write_text(text)
    return from_file(MPI.COMM_SELF, path)


def moments(domain: Domain) -> dict[str, list[float]]:
    """Return size and first moments of all parts and regions, by their names in small letters."""
    places = {f"part {name}": {"part": name} for name in domain.parts}
    places |= {f"region {name}": {"region": name} for name in domain.regions}
    axes = [lambda x, *_, k=k: x[k] for k in range(3)]
    return {
        name.lower(): [integral(domain, of, **place) for of in (1.0, *axes)]
        for name, place in places.items()
    }


def agree(found: Domain, expected: Domain) -> None:
    one, other = moments(found), moments(expected)
    assert {*one} == {*other} and not found.unusable
    for name, values in other.items():
        assert one[name] == pytest.approx(values, rel=1e-12, abs=1e-12), name


#: Turning by 120 degrees about a parallel of (1, 1, 1) through (1, 0, 0): x to y to z.
LINES = "2., 0., -1.D0\n1., 0., 0., 3., 2., 2., 120.\n"


def turned(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the place of a point that is moved by (2, 0, -1), and then turned."""
    return 1 + (z - 1), x + 2 - 1, y


@pytest.mark.slow
def test_two_instances_of_a_part(tmp_path):
    """Moved first, then turned about an axis of the assembly; numbers of each are its own."""
    instances = instance("One", "Cube") + instance("Two", "cube", LINES)
    found = read(tmp_path / "parts.inp", assembly(part("Cube", 2), instances))
    expected = flat(("One", 2, lambda *x: x), ("Two", 2, turned))
    agree(found, read(tmp_path / "flat.inp", expected))
    assert integral(found) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("lines", "moved"),
    [
        ("0., 5.\n", lambda x, y, z: (x, y + 5, z)),
        (",,\n0,0,0, 0,0,1, 90\n", lambda x, y, z: (-y, x, z)),
        ("1,0,0\n2,2,7, 2,2,5, 90\n", lambda x, y, z: (2 + y - 2, 2 - (x + 1 - 2), z)),
        ("1,2,3\n1,0,0, 0,0,0, -180\n", lambda x, y, z: (x + 1, -y - 2, -z - 3)),
    ],
)
def test_motions(lines, moved, tmp_path):
    """Right-handed about the line from the first point to the second."""
    text = assembly(part("Cube", 1), instance("One", "Cube", lines))
    expected = read(tmp_path / "flat.inp", flat(("One", 1, moved)).replace("One.", ""))
    agree(read(tmp_path / "parts.inp", text), expected)


def test_a_plane_part_is_turned_over(tmp_path):
    """About an axis of its plane: 180 degrees leave it there but for rounding."""
    own = "*NODE\n1,0,0\n2,2,0\n3,2,1\n4,0,1\n*ELEMENT, TYPE=CPS4, ELSET=all\n1,1,2,3,4\n"
    plate = f"*PART, NAME=Plate\n{own}*SURFACE, NAME=end\nall, S2\n*END PART\n"
    lines = "0., 2.\n1., 0., 0., 1., 1., 0., 180.\n"
    instances = instance("One", "Plate") + instance("Two", "Plate", lines)
    domain = read(tmp_path / "parts.inp", assembly(plate, instances))
    for name, place in {"One": (2, 0.5), "Two": (0, 2.5)}.items():
        found = [integral(domain, lambda x, _, k=k: x[k], f"{name}.end") for k in (0, 1)]
        assert found == pytest.approx(place, abs=1e-12)
        assert integral(domain, region=f"{name}.all") == pytest.approx(2.0)


def test_two_parts_numbered_from_one(tmp_path):
    """One has its nodes in its instance, as an independent one has; unique names stand alone."""
    own = block(3).replace(", ELSET=Eall", "") + sets(3)
    parts = part("Cube", 2) + "*PART, NAME=Other\n*END PART\n" + part("Unused", 1)
    parts = parts.replace("*END PART\n", "*NSET, NSET=Edge\n1, 2, 4, 5\n*END PART\n", 1)
    instances = instance("One", "Cube") + instance("Two", "Other", "0., 0., 1.\n", own)
    found = read(tmp_path / "parts.inp", assembly(parts, instances))
    text = flat(("One", 2, lambda *x: x), ("Two", 3, lambda x, y, z: (x, y, z + 1)))
    agree(found, read(tmp_path / "flat.inp", text + "*NSET, NSET=Edge\n1, 2, 4, 5\n"))
    said = "left out: *PART, NAME=Unused without an instance, *STEP, *STATIC"
    assert found.notes[0] == said


def test_sets_of_the_assembly(tmp_path):
    """By numbers of an instance, of several, or behind its name; nodes and shells of its own."""
    more = "*NODE\n1, 0., 0., 9.\n*NSET, NSET=point\n1\n"
    more += "*NSET, NSET=ends, INSTANCE=One, GENERATE\n1, 9\n"
    more += "*NSET, NSET=ends, INSTANCE=Two, GENERATE\n19, 27\n"
    more += "*NSET, NSET=low, INSTANCE=Two\nlow,\n*NSET, NSET=both\nOne.high, two.high\n"
    more += "*NSET, NSET=of, ELSET=layer, INSTANCE=Two\n"
    more += "*ELSET, ELSET=_S_S2, INTERNAL, INSTANCE=Two, GENERATE\n5, 8\n"
    more += "*SURFACE, TYPE=ELEMENT, NAME=S\n_S_S2, S2\n*SURFACE, NAME=T, INSTANCE=One\n5, S2\n"
    more += "*SURFACE, NAME=U\nTwo.1, S1\nOne.layer, S1\n*SURFACE, NAME=V, TYPE=NODE\nTwo.low\n"
    more += "*ELEMENT, TYPE=S4R, ELSET=lid\n1, One.1, One.2, One.5, One.4\n"
    instances = instance("One", "Cube") + instance("Two", "Cube", "0., 0., 4.\n")
    found = read(tmp_path / "parts.inp", assembly(part("Cube", 2), instances, more))
    expected = {
        **{"ends": (2, 5.0), "low": (1, 4.0), "both": (2, 6.0), "of": (1 + 2.0, 4 + 2 * 4.25)},
        **{"s": (1, 5.0), "t": (0.25, 0.25), "u": (1.25, 1.0), "v": (1, 4.0), "lid": (0.25, 0.0)},
    }
    got = moments(found)
    assert {k: got[f"part {k}"][::3] for k in expected} == {
        k: pytest.approx(v, abs=1e-12) for k, v in expected.items()
    }
    assert got["region _s_s2"][::3] == pytest.approx([0.5, 0.5 * 4.75])
    assert found.notes[1] == "sets of nodes that hold no facet of the boundary: point"


def test_parts_and_instances_that_have_no_end(tmp_path):
    """They end where the next one begins."""
    instances = instance("One", "Cube") + instance("Two", "Cube", LINES)
    whole = assembly(part("Cube", 1), instances)
    cut = whole.replace("*END PART\n", "").replace("*END INSTANCE\n", "")
    agree(read(tmp_path / "cut.inp", cut), read(tmp_path / "whole.inp", whole))


def test_numbers_of_an_instance_end_with_it(tmp_path):
    """A set of a part that names more nodes than it has takes none of the next instance."""
    more = part("Cube", 1).replace("*END", "*NSET, NSET=far, GENERATE\n5, 5000\n*END")
    instances = instance("One", "Cube") + instance("Two", "Cube", "0., 0., 4.\n")
    got = moments(read(tmp_path / "parts.inp", assembly(more, instances)))
    assert got["part one.far"] == pytest.approx([1.0, 0.5, 0.5, 1.0])


def solve(domain: Domain) -> tuple[np.ndarray, np.ndarray]:
    """Press the block Two on the block One; return displacements and pressures."""
    low, high = ([constant(value, 3) for value in (0.0, 0.0, w)] for w in (0.0, -0.02))
    fixed = [Fixed("One.low", low), Fixed("Two.high", high)]
    laws = {"One.all": Linear(1.0, 0.3), "Two.all": Linear(3.0, 0.2)}
    body = Body([Material(law, on=(name,)) for name, law in laws.items()], fixed)
    gap = GapFunction(lambda points: np.zeros(len(points)))
    problem = ContactProblem(domain, body, Contact("Two.low", gap, against="One.high"))
    state, outcome = Newton(problem, NewtonOptions(tolerance=1e-13)).solve()
    assert outcome.converged, outcome
    return state.x, state.forces.pressure


def test_contact_of_two_instances(tmp_path):
    """Nodes in one place stay apart: the bodies touch, and forces are those of the flat file."""
    lines = "0., 0., 1.\n0.5, 0.5, 0., 0.5, 0.5, 1., 90.\n"
    instances = instance("One", "Cube") + instance("Two", "Fine", lines)
    parts = part("Cube", 2) + part("Fine", 3)
    found = solve(read(tmp_path / "parts.inp", assembly(parts, instances)))
    blocks = ("One", 2, lambda *x: x), ("Two", 3, lambda x, y, z: (1 - y, x, z + 1))
    expected = solve(read(tmp_path / "flat.inp", flat(*blocks)))
    assert np.max(expected[1]) > 0.01
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


CUBE, ONE = part("Cube", 1), instance("One", "Cube")
ACCEPTED = "accepted: a line of its translation"


@pytest.mark.parametrize(
    ("parts", "instances", "words"),
    [
        (CUBE, instance("One", "Ball"), "NAME=One: there is no part 'Ball'; accepted: those"),
        (CUBE + CUBE, ONE, "*PART, NAME=Cube: it is there twice"),
        (CUBE, ONE + ONE, "*INSTANCE, NAME=One: it is there twice"),
        (CUBE.replace(", NAME=Cube", ""), ONE, "not found: 'NAME'; accepted: mesh files of Gmsh"),
        (CUBE, ONE + "*NSET, NSET=a, INSTANCE=Two\n1\n", "there is no instance Two"),
        (CUBE, ONE + "*NSET, NSET=a\nhigh\n", "there is no set HIGH"),
        (CUBE, ONE + "*NSET, NSET=a\nOne.up\n", "there is no set ONE.UP"),
        (CUBE, ONE + "*SURFACE, NAME=a\nOne.1, S7\n", "elements 1 have no face 'S7'"),
        (CUBE.replace("\n8, ", "\n7, 0., 0., 3.\n8, "), ONE, "node 7 is at two places"),
        (CUBE.replace("\n1, 1, 2", "\n1, 1, two"), ONE, "'two' where a number belongs"),
        (CUBE.replace("*END", "*SYSTEM\n0,0,1\n*END"), ONE, "*SYSTEM makes or moves nodes"),
        (CUBE, instance("One", "Cube", "0., 0., 1., 2.\n"), f"0., 0., 1., 2.; {ACCEPTED}"),
        (CUBE, instance("One", "Cube", "0., 0., nan\n"), ACCEPTED),
        (CUBE, instance("One", "Cube", "0., 0., zero\n"), "float: 'zero'"),
        (CUBE, instance("One", "Cube", "0.\n0, 0, 0, 0, 0, 1\n"), ACCEPTED),
        (CUBE, instance("One", "Cube", "0.\n1, 2, 3, 1, 2, 3, 90.\n"), ACCEPTED),
        (CUBE, instance("One", "Cube", "0.\n0, 0, 0, 0, 0, 1, 90.\n0.\n"), ACCEPTED),
        (CUBE.replace("\n8, 1.0", "\n8, inf"), ONE, "coordinates are no numbers"),
        (CUBE, "", "it has no triangles"),
    ],
)
def test_damaged_assemblies_end_in_one_line(parts, instances, words, tmp_path, capfd):
    (tmp_path / "parts.inp").write_text(assembly(parts, instances))
    assert main(["new", str(tmp_path / "parts.inp")]) == BAD_INPUT
    printed = capfd.readouterr()
    assert words in printed.err and len(printed.err.splitlines()) == 1
    assert printed.out == "" and [path.name for path in tmp_path.iterdir()] == ["parts.inp"]
