"""Parts and instances of Abaqus' input files, against files whose nodes stand in their places."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Domain, Fixed, GapFunction, Material, NewtonOptions, from_file
from contact.methods.newton import Newton
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.mesh.test_input_files import cube
from tests.problems import files
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
    return f"*PART, NAME={name}\n{files.abaqus(cube(n))}{sets(n)}*END PART\n"


def instance(name: str, of: str, lines: str = "", content: str = "") -> str:
    return f"*INSTANCE, NAME={name}, PART={of}\n{lines}{content}*END INSTANCE\n"


def assembly(parts: str, instances: str, more: str = "") -> str:
    return f"*HEADING\n{parts}*ASSEMBLY, NAME=A\n{instances}{more}*END ASSEMBLY\n*STEP\n*STATIC\n"


def flat(*blocks) -> str:
    """Return blocks in a file without parts: a name, n and a map of the nodes of each."""
    text, first, cells = "", 0, 0
    for name, n, moved in blocks:
        contents = cube(n)
        points = np.transpose(moved(*contents.points.T))
        text += files.abaqus(replace(contents, points=points), first + 1, cells + 1)
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


def test_two_parts_numbered_from_one(tmp_path):
    """One has its nodes in its instance, as an independent one has; unique names stand alone."""
    own = files.abaqus(cube(3)) + sets(3)
    parts = part("Cube", 2) + "*PART, NAME=Other\n*END PART\n" + part("Unused", 1)
    parts = parts.replace("*END PART\n", "*NSET, NSET=Edge\n1, 2, 4, 5\n*END PART\n", 1)
    instances = instance("One", "Cube") + instance("Two", "Other", "0., 0., 1.\n", own)
    found = read(tmp_path / "parts.inp", assembly(parts, instances))
    text = flat(("One", 2, lambda *x: x), ("Two", 3, lambda x, y, z: (x, y, z + 1)))
    agree(found, read(tmp_path / "flat.inp", text + "*NSET, NSET=Edge\n1, 2, 4, 5\n"))


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
    assert "point" not in found.parts


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
    return state.x, state.multipliers.contact


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
