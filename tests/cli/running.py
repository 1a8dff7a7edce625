"""A case that is right, and what runs it by the command line, or sees that it is refused."""

import re
from pathlib import Path

import pytest
from mpi4py import MPI

from contact.cli.main import BAD_INPUT, main

BAR = """
[mesh]
generator = "rectangle"
size = [2.0, 1.0]
cells = [4, 2]
[mesh.parts.half]
side = "bottom"
to = 1.0
[material]
law = "log"
young = 1.0
poisson = 0.3
yield_strain = 0.05
[[fixed]]
on = "left"
displacement = [0.0, 0.0]
[[load]]
on = "top"
traction = [0.0, -0.001]
[contact]
on = "bottom"
gap = 0.0
[friction]
law = "coulomb"
mu = 0.3
"""

PIEZO = """
[material.piezo]
e31 = -5.4
e33 = 15.8
e15 = 12.3
beta11 = 8.1
beta33 = 7.4
"""

MESH = """
[mesh]
file = "{file}"
[material]
young = 1.0
poisson = 0.3
[[fixed]]
on = "left"
displacement = [0.0, 0.0]
[contact]
on = "bottom"
"""


def run(case: Path, *options: str, capfd: pytest.CaptureFixture[str]) -> tuple[int, list[str]]:
    """Solve a case by the command line; return the exit status and the lines of stderr."""
    MPI.COMM_WORLD.barrier()
    out = case.parent / "out"
    status = main(["solve", str(case), "--out", str(out), "--quiet", *options])
    lines = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    if status == BAD_INPUT:
        assert not out.exists(), "bad input must leave nothing behind"
    return status, lines


def write(folder: Path, text: str, name: str = "case.toml") -> Path:
    """Write a case file, on rank 0."""
    path = folder / name
    if MPI.COMM_WORLD.rank == 0:
        path.write_text(text)
    return path


def check_identifier(line: str) -> None:
    """Check that a message ends in an identifier, and has no second one."""
    found = re.search(r" (\[[a-z]+(-[a-z]+)*\])$", line)
    assert found, line
    before = line[: found.start()]
    assert found[1] not in before and not re.search(r"\[[a-z]+(-[a-z]+)+\]", before), line


def refuse(case: Path, words: list[str], capfd: pytest.CaptureFixture[str], *options: str) -> None:
    """Check that a case is refused with one message that names the file and holds the words."""
    status, lines = run(case, *options, capfd=capfd)
    assert status == BAD_INPUT
    if MPI.COMM_WORLD.rank == 0:
        assert len(lines) == 1, lines
        assert lines[0].startswith("contact: ")
        check_identifier(lines[0])
        missing = [word for word in [case.name, *words] if word not in lines[0]]
        assert not missing, f"{missing} not in: {lines[0]}"
    else:
        assert lines == []
